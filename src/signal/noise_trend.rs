//! The power of noise over frequency without the scatter of its estimate.

use nalgebra::{Matrix3, RowVector3};
use statrs::function::gamma::digamma;

/// Power of noise at one harmonic.
#[derive(Debug, Clone, Copy)]
pub struct NoisePower {
    /// Mean square of one period's coefficient, Nm².
    pub value: f64,
    /// Variance of its estimate over its square, of what all channels share.
    pub shared_variance: f64,
    /// Of how far all noise of the channel lies above that of the others.
    pub level_variance: f64,
    /// Of what one harmonic has beside both.
    pub colour_variance: f64,
}

/// Harmonics on each side of harmonic k whose power says something about that of k: max(3, k/4).
pub fn pooled(k: usize) -> usize {
    (k / 4).max(FEWEST)
}

/// Harmonics on each side of harmonic k that say how far the noise of one channel lies above that of all: max(12, k/4).
pub fn pooled_level(k: usize) -> usize {
    pooled(k).max(LEVEL)
}

/// With fewer, the scatter of few periods says little of the slowest harmonics' noise; with more, a line misses how
/// noise of two colours bends there.
const FEWEST: usize = 3;
/// What one channel's noise has beside that of the others is mostly how strong it is, and hardly its colour.
const LEVEL: usize = 12;

/// The power of noise by harmonic, 0 … `last`, without its scatter: straight lines of ln power in
/// ln harmonic over k ± max(3, k/4), seven harmonics or more. `freedom` is that of one harmonic, ν, whose
/// logarithm is low by ln ν − ψ(ν) in the mean, with the variance ψ'(ν).
pub fn noise_trend(power: &[f64], freedom: usize, last: usize) -> Vec<NoisePower> {
    let end = power.len() - 1;
    let noise = Scatter::of(freedom);
    let logarithms = noise.logarithms(power);
    let at = |k: usize| {
        let fit = LocalFit::new(near(k, end), k, 1);
        NoisePower {
            value: fit.value(&logarithms).exp(),
            shared_variance: 0.0,
            level_variance: 0.0,
            colour_variance: noise.variance * fit.square(),
        }
    };
    // The mean has no logarithm: it is as noisy as its neighbour.
    (0..=last.min(end)).map(|k| at(k.max(1))).collect()
}

/// [`noise_trend`] of J channels whose noise is of one kind, as that of an arm's drives is; `likeness` is the mean squared
/// coherence between them.
///
/// The mean of their ln powers, J times as well known as one channel's, is followed by parabolas over the same harmonics: at the
/// slowest ones lines miss noise of two colours by a tenth. How far a channel lies above the mean is a level, of harmonics
/// k ± max(12, k/4). Where the channels' colours differ, level and slope over the near harmonics are further from
/// it than chance has them, by χ² of 2 (J − 1) degrees of freedom, and the line through these counts with the weight
/// 1 − 2 (J − 1)/χ² (James and Stein 1961, for the mean of normal numbers).
pub fn noise_trends(
    power: &[Vec<f64>],
    freedom: usize,
    likeness: f64,
    last: usize,
) -> Vec<Vec<NoisePower>> {
    let channels = power.len() as f64;
    let Some(end) = power.first().map(|p| p.len() - 1) else { return Vec::new() };
    if power.len() == 1 {
        return vec![noise_trend(&power[0], freedom, last)];
    }
    let noise = Scatter::of(freedom);
    let mut beside: Vec<Vec<f64>> = power.iter().map(|p| noise.logarithms(p)).collect();
    let mean: Vec<f64> =
        (0..=end).map(|h| beside.iter().map(|own| own[h]).sum::<f64>() / channels).collect();
    beside.iter_mut().for_each(|own| own.iter_mut().zip(&mean).for_each(|(own, m)| *own -= m));
    let shared_variance = noise.variance * (1.0 + (channels - 1.0) * likeness) / channels;
    let own_variance = noise.variance * (1.0 - likeness).max(0.0);
    // All deviations from the mean together are none.
    let share = own_variance * (1.0 - 1.0 / channels);

    let mut trends = vec![Vec::with_capacity(last + 1); power.len()];
    for k in (0..=last.min(end)).map(|k| k.max(1)) {
        let parabola = LocalFit::new(near(k, end), k, 2);
        let line = LocalFit::new(near(k, end), k, 1);
        let level = LocalFit::new(around(k, pooled_level(k), end), k, 0);
        let near_level = LocalFit::new(near(k, end), k, 0);
        // What the near harmonics have beyond the level, in standard deviations: their own level, and their slope.
        let of_level = own_variance * (near_level.square() - level.square());
        let of_slope = own_variance * (line.square() - near_level.square());
        let (mut square, mut terms) = (0.0, 0.0);
        for (lines, variance) in
            [([&near_level, &level], of_level), ([&line, &near_level], of_slope)]
        {
            if variance > 1e-9 * own_variance {
                let differ = |own: &Vec<f64>| lines[0].value(own) - lines[1].value(own);
                square += beside.iter().map(|own| differ(own).powi(2)).sum::<f64>() / variance;
                terms += channels - 1.0;
            }
        }
        let weight = if square > terms { 1.0 - terms / square } else { 0.0 };
        let (level_square, line_square) = (level.square(), line.square());
        for (trend, own) in trends.iter_mut().zip(&beside) {
            let (level, line) = (level.value(own), line.value(own));
            trend.push(NoisePower {
                value: (parabola.value(&mean) + level + weight * (line - level)).exp(),
                shared_variance: shared_variance * parabola.square(),
                level_variance: share * level_square,
                colour_variance: share * weight * (line_square - level_square),
            });
        }
    }
    trends
}

