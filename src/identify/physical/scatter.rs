//! Uncertainty of a constrained estimate.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

use super::structure::Structure;

/// σ of the base parameters and of all standard parameters.
#[derive(Debug, Clone, PartialEq)]
pub struct Sigma {
    /// Of the base parameters.
    pub base: Vec<f64>,
    /// Of the standard parameters, as far as the data determine them: a parameter that only the prior determines has
    /// none of the data's noise.
    pub standard: Vec<f64>,
}

/// Three measures of the scatter of the estimate. They agree where no bound is near.
///
/// Delta method: with the right-hand side ρ = R θ̂ and its covariance N, y moves by dy = S⁻¹ (R K)ᵀ dρ, where S is
/// the curvature of the objective in free parameters. Log-Cholesky parameters η (P = T Tᵀ, T triangular with diagonal
/// e^η; D. Rucker, P. M. Wensing, "Smooth parameterization of rigid-body inertia", 2022) have no bounds. The
/// curvature in them, transformed back to y, is H + Σ tr(Z d²P). On the central path, where Z = μ P⁻¹, the second
/// term is μ tr(P⁻¹dP P⁻¹dP): the curvature that the last Newton step of the interior-point method contains anyway.
#[derive(Debug, Clone, PartialEq)]
pub struct Scatter {
    /// By the full curvature. An active bound fixes its direction, which therefore does not contribute to this σ.
    pub held: Sigma,
    /// By the Gauss–Newton curvature, which contains only the data and the prior (with the prior's curvature at the
    /// prior): as if there were no bounds. In log-Cholesky parameters this is the textbook formula J
    /// (JᵀHJ)⁻¹Jᵀ = H⁻¹.
    pub released: Sigma,
    /// Root mean square distance of estimates drawn around the estimate (parametric bootstrap): a bound takes effect
    /// in the draws that go beyond it, and only there.
    pub drawn: Option<Sigma>,
}

impl Sigma {
    /// σ by dy = S⁻¹ (R K)ᵀ dρ with cov ρ = `noise`; `map` is R K.
    pub(super) fn by_delta_method(
        structure: &Structure,
        curvature: &Cholesky<f64, Dyn>,
        map: &DMatrix<f64>,
        noise: &DMatrix<f64>,
    ) -> Self {
        let sensitivity = curvature.solve(&map.transpose());
        let scatter = |of: &DMatrix<f64>| -> Vec<f64> {
            let linear = of * &sensitivity;
            let spread = &linear * noise;
            linear
                .row_iter()
                .zip(spread.row_iter())
                .map(|(a, b)| a.dot(&b).max(0.0).sqrt())
                .collect()
        };
        Self { base: scatter(&structure.base_map), standard: scatter(&structure.standard_map()) }
    }
}

/// Effect of an error of the prior on a standard parameter, without noise and bounds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FileError {
    /// Root mean square error of the estimate if the prior is wrong by 100 % in every direction of its metric, in the
    /// parameter's unit. It is proportional to the error of the prior.
    pub stays: f64,
    /// `stays` over the error of the prior itself: 0 where the data determine the parameter, 1 where only the prior
    /// does.
    pub share: f64,
}

impl FileError {
    /// The effect for every standard parameter. With the prior's curvature A = `pulls`, its weight γ and the
    /// `curvature` S = (R K)ᵀ(R K) + γ A, the estimate is off by S⁻¹ γ A times the prior's error, whose covariance is
    /// A⁻¹. Its error is therefore γ √diag(E S⁻¹ A S⁻¹ Eᵀ), compared with √diag(E A⁻¹ Eᵀ) of the prior.
    pub(super) fn of(
        structure: &Structure,
        curvature: &Cholesky<f64, Dyn>,
        pulls: &DMatrix<f64>,
        weight: f64,
    ) -> Vec<Self> {
        let columns = structure.standard_map().transpose();
        let of_prior = Cholesky::new(pulls.clone()).map(|pulls| pulls.solve(&columns));
        let stays = weight * curvature.solve(&columns);
        let squares = (pulls * &stays).component_mul(&stays).row_sum();
        let whole = of_prior.map(|of_prior| of_prior.component_mul(&columns).row_sum());
        let error = |k: usize| {
            let stays = squares[k].max(0.0).sqrt();
            let whole = whole.as_ref().map_or(f64::INFINITY, |whole| whole[k].max(0.0).sqrt());
            Self { stays, share: if whole > 0.0 { stays / whole } else { 0.0 } }
        };
        (0..columns.ncols()).map(error).collect()
    }
}

/// Sums of squared deviations over draws.
#[derive(Debug, Clone)]
pub(super) struct Deviations {
    draws: usize,
    base: DVector<f64>,
    standard: DVector<f64>,
}

impl Deviations {
    pub(super) fn new(structure: &Structure) -> Self {
        Self {
            draws: 0,
            base: DVector::zeros(structure.base_map.nrows()),
            standard: DVector::zeros(structure.standard(&structure.start).len()),
        }
    }

    /// Adds one draw that is `deviation` away in the unknowns.
    pub(super) fn add(&mut self, structure: &Structure, deviation: &DVector<f64>) {
        self.draws += 1;
        self.base += (&structure.base_map * deviation).map(|d| d * d);
        self.standard += DVector::from_vec(structure.standard(deviation)).map(|d| d * d);
    }

    pub(super) fn sigma(&self) -> Sigma {
        let root = |squares: &DVector<f64>| -> Vec<f64> {
            squares.iter().map(|s| (s / self.draws as f64).sqrt()).collect()
        };
        Sigma { base: root(&self.base), standard: root(&self.standard) }
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Matrix4;

    /// A lower triangular matrix with eˣ on its diagonal.
    fn factor(eta: &Matrix4<f64>) -> Matrix4<f64> {
        Matrix4::from_fn(|i, j| match i.cmp(&j) {
            std::cmp::Ordering::Less => 0.0,
            std::cmp::Ordering::Equal => eta[(i, i)].exp(),
            std::cmp::Ordering::Greater => eta[(i, j)],
        })
    }

    /// Checks the statement in the documentation of `Scatter` by second differences (step h: truncation h², rounding
    /// 1e-16/h²; 1e-4 leaves 1e-6).
    #[test]
    fn log_cholesky_curvature_is_the_interior_points() {
        let eta = Matrix4::from_fn(|i, j| 0.3 * ((4 * i + j) as f64).sin());
        let step = Matrix4::from_fn(|i, j| ((3 * i + 7 * j) as f64).cos());
        let mu = 0.7;
        let h = 1e-4;
        let p = |t: f64| {
            let l = factor(&(eta + t * step));
            l * l.transpose()
        };
        let inverse = p(0.0).try_inverse().unwrap();
        let second = (p(h) + p(-h) - 2.0 * p(0.0)) / (h * h);
        let first = inverse * (p(h) - p(-h)) / (2.0 * h);
        let by_cholesky = mu * (inverse * second).trace();
        let by_barrier = mu * (first * first).trace();
        assert!((by_cholesky / by_barrier - 1.0).abs() < 1e-5, "{by_cholesky} {by_barrier}");
    }
}
