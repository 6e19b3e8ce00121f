//! Contribution of every instant to the normal equations.

use nalgebra::DMatrix;

use crate::identify::fit::Fit;
use crate::identify::problem::Problem;

/// g_t = X_tᵀW²e_t summed over the joints, one row per sample of all periods: P·n × b.
pub fn time_scores(problem: &Problem, fit: &Fit) -> DMatrix<f64> {
    let n = problem.samples;
    let residuals = problem.residuals(&fit.theta);
    let mut scores = DMatrix::zeros(n * problem.periods, problem.parameters());
    for (j, panel) in problem.panels.iter().enumerate() {
        let weight = fit.weights[j] * fit.weights[j];
        for (base, x) in problem.plan.base_indices(j).zip(panel.x.chunks_exact(n)) {
            let mut column = scores.column_mut(base);
            let periods = residuals.joint(j).chunks_exact(n);
            for (e, out) in periods.zip(column.as_mut_slice().chunks_exact_mut(n)) {
                for ((out, x), e) in out.iter_mut().zip(x).zip(e) {
                    *out += weight * x * e;
                }
            }
        }
    }
    scores
}
