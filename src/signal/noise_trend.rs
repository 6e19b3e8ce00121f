//! The power of noise over frequency without the scatter of its estimate.

use statrs::function::gamma::digamma;

/// Power of noise at one harmonic.
#[derive(Debug, Clone, Copy)]
pub struct NoisePower {
    /// Mean square of one period's coefficient, Nm².
    pub value: f64,
    /// Variance of its estimate over its square.
    pub relative_variance: f64,
}

/// Harmonics on each side of harmonic k whose power says something about that of k: max(3, k/4).
pub fn pooled(k: usize) -> usize {
    (k / 4).max(FEWEST)
}

/// With fewer, the scatter of few periods says little of the slowest harmonics' noise; with more, a line misses how
/// noise of two colours bends there.
const FEWEST: usize = 3;

/// The power of noise by harmonic, 0 … `last`, without its scatter: straight lines of ln power in
/// ln harmonic over k ± max(3, k/4), seven harmonics or more. `freedom` is that of one harmonic, ν, whose
/// logarithm is low by ln ν − ψ(ν) in the mean, with the variance ψ'(ν).
pub fn noise_trend(power: &[f64], freedom: usize, last: usize) -> Vec<NoisePower> {
    let end = power.len() - 1;
    let bias = (freedom as f64).ln() - digamma(freedom as f64);
    let variance = trigamma(freedom);
    let points: Vec<(f64, f64)> =
        power.iter().enumerate().map(|(h, p)| ((h as f64).ln(), p.ln() + bias)).collect();
    let at = |k: usize| {
        let first = k.saturating_sub(pooled(k)).max(1);
        let window = &points[first..=(k + pooled(k)).max(first + 2 * FEWEST).min(end)];
        let count = window.len() as f64;
        let x0 = window.iter().map(|p| p.0).sum::<f64>() / count;
        let y0 = window.iter().map(|p| p.1).sum::<f64>() / count;
        let (xy, xx) = window.iter().fold((0.0, 0.0), |(xy, xx), (x, y)| {
            (xy + (x - x0) * (y - y0), xx + (x - x0) * (x - x0))
        });
        let from_middle = points[k].0 - x0;
        NoisePower {
            value: (y0 + xy / xx * from_middle).exp(),
            relative_variance: variance * (1.0 / count + from_middle * from_middle / xx),
        }
    };
    // The mean has no logarithm: it is as noisy as its neighbour.
    (0..=last.min(end)).map(|k| at(k.max(1))).collect()
}

/// ψ'(n) = π²/6 − Σ 1/i², i < n.
fn trigamma(n: usize) -> f64 {
    let below: f64 = (1..n).map(|i| 1.0 / (i * i) as f64).sum();
    std::f64::consts::PI.powi(2) / 6.0 - below
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{SeedableRng, rngs::ChaCha8Rng};
    use rand_distr::{Distribution, StandardNormal};

    /// Power that falls as 1/h² is found without a bend at its steep beginning.
    #[test]
    fn steep_noise_keeps_its_slope() {
        const FREEDOM: usize = 7;
        const TRIALS: usize = 200;
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut mean = [0.0; 40];
        for _ in 0..TRIALS {
            let power: Vec<f64> = (0..200)
                .map(|h: usize| {
                    let square = |_| {
                        let x: f64 = StandardNormal.sample(&mut rng);
                        x * x
                    };
                    let chi: f64 = (0..2 * FREEDOM).map(square).sum();
                    chi / (2 * FREEDOM) as f64 / (h.max(1) as f64).powi(2)
                })
                .collect();
            for (k, (mean, found)) in
                mean.iter_mut().zip(noise_trend(&power, FREEDOM, 39)).enumerate()
            {
                *mean += (found.value * (k.max(1) as f64).powi(2)).ln() / TRIALS as f64;
            }
        }
        // ln of χ²₁₄/14 has the variance ψ'(7) = 0.154; the line through seven points ends with 0.67 of
        // it at most: σ of the mean of 200 is 0.023. Six σ of forty fail in one of 10⁷ seeds.
        for (k, mean) in mean.iter().enumerate() {
            assert!(mean.abs() < 0.15, "harmonic {k}: off by {mean:.3}");
        }
    }
}
