//! Tests whether noise alone explains a physically impossible estimate.

use nalgebra::{Cholesky, DMatrix, DVector};
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::error::PhysicalError;
use super::estimate::{Constrained, Data, PhysicalOptions, ROUGH_GAP, Solver};
use super::scatter::{Deviations, Sigma};

/// Whether the unconstrained estimate belongs to any set of links, and the cost of making it so.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Evidence {
    /// The largest t for which links with exactly the unconstrained base parameters exist whose pseudo-inertias (and
    /// friction and rotor inertias) are all at least t times the prior's. If negative, no links have these base
    /// parameters; −1 means that they are short by the size of the prior.
    pub realisable: f64,
    /// T = ‖R (K x − θ̂)‖²: increase of the weighted sum of squares by the repair, in units of the noise.
    pub distance: f64,
    /// Number of bootstrap draws with T at least as large, and number of all draws.
    pub exceeded: Option<(usize, usize)>,
}

/// p-value below which noise is no explanation.
const SIGNIFICANT: f64 = 0.01;

impl Evidence {
    /// (1 + draws at least as large)/(1 + all draws).
    pub fn p_value(&self) -> Option<f64> {
        self.exceeded.map(|(larger, draws)| (1 + larger) as f64 / (1 + draws) as f64)
    }

    /// Whether some links have the unconstrained base parameters.
    pub fn is_realisable(&self) -> bool {
        self.realisable >= 0.0
    }

    /// Whether the repair cost more fit than noise explains (p < 1 %).
    pub fn model_is_wrong(&self) -> bool {
        !self.is_realisable() && self.p_value().is_some_and(|p| p < SIGNIFICANT)
    }

    /// The finding in words.
    pub fn sentence(&self) -> String {
        let Self { realisable, distance, .. } = self;
        if self.is_realisable() {
            return format!(
                "links exist that have the fitted base parameters, with pseudo-inertias of at least {realisable:.2e} times the \
                 robot file's"
            );
        }
        let found = format!(
            "the fitted base parameters are physically impossible (no links have them; they are short by {:.2} times the robot file's \
             pseudo-inertias); the nearest possible ones raise the sum of squares by {distance:.1} in units of the noise",
            -realisable
        );
        // With no draw at least as large, the probability is below the least that this number of draws can show.
        let is = if self.exceeded.is_some_and(|(larger, _)| larger == 0) { "≤" } else { "=" };
        match self.p_value() {
            Some(p) if p < SIGNIFICANT => format!(
                "{found}, more than noise explains (p {is} {p:.3}): the model is wrong, not only \
                 noisy. Run armid diagnose"
            ),
            Some(p) => format!(
                "within noise an arm can have the fitted base parameters (p = {p:.2}): none has exactly these, and the nearest \
                 possible ones raise the sum of squares by {distance:.1} in units of the noise"
            ),
            None => found,
        }
    }
}

/// A factor L with L Lᵀ = Ω; for a singular Ω the diagonal factor with its variances.
pub(super) fn noise_root(omega: &DMatrix<f64>) -> DMatrix<f64> {
    let of_variances = || DMatrix::from_diagonal(&omega.diagonal().map(f64::sqrt));
    Cholesky::new(omega.clone()).map_or_else(of_variances, Cholesky::unpack)
}

/// Result of the bootstrap.
pub(super) struct Draws {
    /// Number of draws with T at least as large, and number of all draws.
    pub exceeded: (usize, usize),
    /// Scatter of the draws' estimates.
    pub sigma: Sigma,
}

/// Draws noise about the constrained estimate, and determines how many draws cost at least as much fit and how far
/// their estimates are from it. Where T was positive, the estimate is on the boundary: the least favourable of all
/// arms that can exist.
pub(super) fn bootstrap(
    solver: &Solver,
    data: &Data,
    constrained: &Constrained,
    noise_root: &DMatrix<f64>,
    options: &PhysicalOptions,
) -> Result<Option<Draws>, PhysicalError> {
    if options.bootstrap == 0 {
        return Ok(None);
    }
    let mut deviations = Deviations::new(solver.structure());
    let mut rng = ChaCha8Rng::seed_from_u64(options.seed);
    let expected = data.whitened(&constrained.y);
    let mut larger = 0;
    for _ in 0..options.bootstrap {
        let noise = DVector::from_fn(expected.len(), |_, _| StandardNormal.sample(&mut rng));
        let drawn = solver.solve(data, &(&expected + noise_root * noise), ROUGH_GAP)?;
        larger += usize::from(drawn.distance >= constrained.distance);
        deviations.add(solver.structure(), &(drawn.y - &constrained.y));
    }
    Ok(Some(Draws { exceeded: (larger, options.bootstrap), sigma: deviations.sigma() }))
}
