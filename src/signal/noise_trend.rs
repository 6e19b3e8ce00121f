//! Estimates the power of noise over frequency, smoothed so that the scatter of single harmonics is removed.

use nalgebra::{Matrix3, RowVector3};
use statrs::function::gamma::digamma;

/// Power of noise at one harmonic.
#[derive(Debug, Clone, Copy)]
pub struct NoisePower {
    /// Mean square of one period's Fourier coefficient, Nm².
    pub value: f64,
    /// Relative variance of the estimate: the part shared by all channels.
    pub shared_variance: f64,
    /// Relative variance of the part specific to the channel, apart from its level, which is the mean of ln power over
    /// nearby harmonics.
    pub colour_variance: f64,
}

/// Number of harmonics on each side of harmonic k whose power enters the estimate at k: max(3, k/4).
pub fn pooled(k: usize) -> usize {
    (k / 4).max(FEWEST)
}

/// Number of harmonics on each side of harmonic k that determine how far the noise of one channel lies above that of
/// all channels: max(12, k/4).
pub fn pooled_level(k: usize) -> usize {
    pooled(k).max(LEVEL)
}

/// Smallest number of harmonics on each side. With fewer, a few periods determine the noise at the slowest harmonics
/// poorly; with more, a straight line misses the curvature of noise of two colours there.
const FEWEST: usize = 3;
/// The same for the level of one channel. The noise of a channel differs from that of the others mostly in strength and
/// hardly in colour, so many harmonics may be averaged.
const LEVEL: usize = 12;
/// Prior probability that the noise of a channel has another colour than that of the others.
const OTHER_COLOUR: f64 = 0.2;
/// Variance of such a colour relative to that of its estimate.
const SPREAD: f64 = 10.0;
/// Standard deviation of ln power at one harmonic by which colours of the same kind differ.
const ALIKE: f64 = 0.2;
/// Square of the harmonic below which power is taken to flatten, for the extrapolation to the mean (harmonic 0) from
/// its neighbours. For the mean over eight periods, straight lines then estimate 1.17 times the true power if the noise
/// has a time constant of 0.03 periods, 0.97 times at 0.1 periods, and a third at 0.3 periods. Parabolas would give
/// 0.94, 0.95 and a half, with 2.7 times the scatter.
const FLAT_BELOW: f64 = 2.25;

/// Smooths the power of noise at the harmonics 0 … `last`.
///
/// For every harmonic k except the mean, a straight line of ln power over ln harmonic is fitted to the harmonics k ±
/// max(3, k/4), which are at least seven. `freedom` is the number of complex degrees of freedom of one harmonic.
///
/// The mean (harmonic 0) is extrapolated from its seven neighbours, in ln √(h² + 2.25): the power of noise slower than
/// a few harmonics still rises from the first of them to the mean. The power observed at the mean itself is not used,
/// because means drift and have half the degrees of freedom.
pub fn noise_trend(power: &[f64], freedom: usize, last: usize) -> Vec<NoisePower> {
    let end = power.len() - 1;
    let noise = LogScatter::of(2 * freedom);
    let logarithms = noise.logarithms(power);
    let at = |k: usize| {
        let fit = LocalFit::new(near(k, end), k, 1);
        NoisePower {
            value: fit.value(&logarithms).exp(),
            shared_variance: 0.0,
            colour_variance: noise.variance * fit.square(),
        }
    };
    (0..=last.min(end)).map(at).collect()
}

