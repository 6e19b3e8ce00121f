//! Scatter between blocks of time.

use nalgebra::{DMatrix, DVector};

use super::{Covariance, CovarianceError, CovarianceKind, CovarianceMethod, sandwich};
use crate::identify::fit::Fit;
use crate::identify::problem::{Domain, Problem};

/// V = A⁻¹ Ω A⁻¹ with the scores G_b = Σ_{t in block b} X_tᵀW²e_t of B blocks of time,
/// Ω = B/(B − 1) Σ G_b G_bᵀ, and Student's t of B − 1 degrees of freedom.
///
/// Holds for noise of any colour and any correlation between joints whose memory is short against
/// a block; made for a single run without repetitions. Unlike the scatter between periods it sees
/// a model error as noise.
pub struct BlockCluster;

/// Longer than the memory of motor-current noise (about 1 s), short enough for many blocks.
const BLOCK_S: f64 = 5.0;
/// In short records blocks may be shorter, down to this, s.
const SHORTEST_BLOCK_S: f64 = 1.0;
/// Fewer blocks would leave the variance to chance.
const LEAST_BLOCKS: usize = 6;

impl CovarianceMethod for BlockCluster {
    fn covariance(&self, problem: &Problem, fit: &Fit) -> Result<Covariance, CovarianceError> {
        if problem.domain == Domain::Frequency {
            return Err(CovarianceError::NotInTime { what: "blocks of time" });
        }
        let n = problem.samples;
        let seconds = (n * problem.periods) as f64 / problem.rate_hz;
        let least_per_period = LEAST_BLOCKS.div_ceil(problem.periods);
        let Some(length) = block_length(n, least_per_period, problem.rate_hz) else {
            let needed_s = (least_per_period * problem.periods) as f64 * SHORTEST_BLOCK_S;
            return Err(CovarianceError::TooShort { seconds, needed_s });
        };
        let blocks = (n / length) * problem.periods;
        let residuals = problem.residuals(&fit.theta);
        // The last block of a period takes what is left over.
        let per_period = n / length;
        let mut scores = vec![DVector::zeros(problem.parameters()); blocks];
        for (j, panel) in problem.panels.iter().enumerate() {
            let weight = fit.weights[j] * fit.weights[j];
            for (base, column) in problem.plan.base_indices(j).zip(panel.x.chunks_exact(n)) {
                for (p, period) in residuals.joint(j).chunks_exact(n).enumerate() {
                    for k in 0..per_period {
                        let end = if k + 1 == per_period { n } else { (k + 1) * length };
                        let part = k * length..end;
                        let score: f64 = column[part.clone()]
                            .iter()
                            .zip(&period[part])
                            .map(|(x, e)| x * e)
                            .sum();
                        scores[p * per_period + k][base] += weight * score;
                    }
                }
            }
        }
        let mut omega = DMatrix::zeros(problem.parameters(), problem.parameters());
        for score in &scores {
            omega.ger(1.0, score, score, 1.0);
        }
        let count = blocks as f64;
        omega *= count / (count - 1.0);
        let repeats = problem.periods as f64;
        Ok(Covariance {
            kind: CovarianceKind::Blocks,
            matrix: sandwich(fit, &omega) / (repeats * repeats),
            degrees_of_freedom: count - 1.0,
        })
    }
}

/// Samples of a block: of a period of `samples` at least so many `per_period`; short records get shorter blocks rather than none.
/// `None` where they would be too short.
fn block_length(samples: usize, per_period: usize, rate_hz: f64) -> Option<usize> {
    let length = ((BLOCK_S * rate_hz) as usize).min(samples / per_period);
    (length > 0 && length >= (SHORTEST_BLOCK_S * rate_hz) as usize).then_some(length)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of one run six of a second at least; of four periods of 5 s two each; five seconds where the record is long.
    #[test]
    fn blocks_lie_in_a_period() {
        assert_eq!(block_length(750, 6, 125.0), Some(125));
        assert_eq!(block_length(749, 6, 125.0), None);
        assert_eq!(block_length(625, 2, 125.0), Some(312));
        assert_eq!(block_length(10_000, 6, 125.0), Some(625));
    }
}
