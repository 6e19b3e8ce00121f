//! Repeated motions with noise, for tests.

use rand::{SeedableRng, rngs::ChaCha8Rng};
use rand_distr::{Distribution, StandardNormal};

/// Samples per period.
pub const SAMPLES: usize = 1000;
/// Number of periods.
pub const PERIODS: usize = 8;

/// Periods of `mean(k)` plus white noise of standard deviation `noise`.
pub fn periods(mean: impl Fn(usize) -> f64, noise: f64) -> Vec<f64> {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mut random = || -> f64 { StandardNormal.sample(&mut rng) };
    (0..SAMPLES * PERIODS).map(|k| mean(k % SAMPLES) + noise * random()).collect()
}

/// Root mean square.
pub fn rms(y: impl ExactSizeIterator<Item = f64>) -> f64 {
    let samples = y.len() as f64;
    (y.map(|y| y * y).sum::<f64>() / samples).sqrt()
}
