//! Friction of a loaded gear: τ = μ |τ_L| sign q̇, τ_L the torque the gear transmits.

use super::*;

/// See the module.
pub struct LoadFriction;

impl Candidate for LoadFriction {
    fn kind(&self) -> Kind {
        Kind::LoadFriction
    }

    fn columns(&self, scene: &Scene, site: Option<usize>, _: Shape) -> Vec<Column> {
        let j = joint(site);
        // The rotor sits on the motor's side of the gear: its torque is not transmitted.
        let (load, sign) = (scene.link_nm.joint(j), scene.sign.joint(j));
        vec![Column::on(j, samples(scene, |k| load[k].abs() * sign[k]))]
    }

    fn quantities(&self, _: &Scene, _: Option<usize>, _: Shape, b: &[f64]) -> Vec<Quantity> {
        vec![quantity("mu", b[0], "")]
    }

    fn separating_experiment(&self) -> &'static str {
        "the same motion with and without a known payload: this friction scales with the load"
    }

    fn in_words(&self) -> &'static str {
        "friction that grows with the load on the gear"
    }
}
