//! Coulomb friction that depends on the angle: τ = (a cos q + b sin q) sign q̇ = A cos(q + φ) sign q̇.

use super::*;

/// See the module.
pub struct PositionFriction;

impl Candidate for PositionFriction {
    fn kind(&self) -> Kind {
        Kind::PositionFriction
    }

    fn columns(&self, scene: &Scene, site: Option<usize>, _: Shape) -> Vec<Column> {
        let j = joint(site);
        let column = |f: fn(f64) -> f64| dry_friction(scene, j, |at, k| f(at.q_rad[k]));
        vec![column(f64::cos), column(f64::sin)]
    }

    fn quantities(&self, _: &Scene, _: Option<usize>, _: Shape, b: &[f64]) -> Vec<Quantity> {
        vec![
            quantity("amplitude_nm", b[0].hypot(second(b)), "Nm"),
            quantity("phase_rad", (-second(b)).atan2(b[0]), "rad"),
        ]
    }

    fn separating_experiment(&self) -> &'static str {
        "the same motion with another payload or on a tilted base: this friction stays where it was"
    }

    /// Over a turn friction varies by a part of its level. What would have to vary by more than three quarters is a
    /// bent law of something else, seen over a small arc.
    fn is_its_own(&self, scene: &Scene, site: Option<usize>, _: Shape, b: &[f64]) -> bool {
        !scene.periodic || b[0].hypot(second(b)) < 0.75 * scene.coulomb_nm[joint(site)]
    }

    fn in_words(&self) -> &'static str {
        "friction that depends on the angle"
    }
}
