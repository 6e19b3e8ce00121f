//! The information in the data, in units of their noise.

use nalgebra::{DMatrix, DVector};

use crate::identify::covariance::Covariance;
use crate::identify::fit::Fit;

/// The weighted least-squares problem of a fit, reduced to its triangle: for any base parameters θ the weighted sum
/// of squares of all periods exceeds its minimum by ‖R (θ − θ̂)‖², in units of the noise.
#[derive(Debug, Clone)]
pub struct Information {
    /// R, b × b.
    pub root: DMatrix<f64>,
    /// θ̂.
    pub theta: DVector<f64>,
}

/// Least noise assumed, as a share of the torque: less than any sensor has. The residual of a simulation without
/// noise (the digits of its log, its integrator's error) is no evidence against an arm, and must not make R infinite.
const LEAST_NOISE: f64 = 1e-4;

impl Information {
    /// The information of a fit and the covariance V of its estimate. The unit is chosen so that tr(R V Rᵀ) = b. The
    /// size of a distance is then unaffected by weights that were wrong by a common factor, or absent, as in ordinary
    /// least squares.
    pub fn of(fit: &Fit, covariance: &Covariance) -> Self {
        let b = fit.theta.len();
        let root = DMatrix::from_fn(b, b, |i, k| fit.triangle.r(i, k));
        let theta = DVector::from_column_slice(&fit.theta);
        let relative = Self { root, theta };
        let variance = relative.whitened(covariance).trace() / b as f64;
        let sum = |values: &[f64]| values.iter().sum::<f64>();
        let share = (sum(&fit.residual_squares) / sum(&fit.torque_squares)).sqrt();
        let noise = variance.sqrt() * (LEAST_NOISE / share).max(1.0);
        Self { root: relative.root / noise.max(f64::MIN_POSITIVE), ..relative }
    }

    /// ‖R (θ − θ̂)‖².
    pub fn distance(&self, theta: &DVector<f64>) -> f64 {
        (&self.root * (theta - &self.theta)).norm_squared()
    }

    /// The covariance of the noise of R θ̂, with a mean diagonal entry of 1: R V Rᵀ, supplemented by white noise
    /// where the assumed noise exceeds the actual one.
    pub fn noise(&self, covariance: &Covariance) -> DMatrix<f64> {
        let mut noise = self.whitened(covariance);
        let missing = 1.0 - noise.trace() / noise.nrows() as f64;
        let step = noise.nrows() + 1;
        noise.iter_mut().step_by(step).for_each(|variance| *variance += missing.max(0.0));
        noise
    }

    /// R V Rᵀ.
    fn whitened(&self, covariance: &Covariance) -> DMatrix<f64> {
        &self.root * &covariance.matrix * self.root.transpose()
    }
}
