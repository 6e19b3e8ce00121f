//! The bound below which no unbiased estimator can get.

use nalgebra::DMatrix;

use super::fit::{FitError, Fitter, Weighting};
use super::problem::Problem;
use super::whiten::{Spectrum, mix};
use crate::base::{BaseSet, ColumnPlan};

/// Torque noise of known statistics.
pub struct KnownNoise<'a> {
    /// Standard deviation per joint, Nm.
    pub torque_sd_nm: &'a [f64],
    /// Correlation between any two joints at one instant.
    pub correlation: f64,
    /// Power at a frequency in Hz, relative to white noise of the same variance.
    pub power: &'a dyn Fn(f64) -> f64,
}

/// The Cramér–Rao bound of σ, √diag(Σ_k X_kᴴ S_k⁻¹ X_k)⁻¹, for Gaussian noise of known spectrum S_k and an exactly
/// known motion, from the mean and harmonics 1 … `harmonics` of P periods.
pub fn cramer_rao(
    problem: &Problem,
    set: &BaseSet,
    noise: &KnownNoise,
    harmonics: usize,
) -> Result<Vec<f64>, FitError> {
    let plan: &ColumnPlan = &problem.plan;
    let mut rows = Problem::new(plan.clone(), problem.rate_hz);
    Spectrum::default().transform(problem, harmonics, &mut rows);
    let fundamental_hz = problem.rate_hz / problem.samples as f64;
    let weights: Vec<Vec<f64>> = noise
        .torque_sd_nm
        .iter()
        .map(|sd| {
            let row = |row: usize| row.div_ceil(2) as f64 * fundamental_hz;
            (0..rows.samples).map(|k| 1.0 / (sd * (noise.power)(row(k)).sqrt())).collect()
        })
        .collect();
    let joints = problem.joints();
    let correlation =
        DMatrix::from_fn(joints, joints, |i, k| if i == k { 1.0 } else { noise.correlation });
    let mut whitened = Problem::new(plan.cumulative(), problem.rate_hz);
    mix(&rows, &weights, &correlation, &mut whitened);
    let fit = Fitter::new(&whitened).fit(&whitened, set, Weighting::Equal)?;
    let covariance = &fit.inverse * fit.inverse.transpose() / problem.periods as f64;
    Ok(covariance.diagonal().iter().map(|v| v.sqrt()).collect())
}
