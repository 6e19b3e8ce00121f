//! Friction that drifts along the logs of an identification.

use serde::Serialize;

use super::Training;
use crate::identify::DriftingFriction;
use crate::number::significant;

/// Friction of one joint that drifts along a log.
#[derive(Debug, Clone, Serialize)]
pub struct DriftResult {
    /// The log.
    pub log: String,
    /// The joint, from 1.
    pub joint: usize,
    /// Friction in the first period, a mean while the joint moves, Nm.
    pub first_nm: f64,
    /// The same in the last period, Nm.
    pub last_nm: f64,
    /// Rms of the torque by which friction differs from its mean over the log, Nm.
    pub rms_nm: f64,
    /// F statistic of the drift.
    pub statistic: f64,
    /// Degrees of freedom of its F distribution.
    pub degrees_of_freedom: [f64; 2],
    /// Probability that noise alone gives a larger statistic.
    pub p_value: f64,
    /// Probability below which a drift is told.
    pub level: f64,
}

impl DriftResult {
    /// All drifts of the logs behind `training`. Of a misread log there are none: what seems to be friction there need
    /// not be any.
    pub fn all(training: &Training) -> Vec<Self> {
        let of = |drift: &DriftingFriction| Self {
            log: training.logs[drift.log].source.clone(),
            joint: drift.joint + 1,
            first_nm: drift.ends_nm[0],
            last_nm: drift.ends_nm[1],
            rms_nm: drift.rms_nm,
            statistic: drift.statistic,
            degrees_of_freedom: drift.degrees_of_freedom,
            p_value: drift.p_value,
            level: DriftingFriction::REJECT_BELOW,
        };
        let is_read = training.misread.is_none();
        training.identification.drifting_friction.iter().filter(|_| is_read).map(of).collect()
    }

    /// The joint and its change of friction.
    fn in_words(&self) -> String {
        let Self { joint, first_nm, last_nm, .. } = self;
        let share = match *first_nm > 0.0 {
            true => format!(", {:+.1} %", 100.0 * (last_nm / first_nm - 1.0)),
            false => String::new(),
        };
        let [first, last] = [first_nm, last_nm].map(|nm| significant(*nm, 3));
        format!("joint {joint} (from {first} to {last} Nm{share})")
    }
}

/// A remark on every log along which friction drifts.
pub(super) fn remarks(training: &Training) -> Vec<String> {
    let drifts = DriftResult::all(training);
    let of_one = |drifts: &[DriftResult]| {
        let joints: Vec<String> = drifts.iter().map(DriftResult::in_words).collect();
        let remark = format!(
            "friction drifts along the log: {}, as means while the joint moves, in the first and in the last period. The \
             parameters are those of its mean over the log, and σ is that of the noise beside the drift. Friction mostly drifts \
             because it warms up: let the arm move until it is warm before you record. armid diagnose says how fast it drifts, and \
             what else the model lacks",
            joints.join(", ")
        );
        training.named(&drifts[0].log, remark)
    };
    drifts.chunk_by(|a, b| a.log == b.log).map(of_one).collect()
}

/// The friction that the parameters mean where it drifts, in a sentence; `None` where it does not.
pub(super) fn means_in_words(training: &Training) -> Option<String> {
    let mut joints: Vec<usize> =
        DriftResult::all(training).iter().map(|drift| drift.joint).collect();
    joints.sort_unstable();
    joints.dedup();
    let names: Vec<String> = joints.iter().map(usize::to_string).collect();
    let of = if names.len() == 1 { "joint" } else { "joints" };
    (!names.is_empty()).then(|| {
        format!(
            "Friction of {of} {} drifts: its parameters and their intervals mean the friction that there was on average along the \
             log, not that of a cold or of a warm arm.",
            names.join(", ")
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_change_is_told_with_its_share_where_there_is_one() {
        let drift = |first_nm: f64, last_nm: f64| DriftResult {
            log: "a.csv".to_owned(),
            joint: 2,
            first_nm,
            last_nm,
            rms_nm: 1.0,
            statistic: 100.0,
            degrees_of_freedom: [4.0, 1000.0],
            p_value: 1e-50,
            level: DriftingFriction::REJECT_BELOW,
        };
        assert_eq!(drift(20.0, 17.0).in_words(), "joint 2 (from 20.0 to 17.0 Nm, -15.0 %)");
        assert_eq!(drift(-0.5, 17.0).in_words(), "joint 2 (from -0.500 to 17.0 Nm)");
    }
}
