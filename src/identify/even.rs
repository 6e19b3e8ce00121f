//! Puts the channels of a log on an even clock that is not faster than needed.

use std::borrow::Cow;
use std::ops::Range;

use super::error::IdentifyError;
use super::measurement::Measurement;
use super::options::Options;
use crate::robot::JointSignals;
use crate::signal::{
    Bracket, Decimator, Gap, MOST_PER_ROW, Resampler, Scratch, SignalError, bridged_gap_s,
    natural_rate_hz,
};

/// A log is uneven if one of its time steps differs from the natural step by more than this share.
const EVEN_WITHIN: f64 = 0.02;
/// [`Even::highest`] of unprocessed samples: half a cycle, reduced by the loss of accuracy of derivatives near it.
const AS_LOGGED: f64 = 0.48;
/// [`Even::highest`] of samples behind a decimator's low-pass, or linearly interpolated between rows: at 0.37 linear
/// interpolation keeps 62 % of an amplitude.
const REWORKED: f64 = 0.37;

/// The rows of a log, filled-in rows included, and the places of evenly spaced samples among them.
#[derive(Debug, Clone, PartialEq)]
pub struct BetweenRows {
    /// Time of the rows, s.
    pub time_s: Vec<f64>,
    /// Velocities in the rows, rad/s.
    pub qd_rad_s: JointSignals,
    /// Place of every sample among the rows.
    pub places: Vec<Bracket>,
}

/// Angle, velocity and torque before they were decimated.
struct Fine<'a> {
    signals: [Cow<'a, JointSignals>; 3],
    decimator: Decimator,
}

/// A log on an even clock.
pub(super) struct Even<'a> {
    /// Instant of the first sample, s, on the log's clock.
    pub(super) start_s: f64,
    /// Samples per second.
    pub(super) rate_hz: f64,
    /// Whether samples were interpolated between rows.
    pub(super) resampled: bool,
    /// Highest frequency, in cycles per sample, at which the samples still show the log's content.
    pub(super) highest: f64,
    /// The samples before they were decimated; `None` where they were not.
    fine: Option<Fine<'a>>,
    /// Places of resampled samples among the rows; `None` where the samples are the rows, or were decimated
    /// afterwards.
    pub(super) between: Option<BetweenRows>,
    /// Joint angles, rad.
    pub(super) q_rad: Cow<'a, JointSignals>,
    /// Joint velocities, rad/s.
    pub(super) qd_rad_s: Cow<'a, JointSignals>,
    /// Drive torque, Nm.
    pub(super) torque_nm: Cow<'a, JointSignals>,
}