/// [`noise_trend`] for J channels of equal length whose noise is of one kind, such as that of an arm's drives.
///
/// `likeness` is the mean squared coherence between the channels by harmonic. Where it is `None`, the worst case is
/// assumed: channels count as independent for their specific parts, and as fully coherent for the shared part.
///
/// The mean of the ln powers is up to J times as well known as that of one channel. It is fitted by parabolas over the
/// same harmonics, because straight lines miss noise of two colours by a tenth at the slowest harmonics; only for
/// harmonic 0 by straight lines. The difference of a channel from this mean consists of a level, the average over the
/// harmonics k ± max(12, k/4), and a colour, the remainder. Colours differ by a standard deviation of 0.2 or, with the
/// probability of a fifth, by more.
pub fn noise_trends(
    power: &[Vec<f64>],
    freedom: usize,
    likeness: &[Option<f64>],
    last: usize,
) -> Vec<Vec<NoisePower>> {
    let channels = power.len() as f64;
    let Some(end) = power.first().map(|p| p.len() - 1) else { return Vec::new() };
    if power.len() == 1 {
        return vec![noise_trend(&power[0], freedom, last)];
    }
    let noise = LogScatter::of(2 * freedom);
    let mut beside: Vec<Vec<f64>> = power.iter().map(|p| noise.logarithms(p)).collect();
    let mean: Vec<f64> =
        (0..=end).map(|h| beside.iter().map(|own| own[h]).sum::<f64>() / channels).collect();
    beside.iter_mut().for_each(|own| own.iter_mut().zip(&mean).for_each(|(own, m)| *own -= m));

    let mut trends = vec![Vec::with_capacity(last + 1); power.len()];
    for k in 0..=last.min(end) {
        let likeness = likeness[k.min(likeness.len() - 1)];
        let shared = (1.0 + (channels - 1.0) * likeness.unwrap_or(1.0)) / channels;
        // The deviations from the mean sum to zero.
        let own = (1.0 - likeness.unwrap_or(0.0)) * (1.0 - 1.0 / channels);
        // At harmonic 0 a parabola would reduce the error from curvature, but increase the scatter by more.
        let fit = LocalFit::new(near(k, end), k, if k == 0 { 1 } else { 2 });
        let fits = ColourFits::new(k, end, own * noise.variance);
        for (trend, own) in trends.iter_mut().zip(&beside) {
            let colour = fits.colour(own);
            trend.push(NoisePower {
                value: (fit.value(&mean) + fits.level.value(own) + colour.value).exp(),
                shared_variance: shared * noise.variance * fit.square(),
                colour_variance: colour.variance,
            });
        }
    }
    trends
}

/// The colour of a channel at one harmonic: the difference of its ln power from the channel's level.
struct Colour {
    value: f64,
    variance: f64,
}

/// The fits for the colours at one harmonic: lines and levels over nearby harmonics.
struct ColourFits {
    level: LocalFit,
    near_level: LocalFit,
    line: LocalFit,
    /// Variance of ln power at a single harmonic.
    variance: f64,
}

impl ColourFits {
    fn new(k: usize, end: usize, variance: f64) -> Self {
        Self {
            level: LocalFit::new(around(k, pooled_level(k), end), k, 0),
            near_level: LocalFit::new(near(k, end), k, 0),
            line: LocalFit::new(near(k, end), k, 1),
            variance,
        }
    }

    /// Posterior mean and variance of the colour of a channel; `own` is its ln power relative to the mean of all
    /// channels.
    ///
    /// Under the first hypothesis the channel's noise is of the same kind as that of the others, and its colour has the
    /// standard deviation [`ALIKE`]. Under the second, with prior probability [`OTHER_COLOUR`], it is of another kind,
    /// and the variance is [`SPREAD`] times that of its estimate, in level and slope over the near harmonics (a spike
    /// and a slab; Mitchell and Beauchamp 1988). With χ² of these two in units of their variance, the posterior odds of
    /// the first hypothesis are (1 + g)^(m/2) exp(−χ² g/(2 (1 + g))) times the prior odds, where g is [`SPREAD`] and m
    /// the number of the two quantities that can differ at all. The result is the mean over both hypotheses, and the
    /// variance includes the distance between their posterior means.
    fn colour(&self, own: &[f64]) -> Colour {
        let Self { level, near_level, line, variance } = self;
        let (mut square, mut terms) = (0.0, 0.0);
        for (of, beside) in [(near_level, level), (line, near_level)] {
            let variance = variance * (of.square() - beside.square());
            if variance > 1e-9 {
                square += (of.value(own) - beside.value(own)).powi(2) / variance;
                terms += 1.0;
            }
        }
        let odds_before = (1.0 - OTHER_COLOUR) / OTHER_COLOUR;
        let kept = SPREAD / (1.0 + SPREAD);
        let odds = odds_before * (1.0 + SPREAD).powf(0.5 * terms) * (-0.5 * square * kept).exp();
        let other = 1.0 / (1.0 + odds);
        let found = line.value(own) - level.value(own);
        let variance = variance * (line.square() - level.square()).max(0.0);
        let kept_alike = ALIKE * ALIKE / (ALIKE * ALIKE + variance);
        let mean = other * kept + (1.0 - other) * kept_alike;
        let apart = other * (1.0 - other) * (kept - kept_alike).powi(2);
        Colour { value: mean * found, variance: mean * variance + apart * found * found }
    }
}

