//! The matched filter: detects bumps in coloured noise.
//!
//! A bump h b(t − t₀) of unknown height and time, in noise with the power spectrum S(f), is detected best by
//!
//! c(t) = ∫ X(f) B*(f)/S(f) e^{2πift} df, N = ∫ |B(f)|²/S(f) df:
//!
//! h = c/N is the height at t, with the variance 1/N, and c²/N is twice the log-likelihood gained by the bump (D. O.
//! North 1943, reprinted in Proc. IEEE 51 (1963) 1016–1027). S is estimated from the median of the periodograms of
//! overlapping stretches, which a bump in one of them does not move, followed by its trend over frequency. This
//! estimate is off by a factor that does not depend on frequency: N carries the inverse of the factor, and
//! [`Heights::scale`] determines it from the filter's output over the whole record.

use fourier::{Complex64, Forward, Inverse, RealToComplex};
use rayon::prelude::*;

use super::error::{SignalError, checked_rate_hz, enough};
use super::noise_trend::noise_trend;
use crate::median::{median, robust_sigma};
use crate::robot::JointSignals;

/// Length of the stretches from which the noise spectrum is estimated, s. Slower noise looks the same to any bump.
const STRETCH_S: f64 = 8.0;
/// Smallest number of stretches, counted without overlap.
const STRETCHES: usize = 4;
/// Smallest length of the mirror image at each end, s (less only for records shorter than this).
const MIRROR_S: f64 = 4.0;
/// Noise power is taken to be at least this fraction of its maximum: where a sensor's own low-pass leaves almost no
/// noise, the estimate cannot be trusted.
const FLOOR: f64 = 1e-4;

/// Signals prepared for the search for bumps.
///
/// Both ends are extended by a mirror image of a few seconds, so that the step from the last sample to the first leaves
/// no trace in the record.
pub struct MatchedFilter {
    samples: usize,
    /// Samples of mirror image before the first sample.
    before: usize,
    /// Total number of samples, mirror images included.
    extended: usize,
    rate_hz: f64,
    forward: Forward,
    inverse: Inverse,
    /// 1/S of each signal at the frequencies of the extended record.
    weights: Vec<Vec<f64>>,
    /// X/S of each signal.
    weighted: Vec<Vec<Complex64>>,
}

/// Estimated height of a bump of one shape, centred at every sample.
pub struct Heights {
    /// Height of a bump centred at the sample, for each signal.
    pub height: JointSignals,
    /// N of each signal, up to the unknown factor of S.
    pub information: Vec<f64>,
    /// Degrees of freedom of [`Self::scale`] for each signal: the effective number of independent heights.
    pub freedom: Vec<f64>,
}

/// Heights are clipped at this many σ in the estimate of σ.
const CLIPPED: f64 = 2.5;
/// E min(z², [`CLIPPED`]²) of Gaussian z.
const CLIPPED_SQUARE: f64 = 0.977_558;
/// Efficiency of the clipped estimate: the variance of σ estimated from all heights over that of the clipped estimate
/// (Huber 1964, proposal 2).
const CLIPPED_EFFICIENCY: f64 = 0.963;
/// Iterations from the median's σ to the clipped one; each reduces the remaining error to a tenth.
const CLIPPED_STEPS: usize = 4;

impl Heights {
    /// Standard deviation of h √N over all samples, except for the few that hold a bump: the square root of the unknown
    /// factor of S.
    pub fn scale(&self, signal: usize) -> f64 {
        let heights = self.height.joint(signal);
        let mut sizes: Vec<f64> = heights.iter().map(|h| h.abs()).collect();
        let from_median = robust_sigma(&mut sizes);
        let sigma = (0..CLIPPED_STEPS).fold(from_median, |sigma, _| {
            let most = (CLIPPED * sigma).powi(2);
            let square: f64 = heights.iter().map(|h| (h * h).min(most)).sum();
            (square / (CLIPPED_SQUARE * heights.len() as f64)).sqrt()
        });
        sigma * self.information[signal].sqrt()
    }
}

