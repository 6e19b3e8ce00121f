//! Identities that any correct rigid-body dynamics satisfies, checked on the golden states of the UR5, the UR10e and
//! the tilted arm.
//!
//! Tolerances. Identities between two exact expressions: 1e-10 of the size of the terms (round-off
//! 1e-16 times a few thousand operations, with three digits in hand). Identities with a derivative:
//! central differences of step h = ε^(1/3) ≈ 6e-6 have a truncation error h² f‴/6 and a rounding
//! error ε f/h, both about 1e-11 f; the trigonometric f of six joints in series have third
//! derivatives up to 6³ times their size, and √ε ≈ 1.5e-8 relative bounds the sum.

use crate::golden::State;
use armid::dynamics::{
    Lanes, Model, Motion, ParameterLayout, RegressorBlock, Workspace, forward_dynamics,
    inverse_dynamics, kinetic_energy, mass_matrix, potential_energy, regressor,
};
use armid::robot::JointSignals;
use nalgebra::{DMatrix, DVector};

const EXACT: f64 = 1e-10;
const DIFFERENCED: f64 = 1.5e-8;
const STEP: f64 = 6e-6;

/// Every golden state of every arm.
fn each_state(mut check: impl FnMut(&Model, &mut Workspace<f64>, &State, &str)) {
    for (arm, states) in crate::golden::all() {
        let model = Model::new(&arm);
        let mut ws = Workspace::new(&model);
        for (s, state) in states.iter().enumerate() {
            check(&model, &mut ws, state, &format!("{} state {s}", arm.name));
        }
    }
}

fn torque(model: &Model, ws: &mut Workspace<f64>, q: &[f64], qd: &[f64], qdd: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; model.dof()];
    inverse_dynamics(model, ws, q, qd, qdd, &mut out);
    out
}

fn mass(model: &Model, ws: &mut Workspace<f64>, q: &[f64]) -> DMatrix<f64> {
    let mut out = DMatrix::zeros(model.dof(), model.dof());
    mass_matrix(model, ws, q, &mut out);
    out
}

