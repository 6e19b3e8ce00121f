//! Friction of a loaded gear: τ = μ |τ_L| sign q̇, τ_L the torque the gear transmits.
//!
//! A single run is also asked for the exponent, τ = c |τ_L|^p sign q̇, and for friction under the bending
//! moment on the joint's bearing. Of that moment the torque on the next joint is known, where its axis is
//! perpendicular to this one's (variant 1). μ is the friction per load at the run's rms load. A motion that repeats is
//! asked whether the rotor's torque counts as well (variant 2): where something on the motor's side of the gear rubs.

use std::borrow::Cow;

use super::*;

/// See the module.
pub struct LoadFriction;

/// The variant whose load is the torque that the gear transmits: the rotor sits on the motor's side.
const GEAR: usize = 0;
/// The variant whose load is the bending moment.
const BENDING: usize = 1;
/// The variant whose load is the torque on the motor's side of the gear, the rotor's with it.
pub const MOTOR_SIDE: usize = 2;
/// Exponents to begin with along a single run.
const EXPONENTS: [f64; 4] = [1.0, 1.5, 2.0, 2.5];

/// Torque by which joint `j` is loaded, at its instants, Nm.
fn load(scene: &Scene, j: usize, variant: usize) -> Cow<'_, [f64]> {
    match variant {
        MOTOR_SIDE => scene.at_instants(scene.load_nm.joint(j)),
        BENDING => scene.link_at_instants(j + 1).into(),
        _ => scene.link_at_instants(j).into(),
    }
}

/// Whether the axis behind joint `j` is perpendicular to its own, so that its torque bends joint `j`.
fn is_bent(scene: &Scene, j: usize) -> bool {
    // The cosine between both axes: the child's z in the parent's frame.
    scene.arm.joints.get(j + 1).is_some_and(|next| next.placement.rotation[(2, 2)].abs() < 0.1)
}

/// p; a motion that repeats is not asked for it.
fn exponent(shape: Shape) -> f64 {
    if shape.value > 0.0 { shape.value } else { 1.0 }
}

impl Candidate for LoadFriction {
    fn kind(&self) -> Kind {
        Kind::LoadFriction
    }

    fn shapes(&self, scene: &Scene, site: Option<usize>) -> Vec<Shape> {
        if scene.periodic {
            return [GEAR, MOTOR_SIDE].map(|variant| Shape { variant, value: 0.0 }).into();
        }
        let variants = if is_bent(scene, joint(site)) { GEAR..=BENDING } else { GEAR..=GEAR };
        variants.flat_map(|variant| EXPONENTS.map(|value| Shape { variant, value })).collect()
    }

    fn search(&self) -> Search {
        Search::Logarithmic
    }

    fn columns(&self, scene: &Scene, site: Option<usize>, shape: Shape) -> Vec<Column> {
        let j = joint(site);
        let load = load(scene, j, shape.variant);
        let p = exponent(shape);
        vec![dry_friction(scene, j, |_, k| load[k].abs().powf(p))]
    }

    fn quantities(
        &self,
        scene: &Scene,
        site: Option<usize>,
        shape: Shape,
        b: &[f64],
    ) -> Vec<Quantity> {
        let load = load(scene, joint(site), shape.variant);
        let rms = (load.iter().map(|l| l * l).sum::<f64>() / load.len() as f64).sqrt();
        let mu = b[0] * rms.powf(exponent(shape) - 1.0);
        let name = if shape.variant == BENDING { "mu_bending" } else { "mu" };
        let mut out = vec![quantity(name, mu, "")];
        if shape.value > 0.0 {
            out.push(quantity("exponent", shape.value, ""));
        }
        out
    }

    /// A gear whose friction is its load does not turn.
    fn can_be(&self, _: &Scene, _: Option<usize>, mu: f64) -> bool {
        mu.abs() < 1.0
    }

    fn separating_experiment(&self) -> &'static str {
        "the same motion with and without a known payload: this friction scales with the load"
    }

    fn in_words(&self) -> &'static str {
        "friction that grows with the load on the gear"
    }

    fn form(&self, _: &Scene, shape: Shape) -> Option<&'static str> {
        match shape.variant {
            MOTOR_SIDE => Some("load of the motor, the rotor's with it"),
            BENDING => Some("bending moment on the bearing"),
            _ => None,
        }
    }
}
