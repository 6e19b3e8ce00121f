//! Covariance that is consistent under heteroscedasticity and autocorrelation (HAC).

use nalgebra::DMatrix;

use super::scores::time_scores;
use super::{Covariance, CovarianceError, CovarianceKind, CovarianceMethod, sandwich};
use crate::identify::fit::Fit;
use crate::identify::problem::{Domain, Problem};

/// V = A⁻¹ Ω A⁻¹ · T/(T − b), Ω = Σ_{|k| ≤ L} (1 − |k|/(L + 1)) Σ_t g_t g_{t−k}ᵀ over the scores g_t = X_tᵀW²e_t of T
/// instants, summed over the joints (Newey and West 1987; Driscoll and Kraay 1998 for the sum over joints).
///
/// Valid for noise whose memory is short compared with L samples. A model error counts as noise.
pub struct NeweyWest {
    /// Number of lags L; `None`: Andrews' (1991) bandwidth for the Bartlett kernel, each score taken as a first-order
    /// autoregression.
    pub lags: Option<usize>,
}

impl CovarianceMethod for NeweyWest {
    fn covariance(&self, problem: &Problem, fit: &Fit) -> Result<Covariance, CovarianceError> {
        if problem.domain == Domain::Frequency {
            return Err(CovarianceError::NotInTime { what: "lags in time" });
        }
        let scores = time_scores(problem, fit);
        let (instants, b) = scores.shape();
        if instants <= b {
            let [seconds, needed_s] = [instants, b + 1].map(|rows| rows as f64 / problem.rate_hz);
            return Err(CovarianceError::TooShort { seconds, needed_s });
        }
        let lags = self.lags.unwrap_or_else(|| andrews(&scores)).min(instants / 2);
        let omega = bartlett(&scores, lags);
        let periods = problem.periods as f64;
        let t = instants as f64;
        let correction = t / (t - b as f64) / (periods * periods);
        Ok(Covariance {
            kind: CovarianceKind::Hac,
            matrix: sandwich(fit, &omega) * correction,
            // Degrees of freedom of a Bartlett estimate: 1.5 T/L (Priestley 1981: its relative variance is
            // 2/3 · L/T · 2).
            degrees_of_freedom: 1.5 * t / (lags + 1) as f64,
        })
    }
}

/// Σ_{|k| ≤ L} (1 − |k|/(L + 1)) Σ_t g_t g_{t−k}ᵀ, computed as 1/(L + 1) Σ_s B_s B_sᵀ over the sums B_s of all
/// windows of L + 1 instants, including those that reach beyond the ends.
fn bartlett(scores: &DMatrix<f64>, lags: usize) -> DMatrix<f64> {
    let (instants, b) = scores.shape();
    let mut windows = DMatrix::zeros(instants + lags, b);
    for (score, mut window) in scores.column_iter().zip(windows.column_iter_mut()) {
        let mut sum = 0.0;
        for s in 0..instants + lags {
            sum += if s < instants { score[s] } else { 0.0 };
            sum -= if s > lags { score[s - lags - 1] } else { 0.0 };
            window[s] = sum;
        }
    }
    windows.tr_mul(&windows) / (lags + 1) as f64
}

/// Andrews' bandwidth L = 1.1447 (α T)^⅓, α = Σ 4ρ²s⁴/((1 − ρ)⁶(1 + ρ)²) / Σ s⁴/(1 − ρ)⁴, with the autocorrelation ρ
/// and the innovation variance s² of each score in units of its own scale (equal weights).
fn andrews(scores: &DMatrix<f64>) -> usize {
    let instants = scores.nrows();
    let (mut numerator, mut denominator) = (0.0, 0.0);
    for score in scores.column_iter() {
        let g = score.as_slice();
        let square: f64 = g.iter().map(|v| v * v).sum();
        if square <= 0.0 {
            continue;
        }
        let product: f64 = g.windows(2).map(|w| w[0] * w[1]).sum();
        let rho = (product / square).clamp(-0.97, 0.97);
        let s4 = (1.0 - rho * rho).powi(2);
        numerator += 4.0 * rho * rho * s4 / ((1.0 - rho).powi(6) * (1.0 + rho).powi(2));
        denominator += s4 / (1.0 - rho).powi(4);
    }
    if denominator <= 0.0 {
        return 0;
    }
    (1.1447 * (numerator / denominator * instants as f64).cbrt()) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn windows_add_up_to_the_kernel() {
        let g = DMatrix::from_fn(40, 2, |t, i| ((t * t) as f64 * 0.3 + i as f64).sin());
        for lags in [0, 1, 7] {
            let mut direct = DMatrix::zeros(2, 2);
            for t in 0..40_usize {
                for s in 0..40_usize {
                    let k = t.abs_diff(s);
                    if k <= lags {
                        let kernel = 1.0 - k as f64 / (lags + 1) as f64;
                        direct += kernel * g.row(t).transpose() * g.row(s);
                    }
                }
            }
            assert!((bartlett(&g, lags) - direct).amax() < 1e-12);
        }
    }
}
