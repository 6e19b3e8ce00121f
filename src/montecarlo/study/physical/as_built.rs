//! The arm as built, which differs from the arm in the robot file.

use nalgebra::{Cholesky, Matrix4};
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::robot::{Arm, LinkInertia};

/// Standard deviation of the log-Cholesky parameters of a body; mass and moments vary by about 20 %.
const BODY_SPREAD: f64 = 0.1;
/// Standard deviation of the logarithms of rotor inertia and friction.
const DRIVE_SPREAD: f64 = 0.2;

/// A copy of `arm` in which every body and drive deviates at random from its nominal values, while every body remains
/// physically possible: its pseudo-inertia is P = L U Uᵀ Lᵀ, with L Lᵀ the nominal one and U triangular and close to 1.
pub fn as_built(arm: &Arm, seed: u64) -> Arm {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
    let mut arm = arm.clone();
    for joint in &mut arm.joints {
        let u = Matrix4::from_fn(|i, j| match i.cmp(&j) {
            std::cmp::Ordering::Less => 0.0,
            std::cmp::Ordering::Equal => (BODY_SPREAD * normal()).exp(),
            std::cmp::Ordering::Greater => BODY_SPREAD * normal(),
        });
        if let Some(nominal) = Cholesky::new(joint.link.pseudo_inertia()) {
            let root = nominal.l() * u;
            joint.link = LinkInertia::from_pseudo_inertia(&(root * root.transpose()));
        }
        let drive = &mut joint.drive;
        for value in
            [&mut drive.rotor_inertia_kg_m2, &mut drive.viscous_nm_s_rad, &mut drive.coulomb_nm]
        {
            *value *= (DRIVE_SPREAD * normal()).exp();
        }
    }
    arm
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_can_exist_and_is_another() {
        let nominal = Arm::built_in("ur5").unwrap();
        let built = as_built(&nominal, 1);
        for (a, b) in nominal.joints.iter().zip(&built.joints) {
            assert!(b.link.consistency_margin() > 0.0);
            let ratio = b.link.mass_kg() / a.link.mass_kg();
            // The bounds allow for three standard deviations of e^(2·0.1 n) and of the off-diagonal contributions.
            assert!((0.5..2.0).contains(&ratio) && ratio != 1.0, "{ratio}");
        }
    }
}