impl<'a> Even<'a> {
    /// Resamples an uneven log, or one that is wanted on a clock `faster` by this factor; decimates a fast one.
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
            fine: None,
            between: None,
            q_rad: Cow::Borrowed(m.q_rad),
            qd_rad_s: Cow::Borrowed(m.qd_rad_s),
            torque_nm: Cow::Borrowed(m.torque_nm),
        };
        if wanted_hz > MOST_PER_ROW * natural_hz {
            let (log, most_hz) = (m.source.to_owned(), MOST_PER_ROW * natural_hz);
            return Err(IdentifyError::RateAboveLog { log, wanted_hz, natural_hz, most_hz });
        }
        if wanted_hz > 1.001 * natural_hz {
            warnings.push(format!(
                "{wanted_hz} Hz is more than the {natural_hz:.1} Hz of the log: samples between its rows are interpolated and \
                 tell nothing new, and a σ that counts samples (ols, wls) is too small"
            ));
        }
        let is_natural = (0.999 * natural_hz..=1.001 * natural_hz).contains(&wanted_hz);
        // A decimator divides the grid's rate by a whole number; the grid is therefore put on the smallest multiple
        // of the wanted rate that is not below the log's.
        let parts = if is_natural { 1 } else { whole_parts(natural_hz, wanted_hz) };
        if !is_even || !is_natural || faster.is_some() {
            let plain_hz = if is_natural { even.rate_hz } else { parts as f64 * wanted_hz };
            let grid_hz = faster.unwrap_or(1.0) * plain_hz;
            let grid = Resampler::new(m.time_s, grid_hz, bridged_gap_s(natural_hz))?;
            even.put_on(&grid, grid_hz, m, warnings)?;
        }
        let every = match options.rate_hz {
            Some(_) => parts,
            None => whole_parts(even.rate_hz, Options::HIGHEST_RATE_HZ),
        };
        if every > 1 {
            even.decimate(Decimator::new(every, even.rate_hz)?, filter)?;
        }
        Ok(even)
    }

    /// Angles and velocities as they were read, in the rows from which a decimator made the samples `window`, and how
    /// many rows make one sample. `None` where samples are not rows of the log behind a decimator.
    pub(super) fn as_read(&self, window: &Range<usize>) -> Option<([JointSignals; 2], usize)> {
        let Fine { signals: [q_rad, qd_rad_s, _], decimator } =
            self.fine.as_ref().filter(|_| !self.resampled)?;
        let every = decimator.every();
        let rows = window.start * every..(window.end * every).min(q_rad.samples());
        Some(([q_rad.slice(rows.clone()), qd_rad_s.slice(rows)], every))
    }

    /// Angle, velocity and torque in the samples `window` of a motion that repeats every `samples_per_period` samples.
    ///
    /// A decimator does not know how a record continues beyond its ends. That of a motion that repeats continues as it
    /// does a period later or earlier.
    pub(super) fn repeated(
        &self,
        window: &Range<usize>,
        samples_per_period: usize,
        filter: &mut Scratch,
    ) -> Result<[JointSignals; 3], SignalError> {
        let Some(Fine { signals, decimator }) = &self.fine else {
            return Ok(
                [&self.q_rad, &self.qd_rad_s, &self.torque_nm].map(|y| y.slice(window.clone()))
            );
        };
        let every = decimator.every();
        // Both are whole numbers of samples.
        let period = samples_per_period * every;
        let pad = (decimator.edge_samples().div_ceil(every) * every).min(period);
        let mut out = [(); 3].map(|()| JointSignals::zeros(self.q_rad.joints(), window.len()));
        let mut row = Vec::new();
        for (out, y) in out.iter_mut().zip(signals) {
            for j in 0..y.joints() {
                let y = y.joint(j);
                row.clear();
                row.extend((window.start * every..window.end * every + 2 * pad).map(|k| {
                    // Row k − pad of the record.
                    match k.checked_sub(pad) {
                        None => y[k + period - pad],
                        Some(k) if k >= y.len() => y[k - period],
                        Some(k) => y[k],
                    }
                }));
                decimator.decimate_in_place(&mut row, filter)?;
                let first = pad / every;
                out.joint_mut(j).copy_from_slice(&row[first..first + window.len()]);
            }
        }
        Ok(out)
    }

    fn put_on(
        &mut self,
        grid: &Resampler,
        grid_hz: f64,
        m: &Measurement,
        warnings: &mut Vec<String>,
    ) -> Result<(), IdentifyError> {
        let longest = grid.longest_segment();
        let cut = |signals: JointSignals| Cow::Owned(signals.slice(longest.clone()));
        let grid_s = &grid.time_s()[longest.clone()];
        warnings.extend(gap_warning(grid.gaps(), [grid_s[0], grid_s[grid_s.len() - 1]]));
        self.start_s = grid_s[0];
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
        decimator: Decimator,
        filter: &mut Scratch,
    ) -> Result<(), IdentifyError> {
        let signals = [&self.q_rad, &self.qd_rad_s, &self.torque_nm].map(|signals| signals.clone());
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
        self.fine = Some(Fine { signals, decimator });
        Ok(())
    }
}

/// What the user should know of the `gaps` in a log of which only the stretch from `kept_s[0]` to `kept_s[1]` is used;
/// `None` without a gap.
fn gap_warning(gaps: &[Gap], kept_s: [f64; 2]) -> Option<String> {
    let length_s = |gap: &Gap| gap.end_s - gap.start_s;
    let longest = gaps.iter().max_by(|a, b| length_s(a).total_cmp(&length_s(b)))?;
    let (longest_s, from_s) = (length_s(longest), longest.start_s);
    let missing = match gaps.len() {
        1 => format!("for {longest_s:.2} s from {from_s:.2} s on"),
        count => {
            let all_s: f64 = gaps.iter().map(length_s).sum();
            format!(
                "in {count} gaps of {all_s:.2} s together, the longest {longest_s:.2} s from {from_s:.2} s on"
            )
        }
    };
    Some(format!(
        "no samples {missing}: only the longest stretch without such a gap, {:.2} s to {:.2} s, is used (cut into files, the \
         others count as logs beside it)",
        kept_s[0], kept_s[1]
    ))
}

/// Rate that a log with the time stamps `time_s` has where none is asked for, Hz.
pub(super) fn usual_rate_hz(time_s: &[f64]) -> Result<f64, SignalError> {
    let natural_hz = natural_rate_hz(time_s)?;
    Ok(natural_hz / whole_parts(natural_hz, Options::HIGHEST_RATE_HZ) as f64)
}

