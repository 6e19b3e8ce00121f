//! One noise variance per joint.

use super::{Covariance, CovarianceError, CovarianceKind, CovarianceMethod, sandwich};
use crate::identify::fit::Fit;
use crate::identify::problem::Problem;
use nalgebra::DMatrix;

/// V = A⁻¹ (Σ_j w_j⁴ s_j² X_jᵀX_j) A⁻¹ / P, A = XᵀW²X: white noise of its own standard deviation
/// s_j on every joint. With the weights of weighted least squares, w_j = 1/s_j, this is the usual
/// (XᵀW²X)⁻¹ / P (Gautier 1997); with unit weights it is the honest σ of ordinary least squares.
pub struct WeightedLeastSquares;

impl CovarianceMethod for WeightedLeastSquares {
    fn covariance(&self, problem: &Problem, fit: &Fit) -> Result<Covariance, CovarianceError> {
        let b = problem.parameters();
        let n = problem.samples;
        let scale: Vec<f64> =
            fit.weights.iter().zip(&fit.joint_sigma_nm).map(|(w, s)| w * s).collect();
        // With w_j s_j = 1 the meat is A itself and nothing has to be summed.
        let one = scale.iter().all(|k| (k - 1.0).abs() < 1e-3);
        let matrix = if one {
            &fit.inverse * fit.inverse.transpose()
        } else {
            let mut meat = DMatrix::zeros(b, b);
            for (j, panel) in problem.panels.iter().enumerate() {
                let base: Vec<usize> = problem.plan.base_indices(j).collect();
                let factor = (scale[j] * fit.weights[j]).powi(2);
                let columns: Vec<&[f64]> = panel.x.chunks_exact(n).collect();
                for (p, &row) in base.iter().enumerate() {
                    for (q, &column) in base.iter().enumerate().take(p + 1) {
                        let product: f64 =
                            columns[p].iter().zip(columns[q]).map(|(a, b)| a * b).sum();
                        meat[(row, column)] += factor * product;
                        if p != q {
                            meat[(column, row)] += factor * product;
                        }
                    }
                }
            }
            sandwich(fit, &meat)
        };
        Ok(Covariance {
            kind: CovarianceKind::Wls,
            matrix: matrix / problem.periods as f64,
            degrees_of_freedom: (problem.samples * problem.periods) as f64,
        })
    }
}
