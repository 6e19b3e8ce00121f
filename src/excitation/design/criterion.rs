//! Criteria that compare information matrices.

use faer::linalg::solvers::DenseSolveCore;
use faer::{Mat, Side};
use serde::{Deserialize, Serialize};

/// A figure of merit of an information matrix Λ (n × n); smaller is better.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Criterion {
    /// −(1/n) ln det Λ of the whitened information: the volume of the confidence ellipsoid.
    D,
    /// ln of the mean of σ_i²/s_i² (s: scale of parameter i): the mean relative variance.
    A,
    /// −ln λ_min of the whitened information about the parameters in units of their scale: the worst
    /// combination.
    E,
    /// ln cond(Θ_BᵀΘ_B), the paper's (22), unweighted.
    Cond,
    /// ln cond of the unweighted Θ_BᵀΘ_B with columns of unit length.
    Scaled,
}

impl Criterion {
    /// Whether Λ is weighted with the torque noise.
    pub fn whitened(self) -> bool {
        matches!(self, Self::D | Self::A | Self::E)
    }

    /// A value of the criterion in words, as the number that is usually quoted.
    pub fn in_words(self, value: f64) -> String {
        match self {
            Self::D => format!("det^(1/n) of the covariance {:.4e}", value.exp()),
            Self::A => format!("rms relative sigma {:.4}", (0.5 * value).exp()),
            Self::E => format!("worst relative sigma {:.4}", (0.5 * value).exp()),
            Self::Cond => format!("condition {:.1}", value.exp()),
            Self::Scaled => format!("scaled condition {:.2}", value.exp()),
        }
    }

    /// Value of the criterion for Λ. `None` if Λ is not positive definite to working precision.
    pub fn value(self, information: &Mat<f64>, scales: &[f64]) -> Option<f64> {
        match self {
            Self::D | Self::A => self.smooth(information, scales, 1.0).map(|(value, _)| value),
            Self::E => {
                let spectrum = eigenvalues(&congruent(information, scales))?;
                Some(-spectrum[0].ln())
            }
            Self::Cond => condition(information).map(f64::ln),
            Self::Scaled => {
                condition(&congruent(information, &equilibration(information)?)).map(f64::ln)
            }
        }
    }

    /// The criterion and its derivative G by Λ (symmetric, df = tr(G dΛ)).
    ///
    /// Extreme eigenvalues coincide at an optimum, where they have no derivative. They are replaced by p-norms of the
    /// spectrum, ln λ_max ≤ (1/p) ln Σ λᵖ and −ln λ_min ≤ (1/p) ln Σ λ⁻ᵖ, which are smooth upper bounds, exact to
    /// within ln(n)/p.
    pub fn smooth(
        self,
        information: &Mat<f64>,
        scales: &[f64],
        sharpness: f64,
    ) -> Option<(f64, Mat<f64>)> {
        let n = information.nrows();
        match self {
            Self::D => {
                let factor = information.llt(Side::Lower).ok()?;
                let half: f64 = (0..n).map(|i| factor.L()[(i, i)].ln()).sum();
                let mut g = factor.inverse();
                scale_all(&mut g, -1.0 / n as f64);
                Some((-2.0 * half / n as f64, g))
            }
            Self::A => {
                let inverse = information.llt(Side::Lower).ok()?.inverse();
                let trace: f64 = (0..n).map(|i| inverse[(i, i)] / (scales[i] * scales[i])).sum();
                // d tr(S⁻¹Λ⁻¹S⁻¹) = −tr(Λ⁻¹ S⁻² Λ⁻¹ dΛ).
                let mut scaled = inverse.clone();
                for i in 0..n {
                    for k in 0..n {
                        scaled[(i, k)] /= scales[i] * scales[i];
                    }
                }
                let mut g = &inverse * &scaled;
                scale_all(&mut g, -1.0 / trace);
                Some(((trace / n as f64).ln(), g))
            }
            Self::E => {
                let (value, g) = soft_spectrum(&congruent(information, scales), sharpness, false)?;
                Some((value, congruent(&g, scales)))
            }
            Self::Cond => soft_spectrum(information, sharpness, true),
            Self::Scaled => {
                let s = equilibration(information)?;
                let c = congruent(information, &s);
                let (value, g) = soft_spectrum(&c, sharpness, true)?;
                // C_ij = s_i s_j Λ_ij with s = Λ_ii^(-1/2): a diagonal entry also changes its row and column.
                let mut out = congruent(&g, &s);
                for i in 0..n {
                    let moved: f64 = (0..n).map(|k| g[(i, k)] * c[(k, i)]).sum();
                    out[(i, i)] -= moved / information[(i, i)];
                }
                Some((value, out))
            }
        }
    }
}

/// λ_max/λ_min of a symmetric matrix, `None` unless positive definite.
pub(super) fn condition(matrix: &Mat<f64>) -> Option<f64> {
    let spectrum = eigenvalues(matrix)?;
    Some(spectrum[spectrum.len() - 1] / spectrum[0])
}

/// Eigenvalues in ascending order, `None` unless all are positive.
fn eigenvalues(matrix: &Mat<f64>) -> Option<Vec<f64>> {
    let spectrum = matrix.self_adjoint_eigenvalues(Side::Lower).ok()?;
    (spectrum[0] > 0.0).then_some(spectrum)
}

/// s_i = Λ_ii^(−1/2): scales that give the columns of Θ unit length.
pub(super) fn equilibration(information: &Mat<f64>) -> Option<Vec<f64>> {
    let diagonal = (0..information.nrows()).map(|i| information[(i, i)]);
    diagonal.map(|d| (d > 0.0).then(|| 1.0 / d.sqrt())).collect()
}

