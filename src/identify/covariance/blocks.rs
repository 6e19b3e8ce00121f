//! Scatter between blocks of time.

use std::ops::Range;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::{Covariance, CovarianceError, CovarianceKind, CovarianceMethod};
use crate::dot::dot;
use crate::identify::fit::Fit;
use crate::identify::problem::{Domain, Problem};
use crate::robot::JointSignals;
use crate::signal::replicate_noise;

/// V = A⁻¹ (Σ_b G̃_b G̃_bᵀ) A⁻¹ with A = XᵀW²X over B blocks of time with the scores G_b = Σ_{t in block b}
/// X_tᵀW²e_t.
///
/// The fit adapts to every block, most where few blocks determine a parameter; residuals are therefore too small, by
/// another factor in each block. With S_b = X_bᵀW²X_b, A = L Lᵀ and T_b = L⁻¹ S_b L⁻ᵀ, the corrected score G̃_b = L
/// (1 − T_b)^(−½) L⁻¹ G_b compensates for it: for white noise V is then unbiased (Bell and McCaffrey 2002, their
/// CR2). The degrees of freedom are Satterthwaite's for white noise, ν_i = (tr Γ)²/tr Γ² with the covariances Γ_bc of
/// the blocks' contributions to parameter i (Imbens and Kolesár 2016); for all parameters together their harmonic
/// mean is stated.
///
/// Valid for noise of any colour and any correlation between joints whose memory is short compared with a block;
/// meant for a single run without repetitions. Unlike the scatter between periods, V counts a model error as noise.
pub struct BlockCluster;

/// Length of a block, s: longer than the memory of motor-current noise (about 1 s), short enough for many blocks.
pub const BLOCK_S: f64 = 5.0;
/// Shortest block, s, to which blocks may shrink in short records.
const SHORTEST_BLOCK_S: f64 = 1.0;
/// Fewest blocks of which a covariance is made: the variance of fewer would be left to chance, and drawing from fewer
/// would repeat the same record over and over.
pub const LEAST_BLOCKS: usize = 6;

impl CovarianceMethod for BlockCluster {
    fn covariance(&self, problem: &Problem, fit: &Fit) -> Result<Covariance, CovarianceError> {
        if problem.domain == Domain::Frequency {
            return Err(CovarianceError::NotInTime { what: "blocks of time" });
        }
        let n = problem.samples;
        let seconds = (n * problem.periods) as f64 / problem.rate_hz;
        // Periods that are copies of one another say nothing that the first does not: their errors add up.
        let copies = if are_copies(problem) { problem.periods } else { 1 };
        let independent = problem.periods / copies;
        let least_per_period = LEAST_BLOCKS.div_ceil(independent);
        let Some(length) = block_length(n, least_per_period, problem.rate_hz) else {
            let needed_s = (least_per_period * problem.periods) as f64 * SHORTEST_BLOCK_S;
            return Err(CovarianceError::TooShort { seconds, needed_s });
        };
        // The last block of a period includes the remainder.
        let per_period = n / length;
        let parts: Vec<Range<usize>> = (0..per_period)
            .map(|k| k * length..if k + 1 == per_period { n } else { (k + 1) * length })
            .collect();
        let repeats = problem.periods as f64;
        let leverages: Vec<Leverage> =
            parts.iter().map(|part| Leverage::of(problem, fit, part, independent)).collect();
        // L⁻¹ G̃_b, with L Lᵀ = A of one period.
        let mut scores = DMatrix::zeros(problem.parameters(), per_period * problem.periods);
        let raw = scores_by_block(problem, fit, &parts);
        for ((b, raw), mut score) in raw.iter().enumerate().zip(scores.column_iter_mut()) {
            let Leverage { correction, .. } = &leverages[b % per_period];
            score.copy_from(&(correction * fit.inverse.tr_mul(raw)));
        }
        let effects = &fit.inverse * scores / repeats;
        Ok(Covariance {
            kind: CovarianceKind::Blocks,
            matrix: &effects * effects.transpose() * copies as f64,
            degrees_of_freedom: degrees_of_freedom(fit, &leverages, independent),
        })
    }
}

/// Whether the torque of all periods is that of the first; false for a single one.
fn are_copies(problem: &Problem) -> bool {
    let Problem { panels, samples, periods, .. } = problem;
    let torque = JointSignals::from_fn(panels.len(), samples * periods, |j, k| panels[j].y[k]);
    replicate_noise(&torque, *samples).is_ok_and(|replicates| replicates.are_alike())
}

/// Share of one block in the information of the whole record.
struct Leverage {
    /// T_b.
    share: DMatrix<f64>,
    /// (1 − T_b)^(−½).
    correction: DMatrix<f64>,
}

/// Least eigenvalue of 1 − T_b: no score is enlarged more than tenfold. Where a single block determines a parameter,
/// no scatter shows its noise.
const LEAST_LEFT: f64 = 0.01;

impl Leverage {
    /// The share of the samples `part` of one of `periods` periods.
    fn of(problem: &Problem, fit: &Fit, part: &Range<usize>, periods: usize) -> Self {
        let b = problem.parameters();
        let mut normal = DMatrix::zeros(b, b);
        for (j, panel) in problem.panels.iter().enumerate() {
            let weight = fit.weights[j] * fit.weights[j];
            let columns: Vec<(usize, &[f64])> = problem
                .plan
                .base_indices(j)
                .zip(panel.x.chunks_exact(problem.samples).map(|column| &column[part.clone()]))
                .collect();
            for (at, (i, x)) in columns.iter().enumerate() {
                for (k, y) in &columns[..=at] {
                    normal[(*i, *k)] += weight * dot(x, y);
                }
            }
        }
        normal.fill_upper_triangle_with_lower_triangle();
        let share = fit.inverse.tr_mul(&normal) * &fit.inverse / periods as f64;
        let correction = leverage_correction(&share);
        Self { share, correction }
    }
}