fn shifted(q: &[f64], direction: &[f64], step: f64) -> Vec<f64> {
    q.iter().zip(direction).map(|(q, d)| q + step * d).collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[test]
fn the_regressor_times_the_parameters_is_the_inverse_dynamics() {
    each_state(|model, ws, s, at| {
        let parameters = DVector::from_vec(model.standard_parameters());
        let linear = regressor(model, ws, &s.q_rad, &s.qd_rad_s, &s.qdd_rad_s2) * &parameters;
        let direct = torque(model, ws, &s.q_rad, &s.qd_rad_s, &s.qdd_rad_s2);
        let error = (linear - DVector::from_vec(direct.clone())).norm();
        assert!(error < EXACT * DVector::from_vec(direct).norm(), "{at}: {error:e} Nm");
    });
}

#[test]
fn the_mass_matrix_is_symmetric_and_positive_definite() {
    each_state(|model, ws, s, at| {
        let m = mass(model, ws, &s.q_rad);
        assert_eq!(m, m.transpose(), "{at}");
        // The rotors alone make every eigenvalue at least the smallest rotor inertia; links only add to it.
        let layout = ParameterLayout::new(model.dof());
        let parameters = model.standard_parameters();
        let rotors = (0..layout.count()).filter(|&k| layout.name(k).starts_with("Ia"));
        let floor = rotors.map(|k| parameters[k]).fold(f64::INFINITY, f64::min);
        let smallest = m.symmetric_eigenvalues().min();
        assert!(smallest >= floor * (1.0 - EXACT), "{at}: {smallest} below {floor} kg m2");
    });
}

/// The inertial part of the torque, with gravity, velocity torques and friction subtracted, is the mass matrix times
/// the acceleration.
#[test]
fn the_mass_matrix_is_what_inverse_dynamics_multiplies_the_acceleration_by() {
    each_state(|model, ws, s, at| {
        let n = model.dof();
        let m = mass(model, ws, &s.q_rad);
        let rest = vec![0.0; n];
        let bias = torque(model, ws, &s.q_rad, &s.qd_rad_s, &rest);
        let full = torque(model, ws, &s.q_rad, &s.qd_rad_s, &s.qdd_rad_s2);
        let inertial = m * DVector::from_column_slice(&s.qdd_rad_s2);
        let size =
            DVector::from_column_slice(&full).norm() + DVector::from_column_slice(&bias).norm();
        for j in 0..n {
            assert!((full[j] - bias[j] - inertial[j]).abs() < EXACT * size, "{at} joint {}", j + 1);
        }
    });
}

/// With C_kj = Σ_i Γ_ijk q̇_i from the Christoffel symbols of M (differenced), Ṁ − 2C is skew, and C q̇ are the
/// velocity torques of the inverse dynamics. The first property holds for any symmetric M(q); the second ties M and the
/// velocity torques to the same arm.
#[test]
fn velocity_torques_come_from_the_christoffel_symbols_of_the_mass_matrix() {
    each_state(|model, ws, s, at| {
        let n = model.dof();
        let qd = &s.qd_rad_s;
        let derivatives: Vec<DMatrix<f64>> = (0..n)
            .map(|i| {
                let unit: Vec<f64> = (0..n).map(|k| f64::from(u8::from(k == i))).collect();
                let ahead = mass(model, ws, &shifted(&s.q_rad, &unit, STEP));
                (ahead - mass(model, ws, &shifted(&s.q_rad, &unit, -STEP))) / (2.0 * STEP)
            })
            .collect();
        let rate: DMatrix<f64> = derivatives.iter().zip(qd).map(|(d, v)| d * *v).sum();
        let c = DMatrix::from_fn(n, n, |k, j| {
            (0..n)
                .map(|i| {
                    let (di, dj, dk) = (&derivatives[i], &derivatives[j], &derivatives[k]);
                    0.5 * (di[(k, j)] + dj[(k, i)] - dk[(i, j)]) * qd[i]
                })
                .sum()
        });
        let size = mass(model, ws, &s.q_rad).norm() * dot(qd, qd).sqrt();
        let skew: DMatrix<f64> = &rate - 2.0 * &c;
        let symmetric = (&skew + skew.transpose()).norm();
        assert!(symmetric <= DIFFERENCED * size, "{at}: {symmetric:e} against {size:e}");

        let rest = vec![0.0; n];
        let moving = torque(model, ws, &s.q_rad, qd, &rest);
        let still = torque(model, ws, &s.q_rad, &rest, &rest);
        let products: DVector<f64> = &c * DVector::from_column_slice(qd);
        let bound = DIFFERENCED * (size * dot(qd, qd).sqrt() + dot(&moving, &moving).sqrt());
        for j in 0..n {
            let velocity_torque = moving[j] - still[j] - model.friction(j, qd[j]);
            let error = (velocity_torque - products[j]).abs();
            assert!(error <= bound, "{at} joint {}: {error:e} against {bound:e} Nm", j + 1);
        }
    });
}

/// The gravity torque is the gradient of the potential energy.
#[test]
fn the_torque_at_rest_is_the_gradient_of_the_potential_energy() {
    each_state(|model, ws, s, at| {
        let n = model.dof();
        let rest = vec![0.0; n];
        let gravity = torque(model, ws, &s.q_rad, &rest, &rest);
        let size = potential_energy(model, &s.q_rad).abs() + dot(&gravity, &gravity).sqrt();
        for (j, g) in gravity.iter().enumerate() {
            let unit: Vec<f64> = (0..n).map(|k| f64::from(u8::from(k == j))).collect();
            let ahead = potential_energy(model, &shifted(&s.q_rad, &unit, STEP));
            let behind = potential_energy(model, &shifted(&s.q_rad, &unit, -STEP));
            let slope = (ahead - behind) / (2.0 * STEP);
            assert!((slope - g).abs() < DIFFERENCED * size, "{at} joint {}", j + 1);
        }
    });
}

/// The power of the drives less the power dissipated by friction is the rate of the energy: τᵀq̇ − fᵀq̇ = dE/dt along
/// (q̇, q̈).
#[test]
fn the_power_of_the_drives_is_the_rate_of_energy_and_what_friction_takes() {
    each_state(|model, ws, s, at| {
        let mut energy = |t: f64| {
            // The parabola through the state with its velocity and acceleration.
            let velocity = shifted(&s.qd_rad_s, &s.qdd_rad_s2, t);
            let drift = shifted(&s.q_rad, &s.qd_rad_s, t);
            let q = shifted(&drift, &s.qdd_rad_s2, 0.5 * t * t);
            kinetic_energy(model, ws, &q, &velocity) + potential_energy(model, &q)
        };
        let rate = (energy(STEP) - energy(-STEP)) / (2.0 * STEP);
        let level = energy(0.0).abs();
        let drives = torque(model, ws, &s.q_rad, &s.qd_rad_s, &s.qdd_rad_s2);
        let friction: f64 =
            s.qd_rad_s.iter().enumerate().map(|(j, v)| model.friction(j, *v) * v).sum();
        let size =
            level + dot(&drives, &drives).sqrt() * (1.0 + dot(&s.qd_rad_s, &s.qd_rad_s).sqrt());
        let error = (dot(&drives, &s.qd_rad_s) - friction - rate).abs();
        // d³E/dt³ contains q̈²/q̇, about 10 times the size of the motion itself.
        assert!(error < 10.0 * DIFFERENCED * size, "{at}: {error:e} against {size:e} W");
    });
}

#[test]
fn forward_dynamics_undoes_inverse_dynamics() {
    each_state(|model, ws, s, at| {
        let drives = torque(model, ws, &s.q_rad, &s.qd_rad_s, &s.qdd_rad_s2);
        let mut back = vec![0.0; model.dof()];
        forward_dynamics(model, ws, &s.q_rad, &s.qd_rad_s, &drives, &mut back).unwrap();
        let size = dot(&s.qdd_rad_s2, &s.qdd_rad_s2).sqrt();
        for (j, (actual, expected)) in back.iter().zip(&s.qdd_rad_s2).enumerate() {
            assert!((actual - expected).abs() < EXACT * size, "{at} joint {}", j + 1);
        }
    });
}

/// Eight samples at a time give the same bits as one at a time, also where the last group is incomplete and where a
/// block starts inside a motion.
#[test]
fn a_block_of_samples_has_the_bits_of_single_samples() {
    for (arm, states) in crate::golden::all() {
        let model = Model::new(&arm);
        let n = model.dof();
        let layout = ParameterLayout::new(n);
        let signals = |of: fn(&State) -> &[f64]| {
            JointSignals::from_fn(n, states.len(), |j, k| of(&states[k])[j])
        };
        let motion = Motion {
            q_rad: signals(|s| &s.q_rad),
            qd_rad_s: signals(|s| &s.qd_rad_s),
            qdd_rad_s2: signals(|s| &s.qdd_rad_s2),
        };
        let mut lanes: Workspace<Lanes> = Workspace::new(&model);
        let mut ws = Workspace::new(&model);
        let mut block = RegressorBlock::new(&model, 64);
        for (start, length) in [(0, 64), (64, 64), (129, 61), (3, 1), (190, 10)] {
            block.fill(&model, &mut lanes, &motion, start..start + length);
            assert_eq!(block.samples(), length);
            for k in 0..length {
                let s = &states[start + k];
                let single = regressor(&model, &mut ws, &s.q_rad, &s.qd_rad_s, &s.qdd_rad_s2);
                for j in 0..n {
                    for c in 0..layout.count() {
                        let stored = block.column(j, layout.parameter(c)).map_or(0.0, |v| v[k]);
                        // −0 and 0 count as equal: a structural zero has no sign.
                        let same = stored == single[(j, c)]
                            && (stored == 0.0 || stored.to_bits() == single[(j, c)].to_bits());
                        assert!(same, "{} sample {}, {}", arm.name, start + k, layout.name(c));
                    }
                }
            }
        }
    }
}
