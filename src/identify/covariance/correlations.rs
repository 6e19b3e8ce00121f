//! Shrinkage of correlations that a scatter has too few degrees of freedom to show.

use nalgebra::DMatrix;

use super::Covariance;

impl Covariance {
    /// Keeps σ and replaces the correlations by (1 − a) r_ik + a t_ik: the found r are shrunk towards those of
    /// `target`, t. In a = Σ_{i≠k} (1 − r_ik²)²/ν / Σ_{i≠k} (r_ik − t_ik)², at most 1, the numerator is the squared
    /// difference that chance alone explains with ν degrees of freedom (Schäfer and Strimmer 2005, their target C
    /// with known correlations in place of none).
    ///
    /// A scatter with ν degrees of freedom between b parameters says next to nothing about their b(b − 1)/2
    /// correlations unless ν is many times b. With fewer than b degrees of freedom it is singular; with 2 (b + 1),
    /// squared errors in units of it, eᵀV⁻¹e, are 2b on average where they should be b. The equations know how the
    /// motion correlates the parameters' errors; the scatter knows how large each error is.
    pub(super) fn with_correlations_towards(mut self, target: &DMatrix<f64>) -> Self {
        let [found, known] = [&self.matrix, target].map(correlations);
        let (mut by_chance, mut apart) = (0.0, 0.0);
        for (r, t) in found.iter().zip(&known) {
            // On the diagonal both are one.
            by_chance += (1.0 - r * r).powi(2) / self.degrees_of_freedom;
            apart += (r - t).powi(2);
        }
        // Without any scatter ν may be NaN; `min` then returns 1, and only the target remains.
        let towards = (by_chance / apart).min(1.0);
        let sigma = self.sigma();
        self.matrix = DMatrix::from_fn(sigma.len(), sigma.len(), |i, k| {
            if i == k {
                return self.matrix[(i, i)];
            }
            let (r, t) = (found[(i, k)], known[(i, k)]);
            sigma[i] * sigma[k] * (r + towards * (t - r))
        });
        self
    }
}

/// Correlations m_ik/√(m_ii m_kk) of what has the covariance, or the sums of products, m; 0 for what does not scatter.
pub(in crate::identify) fn correlations(matrix: &DMatrix<f64>) -> DMatrix<f64> {
    let scale = matrix.diagonal().map(f64::sqrt);
    DMatrix::from_fn(matrix.nrows(), matrix.ncols(), |i, k| {
        let product = scale[i] * scale[k];
        match i == k {
            true => 1.0,
            false if product > 0.0 => matrix[(i, k)] / product,
            false => 0.0,
        }
    })
}

#[cfg(test)]
mod tests {
    use super::super::CovarianceKind;
    use super::*;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    const B: usize = 12;

    /// ρ^|i − k| with σ_i = i + 1.
    fn law(rho: f64) -> DMatrix<f64> {
        let sigma = |i: usize| (i + 1) as f64;
        DMatrix::from_fn(B, B, |i, k| sigma(i) * sigma(k) * rho.powi(i.abs_diff(k) as i32))
    }

    /// The scatter of `freedom` draws from `law`.
    fn scatter(law: &DMatrix<f64>, freedom: usize, seed: u64) -> Covariance {
        let mut rng = rand::rngs::ChaCha8Rng::seed_from_u64(seed);
        let root = law.clone().cholesky().unwrap().unpack();
        let draws = root * DMatrix::from_fn(B, freedom, |_, _| StandardNormal.sample(&mut rng));
        Covariance {
            kind: CovarianceKind::Periods,
            matrix: &draws * draws.transpose() / freedom as f64,
            degrees_of_freedom: freedom as f64,
        }
    }

    #[test]
    fn a_short_scatter_keeps_its_sigmas_and_takes_over_the_correlations() {
        let law = law(0.7);
        for seed in 0..20 {
            let found = scatter(&law, 5, seed);
            let sigma = found.sigma();
            let whole = found.with_correlations_towards(&law);
            assert_eq!(whole.sigma(), sigma);
            assert!(whole.matrix.clone().cholesky().is_some(), "not positive definite");
        }
    }

    /// A scatter with many thousand degrees of freedom is more reliable: a wrong target has no weight.
    #[test]
    fn a_long_scatter_keeps_its_correlations() {
        let found = scatter(&law(0.7), 20_000, 3);
        let before = found.matrix.clone();
        let apart = (correlations(&before) - correlations(&law(0.0))).norm_squared();
        let after = found.with_correlations_towards(&law(0.0)).matrix;
        let moved = (correlations(&after) - correlations(&before)).norm_squared();
        // a is at most the sum of 1/ν over the B² pairs, divided by the squared difference.
        let bound = (B * B) as f64 / 20_000.0 / apart;
        assert!(moved.sqrt() <= bound * apart.sqrt(), "{moved} {bound}");
    }

    #[test]
    fn no_scatter_stays_none() {
        let nothing = Covariance {
            kind: CovarianceKind::Spectral,
            matrix: DMatrix::zeros(B, B),
            degrees_of_freedom: f64::NAN,
        };
        assert_eq!(nothing.with_correlations_towards(&law(0.5)).matrix, DMatrix::zeros(B, B));
    }
}