/// Harmonics of 1 … `end` near `k` that enter the estimate at k: seven or more, except close to `end`.
fn near(k: usize, end: usize) -> std::ops::RangeInclusive<usize> {
    around(k, pooled(k), end)
}

fn around(k: usize, reach: usize, end: usize) -> std::ops::RangeInclusive<usize> {
    let first = k.saturating_sub(reach).max(1);
    first..=(k + reach).max(first + 2 * FEWEST).min(end)
}

/// Bias and variance of the logarithm of an estimated power.
pub struct LogScatter {
    /// Bias to add, ln (ν/2) − ψ(ν/2): the logarithm is too low by this on average.
    bias: f64,
    /// Variance of the logarithm, ψ'(ν/2).
    pub variance: f64,
}

impl LogScatter {
    /// For a mean square of ν = `freedom` real numbers.
    pub fn of(freedom: usize) -> Self {
        let half = 0.5 * freedom as f64;
        Self { bias: half.ln() - digamma(half), variance: trigamma_of_half(freedom) }
    }

    /// The logarithm of a power, corrected for its bias.
    pub fn logarithm(&self, power: f64) -> f64 {
        power.ln() + self.bias
    }

    fn logarithms(&self, power: &[f64]) -> Vec<f64> {
        power.iter().map(|p| self.logarithm(*p)).collect()
    }
}

/// A least-squares polynomial in ln harmonic over a range of harmonics, evaluated at one harmonic or at the mean
/// (harmonic 0).
struct LocalFit {
    first: usize,
    /// Weight of every harmonic in the value.
    weights: Vec<f64>,
}

impl LocalFit {
    /// Fits a polynomial of `degree` 0, 1 or 2 over `harmonics`, evaluated at the harmonic `at`.
    fn new(harmonics: std::ops::RangeInclusive<usize>, at: usize, degree: usize) -> Self {
        let first = *harmonics.start();
        let row = |h: usize| {
            let x = match at {
                0 => 0.5 * ((h * h) as f64 / FLAT_BELOW).ln_1p(),
                _ => (h as f64 / at as f64).ln(),
            };
            RowVector3::new(1.0, x, x * x)
        };
        let mut normal = Matrix3::identity();
        // A small number of harmonics limits the degree.
        let size = (degree + 1).min(harmonics.clone().count());
        normal.view_mut((0, 0), (size, size)).fill(0.0);
        for h in harmonics.clone() {
            let row = row(h);
            let mut corner = normal.view_mut((0, 0), (size, size));
            corner += row.columns(0, size).transpose() * row.columns(0, size);
        }
        let solution = normal.try_inverse().unwrap_or_else(Matrix3::zeros).column(0).into_owned();
        let weight = |h| (row(h).columns(0, size) * solution.rows(0, size))[(0, 0)];
        Self { first, weights: harmonics.map(weight).collect() }
    }

    fn value(&self, y: &[f64]) -> f64 {
        self.weights.iter().zip(&y[self.first..]).map(|(w, y)| w * y).sum()
    }

    /// Σ w²: the variance of the value relative to that of one harmonic.
    fn square(&self) -> f64 {
        self.weights.iter().map(|w| w * w).sum()
    }
}

