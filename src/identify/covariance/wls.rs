//! One noise variance per joint.

use super::{Covariance, CovarianceError, CovarianceKind, CovarianceMethod, sandwich};
use crate::identify::fit::Fit;
use crate::identify::problem::Problem;
use nalgebra::{DMatrix, DMatrixView};

/// V = A⁻¹ (Σ_j w_j⁴ s_j² X_jᵀX_j) A⁻¹ / P, A = XᵀW²X, for white noise with its own standard deviation s_j on every
/// joint. With the weights of weighted least squares, w_j = 1/s_j, this is the usual (XᵀW²X)⁻¹ / P (Gautier 1997);
/// with unit weights it is the correct covariance of ordinary least squares.
pub struct WeightedLeastSquares;

impl CovarianceMethod for WeightedLeastSquares {
    fn covariance(&self, problem: &Problem, fit: &Fit) -> Result<Covariance, CovarianceError> {
        let scale: Vec<f64> =
            fit.weights.iter().zip(&fit.joint_sigma_nm).map(|(w, s)| w * s).collect();
        // With w_j s_j = 1 the meat is A itself and nothing has to be summed.
        let one = scale.iter().all(|k| (k - 1.0).abs() < 1e-3);
        let matrix = if one {
            &fit.inverse * fit.inverse.transpose()
        } else {
            sandwich(fit, &meat(problem, fit, &fit.joint_sigma_nm, |_, _| {}))
        };
        // Those with which s_j is known on the joint that tells most parameters.
        let most = (0..problem.joints()).map(|j| problem.plan.base_indices(j).len()).max();
        let values = problem.samples * problem.periods;
        Ok(Covariance {
            kind: CovarianceKind::Wls,
            matrix: matrix / problem.periods as f64,
            degrees_of_freedom: values.saturating_sub(most.unwrap_or(0)).max(1) as f64,
        })
    }
}

/// Σ_j w_j⁴ s_j² X̃_jᵀX̃_j of one period, where `colour` turns the columns of joint j into X̃_j.
pub(super) fn meat(
    problem: &Problem,
    fit: &Fit,
    sigma_nm: &[f64],
    colour: impl Fn(usize, &mut [f64]),
) -> DMatrix<f64> {
    let (n, b) = (problem.samples, problem.parameters());
    let mut meat = DMatrix::zeros(b, b);
    for (j, panel) in problem.panels.iter().enumerate() {
        let factor = (sigma_nm[j] * fit.weights[j] * fit.weights[j]).powi(2);
        let mut x = panel.x.clone();
        x.chunks_exact_mut(n).for_each(|column| colour(j, column));
        let x = DMatrixView::from_slice(&x, n, x.len() / n);
        let products = x.tr_mul(&x);
        let base: Vec<usize> = problem.plan.base_indices(j).collect();
        for (product, &column) in products.column_iter().zip(&base) {
            for (product, &row) in product.iter().zip(&base) {
                meat[(row, column)] += factor * product;
            }
        }
    }
    meat
}