/// Harmonics near `k` of 1 … `end` whose power says something about it, seven or more.
fn near(k: usize, end: usize) -> std::ops::RangeInclusive<usize> {
    around(k, pooled(k), end)
}

fn around(k: usize, reach: usize, end: usize) -> std::ops::RangeInclusive<usize> {
    let first = k.saturating_sub(reach).max(1);
    first..=(k + reach).max(first + 2 * FEWEST).min(end)
}

/// How the estimated power of one harmonic scatters.
struct Scatter {
    /// ln ν − ψ(ν).
    bias: f64,
    /// ψ'(ν).
    variance: f64,
}

impl Scatter {
    fn of(freedom: usize) -> Self {
        let nu = freedom as f64;
        Self { bias: nu.ln() - digamma(nu), variance: trigamma(freedom) }
    }

    fn logarithms(&self, power: &[f64]) -> Vec<f64> {
        power.iter().map(|p| p.ln() + self.bias).collect()
    }
}

/// A polynomial in ln harmonic, by least squares over some harmonics, at one of them.
struct LocalFit {
    first: usize,
    /// What every harmonic counts.
    weights: Vec<f64>,
}

impl LocalFit {
    /// Of `degree` 0, 1 or 2.
    fn new(harmonics: std::ops::RangeInclusive<usize>, at: usize, degree: usize) -> Self {
        let first = *harmonics.start();
        let row = |h: usize| {
            let x = (h as f64 / at as f64).ln();
            RowVector3::new(1.0, x, x * x)
        };
        let mut normal = Matrix3::identity();
        let size = degree + 1;
        normal.view_mut((0, 0), (size, size)).fill(0.0);
        for h in harmonics.clone() {
            let row = row(h);
            let mut corner = normal.view_mut((0, 0), (size, size));
            corner += row.columns(0, size).transpose() * row.columns(0, size);
        }
        // Seven or more harmonics that differ bear a parabola.
        let solution = normal.try_inverse().unwrap_or_else(Matrix3::zeros).column(0).into_owned();
        let weight = |h| (row(h).columns(0, size) * solution.rows(0, size))[(0, 0)];
        Self { first, weights: harmonics.map(weight).collect() }
    }

    fn value(&self, y: &[f64]) -> f64 {
        self.weights.iter().zip(&y[self.first..]).map(|(w, y)| w * y).sum()
    }

    /// Σ w²: the variance of the value over that of one harmonic.
    fn square(&self) -> f64 {
        self.weights.iter().map(|w| w * w).sum()
    }
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

