//! One noise variance for all joints.

use super::{Covariance, CovarianceError, CovarianceKind, CovarianceMethod};
use crate::identify::fit::Fit;
use crate::identify::problem::Problem;

/// V = s² (XᵀX)⁻¹, s² = ‖W e‖²/(m − b), for white noise of one standard deviation on all (weighted) equations.
pub struct OrdinaryLeastSquares;

impl CovarianceMethod for OrdinaryLeastSquares {
    fn covariance(&self, problem: &Problem, fit: &Fit) -> Result<Covariance, CovarianceError> {
        let squares: f64 =
            fit.residual_squares.iter().zip(&fit.weights).map(|(e, w)| e * w * w).sum();
        let equations: usize = (0..problem.joints()).map(|j| problem.equations(j)).sum();
        let degrees_of_freedom = equations.saturating_sub(problem.parameters()).max(1) as f64;
        let variance = squares / degrees_of_freedom;
        Ok(Covariance {
            kind: CovarianceKind::Ols,
            matrix: &fit.inverse * fit.inverse.transpose() * (variance / problem.periods as f64),
            degrees_of_freedom,
        })
    }
}
