//! Estimator and covariance applied to one problem.

use super::columns::ColumnPlan;
use super::covariance::{Covariance, CovarianceKind};
use super::error::IdentifyError;
use super::fit::{Estimator, Fit, FitError, Fitter};
use super::problem::Problem;
use super::whiten::ReplicateWhitening;
use crate::base::BaseSet;

/// Memory for estimates of problems of one shape.
pub struct Estimation {
    plan: ColumnPlan,
    fitter: Fitter,
    whitened: Option<Whitened>,
}

/// Memory of the estimators that whiten first.
struct Whitened {
    whitening: ReplicateWhitening,
    problem: Problem,
    fitter: Fitter,
}

/// Share of the motion's harmonics whose equations are used: those near its end lack the products
/// of what was cut off the motion with the mass matrix.
const USED_HARMONICS: f64 = 0.8;
/// Always used, so that a motion of few harmonics still gives equations for all parameters.
const LEAST_HARMONICS: usize = 24;

impl Estimation {
    /// For problems shaped like `problem`, whatever its number of samples.
    pub fn new(problem: &Problem) -> Self {
        Self { plan: problem.plan.clone(), fitter: Fitter::new(problem), whitened: None }
    }

    /// θ̂ and its covariance. `harmonics` of a motion that repeats: the highest of each joint, 0 for
    /// one that stands still.
    pub fn estimate(
        &mut self,
        problem: &Problem,
        set: &BaseSet,
        estimator: Estimator,
        kind: CovarianceKind,
        harmonics: Option<&[usize]>,
    ) -> Result<(Fit, Covariance), IdentifyError> {
        if estimator != Estimator::Spectral {
            let fit = self.fitter.fit(problem, set, estimator)?;
            let covariance = kind.method().covariance(problem, &fit)?;
            return Ok((fit, covariance));
        }
        let moving = harmonics.unwrap_or_default().iter().filter(|h| **h > 0).min();
        let (Some(&highest), true) = (moving, problem.periods >= LEAST_PERIODS) else {
            let (periods, needed) = (problem.periods, LEAST_PERIODS);
            return Err(FitError::TooFewPeriods { periods, needed }.into());
        };
        let used = ((USED_HARMONICS * highest as f64) as usize).max(LEAST_HARMONICS);
        let whitened = self.whitened.get_or_insert_with(|| {
            let whitened = Problem::new(self.plan.cumulative(), 0.0);
            let fitter = Fitter::new(&whitened);
            Whitened { whitening: ReplicateWhitening::default(), problem: whitened, fitter }
        });
        whitened.whitening.whiten(problem, used, &mut whitened.problem);
        let mut fit = whitened.fitter.fit(&whitened.problem, set, Estimator::Ols)?;
        let covariance = kind.method().covariance(&whitened.problem, &fit)?;
        fit.estimator = estimator;
        fit.state_residuals_of(problem);
        Ok((fit, covariance))
    }
}

/// Periods whose scatter gives weights: below, the noise of the weights outdoes their use.
const LEAST_PERIODS: usize = 3;