/// (1 − T)^(−½) for a block with the share T of the information: the factor by which its score has to be enlarged
/// because the fit adapted to it.
fn leverage_correction(share: &DMatrix<f64>) -> DMatrix<f64> {
    let parts = share.clone().symmetric_eigen();
    let factor = parts.eigenvalues.map(|t| (1.0 - t).max(LEAST_LEFT).powf(-0.5));
    &parts.eigenvectors * DMatrix::from_diagonal(&factor) * parts.eigenvectors.transpose()
}

/// Σ_b c_b c_bᵀ, c_b = (1 − T_b)^(−½) L⁻¹ G_b, from the `shares` T_b of the blocks and their `scores` L⁻¹ G_b.
pub fn enlarged_scatter(shares: &[DMatrix<f64>], scores: &[DVector<f64>]) -> DMatrix<f64> {
    let count = scores.first().map_or(0, |score| score.len());
    let enlarged: Vec<DVector<f64>> = shares
        .par_iter()
        .zip(scores)
        .map(|(share, score)| leverage_correction(share) * score)
        .collect();
    let mut scatter = DMatrix::zeros(count, count);
    enlarged.iter().for_each(|score| scatter.ger(1.0, score, score, 1.0));
    scatter
}

/// Probability that chance alone takes k `values` this far from zero, with a `covariance` from the scatter of B
/// `blocks`: the Wald statistic W as Hotelling's T², that is W (B − k)/(k (B − 1)) as F(k, B − k). 1 if the covariance
/// is singular or there are too few blocks.
pub fn by_chance(values: &DVector<f64>, covariance: DMatrix<f64>, blocks: usize) -> f64 {
    let k = values.len();
    let Some(inverse) = covariance.try_inverse().filter(|_| k > 0 && blocks > k) else {
        return 1.0;
    };
    let wald = (values.transpose() * inverse * values)[(0, 0)];
    let free = (blocks - k) as f64;
    let f = wald * free / (k * (blocks - 1)) as f64;
    FisherSnedecor::new(k as f64, free).map_or(1.0, |d| d.sf(f))
}

/// G_b of all blocks, period after period.
fn scores_by_block(problem: &Problem, fit: &Fit, parts: &[Range<usize>]) -> Vec<DVector<f64>> {
    let n = problem.samples;
    let residuals = problem.residuals(&fit.theta);
    let mut scores = vec![DVector::zeros(problem.parameters()); parts.len() * problem.periods];
    for (j, panel) in problem.panels.iter().enumerate() {
        let weight = fit.weights[j] * fit.weights[j];
        for (base, column) in problem.plan.base_indices(j).zip(panel.x.chunks_exact(n)) {
            for (p, period) in residuals.joint(j).chunks_exact(n).enumerate() {
                for (k, part) in parts.iter().enumerate() {
                    let score = dot(&column[part.clone()], &period[part.clone()]);
                    scores[p * parts.len() + k][base] += weight * score;
                }
            }
        }
    }
    scores
}

/// Harmonic mean of the ν_i. Block b contributes w_bᵀ L⁻¹ G_b to parameter i, with w_b = (1 − T_b)^(−½) L⁻¹ e_i, and
/// for white noise cov(L⁻¹ G_b, L⁻¹ G_c) = δ_bc T_b − T_b T_c.
fn degrees_of_freedom(fit: &Fit, leverages: &[Leverage], periods: usize) -> f64 {
    let b = fit.inverse.nrows();
    let mut inverse_sum = 0.0;
    for i in 0..b {
        let unit = fit.inverse.row(i).transpose();
        let told: Vec<(f64, DVector<f64>)> = leverages
            .iter()
            .map(|Leverage { share, correction }| {
                let w = correction * &unit;
                let through = share * &w;
                (w.dot(&through), through)
            })
            .collect();
        let mut trace = 0.0;
        let mut squares = 0.0;
        let mut products = DMatrix::zeros(b, b);
        for (own, through) in &told {
            let same = through.norm_squared();
            trace += own - same;
            // The block itself instead of its product with itself, which is among those of all pairs.
            squares += (own - same).powi(2) - same * same;
            products.ger(1.0, through, through, 1.0);
        }
        // Σ_bc (t_b · t_c)² = ‖Σ_b t_b t_bᵀ‖², in a time that grows with the number of blocks and not with its square.
        squares += periods as f64 * products.norm_squared();
        inverse_sum += squares / (periods as f64 * trace * trace);
    }
    b as f64 / inverse_sum
}

/// Samples of a block, so that a period of `samples` has at least `per_period` blocks; short records get shorter
/// blocks rather than none. `None` where the blocks would be too short.
fn block_length(samples: usize, per_period: usize, rate_hz: f64) -> Option<usize> {
    let length = ((BLOCK_S * rate_hz) as usize).min(samples / per_period);
    (length > 0 && length >= (SHORTEST_BLOCK_S * rate_hz) as usize).then_some(length)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A single run has at least six blocks of a second, four periods of 5 s have two each, and a long record has
    /// blocks of 5 s.
    #[test]
    fn blocks_lie_in_a_period() {
        assert_eq!(block_length(750, 6, 125.0), Some(125));
        assert_eq!(block_length(749, 6, 125.0), None);
        assert_eq!(block_length(625, 2, 125.0), Some(312));
        assert_eq!(block_length(10_000, 6, 125.0), Some(625));
    }
}
