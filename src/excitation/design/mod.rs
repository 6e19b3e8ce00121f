//! Designs an excitation: the series (24) that is most informative about the parameters, inside the limits.
//!
//! Input: an arm, its base parameters and a [`Specification`]. Output: a [`Design`], which is a motion that passed its
//! check, with the [`Prediction`] of the accuracy it will give.
//!
//! ```text
//! minimise   f(Λ(x)),   Λ = Σ_t Θ_B(t)ᵀ W Θ_B(t),   x = offsets, coefficients (and period)
//! subject to position, velocity, acceleration, torque, clearance at all times
//! ```
//!
//! q, q̇, q̈ are linear in x. f has analytic derivatives, chained in three steps: by Λ ([`Criterion`]), by the motion
//! with one reverse sweep through the regressor, and by x with a transposed matrix. The limits enter as a logarithmic
//! barrier whose curvature is known; the curvature of f is learnt (BFGS). Many random starts compete, and fewer and
//! fewer of them are refined.

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
pub use specification::{LONGEST_S, Specification};
