//! The design of an excitation: which series (24) tells most about the parameters, inside the limits.
//!
//! Enters: an arm, its base parameters and a [`Specification`]. Leaves: a [`Design`]: a motion that
//! passed its check, and the [`Prediction`] of what it will tell.
//!
//! ```text
//! minimise   f(Λ(x)),   Λ = Σ_t Θ_B(t)ᵀ W Θ_B(t),   x = offsets, coefficients (and period)
//! subject to position, velocity, acceleration, torque, clearance at all times
//! ```
//!
//! q, q̇, q̈ are linear in x. f has analytic derivatives: by Λ ([`Criterion`]), from there by the motion
//! with one reverse sweep through the regressor, from there by x with a transposed matrix. The limits are
//! a logarithmic barrier whose curvature is known; the curvature of f is learnt (BFGS). Many random
//! starts compete, fewer and fewer are refined.

mod barrier;
mod criterion;
mod error;
mod information;
mod interior_point;
mod prediction;
mod problem;
mod run;
mod search;
mod space;
mod specification;

pub use criterion::Criterion;
pub use error::DesignError;
pub use prediction::{Experiment, Prediction};
pub use run::{Budget, Design, Finalist, design, parameter_scales};
pub use search::Progress;
pub use space::Variables;
pub use specification::Specification;
