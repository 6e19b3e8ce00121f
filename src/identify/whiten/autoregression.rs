//! Whitens noise that is correlated in time, joint by joint.

use crate::identify::fit::Fit;
use crate::identify::problem::Problem;

/// Longest memory considered, samples.
const HIGHEST_ORDER: usize = 40;

/// Coefficients a_1 … a_q of e_t = Σ a_i e_{t−i} + white, from the Yule–Walker equations, with the
/// order q ≤ 40 of least BIC.
pub fn autoregression(e: &[f64]) -> Vec<f64> {
    let n = e.len();
    let highest = HIGHEST_ORDER.min(n / 10);
    let mean = e.iter().sum::<f64>() / n as f64;
    let centred: Vec<f64> = e.iter().map(|v| v - mean).collect();
    let covariance: Vec<f64> = (0..=highest)
        .map(|k| centred.iter().zip(&centred[k..]).map(|(a, b)| a * b).sum::<f64>() / n as f64)
        .collect();
    let mut error = covariance[0];
    let (mut best, mut best_bic) = (Vec::new(), n as f64 * error.ln());
    let mut a: Vec<f64> = Vec::new();
    // Levinson's recursion.
    for q in 0..highest {
        if error <= 1e-12 * covariance[0] {
            break;
        }
        let predicted: f64 = a.iter().enumerate().map(|(i, a)| a * covariance[q - i]).sum();
        let reflection = (covariance[q + 1] - predicted) / error;
        let before = a.clone();
        for (i, a) in a.iter_mut().enumerate() {
            *a -= reflection * before[q - 1 - i];
        }
        a.push(reflection);
        error *= 1.0 - reflection * reflection;
        let bic = n as f64 * error.ln() + (q + 1) as f64 * (n as f64).ln();
        if bic < best_bic {
            (best, best_bic) = (a.clone(), bic);
        }
    }
    best
}

/// Filters every joint's columns and torque by 1 − Σ a_i z⁻ⁱ, estimated from the joint's own residuals in `fit`, and
/// writes them into `out` (same plan). A repeating motion is filtered as periodic: its columns are exact, and only at
/// the first samples does the filter combine noise with that of the last ones. Of a single run the first samples are
/// lost.
pub fn prewhiten(problem: &Problem, fit: &Fit, out: &mut Problem) {
    let n = problem.samples;
    let residuals = problem.residuals(&fit.theta);
    let filters: Vec<Vec<f64>> =
        (0..problem.joints()).map(|j| autoregression(residuals.joint(j))).collect();
    let longest = filters.iter().map(Vec::len).max().unwrap_or(0);
    let lost = if problem.periods == 1 { longest } else { 0 };
    out.samples = n - lost;
    out.periods = problem.periods;
    out.rate_hz = problem.rate_hz;
    out.domain = problem.domain;
    for ((source, target), a) in problem.panels.iter().zip(&mut out.panels).zip(&filters) {
        target.x.clear();
        for column in source.x.chunks_exact(n) {
            filter_round(column, a, lost, &mut target.x);
        }
        target.y.clear();
        filter_round(&source.y, a, lost, &mut target.y);
    }
}

fn filter_round(y: &[f64], a: &[f64], lost: usize, out: &mut Vec<f64>) {
    let n = y.len();
    // The memory may be longer than a period.
    let past =
        |t: usize, i: usize| y[if t > i { t - i - 1 } else { (t + a.len() * n - i - 1) % n }];
    out.extend((lost..n).map(|t| {
        let predicted: f64 = a.iter().enumerate().map(|(i, a)| a * past(t, i)).sum();
        y[t] - predicted
    }));
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    #[test]
    fn the_order_and_the_coefficients_are_found() {
        let mut rng = rand::rngs::ChaCha8Rng::seed_from_u64(5);
        let mut e = vec![0.0; 20_000];
        for t in 2..e.len() {
            let white: f64 = StandardNormal.sample(&mut rng);
            e[t] = 0.6 * e[t - 1] + 0.25 * e[t - 2] + white;
        }
        let a = autoregression(&e);
        assert_eq!(a.len(), 2);
        // σ of a coefficient is √((1 − a₂²)/n) = 0.7 %; the bound is 5 σ.
        assert!((a[0] - 0.6).abs() < 0.035 && (a[1] - 0.25).abs() < 0.035, "{a:?}");
        let mut white = Vec::new();
        filter_round(&e, &a, 0, &mut white);
        let variance = white.iter().map(|v| v * v).sum::<f64>() / white.len() as f64;
        let lagged = white.windows(2).map(|w| w[0] * w[1]).sum::<f64>() / white.len() as f64;
        assert!((variance - 1.0).abs() < 0.05 && lagged.abs() < 0.035, "{variance} {lagged}");
    }

    /// The filter by its definition, on so many repetitions of the period that nothing has to be wrapped. The sums are
    /// the same, term by term.
    #[test]
    fn a_memory_longer_than_the_period_goes_round_it() {
        let period: Vec<f64> = (0..20).map(|t| (0.7 * (t * t) as f64).sin()).collect();
        let a: Vec<f64> = (0..25).map(|i| 0.3 * (1.3 * i as f64).cos()).collect();
        let mut round = Vec::new();
        filter_round(&period, &a, 0, &mut round);
        let long = period.repeat(3);
        let plain = |t: usize| {
            let predicted: f64 = a.iter().zip(1..).map(|(a, back)| a * long[t - back]).sum();
            long[t] - predicted
        };
        assert_eq!(round, (40..60).map(plain).collect::<Vec<f64>>());
    }

    #[test]
    fn noise_without_memory_is_left_alone() {
        let mut rng = rand::rngs::ChaCha8Rng::seed_from_u64(6);
        let e: Vec<f64> = (0..5000).map(|_| StandardNormal.sample(&mut rng)).collect();
        assert!(autoregression(&e).is_empty());
    }
}
