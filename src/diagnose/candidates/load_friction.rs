//! Friction of a loaded gear: τ = μ |τ_L| sign q̇, with τ_L the torque that the gear transmits. μ is the friction per
//! load at the run's rms load.
//!
//! In a single run, two more things are estimated: the exponent p of τ = c |τ_L|^p sign q̇, and friction under the
//! bending moment on the joint's bearing. The torque on the next joint tells this moment where the axes of the two
//! joints are perpendicular (variant 1). In a periodic motion, a variant whose load includes the rotor's torque is
//! tried instead (variant 2): something rubs on the motor's side of the gear. Where the motion tells only the sum of the
//! inertias of links and rotor, the rotor's share of it is tried as well (variant 3): with the rotor 20 % too heavy in the
//! robot's file, μ of 0.1 came out as 0.1036 ± 0.0006 of joint 2 of an arm, and without any rotor as 0.084.

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
/// Variant whose load is the torque that the gear transmits, for another rotor than that of the description. The value is
/// the rotor's inertia, kg m².
pub const ROTOR: usize = 3;
/// Shares of the inertia of rotor and links that the rotor is tried with, least and largest.
const SHARES: [f64; 2] = [0.02, 0.98];
/// Number of these shares.
const SHARES_TRIED: usize = 8;
/// Starting exponents for a single run.
const EXPONENTS: [f64; 4] = [1.0, 1.5, 2.0, 2.5];

/// Torque that loads joint `j`, at its instants, Nm.
fn load(scene: &Scene, j: usize, shape: Shape) -> Cow<'_, [f64]> {
    match shape.variant {
        MOTOR_SIDE => scene.at_instants(scene.load_nm.joint(j)),
        BENDING => scene.link_at_instants(j + 1).into(),
        ROTOR => {
            let described = scene.arm.joints[j].drive.rotor_inertia_kg_m2;
            let lighter = described - shape.value;
            let qdd = scene.accelerations(scene.motion.qd_rad_s.joint(j));
            let mut load = scene.link_at_instants(j).to_vec();
            let rest = scene.at_instants(&qdd);
            load.iter_mut().zip(rest.iter()).for_each(|(load, qdd)| *load += lighter * qdd);
            load.into()
        }
        _ => scene.link_at_instants(j).into(),
    }
}

/// Mean inertia of the rotor and the links of joint `j` about its axis, kg m².
fn inertia_kg_m2(scene: &Scene, j: usize) -> f64 {
    let links = scene.mass_kg_m2[j].joint(j);
    let mean = links.iter().sum::<f64>() / links.len() as f64;
    mean + scene.arm.joints[j].drive.rotor_inertia_kg_m2
}

/// Whether the axis after joint `j` is perpendicular to that of joint `j`, so that its torque bends the bearing of
/// joint `j`.
fn is_bent(scene: &Scene, j: usize) -> bool {
    // Cosine between the two axes: the child's z axis in the parent's frame.
    scene.arm.joints.get(j + 1).is_some_and(|next| next.placement.rotation[(2, 2)].abs() < 0.1)
}

/// Exponent p where it is estimated.
fn fitted_exponent(shape: Shape) -> Option<f64> {
    (shape.variant != ROTOR && shape.value > 0.0).then_some(shape.value)
}

/// Exponent p; 1 in a periodic motion, for which it is not estimated.
fn exponent(shape: Shape) -> f64 {
    fitted_exponent(shape).unwrap_or(1.0)
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

    fn finer_shapes(&self, scene: &Scene, site: Option<usize>, _: Shape) -> Vec<Shape> {
        if !scene.periodic || scene.tells_rotor[joint(site)] {
            return Vec::new();
        }
        let inertia_kg_m2 = inertia_kg_m2(scene, joint(site));
        let shares = geometric(SHARES[0], SHARES[1], SHARES_TRIED);
        shares.map(|share| Shape { variant: ROTOR, value: share * inertia_kg_m2 }).collect()
    }

    /// The rotor's share is one more number that is fitted: it counts as many shapes.
    fn alternatives(&self, _: &Scene, _: Option<usize>, shape: Shape) -> Option<f64> {
        (shape.variant == ROTOR).then_some(2.0 * SHARES_TRIED as f64)
    }

    fn search(&self) -> Search {
        Search::Logarithmic
    }

    fn columns(&self, scene: &Scene, site: Option<usize>, shape: Shape) -> Vec<Column> {
        let j = joint(site);
        let load = load(scene, j, shape);
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
        let name = if shape.variant == BENDING { "mu_bending" } else { "mu" };
        let Some(exponent) = fitted_exponent(shape) else {
            let mut out = vec![quantity(name, b[0], "")];
            if shape.variant == ROTOR {
                out.push(quantity("rotor_inertia_kg_m2", shape.value, "kg m²"));
            }
            return out;
        };
        let load = load(scene, joint(site), shape);
        let rms = (load.iter().map(|l| l * l).sum::<f64>() / load.len() as f64).sqrt();
        // Only together with its load, μ says how large such friction is.
        vec![
            quantity(name, b[0] * rms.powf(exponent - 1.0), ""),
            quantity("exponent", exponent, ""),
            quantity("rms_load_nm", rms, "Nm"),
        ]
    }

    /// No gear runs easier under load.
    fn is_possible(&self, _: Shape, b: &[f64]) -> bool {
        b[0] > 0.0
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
            ROTOR => Some("rotor's inertia fitted"),
            _ => None,
        }
    }
}
