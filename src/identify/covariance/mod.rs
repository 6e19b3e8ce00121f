//! Covariances of the estimate: one method per file, one trait.
//!
//! A σ is a claim about how θ̂ would scatter over repetitions of the experiment. Each method rests on other
//! assumptions about the noise; the Monte Carlo study measures how often each method's intervals contain the truth.
//!
//! Enters: the equations of a log and their solution. Leaves: the b × b covariance of the base parameters with its
//! degrees of freedom.

mod blocks;
mod bootstrap;
mod correlations;
mod equations;
mod newey_west;
mod ols;
mod paper;
mod periods;
mod scores;
mod spectral;
mod wls;

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, StudentsT};
use thiserror::Error;

pub use blocks::{BLOCK_S, BlockCluster, LEAST_BLOCKS, by_chance, enlarged_scatter};
pub use bootstrap::BlockBootstrap;
pub use newey_west::NeweyWest;
pub use ols::OrdinaryLeastSquares;
pub use paper::Paper;
pub use periods::PeriodReplicates;
pub use spectral::SpectralSandwich;
pub use wls::WeightedLeastSquares;

pub(super) use correlations::correlations;
use equations::of_equations;

use super::fit::Fit;
use super::problem::Problem;

/// A method's covariance of θ̂.
#[derive(Debug, Clone)]
pub struct Covariance {
    /// Which method made it.
    pub kind: CovarianceKind,
    /// b × b, products of the parameters' units.
    pub matrix: DMatrix<f64>,
    /// Degrees of freedom of the noise variance behind it; infinite for many.
    pub degrees_of_freedom: f64,
}

impl Covariance {
    /// σ of every parameter.
    pub fn sigma(&self) -> Vec<f64> {
        self.matrix.diagonal().iter().map(|v| v.sqrt()).collect()
    }

    /// Mean of [`squared_distance`] over errors of the estimate: b ν/(ν − 2), the mean square of Student's t for each
    /// parameter. `None` with four degrees of freedom or fewer: the squared distance then has no variance, and no
    /// mean over trials shows its expectation.
    pub fn mean_distance(&self) -> Option<f64> {
        let freedom = self.degrees_of_freedom;
        (freedom > 4.0).then(|| self.matrix.nrows() as f64 * (1.0 + 2.0 / (freedom - 2.0)))
    }

    /// Half-width of the 95 % interval in units of σ: Student's t with the degrees of freedom.
    pub fn quantile_95(&self) -> f64 {
        quantile_95(self.degrees_of_freedom)
    }
}

/// eᵀV⁻¹e of an `error` e with the covariance V, `matrix`; `None` where V is singular.
pub fn squared_distance(matrix: &DMatrix<f64>, error: &[f64]) -> Option<f64> {
    // Units differ: only the matrix of correlations shows whether V is singular.
    let root = correlations(matrix).cholesky()?.unpack();
    let sigma = matrix.diagonal().map(f64::sqrt);
    let error = DVector::from_column_slice(error).component_div(&sigma);
    root.solve_lower_triangular(&error).map(|e| e.norm_squared())
}

/// V⁻¹ of a covariance V, `matrix`; `None` where it is not positive definite.
pub fn precision(matrix: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let inverse = correlations(matrix).cholesky()?.inverse();
    let scale = matrix.diagonal().map(|variance| 1.0 / variance.sqrt());
    Some(inverse.map_with_location(|i, k, value| scale[i] * scale[k] * value))
}

/// 97.5 % quantile of the normal distribution: 95 % of its values lie within this many σ of its mean.
pub const Z_95: f64 = 1.959_963_984_540_054;

/// 97.5 % quantile of Student's t; [`Z_95`] for infinitely many degrees of freedom.
pub fn quantile_95(degrees_of_freedom: f64) -> f64 {
    student_quantile(0.975, degrees_of_freedom)
}

/// Quantile of Student's t with `degrees_of_freedom`, at least one: a value of t is below it with `probability`.
pub fn student_quantile(probability: f64, degrees_of_freedom: f64) -> f64 {
    // Beyond 1e6 the quantile differs from the normal one by less than 3e-6.
    match StudentsT::new(0.0, 1.0, degrees_of_freedom.clamp(1.0, 1e6)) {
        Ok(t) => t.inverse_cdf(probability),
        Err(_) => f64::NAN,
    }
}

