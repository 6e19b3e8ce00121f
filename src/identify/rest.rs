//! Joints that do not move, and joints whose motion is lost between samples that are too far apart.

use super::course::Course;
use super::error::IdentifyError;
use super::identifier::Identifier;
use super::lowered::Lowered;
use super::measurement::Measurement;
use super::prediction::resting_joints;
use super::regression::Regression;
use crate::signal::reading_noise;

/// Share of a joint's speed (rms) below which its motion is lost: what is left of it no longer tells of the joint.
const LOST: f64 = 0.5;

/// Joints (0-based) whose motion is missing in the rows of a regression.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Rest {
    /// Joints that stand still.
    pub still: Vec<usize>,
    /// Joints that move in the log, too fast for the rate of the rows.
    pub outpaced: Vec<usize>,
    /// Rate of the rows, Hz.
    pub rate_hz: f64,
    /// What options lowered, which can take a part of any motion away.
    pub lowered: Vec<Lowered>,
}

impl Rest {
    /// The joints whose motion is missing in `regression`.
    pub fn of(regression: &Regression) -> Self {
        let outpaced = regression.outpaced.clone();
        let mut still = resting_joints(&regression.course().qd_rad_s);
        still.retain(|j| !outpaced.contains(j));
        let rate_hz = regression.prepared.processing.rate_hz;
        Self { still, outpaced, rate_hz, lowered: regression.lowered.clone() }
    }
}

/// Whether no joint moves along the log `m`, as `identifier` reads it.
pub fn nothing_moves(identifier: &mut Identifier, m: &Measurement) -> bool {
    match identifier.regression(m) {
        Ok(regression) => Rest::of(&regression).still.len() == m.q_rad.joints(),
        Err(error) => matches!(error, IdentifyError::NoMotion { .. }),
    }
}

/// The joints of the log `m` that move, and of whose speed next to nothing is left in its `course` at another rate.
pub(super) fn outpaced(m: &Measurement, course: &Course) -> Vec<usize> {
    let (Some(first_s), Some(last_s)) = (course.time_s.first(), course.time_s.last()) else {
        return Vec::new();
    };
    let rows = m.time_s.partition_point(|s| s < first_s)..m.time_s.partition_point(|s| s <= last_s);
    let is_outpaced = |j: &usize| {
        let qd_rad_s = m.qd_rad_s.joint(*j);
        let noise = reading_noise(qd_rad_s).powi(2);
        let recorded = (mean_square(&qd_rad_s[rows.clone()]) - noise).max(0.0);
        m.moves(*j) && mean_square(course.qd_rad_s.joint(*j)) < LOST * LOST * recorded
    };
    (0..m.qd_rad_s.joints()).filter(is_outpaced).collect()
}

fn mean_square(y: &[f64]) -> f64 {
    y.iter().map(|v| v * v).sum::<f64>() / y.len() as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::JointSignals;
    use rand::{SeedableRng, rngs::ChaCha8Rng};
    use rand_distr::{Distribution, StandardNormal};

    /// Joint 1 turns once a second and joint 2 once in a minute, joint 3 rests under noise. In samples a second apart
    /// joint 1 seems to rest.
    #[test]
    fn a_motion_between_samples_is_no_rest() {
        let turns_hz = [1.0, 1.0 / 60.0, 0.0];
        let speed = |j: usize, s: f64| (std::f64::consts::TAU * turns_hz[j] * s).sin();
        let time_s: Vec<f64> = (0..7500).map(|k| 0.008 * f64::from(k)).collect();
        let mut rng = ChaCha8Rng::seed_from_u64(8);
        let mut noise = || -> f64 { StandardNormal.sample(&mut rng) };
        let qd_rad_s =
            JointSignals::from_fn(3, time_s.len(), |j, k| speed(j, time_s[k]) + 0.02 * noise());
        let still = JointSignals::zeros(3, time_s.len());
        let m = Measurement {
            source: "a.csv",
            time_s: &time_s,
            q_rad: &still,
            qd_rad_s: &qd_rad_s,
            torque_nm: &still,
        };
        let slow_s: Vec<f64> = (0..60).map(f64::from).collect();
        let course = |time_s: &[f64]| Course {
            qd_rad_s: JointSignals::from_fn(3, time_s.len(), |j, k| speed(j, time_s[k])),
            time_s: time_s.to_vec(),
        };
        assert_eq!(outpaced(&m, &course(&slow_s)), [0]);
        assert!(outpaced(&m, &course(&time_s)).is_empty());
    }
}
