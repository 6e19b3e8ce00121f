//! Friction of a loaded gear: τ = μ |τ_L| sign q̇, with τ_L the torque that the gear transmits. μ is the friction per
//! load at the run's rms load.
//!
//! In a single run, two more things are estimated: the exponent p of τ = c |τ_L|^p sign q̇, and friction under the
//! bending moment on the joint's bearing. The torque on the next joint tells this moment where the axes of the two
//! joints are perpendicular (variant 1). In a periodic motion, a variant whose load includes the rotor's torque is
//! tried instead (variant 2): something rubs on the motor's side of the gear.

use std::borrow::Cow;

use super::*;

/// See the module.
pub struct LoadFriction;

/// Variant whose load is the torque that the gear transmits, without the rotor's: the rotor sits on the motor's side.
const GEAR: usize = 0;
/// Variant whose load is the bending moment.
const BENDING: usize = 1;
/// Variant whose load is the torque on the motor's side of the gear, including the rotor's.
pub const MOTOR_SIDE: usize = 2;
/// Starting exponents for a single run.
const EXPONENTS: [f64; 4] = [1.0, 1.5, 2.0, 2.5];

/// Torque that loads joint `j`, at its instants, Nm.
fn load(scene: &Scene, j: usize, variant: usize) -> Cow<'_, [f64]> {
    match variant {
        MOTOR_SIDE => scene.at_instants(scene.load_nm.joint(j)),
        BENDING => scene.link_at_instants(j + 1).into(),
        _ => scene.link_at_instants(j).into(),
    }
}

/// Whether the axis after joint `j` is perpendicular to that of joint `j`, so that its torque bends the bearing of
/// joint `j`.
fn is_bent(scene: &Scene, j: usize) -> bool {
    // Cosine between the two axes: the child's z axis in the parent's frame.
    scene.arm.joints.get(j + 1).is_some_and(|next| next.placement.rotation[(2, 2)].abs() < 0.1)
}

/// Exponent p; 1 in a periodic motion, for which it is not estimated.
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
            // Only together with its load, μ says how large such friction is.
            out.push(quantity("rms_load_nm", rms, "Nm"));
        }
        out
    }

    /// A gear whose friction equals its load does not turn.
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