impl MatchedFilter {
    /// Prepares `signals` without a trend, sampled at `rate_hz`.
    ///
    /// Errors: fewer than 64 samples, or a rate that is not positive and finite.
    pub fn new(signals: &JointSignals, rate_hz: f64) -> Result<Self, SignalError> {
        checked_rate_hz(rate_hz)?;
        let samples = signals.samples();
        enough("a matched filter", samples, 64)?;
        let mirror = ((MIRROR_S * rate_hz) as usize).min(samples - 1);
        let extended = fast_length(samples + 2 * mirror);
        let mut filter = Self {
            samples,
            before: mirror,
            extended,
            rate_hz,
            forward: fourier::forward(extended),
            inverse: fourier::inverse(extended),
            weights: Vec::new(),
            weighted: Vec::new(),
        };
        let stretch = ((STRETCH_S * rate_hz) as usize).clamp(8, samples / STRETCHES);
        let plan = fourier::forward(stretch);
        let of_joint = |j: usize| {
            let signal = signals.joint(j);
            let mut power = median_power(signal, &*plan);
            let largest = power.iter().copied().fold(0.0, f64::max);
            // For a signal without noise any spectrum will do.
            let least = if largest > 0.0 { FLOOR * largest } else { 1.0 };
            power.iter_mut().for_each(|p| *p = p.max(least));
            // A factor common to all frequencies does not matter here.
            let trend = noise_trend(&power, 1, power.len() - 1);
            let logarithms: Vec<f64> = trend.iter().map(|p| p.value.ln()).collect();
            let mut spectrum = filter.spectrum(filter.with_mirrors(signal));
            let last = logarithms.len() - 1;
            let weights: Vec<f64> = (0..spectrum.len())
                .map(|k| {
                    let at = (k * stretch) as f64 / extended as f64;
                    let left = (at.floor() as usize).min(last - 1);
                    let u = (at - left as f64).min(1.0);
                    (-(1.0 - u) * logarithms[left] - u * logarithms[left + 1]).exp()
                })
                .collect();
            spectrum.iter_mut().zip(&weights).for_each(|(x, w)| *x *= w);
            (weights, spectrum)
        };
        let of_joints: Vec<_> = (0..signals.joints()).into_par_iter().map(of_joint).collect();
        (filter.weights, filter.weighted) = of_joints.into_iter().unzip();
        Ok(filter)
    }

    /// Sampling rate, Hz.
    pub fn rate_hz(&self) -> f64 {
        self.rate_hz
    }

    /// Heights of the bump b(t) in every signal; b must be even in t (s) and zero far from t = 0.
    pub fn heights(&self, bump: impl Fn(f64) -> f64) -> Heights {
        let n = self.extended;
        let of_sample = |k: usize| bump(k.min(n - k) as f64 / self.rate_hz);
        let shape = self.spectrum((0..n).map(of_sample).collect());
        let mut height = JointSignals::zeros(self.weighted.len(), self.samples);
        let mut everywhere = self.inverse.make_output_vec();
        let mut information = Vec::with_capacity(self.weighted.len());
        let mut freedom = Vec::with_capacity(self.weighted.len());
        let inside = CLIPPED_EFFICIENCY * self.samples as f64 / n as f64;
        for (j, (weighted, weights)) in self.weighted.iter().zip(&self.weights).enumerate() {
            // Sums of the information over frequency, and of its square.
            let (mut total, mut squares) = (0.0, 0.0);
            for (k, (b, w)) in shape.iter().zip(weights).enumerate() {
                let is_single = k == 0 || 2 * k == n;
                let (power, count) = (b.norm_sqr() * w, if is_single { 1.0 } else { 2.0 });
                total += count * power;
                squares += count * power * power;
            }
            let mut product: Vec<Complex64> =
                weighted.iter().zip(&shape).map(|(x, b)| x * b.conj() / total).collect();
            // Rounding leaves imaginary parts at the two ends, where the spectrum of a real signal is real.
            product[0].im = 0.0;
            if n.is_multiple_of(2) {
                product[n / 2].im = 0.0;
            }
            self.inverse
                .process(&mut product, &mut everywhere)
                .expect("all buffers are of the plan's length");
            height.joint_mut(j).copy_from_slice(&everywhere[self.before..][..self.samples]);
            information.push(total);
            freedom.push(inside * total * total / squares);
        }
        Heights { height, information, freedom }
    }

    /// `signal` extended by its mirror images.
    fn with_mirrors(&self, signal: &[f64]) -> Vec<f64> {
        let last = (self.samples - 1) as isize;
        (0..self.extended)
            .map(|k| {
                let mut at = (k as isize - self.before as isize).abs();
                if at > last {
                    at = (2 * last - at).max(0);
                }
                signal[at as usize]
            })
            .collect()
    }

    fn spectrum(&self, mut values: Vec<f64>) -> Vec<Complex64> {
        let mut out = self.forward.make_output_vec();
        self.forward.process(&mut values, &mut out).expect("all buffers are of the plan's length");
        out
    }
}

/// The smallest length from `least` on with a fast transform: 2ᵃ 3ᵇ 5ᶜ.
fn fast_length(least: usize) -> usize {
    let is_fast = |length: &usize| {
        let mut rest = *length;
        for factor in [2, 3, 5] {
            while rest.is_multiple_of(factor) {
                rest /= factor;
            }
        }
        rest == 1
    };
    (least..).find(is_fast).unwrap_or(least)
}

