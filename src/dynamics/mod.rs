//! Equations of motion of the arm: M(q) q̈ + c(q, q̇) + g(q) + Q_R(q̇) = Q_M (the paper's (1)), their linear form
//! Θ(q, q̇, q̈) p = Q_M (13), mass matrix, forward dynamics and energies.
//!
//! Enters: an [`Arm`](crate::robot::Arm). Leaves: an immutable [`Model`] and functions `f(&Model, &mut Workspace, …)`
//! over one sample, over eight at once, or over a whole [`Motion`].

mod mass_matrix;
mod model;
mod motion;
mod newton_euler;
mod parameters;
mod real;
mod regressor;
mod regressor_adjoint;
mod vector;
mod workspace;

pub use mass_matrix::{
    NotPositiveDefinite, forward_dynamics, kinetic_energy, mass_matrix, potential_energy,
};
pub use model::Model;
pub use motion::Motion;
pub use newton_euler::{inverse_dynamics, rigid_torque};
pub use parameters::{BODY_PARAMETERS, Parameter, ParameterLayout};
pub use real::{LANES, Lanes, Real, map_pairs, of_pairs, with_widest_registers};
pub use regressor::{RegressorBlock, regressor};
pub use regressor_adjoint::AdjointWorkspace;
pub use vector::Vec3;
pub use workspace::Workspace;
