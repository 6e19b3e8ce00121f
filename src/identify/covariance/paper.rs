//! The paper's (20), as printed.

use super::{Covariance, CovarianceError, CovarianceKind, CovarianceMethod};
use crate::identify::fit::Fit;
use crate::identify::problem::Problem;

/// σ_i = √[(Θ_BᵀΘ_B)⁻¹]_ii, the paper's (20).
///
/// The noise variance is left out. σ_i is a standard deviation only for unweighted least squares and white torque
/// noise of exactly 1 Nm on every joint.
pub struct Paper;

impl CovarianceMethod for Paper {
    fn covariance(&self, problem: &Problem, fit: &Fit) -> Result<Covariance, CovarianceError> {
        Ok(Covariance {
            kind: CovarianceKind::Paper,
            matrix: &fit.inverse * fit.inverse.transpose() / problem.periods as f64,
            degrees_of_freedom: f64::INFINITY,
        })
    }
}