    /// Powers of noise by channel and harmonic 0 … `last` that scatter with 2 `freedom` degrees of freedom.
    fn scattered(
        rng: &mut ChaCha8Rng,
        freedom: usize,
        truth: &[Box<dyn Fn(f64) -> f64>],
        last: usize,
    ) -> Vec<Vec<f64>> {
        let mut of = |mean: f64| {
            let square = |_| -> f64 {
                let x: f64 = StandardNormal.sample(&mut *rng);
                x * x
            };
            mean * (0..2 * freedom).map(square).sum::<f64>() / (2 * freedom) as f64
        };
        truth.iter().map(|p| (0..=last).map(|h| of(p(h.max(1) as f64))).collect()).collect()
    }

    fn variance(power: &NoisePower) -> f64 {
        power.shared_variance + power.level_variance + power.colour_variance
    }

    /// Noise of six drives of different strength, half of it white, a fifth slower than the motion: errors are as
    /// large as they are said to be, half of those of one drive alone, and nowhere is the mean off by much.
    #[test]
    fn drives_of_one_kind_say_more_together() {
        const FREEDOM: usize = 7;
        const TRIALS: usize = 400;
        const LAST: usize = 60;
        let of_drive = |level: f64| -> Box<dyn Fn(f64) -> f64> {
            Box::new(move |h| level * (0.03 + 1.0 / (1.0 + (h / 1.6).powi(2))))
        };
        let truth = [1.0, 1.0, 0.7, 0.15, 0.15, 0.15].map(of_drive);
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut sums = [[0.0; 3]; LAST + 1];
        let mut alone = 0.0;
        for _ in 0..TRIALS {
            let power = scattered(&mut rng, FREEDOM, &truth, 200);
            let trends = noise_trends(&power, FREEDOM, 0.0, LAST);
            for (h, sums) in sums.iter_mut().enumerate() {
                let found = trends[3][h];
                let error = (found.value / truth[3](h.max(1) as f64)).ln();
                sums[0] += error / TRIALS as f64;
                sums[1] += error * error / TRIALS as f64;
                sums[2] += variance(&found) / TRIALS as f64;
            }
            alone += variance(&noise_trend(&power[3], FREEDOM, 1)[1]) / TRIALS as f64;
        }
        for (h, [mean, square, claimed]) in sums.into_iter().enumerate().skip(1) {
            // The mean is known to 0.2/√400 = 0.01, of which this is four, and a parabola over ln 7 is off by 0.06 where two colours bend
            // most.
            assert!(mean.abs() < 0.1, "harmonic {h}: off by {mean}");
            // A mean square of 400 scatters by 7 %, of which this is five, but for the square of 0.06.
            let ratio = (square - 0.0036) / claimed;
            assert!(ratio < 1.35 && square / claimed > 0.65, "harmonic {h}: {square} {claimed}");
        }
        assert!(sums[1][2] < 0.5 * alone, "{} {alone}", sums[1][2]);
    }

    /// One drive whose slow noise has ten times the power that it has in the others: its level alone would miss ln 10 = 2.3.
    #[test]
    fn a_drive_of_another_colour_is_followed() {
        const FREEDOM: usize = 7;
        const TRIALS: usize = 200;
        let other: Box<dyn Fn(f64) -> f64> = Box::new(|h| if h < 5.0 { 10.0 } else { 1.0 });
        let like = || -> Box<dyn Fn(f64) -> f64> { Box::new(|_| 1.0) };
        let truth = [other, like(), like(), like(), like(), like()];
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let mut mean = 0.0;
        let mut alone = 0.0;
        for _ in 0..TRIALS {
            let power = scattered(&mut rng, FREEDOM, &truth, 200);
            let ln = |trend: &[NoisePower]| (trend[2].value / 10.0).ln() / TRIALS as f64;
            mean += ln(&noise_trends(&power, FREEDOM, 0.0, 2)[0]);
            alone += ln(&noise_trend(&power[0], FREEDOM, 2));
        }
        // A line through its own seven harmonics misses the step by as much.
        assert!((mean - alone).abs() < 0.35, "{mean} {alone}");
    }
}
