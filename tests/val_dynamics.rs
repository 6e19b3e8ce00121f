//! The dynamics against Pinocchio 4.1 on 200 random states of each of three arms: UR5, UR10e and an arm with random
//! tilted axes. `tests/golden/dynamics.py` writes the goldens from the robot files alone.
//!
//! Tolerance. Both programs evaluate the same formula in double precision along different paths. Each quantity is a sum
//! of a few hundred products, each of which may exceed the sum after cancellation. Unit round-off 1.1e-16 times a
//! thousand operations times three digits of cancellation is 1e-10 of the Euclidean norm of the whole vector or matrix.
//! The errors printed are near 1e-15. The mistakes that the tests must find are far larger: a wrong sign of the
//! smallest product of inertia (1.5e-6 kg m², UR5 wrist) changes the torque by 5e-6 of its size.

use crate::golden::State;
use armid::dynamics::{
    Model, Workspace, forward_dynamics, inverse_dynamics, kinetic_energy, mass_matrix,
    potential_energy, regressor,
};
use armid::robot::Arm;
use nalgebra::DMatrix;

const RELATIVE: f64 = 1e-10;

/// ‖actual − expected‖ / ‖expected‖; absolute where the expected vector vanishes.
fn relative_error(actual: &[f64], expected: &[f64]) -> f64 {
    assert_eq!(actual.len(), expected.len());
    let norm = |x: f64| if x == 0.0 { 1.0 } else { x.sqrt() };
    let difference: f64 = actual.iter().zip(expected).map(|(a, e)| (a - e).powi(2)).sum();
    difference.sqrt() / norm(expected.iter().map(|e| e * e).sum())
}

fn inertial_parameters(arm: &Arm) -> Vec<f64> {
    arm.joints.iter().flat_map(|joint| joint.link.parameters).collect()
}

/// Compares `actual` with `expected` on every golden state of every arm; prints the largest error.
fn compare(
    mut actual: impl FnMut(&Model, &mut Workspace<f64>, &State) -> Vec<f64>,
    expected: impl Fn(&State) -> Vec<f64>,
) {
    for (arm, states) in crate::golden::all() {
        let model = Model::new(&arm);
        let mut ws = Workspace::new(&model);
        assert!(states.len() >= 200);
        let errors: Vec<f64> = states
            .iter()
            .map(|s| relative_error(&actual(&model, &mut ws, s), &expected(s)))
            .collect();
        let worst = errors.iter().copied().fold(0.0, f64::max);
        println!("{}: worst relative error {worst:.1e}", arm.name);
        for (s, error) in errors.into_iter().enumerate() {
            assert!(error < RELATIVE, "{} state {s}: relative error {error:e}", arm.name);
        }
    }
}

#[test]
fn inverse_dynamics_is_pinocchios() {
    compare(
        |model, ws, s| {
            let mut torque = vec![0.0; model.dof()];
            inverse_dynamics(model, ws, &s.q_rad, &s.qd_rad_s, &s.qdd_rad_s2, &mut torque);
            torque
        },
        |s| s.torque_nm.iter().zip(&s.friction_nm).map(|(t, f)| t + f).collect(),
    );
}

#[test]
fn friction_is_viscous_plus_regularised_coulomb() {
    compare(
        |model, _, s| s.qd_rad_s.iter().enumerate().map(|(j, qd)| model.friction(j, *qd)).collect(),
        |s| s.friction_nm.clone(),
    );
}

#[test]
fn the_inertial_columns_of_the_regressor_are_pinocchios() {
    compare(
        |model, ws, s| {
            let theta = regressor(model, ws, &s.q_rad, &s.qd_rad_s, &s.qdd_rad_s2);
            let inertial = theta.columns(0, 10 * model.dof());
            inertial.row_iter().flat_map(|row| row.iter().copied().collect::<Vec<_>>()).collect()
        },
        |s| s.regressor.clone(),
    );
}

#[test]
fn the_mass_matrix_with_rotors_is_pinocchios() {
    compare(
        |model, ws, s| {
            let mut mass = DMatrix::zeros(model.dof(), model.dof());
            mass_matrix(model, ws, &s.q_rad, &mut mass);
            mass.as_slice().to_vec()
        },
        |s| s.mass_kg_m2.clone(),
    );
}

/// Pinocchio's articulated-body algorithm forms no mass matrix, so that even the method differs.
///
/// The condition number of M is below 1e3 for these arms; the observed errors leave room for that within the common
/// tolerance.
#[test]
fn forward_dynamics_is_pinocchios_articulated_body_algorithm() {
    compare(
        |model, ws, s| {
            let torque: Vec<f64> =
                s.applied_nm().iter().zip(&s.friction_nm).map(|(a, f)| a + f).collect();
            let mut qdd = vec![0.0; model.dof()];
            forward_dynamics(model, ws, &s.q_rad, &s.qd_rad_s, &torque, &mut qdd).unwrap();
            qdd
        },
        |s| s.acceleration_rad_s2.clone(),
    );
}

#[test]
fn kinetic_and_potential_energy_are_pinocchios() {
    compare(
        |model, ws, s| {
            vec![
                kinetic_energy(model, ws, &s.q_rad, &s.qd_rad_s),
                potential_energy(model, &s.q_rad),
            ]
        },
        |s| vec![s.kinetic_j, s.potential_j],
    );
}

/// The parameters of this library's arms, multiplied by Pinocchio's regressor in the same order, give Pinocchio's
/// torque: the order, the signs and the reference point of `LinkInertia` are as documented.
#[test]
fn pinocchios_regressor_takes_our_parameters_to_pinocchios_torque() {
    for (arm, states) in crate::golden::all() {
        assert!(states.len() >= 200);
        let parameters = inertial_parameters(&arm);
        for (s, state) in states.iter().enumerate() {
            let torque: Vec<f64> = state
                .regressor
                .chunks(parameters.len())
                .zip(&arm.joints)
                .zip(&state.qdd_rad_s2)
                .map(|((row, joint), qdd)| {
                    let bodies: f64 = row.iter().zip(&parameters).map(|(a, p)| a * p).sum();
                    bodies + joint.drive.rotor_inertia_kg_m2 * qdd
                })
                .collect();
            let error = relative_error(&torque, &state.torque_nm);
            assert!(error < RELATIVE, "{} state {s}: {error:e}", arm.name);
        }
    }
}
