//! Covariance that the equations predict for noise with a memory.

use nalgebra::DMatrix;

use super::wls::meat;
use super::{CovarianceError, CovarianceMethod, WeightedLeastSquares, sandwich};
use crate::identify::fit::Fit;
use crate::identify::problem::{Domain, Problem};
use crate::identify::whiten::autoregression;

/// A⁻¹ (Σ_j w_j⁴ X_jᵀΓ_jX_j) A⁻¹ / P with the covariance Γ_j in time of the autoregression fitted to the residuals of
/// joint j. For rows in the frequency domain, which are white already, it is the covariance of
/// [`WeightedLeastSquares`].
///
/// Γ_j = s_j² H_j H_jᵀ with the variance s_j² of the innovations and the lower triangle H_j of the responses to one
/// innovation. The products of s_j H_jᵀX_j are therefore summed: the columns run backwards through the filter that
/// generates the noise.
pub(super) fn of_equations(problem: &Problem, fit: &Fit) -> Result<DMatrix<f64>, CovarianceError> {
    if problem.domain == Domain::Frequency {
        return Ok(WeightedLeastSquares.covariance(problem, fit)?.matrix);
    }
    let residuals = problem.residuals(&fit.theta);
    let memories: Vec<Vec<f64>> =
        (0..problem.joints()).map(|j| autoregression(residuals.joint(j))).collect();
    let innovation = |(j, memory): (usize, &Vec<f64>)| innovation_sigma(residuals.joint(j), memory);
    let sigma_nm: Vec<f64> = memories.iter().enumerate().map(innovation).collect();
    let meat = meat(problem, fit, &sigma_nm, |j, column| run_backwards(column, &memories[j]));
    Ok(sandwich(fit, &meat) / problem.periods as f64)
}

/// Replaces x_t by y_t = x_t + Σ a_i y_{t+i}, from the last to the first.
fn run_backwards(column: &mut [f64], a: &[f64]) {
    for t in (0..column.len()).rev() {
        let later: f64 = a.iter().zip(&column[t + 1..]).map(|(a, y)| a * y).sum();
        column[t] += later;
    }
}

/// Root mean square of the innovations e_t − Σ a_i e_{t−i}.
fn innovation_sigma(e: &[f64], a: &[f64]) -> f64 {
    let q = a.len();
    let innovation = |window: &[f64]| {
        let (past, now) = window.split_at(q);
        now[0] - a.iter().zip(past.iter().rev()).map(|(a, e)| a * e).sum::<f64>()
    };
    let squares: f64 = e.windows(q + 1).map(|window| innovation(window).powi(2)).sum();
    (squares / (e.len() - q).max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// H Hᵀ of the responses to one innovation is the covariance of the series: for a first-order autoregression
    /// a^|k|/(1 − a²), far from the start.
    #[test]
    fn columns_run_through_the_covariance_of_the_noise() {
        let a = [0.8];
        let n = 200;
        let response = |t: usize| {
            let mut unit = vec![0.0; n];
            unit[t] = 1.0;
            run_backwards(&mut unit, &a);
            unit
        };
        let [x, y] = [response(150), response(153)];
        let product: f64 = x.iter().zip(&y).map(|(x, y)| x * y).sum();
        let expected = a[0].powi(3) / (1.0 - a[0] * a[0]);
        // The start's influence is 0.8³⁰⁰.
        assert!((product - expected).abs() < 1e-12, "{product} {expected}");
    }

    #[test]
    fn innovations_are_what_the_memory_does_not_foretell() {
        let e: Vec<f64> = (0..50).map(|t| 0.5_f64.powi(t)).collect();
        // Half of the last value predicts each value exactly.
        assert!(innovation_sigma(&e, &[0.5]) < 1e-12);
        let alternating: Vec<f64> = (0..50).map(|t| if t % 2 == 0 { 3.0 } else { -3.0 }).collect();
        assert_eq!(innovation_sigma(&alternating, &[]), 3.0);
    }
}
