//! Least squares over several logs. Joints are weighted by their residual; the covariance comes from the scatter of
//! block sums, which is valid for residuals whose correlation time is short against a block.
//!
//! x̂ = A⁻¹ Σ Xᵀy/s_j², A = Σ XᵀX/s_j², V = B/(B − 1) A⁻¹ (Σ_b g_b g_bᵀ) A⁻¹, where g_b is the sum of Xᵀe/s_j² over
//! block b.

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::error::DiagnoseError;
use super::verdict::Estimate;
use crate::identify::covariance::quantile_95;

/// Equations of one joint along one log.
#[derive(Clone)]
pub(super) struct Equations {
    /// Joint (0-based).
    pub(super) joint: usize,
    /// Rows × unknowns.
    pub(super) columns: DMatrix<f64>,
    /// Torque, Nm.
    pub(super) torque_nm: DVector<f64>,
    /// Block of time of every row; blocks of different logs differ.
    pub(super) block_of: Vec<usize>,
}

/// Estimates of the unknowns with their covariance.
pub(super) struct Solution {
    /// x̂; zero for an unknown whose column is zero everywhere.
    pub(super) x: DVector<f64>,
    covariance: DMatrix<f64>,
    blocks: usize,
}

/// Rounds of reweighting the joints by their residual.
const ROUNDS: usize = 3;

/// Solves `equations` for an arm of `joints` joints; `log` names the logs in an error.
pub(super) fn solve(
    equations: &[Equations],
    joints: usize,
    log: &str,
) -> Result<Solution, DiagnoseError> {
    let unknowns = equations.first().map_or(0, |e| e.columns.ncols());
    let singular = || DiagnoseError::Singular { log: log.to_owned(), unknowns };
    let mut sigma = vec![1.0_f64; joints];
    let mut x = DVector::zeros(unknowns);
    let mut inverse = DMatrix::zeros(unknowns, unknowns);
    for _ in 0..ROUNDS {
        let mut gram = DMatrix::<f64>::zeros(unknowns, unknowns);
        let mut right = DVector::<f64>::zeros(unknowns);
        for e in equations {
            let weight = sigma[e.joint].powi(-2);
            gram.gemm_tr(weight, &e.columns, &e.columns, 1.0);
            right.gemv_tr(weight, &e.columns, &e.torque_nm, 1.0);
        }
        inverse = scaled_inverse(&gram).ok_or_else(singular)?;
        x = &inverse * right;
        let mut squares = vec![(0.0, 0usize); joints];
        for e in equations {
            let residual = &e.torque_nm - &e.columns * &x;
            squares[e.joint].0 += residual.norm_squared();
            squares[e.joint].1 += residual.len();
        }
        for (sigma, (square, count)) in sigma.iter_mut().zip(squares) {
            *sigma = (square / count.max(1) as f64).sqrt().max(f64::MIN_POSITIVE);
        }
    }
    let blocks = equations.iter().flat_map(|e| &e.block_of).max().map_or(0, |b| b + 1);
    let mut scores = DMatrix::<f64>::zeros(unknowns, blocks);
    for e in equations {
        let residual = &e.torque_nm - &e.columns * &x;
        let weight = sigma[e.joint].powi(-2);
        for (row, &block) in e.block_of.iter().enumerate() {
            let factor = weight * residual[row];
            let mut score = scores.column_mut(block);
            score.axpy(factor, &e.columns.row(row).transpose(), 1.0);
        }
    }
    let used = scores.column_iter().filter(|s| s.amax() > 0.0).count();
    let half = &inverse * scores;
    let covariance = &half * half.transpose() * (used as f64 / (used.max(2) - 1) as f64);
    Ok(Solution { x, covariance, blocks: used })
}

/// Inverse of a Gram matrix, scaled to a unit diagonal first because its columns differ in size. Rows and columns of
/// unknowns without a column become zero.
fn scaled_inverse(gram: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let n = gram.nrows();
    let scale: Vec<f64> = (0..n)
        .map(|k| if gram[(k, k)] > 0.0 { gram[(k, k)].sqrt().recip() } else { 0.0 })
        .collect();
    let scaled = DMatrix::from_fn(n, n, |i, k| {
        let diagonal = if i == k && scale[i] == 0.0 { 1.0 } else { 0.0 };
        gram[(i, k)] * scale[i] * scale[k] + diagonal
    });
    let inverse = scaled.cholesky()?.inverse();
    Some(DMatrix::from_fn(n, n, |i, k| inverse[(i, k)] * scale[i] * scale[k]))
}

impl Solution {
    /// `value`, a function of the unknowns, with its 95 % interval by the delta method. `gradient` is its gradient with
    /// respect to the unknowns from number `first` on.
    pub(super) fn estimate(
        &self,
        value: f64,
        first: usize,
        gradient: &[f64],
        unit: &'static str,
    ) -> Estimate {
        let g = DVector::from_column_slice(gradient);
        let part = self.covariance.view((first, first), (g.len(), g.len()));
        let variance = (g.transpose() * part * &g)[(0, 0)].max(0.0);
        let reach = quantile_95((self.blocks.max(2) - 1) as f64) * variance.sqrt();
        Estimate { value, unit, ci95: [value - reach, value + reach] }
    }

    /// Probability that chance alone takes these unknowns this far from zero: the Wald statistic W as Hotelling's T²,
    /// that is W (B − k)/(k (B − 1)) as F(k, B − k). 1 if the covariance is singular or there are too few blocks.
    pub(super) fn probability(&self, unknowns: &[usize]) -> f64 {
        let count = unknowns.len();
        let x = DVector::from_fn(count, |k, _| self.x[unknowns[k]]);
        let covariance = |i: usize, k: usize| self.covariance[(unknowns[i], unknowns[k])];
        let inverse = DMatrix::from_fn(count, count, covariance).try_inverse();
        let Some(inverse) = inverse.filter(|_| count > 0 && self.blocks > count) else {
            return 1.0;
        };
        let wald = (x.transpose() * inverse * &x)[(0, 0)];
        let free = (self.blocks - count) as f64;
        let f = wald * free / (count * (self.blocks - 1)) as f64;
        FisherSnedecor::new(count as f64, free).map_or(1.0, |d| d.sf(f))
    }
}
