//! Scatter between repetitions.

use nalgebra::{DMatrix, DVector};

use super::{Covariance, CovarianceError, CovarianceKind, CovarianceMethod};
use crate::identify::fit::Fit;
use crate::identify::problem::Problem;

/// V = cov(θ̂_p)/P over the estimates θ̂_p from each of the P periods alone, with Student's t of P − 1 degrees of
/// freedom.
///
/// Valid for noise of any colour and any correlation between joints, as long as it is independent from period to
/// period. Everything that repeats, noise or not, drops out: a model error does not widen V.
pub struct PeriodReplicates;

impl CovarianceMethod for PeriodReplicates {
    fn covariance(&self, problem: &Problem, fit: &Fit) -> Result<Covariance, CovarianceError> {
        let periods = problem.periods;
        if periods < 2 {
            return Err(CovarianceError::TooFewPeriods { periods });
        }
        let b = problem.parameters();
        let mean = DVector::from_column_slice(&fit.theta);
        let mut matrix = DMatrix::zeros(b, b);
        for theta in &fit.theta_periods {
            let deviation = DVector::from_column_slice(theta) - &mean;
            matrix.ger(1.0, &deviation, &deviation, 1.0);
        }
        matrix /= (periods * (periods - 1)) as f64;
        Ok(Covariance {
            kind: CovarianceKind::Periods,
            matrix,
            degrees_of_freedom: (periods - 1) as f64,
        })
    }
}
