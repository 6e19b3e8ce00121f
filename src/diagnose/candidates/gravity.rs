//! Another gravity than the description says, in its direction: the torque changes by b times that of gravity.
//!
//! Masses and first moments take most of this over, but then inertias do not fit them any more.

use super::*;

/// See the module.
pub struct Gravity;

/// Relative step of the numerical derivative.
const STEP: f64 = 1e-4;

impl Candidate for Gravity {
    fn kind(&self) -> Kind {
        Kind::Gravity
    }

    fn sites(&self, _: usize) -> Vec<Option<usize>> {
        vec![None]
    }

    fn columns(&self, scene: &Scene, _: Option<usize>, _: Shape) -> Vec<Column> {
        vec![of_changed_arm(scene, STEP, |arm| arm.gravity_m_s2 *= 1.0 + STEP)]
    }

    fn quantities(&self, scene: &Scene, _: Option<usize>, _: Shape, b: &[f64]) -> Vec<Quantity> {
        let g_m_s2 = self.without_effect(scene);
        vec![quantity("g_m_s2", g_m_s2 * (1.0 + b[0]), "m/s²")]
    }

    fn without_effect(&self, scene: &Scene) -> f64 {
        scene.arm.gravity_m_s2.norm()
    }

    fn separating_experiment(&self) -> &'static str {
        "a known payload, weighed at the same place"
    }

    fn in_words(&self) -> &'static str {
        "another gravity than the description says"
    }
}
