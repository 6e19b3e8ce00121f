//! Mass matrix, forward dynamics and energies.

use nalgebra::{Cholesky, DMatrix, DVector};
use thiserror::Error;

use super::model::Model;
use super::newton_euler::inverse_dynamics;
use super::real::Real;
use super::vector::Vec3;
use super::workspace::Workspace;

/// The mass matrix of the model is not positive definite: no arm has these parameters.
#[derive(Debug, Clone, PartialEq, Error)]
#[error(
    "the mass matrix is not positive definite at q = {q_rad:?} rad (smallest eigenvalue {smallest_kg_m2:.3e} kg m2)"
)]
pub struct NotPositiveDefinite {
    /// Configuration.
    pub q_rad: Vec<f64>,
    /// Smallest eigenvalue there.
    pub smallest_kg_m2: f64,
}

/// M(q) with rotor inertias on the diagonal, N × N, kg m²: the coefficient of q̈ in (1).
///
/// M_jk = Σ_i v_j·P_ik + s_j·L_ik with the momentum (P, L) of body i for unit speed of joint k.
pub fn mass_matrix(model: &Model, ws: &mut Workspace<f64>, q_rad: &[f64], m: &mut DMatrix<f64>) {
    m.fill(0.0);
    for (i, body) in model.bodies.iter().enumerate() {
        let sin_cos = Real::sin_cos(q_rad[i]);
        for (s, v) in &mut ws.jacobian[..i] {
            *v = body.to_child(sin_cos, *v + s.cross_constant(body.origin));
            *s = body.to_child(sin_cos, *s);
        }
        ws.jacobian[i] = (Vec3::constant([0.0, 0.0, 1.0]), Vec3::zero());
        let h = body.first_moment();
        for k in 0..=i {
            let (s, v) = ws.jacobian[k];
            let momentum = v * body.inertial[0] + s.cross_constant(h);
            let spin = body.inertia_times(s) - v.cross_constant(h);
            for j in 0..=k {
                let (s, v) = ws.jacobian[j];
                m[(j, k)] += v.dot(momentum) + s.dot(spin);
            }
        }
        m[(i, i)] += body.rotor_inertia;
    }
    m.fill_lower_triangle_with_upper_triangle();
}

/// q̈ that the drive torque `torque_nm` produces: M(q) q̈ = τ − c − g − friction.
pub fn forward_dynamics(
    model: &Model,
    ws: &mut Workspace<f64>,
    q_rad: &[f64],
    qd_rad_s: &[f64],
    torque_nm: &[f64],
    qdd_rad_s2: &mut [f64],
) -> Result<(), NotPositiveDefinite> {
    let n = model.dof();
    let mut bias = DVector::zeros(n);
    let rest = vec![0.0; n];
    inverse_dynamics(model, ws, q_rad, qd_rad_s, &rest, bias.as_mut_slice());
    let mut m = DMatrix::zeros(n, n);
    mass_matrix(model, ws, q_rad, &mut m);
    let factor = Cholesky::new(m.clone()).ok_or_else(|| NotPositiveDefinite {
        q_rad: q_rad.to_vec(),
        smallest_kg_m2: m.symmetric_eigenvalues().min(),
    })?;
    let mut rhs = DVector::from_column_slice(torque_nm) - bias;
    factor.solve_mut(&mut rhs);
    qdd_rad_s2.copy_from_slice(rhs.as_slice());
    Ok(())
}

/// Kinetic energy ½ q̇ᵀ M(q) q̇ of links and rotors, J.
pub fn kinetic_energy(
    model: &Model,
    ws: &mut Workspace<f64>,
    q_rad: &[f64],
    qd_rad_s: &[f64],
) -> f64 {
    let n = model.dof();
    let mut m = DMatrix::zeros(n, n);
    mass_matrix(model, ws, q_rad, &mut m);
    let qd = DVector::from_column_slice(qd_rad_s);
    0.5 * qd.dot(&(m * &qd))
}

/// Potential energy −Σ_i gᵀ(m p_i + R_i h_i) of the links, J; zero with all mass at the base origin.
pub fn potential_energy(model: &Model, q_rad: &[f64]) -> f64 {
    // Gravity and the base origin carried into each body's frame.
    let mut gravity: Vec3<f64> = Vec3::constant(model.gravity);
    let mut origin: Vec3<f64> = Vec3::zero();
    let mut energy = 0.0;
    for (body, &q) in model.bodies.iter().zip(q_rad) {
        let sin_cos = Real::sin_cos(q);
        origin = body.to_child(sin_cos, origin + Vec3::constant(body.origin));
        gravity = body.to_child(sin_cos, gravity);
        energy -= gravity.dot(origin * body.inertial[0] + Vec3::constant(body.first_moment()));
    }
    energy
}
