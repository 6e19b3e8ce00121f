//! Least squares over several logs. Joints are weighted by their residual; the covariance comes from the scatter of
//! block sums, which is valid for residuals whose correlation time is short against a block.
//!
//! x̂ = A⁻¹ Σ Xᵀy/s_j², A = Σ XᵀX/s_j² = L Lᵀ, V = A⁻¹ (Σ_b g̃_b g̃_bᵀ) A⁻¹, where g_b is the sum of Xᵀe/s_j² over
//! block b, S_b that of XᵀX/s_j², T_b = L⁻¹ S_b L⁻ᵀ, and g̃_b = L (1 − T_b)^(−½) L⁻¹ g_b makes up for the adaptation of
//! the fit to its block, as in [`BlockCluster`](crate::identify::covariance::BlockCluster).

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::error::DiagnoseError;
use super::verdict::Estimate;
use crate::identify::covariance::{by_chance, enlarged_scatter, quantile_95};

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
    /// Per unknown, the number of blocks in which its column is not zero: a body on the flange is known from the blocks
    /// of one log alone.
    blocks: Vec<usize>,
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
    let mut weights = vec![1.0; joints];
    let mut x = DVector::zeros(unknowns);
    let mut root = DMatrix::zeros(unknowns, unknowns);
    for _ in 0..ROUNDS {
        weights = sigma.iter().map(|sigma| sigma.powi(-2)).collect();
        let mut gram = DMatrix::<f64>::zeros(unknowns, unknowns);
        let mut right = DVector::<f64>::zeros(unknowns);
        for e in equations {
            gram.gemm_tr(weights[e.joint], &e.columns, &e.columns, 1.0);
            right.gemv_tr(weights[e.joint], &e.columns, &e.torque_nm, 1.0);
        }
        root = inverse_root(&gram).ok_or_else(singular)?;
        x = &root * root.tr_mul(&right);
        let mut squares = vec![(0.0, 0usize); joints];
        for e in equations {
            let residual = &e.torque_nm - &e.columns * &x;
            squares[e.joint].0 += residual.norm_squared();
            squares[e.joint].1 += residual.len();
        }
        // A joint without rows has no residual, and its weight is not needed.
        for (sigma, (square, count)) in sigma.iter_mut().zip(squares) {
            if count > 0 {
                *sigma = (square / count as f64).sqrt().max(f64::MIN_POSITIVE);
            }
        }
    }
    let count = equations.iter().flat_map(|e| &e.block_of).max().map_or(0, |b| b + 1);
    let mut scores = vec![DVector::<f64>::zeros(unknowns); count];
    let mut grams = vec![DMatrix::<f64>::zeros(unknowns, unknowns); count];
    for e in equations {
        let residual = &e.torque_nm - &e.columns * &x;
        let weight = weights[e.joint];
        let mut from = 0;
        for part in e.block_of.chunk_by(|a, b| a == b) {
            let columns = e.columns.rows(from, part.len());
            scores[part[0]].gemv_tr(weight, &columns, &residual.rows(from, part.len()), 1.0);
            grams[part[0]].gemm_tr(weight, &columns, &columns, 1.0);
            from += part.len();
        }
    }
    let told_by = |k: usize| grams.iter().filter(|gram| gram[(k, k)] > 0.0).count();
    let blocks = (0..unknowns).map(told_by).collect();
    let shares: Vec<DMatrix<f64>> =
        grams.par_iter().map(|gram| root.tr_mul(gram) * &root).collect();
    let scores: Vec<DVector<f64>> = scores.iter().map(|score| root.tr_mul(score)).collect();
    let covariance = &root * enlarged_scatter(&shares, &scores) * root.transpose();
    Ok(Solution { x, covariance, blocks })
}

/// L⁻ᵀ of a Gram matrix A = L Lᵀ, so that A⁻¹ = L⁻ᵀ L⁻¹. A is scaled to a unit diagonal first because its columns
/// differ in size. Rows and columns of unknowns without a column are zero.
fn inverse_root(gram: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let n = gram.nrows();
    let scale: Vec<f64> = (0..n)
        .map(|k| if gram[(k, k)] > 0.0 { gram[(k, k)].sqrt().recip() } else { 0.0 })
        .collect();
    let scaled = DMatrix::from_fn(n, n, |i, k| {
        let diagonal = if i == k && scale[i] == 0.0 { 1.0 } else { 0.0 };
        gram[(i, k)] * scale[i] * scale[k] + diagonal
    });
    let root = scaled.cholesky()?.l().transpose().try_inverse()?;
    Some(DMatrix::from_fn(n, n, |i, k| root[(i, k)] * scale[i]))
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
        let used = (0..g.len()).filter(|k| g[*k] != 0.0).map(|k| first + k);
        let reach = quantile_95((self.least_blocks(used) - 1) as f64) * variance.sqrt();
        Estimate { value, unit, ci95: [value - reach, value + reach] }
    }

    /// Probability that chance alone takes these unknowns this far from zero ([`by_chance`]).
    pub(super) fn probability(&self, unknowns: &[usize]) -> f64 {
        let count = unknowns.len();
        let x = DVector::from_fn(count, |k, _| self.x[unknowns[k]]);
        let covariance = |i: usize, k: usize| self.covariance[(unknowns[i], unknowns[k])];
        let blocks = self.least_blocks(unknowns.iter().copied());
        by_chance(&x, DMatrix::from_fn(count, count, covariance), blocks)
    }

    /// Number B of blocks that tell the least known of these unknowns; at least 2.
    fn least_blocks(&self, unknowns: impl Iterator<Item = usize>) -> usize {
        unknowns.map(|k| self.blocks[k]).min().unwrap_or(0).max(2)
    }
}
