//! Physically consistent parameters: an estimate that a simulator accepts.
//!
//! Least squares gives base parameters that need not belong to any set of links: noise or a wrong model lead to
//! negative rotor inertias and indefinite mass matrices. Here all standard parameters x are estimated at once,
//!
//! minimise ½ ‖R (K x − θ̂)‖² + γ D(x ‖ x₀)
//! subject to P_i ⪰ ε P₀_i, Ia, rv, rc ≥ 0, and the robot file's bounds where it has some,
//!
//! with the whitened triangle R of the data, the base map K, each body's pseudo-inertia P_i and the robot file's P₀_i
//! (P. M. Wensing, S. Kim, J.-J. Slotine, "Linear matrix inequalities for physically consistent inertial parameter
//! identification", 2018). D pulls x to the robot file. It is the constant pull-back metric ½ Σ tr(P₀⁻¹ΔP P₀⁻¹ΔP), or
//! the entropic divergence Σ tr(P₀⁻¹P) − ln det(P₀⁻¹P) − 4 (T. Lee, P. M. Wensing, F. C. Park, "Geometric robot
//! dynamic identification", 2020); drive parameters are pulled likewise through x/x₀. Of a UR5, x has 78 or 84 entries,
//! and the data determine 52 or 58 combinations of them. The prior determines the others; of the combinations in the
//! data, with the default γ = 1, it determines only those known to less than 100 % of the robot file's values.
//!
//! Enters: a [`Fit`](super::Fit) with its covariance. Leaves: a [`PhysicalEstimate`]: standard parameters, how far
//! they are from optimal, whether the unconstrained estimate was realisable, and whether the repair cost more fit
//! than noise explains.

mod cone;
mod error;
mod estimate;
mod evidence;
mod information;
mod program;
mod realisable;
mod scatter;
mod structure;
mod weight;

pub use cone::{Cone, Svec, smat, svec};
pub use error::PhysicalError;
pub use estimate::{Certificate, Constrained, PhysicalEstimate, PhysicalOptions, Solver, solve};
pub use evidence::Evidence;
pub use information::Information;
pub use program::{ConeProgram, ConeSolution, Constraint, ProgramError};
pub use scatter::{FileError, Scatter, Sigma};
pub use structure::{Structure, Subject};
pub use weight::{CrossValidation, PriorMetric, PriorWeight, Pulling};