/// Median of |spectrum|² over half-overlapping stretches with a Hann window, at each frequency.
fn median_power(signal: &[f64], plan: &dyn RealToComplex<f64>) -> Vec<f64> {
    let length = plan.len();
    let mut spectra: Vec<Vec<f64>> = Vec::new();
    for part in signal.windows(length).step_by(length / 2) {
        let phase = |k: usize| std::f64::consts::PI * (k as f64 + 0.5) / length as f64;
        let mut values: Vec<f64> =
            part.iter().enumerate().map(|(k, x)| x * phase(k).sin().powi(2)).collect();
        let mut out = plan.make_output_vec();
        plan.process(&mut values, &mut out).expect("all buffers are of the plan's length");
        spectra.push(out.iter().map(Complex64::norm_sqr).collect());
    }
    let bins = plan.make_output_vec().len();
    let of_bin = |k: usize| {
        let mut powers: Vec<f64> = spectra.iter().map(|s| s[k]).collect();
        median(&mut powers).unwrap_or(0.0)
    };
    (0..bins).map(of_bin).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{SeedableRng, rngs::ChaCha8Rng};
    use rand_distr::{Distribution, StandardNormal};

    const RATE_HZ: f64 = 100.0;

    fn bump(t: f64) -> f64 {
        (1.0 - (t / 0.5).powi(2)).max(0.0)
    }

    /// AR(1) noise, τ = 1 s and σ = 1, beside white noise of σ = 0.2.
    fn noise(seed: u64, samples: usize) -> Vec<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let a = (-1.0 / RATE_HZ).exp();
        let mut slow = normal();
        (0..samples)
            .map(|_| {
                slow = a * slow + (1.0 - a * a).sqrt() * normal();
                slow + 0.2 * normal()
            })
            .collect()
    }

    #[test]
    fn without_noise_the_height_is_that_of_the_bump() {
        let mut signals = JointSignals::zeros(1, 2001);
        let centre = 700;
        for (k, y) in signals.joint_mut(0).iter_mut().enumerate() {
            *y = 3.0 * bump((k as f64 - centre as f64) / RATE_HZ);
        }
        let filter = MatchedFilter::new(&signals, RATE_HZ).unwrap();
        let heights = filter.heights(bump);
        // Exact for any weights: the bump itself is in the record.
        assert!((heights.height.joint(0)[centre] - 3.0).abs() < 1e-9);
    }

    #[test]
    fn slow_noise_hides_a_bump_less_than_from_a_low_pass_and_height_has_the_stated_scatter() {
        const LOGS: usize = 40;
        let (mut square, mut stated) = (0.0, 0.0);
        for seed in 0..LOGS {
            let samples = 8000;
            let mut signals = JointSignals::zeros(1, samples);
            signals.joint_mut(0).copy_from_slice(&noise(seed as u64, samples));
            let centre = 3000;
            for (k, y) in signals.joint_mut(0).iter_mut().enumerate() {
                *y += 1.5 * bump((k as f64 - centre as f64) / RATE_HZ);
            }
            let heights = MatchedFilter::new(&signals, RATE_HZ).unwrap().heights(bump);
            square += (heights.height.joint(0)[centre] - 1.5).powi(2) / LOGS as f64;
            stated += heights.scale(0).powi(2) / heights.information[0] / LOGS as f64;
        }
        // χ²₄₀/40 scatters by 0.22, the stated variance by less: a factor of 2.5 is four σ away.
        assert!((square / stated).ln().abs() < 2.5f64.ln(), "{square} {stated}");
        // A mean over half a second keeps 0.92 of the slow noise.
        assert!(stated.sqrt() < 0.7, "{stated}");
    }

    /// [`Heights::scale`] scatters between logs as its degrees of freedom say, 1/√(2ν), for short and for long bumps;
    /// and a bump of a hundred σ hardly moves it.
    #[test]
    fn scale_is_known_as_well_as_it_says() {
        const LOGS: usize = 100;
        for length_s in [0.2, 2.0] {
            let bump = |t: f64| (1.0 - (2.0 * t / length_s).powi(2)).max(0.0);
            let heights = |seed: usize, nm: f64| {
                let mut signals = JointSignals::zeros(1, 8000);
                signals.joint_mut(0).copy_from_slice(&noise(seed as u64, 8000));
                let hit = signals.joint_mut(0).iter_mut().enumerate();
                hit.for_each(|(k, y)| *y += nm * bump((k as f64 - 3000.0) / RATE_HZ));
                MatchedFilter::new(&signals, RATE_HZ).unwrap().heights(bump)
            };
            let all: Vec<Heights> = (0..LOGS).map(|seed| heights(seed, 0.0)).collect();
            let logs = LOGS as f64;
            let freedom = all.iter().map(|h| h.freedom[0]).sum::<f64>() / logs;
            let scales: Vec<f64> = all.iter().map(|h| h.scale(0).ln()).collect();
            let mean = scales.iter().sum::<f64>() / logs;
            let variance = scales.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / logs;
            // The variance of 100 logs scatters by √(2/99) = 14 %: four of these.
            let ratio = variance * 2.0 * freedom;
            assert!((ratio - 1.0).abs() < 0.57, "{length_s} s: {ratio}");
            let hit = heights(0, 20.0).scale(0).ln() - scales[0];
            assert!(hit.abs() < 2.0 / freedom.sqrt(), "{length_s} s: {hit}");
        }
    }
}