/// S M S with S = diag(scales).
pub(super) fn congruent(matrix: &Mat<f64>, scales: &[f64]) -> Mat<f64> {
    Mat::from_fn(matrix.nrows(), matrix.ncols(), |i, k| scales[i] * matrix[(i, k)] * scales[k])
}

fn scale_all(matrix: &mut Mat<f64>, factor: f64) {
    for column in matrix.col_iter_mut() {
        column.iter_mut().for_each(|x| *x *= factor);
    }
}

/// (1/p) ln Σ λ⁻ᵖ, plus (1/p) ln Σ λᵖ if `both` ends of the spectrum count, and its derivative by the matrix.
fn soft_spectrum(matrix: &Mat<f64>, p: f64, both: bool) -> Option<(f64, Mat<f64>)> {
    let n = matrix.nrows();
    let eigen = matrix.self_adjoint_eigen(Side::Lower).ok()?;
    let (u, s) = (eigen.U(), eigen.S());
    let logs: Vec<f64> = (0..n).map(|i| s[i].ln()).collect();
    if s[0].is_nan() || s[0] <= 0.0 {
        return None;
    }
    let mut slopes = vec![0.0; n];
    let mut value = 0.0;
    let ends: &[f64] = if both { &[-1.0, 1.0] } else { &[-1.0] };
    for sign in ends {
        let peak = logs.iter().map(|l| sign * l).fold(f64::NEG_INFINITY, f64::max);
        let weights: Vec<f64> = logs.iter().map(|l| (p * (sign * l - peak)).exp()).collect();
        let sum: f64 = weights.iter().sum();
        value += peak + sum.ln() / p;
        for i in 0..n {
            slopes[i] += sign * weights[i] / sum / s[i];
        }
    }
    let weighted = Mat::from_fn(n, n, |i, k| u[(i, k)] * slopes[k]);
    Some((value, &weighted * u.transpose()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::rngs::ChaCha8Rng;
    use rand::{RngExt, SeedableRng};

    const ALL: [Criterion; 5] =
        [Criterion::D, Criterion::A, Criterion::E, Criterion::Cond, Criterion::Scaled];

    fn random_information(seed: u64) -> Mat<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let theta = Mat::from_fn(30, 8, |_, c| (1.0 + c as f64) * rng.random_range(-1.0..1.0));
        theta.transpose() * &theta
    }

    /// Directional differences with h = 1e-5: the truncation error is h² ≈ 1e-10, for values of order 1 to 100.
    #[test]
    fn derivatives_are_finite_differences() {
        let scales: Vec<f64> = (0..8).map(|i| 0.5 + 0.3 * i as f64).collect();
        let information = random_information(1);
        let direction = random_information(2);
        for criterion in ALL {
            let (_, g) = criterion.smooth(&information, &scales, 6.0).unwrap();
            let h = 1e-5;
            let at = |t: f64| {
                let moved = Mat::from_fn(8, 8, |i, k| information[(i, k)] + t * direction[(i, k)]);
                criterion.smooth(&moved, &scales, 6.0).unwrap().0
            };
            let slope = (at(h) - at(-h)) / (2.0 * h);
            let stated: f64 = (0..8)
                .flat_map(|i| (0..8).map(move |k| (i, k)))
                .map(|(i, k)| g[(i, k)] * direction[(i, k)])
                .sum();
            assert!((slope - stated).abs() < 1e-7, "{criterion:?}: {slope} {stated}");
        }
    }

    #[test]
    fn smoothing_is_from_above_and_within_its_bound() {
        let scales = vec![1.0; 8];
        for seed in 0..20 {
            let information = random_information(seed);
            for criterion in ALL {
                let exact = criterion.value(&information, &scales).unwrap();
                let (soft, _) = criterion.smooth(&information, &scales, 30.0).unwrap();
                let bound = 2.0 * 8f64.ln() / 30.0 + 1e-12;
                assert!(soft >= exact - 1e-9 && soft <= exact + bound, "{criterion:?}");
            }
        }
    }

    /// diag(1, 4, 16): every criterion by hand.
    #[test]
    fn values_of_a_diagonal_matrix() {
        let m = Mat::from_fn(3, 3, |i, k| if i == k { 4f64.powi(i as i32) } else { 0.0 });
        let unit = [1.0; 3];
        let close = |c: Criterion, expected: f64| {
            assert!((c.value(&m, &unit).unwrap() - expected).abs() < 1e-12, "{c:?}");
        };
        close(Criterion::D, -4f64.ln());
        close(Criterion::A, ((1.0 + 0.25 + 0.0625) / 3.0f64).ln());
        close(Criterion::E, 0.0);
        close(Criterion::Cond, 16f64.ln());
        close(Criterion::Scaled, 0.0);
    }

    /// A direction without information has a pivot and an eigenvalue of exactly zero. Two equal columns have a pivot of
    /// exactly zero too, but an eigenvalue of zero only to within rounding.
    #[test]
    fn a_singular_matrix_has_no_value() {
        let unit = [1.0; 2];
        let one_sided = Mat::from_fn(2, 2, |i, k| if i + k == 0 { 1.0 } else { 0.0 });
        for criterion in ALL {
            for singular in [&one_sided, &Mat::zeros(2, 2)] {
                assert_eq!(criterion.value(singular, &unit), None, "{criterion:?}");
                assert!(criterion.smooth(singular, &unit, 6.0).is_none(), "{criterion:?}");
            }
        }
        let alike = Mat::from_fn(2, 2, |_, _| 1.0);
        for criterion in [Criterion::D, Criterion::A] {
            assert_eq!(criterion.value(&alike, &unit), None, "{criterion:?}");
        }
    }
}
