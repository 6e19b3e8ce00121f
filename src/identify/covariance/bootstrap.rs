//! Bootstrap of residuals in blocks of time.

use nalgebra::{DMatrix, DVector};
use rand::RngExt;

use super::{Covariance, CovarianceError, CovarianceKind, CovarianceMethod, LEAST_BLOCKS};
use crate::identify::fit::Fit;
use crate::identify::problem::{Domain, Problem};
use crate::random::{Channel, TrialStreams};

/// Covariance of θ* = A⁻¹XᵀW²(Xθ̂ + e*) over 200 series e* composed of blocks of the residuals, the same blocks for
/// all joints (moving-block bootstrap, Künsch 1989).
///
/// Valid for noise whose memory is short compared with a block; a model error counts as noise. The random numbers are
/// the same for every log.
pub struct BlockBootstrap;

const REPLICATES: usize = 200;
const BLOCK_S: f64 = 2.0;

impl CovarianceMethod for BlockBootstrap {
    fn covariance(&self, problem: &Problem, fit: &Fit) -> Result<Covariance, CovarianceError> {
        if problem.domain == Domain::Frequency {
            return Err(CovarianceError::NotInTime { what: "resampled blocks of time" });
        }
        let n = problem.samples;
        let instants = n * problem.periods;
        let length = ((BLOCK_S * problem.rate_hz) as usize).max(1);
        if instants / length < LEAST_BLOCKS {
            let seconds = instants as f64 / problem.rate_hz;
            let needed_s = LEAST_BLOCKS as f64 * BLOCK_S;
            return Err(CovarianceError::TooShort { seconds, needed_s });
        }
        let residuals = problem.residuals(&fit.theta);
        let mut rng = TrialStreams::new(0, b"bootstrap", 0).stream(Channel::Resampling, 0);
        let bread = &fit.inverse * fit.inverse.transpose();
        let mut matrix = DMatrix::zeros(problem.parameters(), problem.parameters());
        let mut starts = Vec::new();
        let mut resampled = vec![0.0; n];
        for _ in 0..REPLICATES {
            starts.clear();
            let blocks = instants.div_ceil(length);
            starts.extend((0..blocks).map(|_| rng.random_range(0..=instants - length)));
            let mut score = DVector::zeros(problem.parameters());
            for (j, panel) in problem.panels.iter().enumerate() {
                // The periods share one X: only the sum of their residuals matters.
                resampled.fill(0.0);
                let e = residuals.joint(j);
                let mean = e.iter().sum::<f64>() / instants as f64;
                for k in 0..instants {
                    resampled[k % n] += e[starts[k / length] + k % length] - mean;
                }
                let weight = fit.weights[j] * fit.weights[j] / problem.periods as f64;
                for (base, x) in problem.plan.base_indices(j).zip(panel.x.chunks_exact(n)) {
                    let product: f64 = x.iter().zip(&resampled).map(|(x, e)| x * e).sum();
                    score[base] += weight * product;
                }
            }
            let effect = &bread * score;
            matrix.ger(1.0, &effect, &effect, 1.0);
        }
        Ok(Covariance {
            kind: CovarianceKind::Bootstrap,
            matrix: matrix / REPLICATES as f64,
            // The blocks of the record determine how well the variance is known, however often they are drawn.
            degrees_of_freedom: (instants / length - 1).min(REPLICATES) as f64,
        })
    }
}
