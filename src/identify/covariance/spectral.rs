//! Scatter between periods, frequency by frequency.

use std::borrow::Cow;

use nalgebra::DMatrix;

use super::{Covariance, CovarianceError, CovarianceKind, CovarianceMethod};
use crate::identify::fit::Fit;
use crate::identify::problem::{Domain, Problem};
use crate::identify::whiten::Spectrum;
use crate::signal::subtract_mean_period;

/// V = Σ_k Σ_p z_kp z_kpᵀ / (P(P − 1)), z_kp = A⁻¹ X_kᵀW²(Y_pk − Ȳ_k): the effect on θ̂ of the deviation of period p
/// at harmonic k.
///
/// Like the scatter between periods, V is valid for noise of any colour and any correlation between joints. It adds
/// up harmonics, which are independent as soon as the noise's memory is short compared with the period, and so has
/// many more degrees of freedom. Parameter i has ν_i = (Σ_k c_ik)² / Σ_k c_ik²/(ν_k + 2), with the share c_ik of
/// harmonic k in its variance and the ν_k = 2(P − 1) degrees of freedom of one harmonic (Satterthwaite's formula for
/// estimated shares). The harmonic mean of the ν_i is stated.
pub struct SpectralSandwich;

impl CovarianceMethod for SpectralSandwich {
    fn covariance(&self, problem: &Problem, fit: &Fit) -> Result<Covariance, CovarianceError> {
        let periods = problem.periods;
        if periods < 2 {
            return Err(CovarianceError::TooFewPeriods { periods });
        }
        let rows = match problem.domain {
            Domain::Frequency => Cow::Borrowed(problem),
            Domain::Time => {
                let mut rows = Problem::new(problem.plan.clone(), problem.rate_hz);
                Spectrum::default().transform(problem, problem.samples, &mut rows);
                Cow::Owned(rows)
            }
        };
        let bread = &fit.inverse * fit.inverse.transpose();
        let effects = bread * scores(&rows, &fit.weights);
        let freedom = (periods - 1) as f64;
        let matrix = &effects * effects.transpose() / (periods as f64 * freedom);
        Ok(Covariance {
            kind: CovarianceKind::Spectral,
            matrix,
            degrees_of_freedom: degrees_of_freedom(&effects, periods),
        })
    }
}

/// X_kᵀW²(Y_pk − Ȳ_k), one column per harmonic and period: b × (harmonics + 1)·P.
fn scores(rows: &Problem, weights: &[f64]) -> DMatrix<f64> {
    let (n, periods) = (rows.samples, rows.periods);
    let harmonics = n / 2;
    let mut scores = DMatrix::zeros((harmonics + 1) * periods, rows.parameters());
    let mut deviations = Vec::new();
    for (j, panel) in rows.panels.iter().enumerate() {
        deviations.clear();
        deviations.extend_from_slice(&panel.y);
        subtract_mean_period(&mut deviations, n);
        let weight = weights[j] * weights[j];
        for (base, x) in rows.plan.base_indices(j).zip(panel.x.chunks_exact(n)) {
            let mut column = scores.column_mut(base);
            let column = column.as_mut_slice();
            let periods = deviations.chunks_exact(n).zip(column.chunks_exact_mut(harmonics + 1));
            for (d, out) in periods {
                out[0] += weight * x[0] * d[0];
                let pairs = x[1..].chunks_exact(2).zip(d[1..].chunks_exact(2));
                for (out, (x, d)) in out[1..].iter_mut().zip(pairs) {
                    *out += weight * (x[0] * d[0] + x[1] * d[1]);
                }
            }
        }
    }
    scores.transpose()
}

fn degrees_of_freedom(effects: &DMatrix<f64>, periods: usize) -> f64 {
    let bins = effects.ncols() / periods;
    let own = (periods - 1) as f64;
    let mut shares = vec![0.0; bins];
    let mut inverse_sum = 0.0;
    for row in effects.row_iter() {
        shares.fill(0.0);
        for (column, effect) in row.iter().enumerate() {
            shares[column % bins] += effect * effect;
        }
        let all: f64 = shares.iter().sum();
        let squares: f64 = shares
            .iter()
            .enumerate()
            .map(|(k, c)| c * c / (if k == 0 { own } else { 2.0 * own } + 2.0))
            .sum();
        inverse_sum += squares / (all * all);
    }
    effects.nrows() as f64 / inverse_sum
}
