//! Times and joint velocities of the rows of a regression.

use super::prepared::Prepared;
use super::problem::Problem;
use super::regression::Regression;
use crate::robot::JointSignals;

/// Velocities of the rows of `problem`, of all periods, rad/s: it was laid out from the sample `first` of `prepared` on, each
/// `every` samples.
pub(super) fn row_velocities(
    prepared: &Prepared,
    problem: &Problem,
    [first, every]: [usize; 2],
) -> JointSignals {
    let (n, qd_rad_s) = (problem.samples, &prepared.motion.qd_rad_s);
    JointSignals::from_fn(qd_rad_s.joints(), n * problem.periods, |j, k| {
        qd_rad_s.joint(j)[first + k % n * every]
    })
}

/// Time and velocity of every row, of all periods.
#[derive(Debug, Clone)]
pub struct Course {
    /// Time on the log's clock, s; for several logs on the clock of the first, one log after the other.
    pub time_s: Vec<f64>,
    /// Joint velocities, joints × rows, rad/s.
    pub qd_rad_s: JointSignals,
}

impl Course {
    /// The course of a single log.
    pub(super) fn of(regression: &Regression) -> Self {
        let (n, periods) = (regression.problem.samples, regression.problem.periods);
        let processing = &regression.prepared.processing;
        let rate_hz = processing.rate_hz;
        let start_s = processing.window_s[0] + regression.first_sample as f64 / rate_hz;
        let step_s = regression.every as f64 / rate_hz;
        let laid_out = [regression.first_sample, regression.every];
        Self {
            time_s: (0..n * periods).map(|k| start_s + k as f64 * step_s).collect(),
            qd_rad_s: row_velocities(&regression.prepared, &regression.problem, laid_out),
        }
    }

    /// Keeps every `factor`-th row.
    pub(super) fn thin(&mut self, factor: usize) {
        let kept = |y: &[f64]| y.iter().step_by(factor).copied().collect();
        self.time_s = kept(&self.time_s);
        self.qd_rad_s = self.qd_rad_s.map_joints(|_, y| kept(y));
    }

    /// Appends `others` after this course, each one of its own steps after the one before it.
    pub(super) fn append(&mut self, others: &[Self]) {
        for other in others {
            if let (Some(last), Some(first)) = (self.time_s.last(), other.time_s.first()) {
                let step_s = other.time_s.get(1).map_or(0.0, |second| second - first);
                let shift_s = last + step_s - first;
                self.time_s.extend(other.time_s.iter().map(|time_s| time_s + shift_s));
            }
        }
        let all = |j: usize, own: &[f64]| {
            let parts = others.iter().map(|other| other.qd_rad_s.joint(j));
            std::iter::once(own).chain(parts).collect::<Vec<_>>().concat()
        };
        self.qd_rad_s = self.qd_rad_s.map_joints(all);
    }
}
