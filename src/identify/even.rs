//! The channels of a log on an even clock that is not faster than needed.

use std::borrow::Cow;

use super::error::IdentifyError;
use super::options::Options;
use super::prepare::Measurement;
use crate::robot::JointSignals;
use crate::signal::{Bracket, Decimator, Resampler, Scratch, bridged_gap_s, natural_rate_hz};

/// Time stamps further off the median step than this share of it make a log uneven.
const EVEN_WITHIN: f64 = 0.02;
/// [`Even::highest`] of samples as the log has them: half a cycle less what derivatives near it cost.
const AS_LOGGED: f64 = 0.48;
/// The same of samples that went through a decimator's low-pass, or lie on straight lines between rows: at 0.37 a line
/// between two rows keeps 62 % of an amplitude.
const REWORKED: f64 = 0.37;

/// The rows of a log, those in its gaps included, and where samples on an even clock lie among them.
#[derive(Debug, Clone, PartialEq)]
pub struct BetweenRows {
    /// Of the rows, s.
    pub time_s: Vec<f64>,
    /// In the rows, rad/s.
    pub qd_rad_s: JointSignals,
    /// Of every sample.
    pub places: Vec<Bracket>,
}

/// See the module.
pub(super) struct Even<'a> {
    /// Instant of the first sample, s, on the log's clock.
    pub(super) start_s: f64,
    /// Samples per second.
    pub(super) rate_hz: f64,
    /// Whether samples lie between rows.
    pub(super) resampled: bool,
    /// Highest frequency, in cycles per sample, at which the samples show what the log does.
    pub(super) highest: f64,
    /// Where resampled ones lie among the rows; `None` for rows, and for what was decimated since.
    pub(super) between: Option<BetweenRows>,
    /// Joint angles, rad.
    pub(super) q_rad: Cow<'a, JointSignals>,
    /// Joint velocities, rad/s.
    pub(super) qd_rad_s: Cow<'a, JointSignals>,
    /// Drive torque, Nm.
    pub(super) torque_nm: Cow<'a, JointSignals>,
}

impl<'a> Even<'a> {
    /// Resamples an uneven log, or one that is wanted on a clock so many times `faster`; decimates a fast one.
    pub(super) fn of(
        m: &Measurement<'a>,
        options: &Options,
        faster: Option<f64>,
        filter: &mut Scratch,
        warnings: &mut Vec<String>,
    ) -> Result<Self, IdentifyError> {
        let natural_hz = natural_rate_hz(m.time_s)?;
        let step = 1.0 / natural_hz;
        let is_even = m.time_s.windows(2).all(|w| ((w[1] - w[0]) / step - 1.0).abs() < EVEN_WITHIN);
        let wanted_hz = options.rate_hz.unwrap_or(natural_hz);
        // The median step carries the rounding of the time stamps; their mean does not.
        let mean_hz = (m.time_s.len() - 1) as f64 / (m.time_s[m.time_s.len() - 1] - m.time_s[0]);
        let mut even = Self {
            start_s: m.time_s[0],
            rate_hz: if is_even { mean_hz } else { natural_hz },
            resampled: false,
            highest: AS_LOGGED,
            between: None,
            q_rad: Cow::Borrowed(m.q_rad),
            qd_rad_s: Cow::Borrowed(m.qd_rad_s),
            torque_nm: Cow::Borrowed(m.torque_nm),
        };
        let is_natural = (0.999 * natural_hz..=1.001 * natural_hz).contains(&wanted_hz);
        if !is_even || !is_natural || faster.is_some() {
            let plain_hz = if is_natural { even.rate_hz } else { wanted_hz.max(natural_hz) };
            let grid_hz = faster.unwrap_or(1.0) * plain_hz;
            let grid = Resampler::new(m.time_s, grid_hz, bridged_gap_s(natural_hz))?;
            even.put_on(&grid, grid_hz, m, warnings)?;
        }
        let highest_hz = options.rate_hz.unwrap_or(Options::HIGHEST_RATE_HZ);
        let every = (even.rate_hz / highest_hz * 0.999).ceil().max(1.0) as usize;
        if every > 1 {
            even.decimate(&Decimator::new(every, even.rate_hz)?, filter)?;
        }
        Ok(even)
    }

    fn put_on(
        &mut self,
        grid: &Resampler,
        grid_hz: f64,
        m: &Measurement,
        warnings: &mut Vec<String>,
    ) -> Result<(), IdentifyError> {
        for gap in grid.gaps() {
            warnings.push(format!(
                "no samples for {:.2} s from {:.2} s on: only the longest stretch without such a gap \
                 is used",
                gap.end_s - gap.start_s,
                gap.start_s
            ));
        }
        let longest = grid.longest_segment();
        let cut = |signals: JointSignals| Cow::Owned(signals.slice(longest.clone()));
        self.start_s = grid.time_s()[longest.start];
        self.q_rad = cut(grid.instants().angles(m.q_rad, m.qd_rad_s)?);
        self.qd_rad_s = cut(grid.instants().smooth(m.qd_rad_s)?);
        self.torque_nm = cut(grid.instants().straight(m.torque_nm)?);
        self.rate_hz = grid_hz;
        self.resampled = true;
        self.highest = REWORKED;
        self.between = Some(BetweenRows {
            time_s: m.time_s.to_vec(),
            qd_rad_s: m.qd_rad_s.clone(),
            places: grid.instants().places()[longest].to_vec(),
        });
        Ok(())
    }

    fn decimate(
        &mut self,
        decimator: &Decimator,
        filter: &mut Scratch,
    ) -> Result<(), IdentifyError> {
        for signals in [&mut self.q_rad, &mut self.qd_rad_s, &mut self.torque_nm] {
            let mut error = None;
            let decimated = signals.map_joints(|_, y| {
                decimator.decimate(y, filter).unwrap_or_else(|e| {
                    error = Some(e);
                    Vec::new()
                })
            });
            if let Some(error) = error {
                return Err(error.into());
            }
            *signals = Cow::Owned(decimated);
        }
        self.rate_hz = decimator.rate_hz();
        self.highest = REWORKED;
        self.between = None;
        Ok(())
    }
}