/// ψ'(ν/2): π²/6 − Σ 1/i² over i < ν/2 for even ν; π²/2 − 4 Σ 1/i² over odd i < ν for odd ν.
fn trigamma_of_half(nu: usize) -> f64 {
    let square = std::f64::consts::PI.powi(2);
    let below = |i: usize| 1.0 / (i * i) as f64;
    if nu.is_multiple_of(2) {
        square / 6.0 - (1..nu / 2).map(below).sum::<f64>()
    } else {
        0.5 * square - 4.0 * (1..nu).step_by(2).map(below).sum::<f64>()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{SeedableRng, rngs::ChaCha8Rng};
    use rand_distr::{Distribution, StandardNormal};
    use statrs::distribution::{ContinuousCDF, Normal, StudentsT};

    /// Power that falls as 1/h² is estimated without a bend at its steep beginning.
    #[test]
    fn steep_noise_keeps_its_slope() {
        const TRIALS: usize = 200;
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut mean = [0.0; 40];
        for _ in 0..TRIALS {
            let power = scattered(&mut rng, FREEDOM, &[Box::new(|h| h.powi(-2))], 199).remove(0);
            let found = noise_trend(&power, FREEDOM, 39);
            // At the mean this power is infinite.
            for (k, (mean, found)) in mean.iter_mut().zip(found).enumerate().skip(1) {
                *mean += (found.value * (k as f64).powi(2)).ln() / TRIALS as f64;
            }
        }
        // ln of χ²₁₄/14 has the variance ψ'(7) = 0.154; the line through seven points ends with 0.67 of
        // it at most: σ of the mean of 200 is 0.023. Six σ of forty fail in one of 10⁷ seeds.
        for (k, mean) in mean.iter().enumerate().skip(1) {
            assert!(mean.abs() < 0.15, "harmonic {k}: off by {mean:.3}");
        }
    }

    /// Exact prediction of the mean from the scatter of eight periods at harmonics 1 to 7, computed from the
    /// autocovariance of noise that is half white; the other half has a time constant of `forgets` periods. See
    /// [`FLAT_BELOW`].
    #[test]
    fn slow_noise_rises_to_the_mean() {
        const N: usize = 500;
        const PERIODS: usize = 8;
        for (forgets, [least, most]) in
            [(0.03, [0.83, 0.89]), (0.1, [1.0, 1.06]), (0.3, [2.9, 3.3])]
        {
            let autocovariance = |lag: usize| {
                let white = if lag == 0 { 0.5 } else { 0.0 };
                white + 0.5 * (-(lag as f64) / (forgets * N as f64)).exp()
            };
            // Covariance between the coefficients of two periods that are `apart` periods apart.
            let covariance = |h: usize, apart: usize| -> f64 {
                let term = |lag: i64| {
                    let angle = std::f64::consts::TAU * (h as i64 * lag) as f64 / N as f64;
                    let apart = ((apart * N) as i64 + lag).unsigned_abs() as usize;
                    (N as i64 - lag.abs()) as f64 * autocovariance(apart) * angle.cos()
                };
                (1 - N as i64..N as i64).map(term).sum::<f64>() / N as f64
            };
            let of_mean = |h: usize| {
                let pairs = (0..PERIODS * PERIODS).map(|i| (i / PERIODS).abs_diff(i % PERIODS));
                pairs.map(|apart| covariance(h, apart)).sum::<f64>() / PERIODS as f64
            };
            let scatter =
                |h: usize| (PERIODS as f64 * covariance(h, 0) - of_mean(h)) / (PERIODS - 1) as f64;
            let power: Vec<f64> = (0..=7).map(scatter).collect();
            // With this many degrees of freedom the logarithms are unbiased.
            let found = &noise_trends(&[power.clone(), power], 1_000_000, &[Some(0.0)], 0)[0];
            let missed = of_mean(0) / found[0].value;
            assert!((least..most).contains(&missed), "{forgets}: {missed}");
        }
    }

    /// Powers of noise by channel and harmonic 0 … `last`, with a scatter of 2 `freedom` degrees of freedom.
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
        truth.iter().map(|p| (0..=last).map(|h| of(p(h as f64))).collect()).collect()
    }

    const FREEDOM: usize = 7;
    const TRIALS: usize = 400;
    /// Number of harmonics whose trend is tested, and number that exist.
    const LAST: usize = 24;
    const ALL: usize = 60;

    /// Significance level at which noise is taken for something else.
    const RARE: f64 = 1e-4;

    /// For every harmonic from 0 on: mean and mean square of the errors of ln power of `joint`, after its level is
    /// matched to the scatter over the near harmonics; the variance that is claimed; and the rate of false alarms
    /// relative to `RARE`.
    fn errors(truth: &[Box<dyn Fn(f64) -> f64>], joint: usize, together: bool) -> Vec<[f64; 4]> {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut sums = vec![[0.0; 4]; LAST];
        let likeness = [Some(0.0); ALL + 1];
        for _ in 0..TRIALS {
            let power = scattered(&mut rng, FREEDOM, truth, ALL);
            let found = match together {
                true => noise_trends(&power, FREEDOM, &likeness, 2 * LAST).swap_remove(joint),
                false => noise_trend(&power[joint], FREEDOM, 2 * LAST),
            };
            let error: Vec<f64> =
                (0..=2 * LAST).map(|h| (found[h].value / truth[joint](h as f64)).ln()).collect();
            let ratio = |h: usize| power[joint][h] / found[h].value;
            for (h, sums) in sums.iter_mut().enumerate() {
                let near = around(h, pooled_level(h), 2 * LAST);
                let count = near.clone().count() as f64;
                let level = (near.map(ratio).sum::<f64>() / count).ln();
                let error = error[h] + level;
                let claimed = found[h].shared_variance
                    + found[h].colour_variance
                    + 1.0 / (count * FREEDOM as f64);
                // F(1, ν) is the square of Student's t.
                let limit =
                    StudentsT::new(0.0, 1.0, 2.0 / claimed).unwrap().inverse_cdf(0.5 * RARE);
                let chance = 2.0 * Normal::standard().cdf(limit * (0.5 * error).exp());
                let terms = [error, error * error, claimed, chance / RARE];
                sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term / TRIALS as f64);
            }
        }
        sums
    }

    fn of_two_colours(level: f64) -> Box<dyn Fn(f64) -> f64> {
        Box::new(move |h| level * (0.03 + 1.0 / (1.0 + (h / 1.6).powi(2))))
    }

    /// Noise of six drives of different strength, half of it white, a fifth slower than the motion: no error exceeds
    /// its claim, and at the slowest harmonic the mean square error is less than 0.6 of that of one drive alone.
    #[test]
    fn drives_of_one_kind_say_more_together() {
        let truth = [1.0, 1.0, 0.7, 0.15, 0.15, 0.15].map(of_two_colours);
        let together = errors(&truth, 3, true);
        for (h, [mean, square, claimed, false_alarms]) in together.iter().enumerate() {
            // Half a standard deviation is known to 0.2/√400 = 0.01; it is a bias that arises where noise of two
            // colours bends more than a parabola.
            assert!(mean.abs() < 0.5 * claimed.sqrt(), "harmonic {h}: off by {mean}");
            // A mean square of 400 values scatters by 7 %; the limit is three and a half times that.
            assert!(square / claimed < 1.25, "harmonic {h}: {square} {claimed}");
            // A probability of 10⁻⁴ changes by about e^{7 error}: its mean over 400 trials scatters by 15 %; the limit
            // is twice that.
            assert!(*false_alarms < 1.3, "harmonic {h}: {false_alarms}");
        }
        let alone = errors(&truth, 3, false);
        assert!(together[1][1] < 0.6 * alone[1][1], "{} {}", together[1][1], alone[1][1]);
    }

    /// One drive has `factor` times the slow noise power of the others; its level alone would miss that by up to ln
    /// 10 = 2.3. False alarms, on that drive and on another one, are at most three times as frequent as stated.
    #[test]
    fn a_drive_of_another_colour_is_followed() {
        for factor in [1.5, 2.0, 4.0, 10.0] {
            let other: Box<dyn Fn(f64) -> f64> =
                Box::new(move |h| 1.0 + (factor - 1.0) / (1.0 + (h / 3.0).powi(2)));
            let like = || -> Box<dyn Fn(f64) -> f64> { Box::new(|_| 1.0) };
            let truth = [other, like(), like(), like(), like(), like()];
            for joint in [0, 1] {
                for (h, [.., false_alarms]) in errors(&truth, joint, true).into_iter().enumerate() {
                    assert!(false_alarms < 3.0, "{factor} on {joint} at {h}: {false_alarms}");
                }
            }
        }
    }

    /// With fewer harmonics or channels than a parabola and a line over seven need, or a channel without noise, all
    /// results remain finite numbers.
    #[test]
    fn short_records_and_still_channels_leave_numbers() {
        for (channels, end) in [(1, 1), (2, 2), (3, 4), (6, 9)] {
            let power: Vec<Vec<f64>> =
                (0..channels).map(|j| vec![if j == 0 { 1e-12 } else { 2.0 }; end + 1]).collect();
            let trends = noise_trends(&power, 2, &[None], end);
            for power in trends.iter().flatten() {
                assert!(power.value > 0.0 && power.value.is_finite(), "{channels} {end} {power:?}");
                assert!(power.shared_variance >= 0.0 && power.colour_variance >= 0.0, "{power:?}");
            }
        }
    }
}
