//! A wrong torque constant: the log shows (1 + e) times the torque.

use super::*;

/// See the module.
pub struct TorqueGain;

/// Plausible range of the error e.
const LARGEST: std::ops::Range<f64> = -0.5..1.0;

impl Candidate for TorqueGain {
    fn kind(&self) -> Kind {
        Kind::TorqueGain
    }

    fn columns(&self, scene: &Scene, site: Option<usize>, _: Shape) -> Vec<Column> {
        let j = joint(site);
        vec![Column::on(j, scene.torque_nm.joint(j).to_vec())]
    }

    fn quantities(&self, _: &Scene, _: Option<usize>, _: Shape, b: &[f64]) -> Vec<Quantity> {
        vec![quantity("error_fraction", b[0], "")]
    }

    /// A log with twice the torque, or with half of it, is of another arm.
    fn is_possible(&self, _: Shape, b: &[f64]) -> bool {
        LARGEST.contains(&b[0])
    }

    fn separating_experiment(&self) -> &'static str {
        "the same motion with a payload of known mass"
    }

    fn in_words(&self) -> &'static str {
        "a wrong torque constant"
    }
}