/// Smallest whole number that divides `rate_hz` into at most `highest_hz`, or a thousandth more.
fn whole_parts(rate_hz: f64, highest_hz: f64) -> usize {
    (rate_hz / highest_hz * 0.999).ceil().max(1.0) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    const START_S: f64 = 7.0;
    const OMEGA_RAD_S: f64 = 3.0;

    /// Ten seconds of a swinging joint, logged at `log_hz` and put on `rate_hz`: the rate of the samples, and the
    /// largest error of their angles at least two seconds from both ends, rad.
    fn sampled(log_hz: f64, rate_hz: Option<f64>) -> (f64, f64) {
        let rows = (10.0 * log_hz) as usize;
        let time_s: Vec<f64> = (0..rows).map(|k| START_S + k as f64 / log_hz).collect();
        let angle_rad = |t: f64| (OMEGA_RAD_S * t).sin();
        let q_rad = JointSignals::from_fn(1, rows, |_, k| angle_rad(time_s[k]));
        let qd_rad_s =
            JointSignals::from_fn(1, rows, |_, k| OMEGA_RAD_S * (OMEGA_RAD_S * time_s[k]).cos());
        let m = Measurement {
            source: "test",
            time_s: &time_s,
            q_rad: &q_rad,
            qd_rad_s: &qd_rad_s,
            torque_nm: &q_rad,
        };
        let options = Options { rate_hz, ..Options::default() };
        let even = Even::of(&m, &options, None, &mut Scratch::default(), &mut Vec::new()).unwrap();
        let off = even.q_rad.joint(0).iter().enumerate().map(|(k, q)| {
            let t = even.start_s + k as f64 / even.rate_hz;
            (t, (q - angle_rad(t)).abs())
        });
        let inner = off.filter(|(t, _)| (START_S + 2.0..START_S + 8.0).contains(t));
        (even.rate_hz, inner.map(|(_, off)| off).fold(0.0, f64::max))
    }

    #[test]
    fn samples_come_at_the_rate_that_was_asked_for() {
        for wanted_hz in [20.0, 30.0, 50.0, 62.5, 100.0, 120.0, 124.0, 200.0] {
            let (rate_hz, off_rad) = sampled(125.0, Some(wanted_hz));
            assert!((rate_hz - wanted_hz).abs() < 1e-9, "{rate_hz} instead of {wanted_hz} Hz");
            // Cubic interpolation is off by (ω/125 Hz)⁴/384 = 9e-10, and the ends of the slowest low-pass by e⁻²⁰.
            assert!(off_rad < 1e-8, "{off_rad:e} rad at {wanted_hz} Hz");
        }
    }

    /// The warnings about a thousand rows at 125 Hz without those of the gaps `missing` (first, end).
    fn warned(missing: &[[usize; 2]]) -> Vec<String> {
        let is_there = |k: &usize| !missing.iter().any(|[first, end]| (first..end).contains(&k));
        let time_s: Vec<f64> = (0..1000).filter(is_there).map(|k| k as f64 / 125.0).collect();
        let swing = JointSignals::from_fn(1, time_s.len(), |_, k| (OMEGA_RAD_S * time_s[k]).sin());
        let [q_rad, qd_rad_s, torque_nm] = [&swing; 3];
        let m = Measurement { source: "test", time_s: &time_s, q_rad, qd_rad_s, torque_nm };
        let mut warnings = Vec::new();
        Even::of(&m, &Options::default(), None, &mut Scratch::default(), &mut warnings).unwrap();
        warnings
    }

    /// However many gaps there are, one sentence tells of them: a log may lose a hundred stretches.
    #[test]
    fn gaps_are_told_once() {
        const END: &str = "is used (cut into files, the others count as logs beside it)";
        let only = "only the longest stretch without such a gap";
        assert_eq!(warned(&[]), [""; 0]);
        let one = format!("no samples for 0.81 s from 3.19 s on: {only}, 4.00 s to 7.99 s, {END}");
        assert_eq!(warned(&[[400, 500]]), [one]);
        // 51, 101 and 21 steps of 8 ms.
        let three = format!(
            "no samples in 3 gaps of 1.38 s together, the longest 0.81 s from 3.19 s on: {only}, 4.00 s to 7.19 s, {END}"
        );
        assert_eq!(warned(&[[100, 150], [400, 500], [900, 920]]), [three]);
    }

    #[test]
    fn no_thousand_samples_are_made_of_a_row() {
        let time_s: Vec<f64> = (0..1000).map(|k| k as f64 / 125.0).collect();
        let swing = JointSignals::from_fn(1, 1000, |_, k| (OMEGA_RAD_S * time_s[k]).sin());
        let [q_rad, qd_rad_s, torque_nm] = [&swing; 3];
        let m = Measurement { source: "test", time_s: &time_s, q_rad, qd_rad_s, torque_nm };
        let made_of = |rate_hz: f64| {
            let options = Options { rate_hz: Some(rate_hz), ..Options::default() };
            let mut warnings = Vec::new();
            Even::of(&m, &options, None, &mut Scratch::default(), &mut warnings)?;
            Ok::<_, IdentifyError>(warnings.len())
        };
        assert!(matches!(made_of(1e9), Err(IdentifyError::RateAboveLog { .. })));
        assert_eq!((made_of(500.0).unwrap(), made_of(125.0).unwrap()), (1, 0));
    }

    #[test]
    fn the_rate_of_the_log_is_its_own_up_to_the_highest() {
        let own = sampled(125.0, None);
        assert!((own.0 - 125.0).abs() < 1e-9 && own.1 < 1e-12, "{own:?}");
        assert_eq!(sampled(125.0, Some(125.0)), own);
        assert!((sampled(500.0, None).0 - 250.0).abs() < 1e-9);
        assert!((sampled(500.0, Some(500.0)).0 - 500.0).abs() < 1e-9);
    }
}