/// The methods by name.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
#[value(rename_all = "snake_case")]
pub enum CovarianceKind {
    /// The paper's (20), noise variance left out.
    Paper,
    /// s² (XᵀX)⁻¹.
    Ols,
    /// (XᵀW²X)⁻¹ with s_j per joint.
    Wls,
    /// Scatter of the estimates of single periods.
    Periods,
    /// Scatter between periods, frequency by frequency.
    Spectral,
    /// Scatter of the score over blocks of time.
    Blocks,
    /// Autocorrelation of the score (Newey–West).
    Hac,
    /// Residuals resampled in blocks of time.
    Bootstrap,
}

impl std::fmt::Display for CovarianceKind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(match self {
            Self::Paper => "paper",
            Self::Ols => "ols",
            Self::Wls => "wls",
            Self::Periods => "periods",
            Self::Spectral => "spectral",
            Self::Blocks => "blocks",
            Self::Hac => "hac",
            Self::Bootstrap => "bootstrap",
        })
    }
}

/// The reason why a method's covariance does not exist for the data.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum CovarianceError {
    /// Needs replicates.
    #[error("the scatter between periods needs at least 2 whole periods; the log has {periods}")]
    TooFewPeriods {
        /// Whole periods found.
        periods: usize,
    },
    /// Needs noise.
    #[error("the periods are alike to the last digit: their scatter says nothing of noise")]
    AlikePeriods,
    /// Needs samples in the order of time.
    #[error(
        "a covariance from {what} needs an estimator that works in the time domain (ols, wls), not \
         one that works frequency by frequency"
    )]
    NotInTime {
        /// What the covariance is made from.
        what: &'static str,
    },
    /// Needs a longer record.
    #[error(
        "{seconds:.2} s of motion without a gap are too short for this kind of σ; at least {needed_s:.2} s are needed"
    )]
    TooShort {
        /// Length of the record, s.
        seconds: f64,
        /// Length needed, s.
        needed_s: f64,
    },
}

/// A method to compute the covariance of θ̂.
pub trait CovarianceMethod {
    /// V of `fit`, which solved `problem`.
    fn covariance(&self, problem: &Problem, fit: &Fit) -> Result<Covariance, CovarianceError>;
}

impl CovarianceKind {
    /// V of `fit`, which solved `problem`. Where V is a scatter of few parts, its correlations are shrunk towards
    /// those that the equations predict from each joint's noise, as far as chance alone can explain their difference;
    /// σ stays as the method computes it.
    ///
    /// # Errors
    /// [`CovarianceError`] where the data lack something that the method needs.
    pub fn covariance(self, problem: &Problem, fit: &Fit) -> Result<Covariance, CovarianceError> {
        let found = self.method().covariance(problem, fit)?;
        if !self.is_scatter() {
            return Ok(found);
        }
        Ok(found.with_correlations_towards(&of_equations(problem, fit)?))
    }

    /// Whether the covariance is estimated from a scatter in the log, which usually has too few degrees of freedom
    /// for its correlations.
    fn is_scatter(self) -> bool {
        match self {
            Self::Paper | Self::Ols | Self::Wls => false,
            Self::Periods | Self::Spectral | Self::Blocks | Self::Hac | Self::Bootstrap => true,
        }
    }

    fn method(self) -> &'static dyn CovarianceMethod {
        match self {
            Self::Paper => &Paper,
            Self::Ols => &OrdinaryLeastSquares,
            Self::Wls => &WeightedLeastSquares,
            Self::Periods => &PeriodReplicates,
            Self::Spectral => &SpectralSandwich,
            Self::Blocks => &BlockCluster,
            Self::Hac => &NeweyWest { lags: None },
            Self::Bootstrap => &BlockBootstrap,
        }
    }
}

/// The sandwich A⁻¹ Ω A⁻¹ with A = XᵀW²X of one period, A⁻¹ = R⁻¹ R⁻ᵀ.
fn sandwich(fit: &Fit, omega: &DMatrix<f64>) -> DMatrix<f64> {
    let bread = &fit.inverse * fit.inverse.transpose();
    &bread * omega * &bread
}
