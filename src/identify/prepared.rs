//! Motion and torque on one clock, and what was done to the log for it.

use serde::Serialize;

use super::even::BetweenRows;
use super::held_at_rest::HeldAtRest;
use crate::dynamics::Motion;
use crate::robot::JointSignals;
use crate::signal::{Gap, HarmonicPower, PeriodicRecord, Replicates};

/// What was done to a log before the regression.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Processing {
    /// Low-pass on torque and regressor columns, Hz; null where nothing was filtered.
    pub cutoff_hz: Option<f64>,
    /// Order of each of its two passes.
    pub order: Option<usize>,
    /// Rate of the samples used, Hz.
    pub rate_hz: f64,
    /// Begin of the first and end of the last sample used, s, on the log's clock.
    pub window_s: [f64; 2],
    /// Whether the torque went through the low-pass.
    pub torque_filtered: bool,
    /// Period of the motion, s; null for a single run.
    pub period_s: Option<f64>,
    /// Whole periods used, summed over several logs; 1 for a single run, and for several logs that are joined into a
    /// single run.
    pub periods: usize,
    /// Logs used together; everything here but the number of periods refers to the first of them.
    pub logs: usize,
    /// Whether time stamps were uneven and the log was resampled.
    pub resampled: bool,
    /// Highest harmonic of the averaged acceleration, per joint; null for a single run.
    pub harmonics: Option<Vec<usize>>,
}

/// Motion and torque ready for the regressor.
#[derive(Debug, Clone)]
pub struct Prepared {
    /// One period of the averaged motion, or the whole single run.
    pub motion: Motion,
    /// Time from the beginning of the log to the first sample used, s. Where the first periods of a repeating motion
    /// differ from its later ones, they are left out.
    pub lead_in_s: f64,
    /// Torque of all periods one after the other, or of the single run, Nm.
    pub torque_nm: JointSignals,
    /// Scatter of the torque between periods; `None` for a single run.
    pub replicates: Option<Replicates>,
    /// The motion of every single period, with all harmonics up to `highest`; only for a diagnosis and where the motion
    /// repeats.
    pub each_period: Option<Motion>,
    /// Angles and velocities of all periods as they were recorded, rad and rad/s; `None` for a single run.
    pub recorded: Option<PeriodicRecord>,
    /// Where the samples of `torque_nm` are among the rows of the log, between which the torque was interpolated
    /// linearly; only where an uneven log of a repeating motion was put on an even clock.
    pub between: Option<BetweenRows>,
    /// Highest frequency, in cycles per sample, at which the samples of a repeating motion still show the log's
    /// content; the harmonics of `each_period` end there. Not used for a single run.
    pub highest: f64,
    /// Smallest distance between two recorded angles, per joint, rad; empty unless for a diagnosis.
    pub angle_resolution_rad: Vec<f64>,
    /// Power density of the velocities' noise, 2 σ²/f_s for white noise, per joint, (rad/s)²/Hz; `None` where the
    /// periods reveal the noise frequency by frequency.
    pub velocity_noise: Option<Vec<f64>>,
    /// Joints that are known to hold friction in their pauses; where there are none, an identification looks for them.
    pub held_at_rest: Vec<HeldAtRest>,
    /// Largest magnitude of torque that is read, per joint, where readings are clipped there, Nm; empty unless for a
    /// diagnosis.
    pub torque_limit_nm: Vec<Option<f64>>,
    /// How well the averaged acceleration is known, per joint; `None` for a single run.
    pub acceleration: Option<Vec<HarmonicPower>>,
    /// What was done to the log.
    pub processing: Processing,
    /// Share of the samples that are missing in the log and were filled in with the mean of the other periods at
    /// their phase.
    pub filled_share: f64,
    /// What the user should know.
    pub warnings: Vec<String>,
}

impl Prepared {
    /// Accounts for further `gaps` in the log that were filled in from the other periods
    /// ([`fill_gaps`](crate::signal::fill_gaps)).
    pub fn count_filled(&mut self, gaps: &[Gap]) {
        let Processing { window_s: [start_s, end_s], rate_hz, .. } = self.processing;
        let rows = |gap: &Gap| {
            let missing_s = gap.end_s.min(end_s) - gap.start_s.max(start_s);
            (missing_s * rate_hz - 1.0).max(0.0)
        };
        let [_, before] = self.kept();
        self.filled_share += gaps.iter().map(rows).sum::<f64>() / ((end_s - start_s) * rate_hz);
        let [_, scatter] = self.kept();
        for sigma in self.replicates.iter_mut().flat_map(|r| &mut r.sigma) {
            *sigma *= (before / scatter).sqrt();
        }
    }

    /// The parts of P periods that count, where the share f of their samples was filled in. The first, 1 − f,
    /// determines the mean, whose noise has the variance σ²/(P (1 − f)). The second, 1 − f P/(P − 1), is the part of
    /// the P − 1 degrees of freedom that determines the scatter. For joined logs, whose rows count one by one, both
    /// are 1 − f.
    pub fn kept(&self) -> [f64; 2] {
        let (periods, f) = (self.processing.periods as f64, self.filled_share);
        let of_scatter = if periods < 2.0 { f } else { f * periods / (periods - 1.0) };
        [1.0 - f, 1.0 - of_scatter]
    }
}
