//! Noise of the torque readings: its colour in time and its correlation across the joints.

use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};

use super::error::PlantError;
use crate::random::{Channel, TrialStreams};
use crate::robot::JointSignals;

/// Colour of one noise component, that is, its correlation in time. All processes are stationary with unit variance.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Colour {
    /// Independent from sample to sample.
    White,
    /// First-order autoregression: autocorrelation exp(−|t|/T).
    Ar1 {
        /// Time constant T, s.
        time_constant_s: f64,
    },
    /// White noise through a causal second-order Butterworth low-pass.
    LowPass {
        /// Cut-off frequency (−3 dB), Hz.
        cutoff_hz: f64,
    },
}

/// One component of the noise: its share of the variance and its colour.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Component {
    /// Share of the variance, 0…1.
    pub share: f64,
    /// Colour of the component.
    pub colour: Colour,
}

/// Noise of the torque channels: e_j = s_j Σ_c √share_c (√(1−ρ) own_jc + √ρ shared_c), where own_jc and shared_c are
/// independent unit-variance processes of colour c. The noise of joint j has the standard deviation s_j, and the
/// correlation between any two joints at the same instant is ρ.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoiseModel {
    /// Components; their shares sum to 1.
    pub components: Vec<Component>,
    /// Correlation ρ between the joints, 0 ≤ ρ < 1.
    #[serde(default)]
    pub cross_joint_correlation: f64,
}

impl Default for NoiseModel {
    fn default() -> Self {
        Self::white()
    }
}

impl NoiseModel {
    /// White noise, independent in time and across the joints.
    pub fn white() -> Self {
        let components = vec![Component { share: 1.0, colour: Colour::White }];
        Self { components, cross_joint_correlation: 0.0 }
    }

    /// The colour of the residuals of a real arm of the same family, as seen in the public UR10e logs: half of the
    /// variance is white, 30 % has a time constant of 20 ms and 20 % one of 1 s; the correlation between joints is 0.3.
    pub fn real_arm() -> Self {
        let part = |share, colour| Component { share, colour };
        Self {
            components: vec![
                part(0.5, Colour::White),
                part(0.3, Colour::Ar1 { time_constant_s: 0.02 }),
                part(0.2, Colour::Ar1 { time_constant_s: 1.0 }),
            ],
            cross_joint_correlation: 0.3,
        }
    }

    /// Checks shares, time constants, cut-off frequencies (below half of `rate_hz`) and ρ.
    pub fn validate(&self, rate_hz: f64) -> Result<(), PlantError> {
        let check = |ok: bool, key, value, requirement| {
            if ok { Ok(()) } else { Err(PlantError::Setting { key, value, requirement }) }
        };
        for Component { share, colour } in &self.components {
            check(*share >= 0.0, "torque_noise share", *share, "must not be negative")?;
            match *colour {
                Colour::White => {}
                Colour::Ar1 { time_constant_s: t } => {
                    let ok = t > 0.0 && t.is_finite();
                    check(ok, "torque_noise time_constant_s", t, "must be positive")?;
                }
                Colour::LowPass { cutoff_hz: f } => {
                    let key = "torque_noise cutoff_hz";
                    let requirement =
                        "must be at least 0.00125: slower noise takes more than an hour to change";
                    check(f >= FORGOTTEN / LONGEST_S, key, f, requirement)?;
                    check(f < 0.5 * rate_hz, key, f, "must be below half of the log's rate")?;
                }
            }
        }
        let sum: f64 = self.components.iter().map(|c| c.share).sum();
        let count_fits = self.components.len() <= usize::from(u8::MAX);
        check(count_fits && (sum - 1.0).abs() < 1e-9, "torque_noise shares", sum, "must sum to 1")?;
        let rho = self.cross_joint_correlation;
        let ok = (0.0..1.0).contains(&rho);
        check(ok, "torque_noise cross_joint_correlation", rho, "must be 0 or more and below 1")
    }

    /// Autocorrelation at lags 0, 1, …, `lags` − 1 samples of `1/rate_hz`.
    pub(super) fn autocorrelation(&self, rate_hz: f64, lags: usize) -> Vec<f64> {
        let mut sum = vec![0.0; lags];
        for Component { share, colour } in &self.components {
            for (k, sum) in sum.iter_mut().enumerate() {
                *sum += share
                    * match *colour {
                        Colour::White => f64::from(u8::from(k == 0)),
                        Colour::Ar1 { time_constant_s } => {
                            (-(k as f64) / (rate_hz * time_constant_s)).exp()
                        }
                        Colour::LowPass { .. } => 0.0,
                    };
            }
            if let Colour::LowPass { cutoff_hz } = *colour {
                let filter = Butterworth2::new(cutoff_hz / rate_hz);
                let correlation = filter.autocorrelation(run_in_samples(cutoff_hz, rate_hz), lags);
                for (sum, r) in sum.iter_mut().zip(correlation) {
                    *sum += share * r;
                }
            }
        }
        sum
    }

    /// Power spectrum, as a function of the frequency in Hz, of noise sampled at `rate_hz`, relative to white noise of
    /// the same variance. It is |H(e^{iω})|² of the filter that shapes the noise, and its mean over all frequencies is
    /// 1.
    pub fn spectrum(&self, rate_hz: f64) -> impl Fn(f64) -> f64 + use<> {
        let part = |c: &Component| (c.share, Spectrum::new(c.colour, rate_hz));
        let parts: Vec<(f64, Spectrum)> = self.components.iter().map(part).collect();
        move |frequency_hz: f64| {
            let omega = std::f64::consts::TAU * frequency_hz / rate_hz;
            parts.iter().map(|(share, part)| share * part.power(omega)).sum::<f64>()
        }
    }

    /// Adds the noise of one trial to `signals`, which are sampled at `rate_hz`, with standard deviation `sd[j]` at
    /// joint j. `shared` is working memory.
    pub(super) fn add_to(
        &self,
        streams: &TrialStreams,
        rate_hz: f64,
        sd: &[f64],
        shared: &mut Vec<f64>,
        signals: &mut JointSignals,
    ) {
        let rho = self.cross_joint_correlation;
        for (component, part) in (0..=u8::MAX).zip(&self.components) {
            shared.clear();
            if rho > 0.0 {
                let mut rng = streams.stream(Channel::TorqueShared { component }, 0);
                let mut process = Process::new(part.colour, rate_hz, &mut rng);
                shared.extend((0..signals.samples()).map(|_| process.next(&mut rng)));
            }
            for (j, &sd) in sd.iter().enumerate() {
                let mut rng = streams.stream(Channel::Torque { component }, j);
                let mut process = Process::new(part.colour, rate_hz, &mut rng);
                let scale = sd * part.share.sqrt();
                let (own, common) = (scale * (1.0 - rho).sqrt(), scale * rho.sqrt());
                let series = signals.joint_mut(j);
                for value in series.iter_mut() {
                    *value += own * process.next(&mut rng);
                }
                for (value, shared) in series.iter_mut().zip(&*shared) {
                    *value += common * shared;
                }
            }
        }
    }
}

/// Power spectrum of one colour; the terms that do not depend on frequency are computed once.
#[derive(Debug, Clone, Copy)]
enum Spectrum {
    White,
    Ar1 {
        phi: f64,
    },
    LowPass {
        /// tan(π f_c / f_s).
        corner: f64,
        energy: f64,
    },
}

impl Spectrum {
    fn new(colour: Colour, rate_hz: f64) -> Self {
        match colour {
            Colour::White => Self::White,
            Colour::Ar1 { time_constant_s } => {
                Self::Ar1 { phi: (-1.0 / (rate_hz * time_constant_s)).exp() }
            }
            Colour::LowPass { cutoff_hz } => Self::LowPass {
                corner: (std::f64::consts::PI * cutoff_hz / rate_hz).tan(),
                energy: Butterworth2::new(cutoff_hz / rate_hz)
                    .energy(run_in_samples(cutoff_hz, rate_hz)),
            },
        }
    }

    /// Power at the frequency ω, rad per sample.
    fn power(&self, omega: f64) -> f64 {
        match *self {
            Self::White => 1.0,
            Self::Ar1 { phi } => (1.0 - phi * phi) / (1.0 - 2.0 * phi * omega.cos() + phi * phi),
            Self::LowPass { corner, energy } => {
                let ratio = (0.5 * omega).tan() / corner;
                1.0 / (1.0 + ratio.powi(4)) / energy
            }
        }
    }
}

/// Generator of a unit-variance stationary process, sample by sample.
#[derive(Debug, Clone)]
enum Process {
    White,
    Ar1 { phi: f64, innovation: f64, value: f64 },
    LowPass(Butterworth2),
}

impl Process {
    /// The process in its stationary state, so that its first sample has the same distribution as all others.
    fn new(colour: Colour, rate_hz: f64, rng: &mut impl Rng) -> Self {
        match colour {
            Colour::White => Self::White,
            Colour::Ar1 { time_constant_s } => {
                let phi = (-1.0 / (rate_hz * time_constant_s)).exp();
                Self::Ar1 { phi, innovation: (1.0 - phi * phi).sqrt(), value: normal(rng) }
            }
            Colour::LowPass { cutoff_hz } => {
                let settled = run_in_samples(cutoff_hz, rate_hz);
                let mut filter = Butterworth2::new(cutoff_hz / rate_hz);
                filter.gain /= filter.clone().energy(settled).sqrt();
                for _ in 0..settled {
                    filter.next(normal(rng));
                }
                Self::LowPass(filter)
            }
        }
    }

    #[inline]
    fn next(&mut self, rng: &mut impl Rng) -> f64 {
        let white = normal(rng);
        match self {
            Self::White => white,
            Self::Ar1 { phi, innovation, value } => {
                *value = *phi * *value + *innovation * white;
                *value
            }
            Self::LowPass(filter) => filter.next(white),
        }
    }
}

/// Settling time of a low-pass in units of 1/f_c: its poles decay as exp(−√2 π f_c t), which is e⁻²⁰ after this time.
const FORGOTTEN: f64 = 4.5;
/// Longest settling time allowed for a low-pass, s, because every process draws that many samples before it starts.
const LONGEST_S: f64 = 3600.0;

/// Number of samples after which a low-pass has settled.
fn run_in_samples(cutoff_hz: f64, rate_hz: f64) -> usize {
    (FORGOTTEN * rate_hz / cutoff_hz).ceil() as usize
}

/// Draws a standard normal number.
#[inline]
pub(super) fn normal(rng: &mut impl Rng) -> f64 {
    StandardNormal.sample(rng)
}

/// Second-order Butterworth low-pass by the bilinear transform:
/// H(z) = g (1 + z⁻¹)² / (1 + a₁ z⁻¹ + a₂ z⁻²).
#[derive(Debug, Clone)]
struct Butterworth2 {
    gain: f64,
    a1: f64,
    a2: f64,
    memory: [f64; 2],
}

impl Butterworth2 {
    /// The low-pass with the cut-off frequency `cutoff`, as a fraction of the sampling rate, below 0.5.
    fn new(cutoff: f64) -> Self {
        let k = (std::f64::consts::PI * cutoff).tan();
        let norm = 1.0 / (1.0 + std::f64::consts::SQRT_2 * k + k * k);
        Self {
            gain: k * k * norm,
            a1: 2.0 * (k * k - 1.0) * norm,
            a2: (1.0 - std::f64::consts::SQRT_2 * k + k * k) * norm,
            memory: [0.0; 2],
        }
    }

    fn next(&mut self, input: f64) -> f64 {
        let [m1, m2] = self.memory;
        let m0 = input - self.a1 * m1 - self.a2 * m2;
        self.memory = [m0, m1];
        self.gain * (m0 + 2.0 * m1 + m2)
    }

    /// Autocorrelation of the output for white input, from the first `samples` samples of the impulse response h:
    /// r_k = Σ h_i h_{i+k} / Σ h_i². Returns at most `lags` lags, and none beyond `samples`.
    fn autocorrelation(mut self, samples: usize, lags: usize) -> Vec<f64> {
        let h: Vec<f64> = (0..samples).map(|k| self.next(if k == 0 { 1.0 } else { 0.0 })).collect();
        let product = |k: usize| h[k..].iter().zip(&h).map(|(a, b)| a * b).sum::<f64>();
        let energy = product(0);
        (0..samples.min(lags)).map(|k| product(k) / energy).collect()
    }

    /// Sum of squares of the first `samples` samples of the impulse response: the variance of the output for white
    /// input.
    fn energy(mut self, samples: usize) -> f64 {
        (0..samples).map(|k| self.next(if k == 0 { 1.0 } else { 0.0 }).powi(2)).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATE_HZ: f64 = 125.0;
    const SAMPLES: usize = 200_000;
    /// Bounds of the tests, in standard deviations of the estimate. At 5 each check fails by chance for one in 2
    /// million seeds, and the seed is fixed.
    const SIGMAS: f64 = 5.0;

    fn draw(model: &NoiseModel, sd: &[f64]) -> JointSignals {
        let mut signals = JointSignals::zeros(sd.len(), SAMPLES);
        let streams = TrialStreams::new(11, b"noise", 0);
        model.add_to(&streams, RATE_HZ, sd, &mut Vec::new(), &mut signals);
        signals
    }

    fn mean_product(a: &[f64], b: &[f64]) -> f64 {
        a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>() / a.len().min(b.len()) as f64
    }

    fn single(colour: Colour) -> NoiseModel {
        let components = vec![Component { share: 1.0, colour }];
        NoiseModel { components, cross_joint_correlation: 0.0 }
    }

    /// The variance of a sample variance is 2/n Σ ρ²; Σ ρ² is (1+φ²)/(1−φ²) for AR(1) and
    /// 0.338 f_s/f_c for a second-order Butterworth spectrum 1/(1 + (f/f_c)⁴).
    #[test]
    fn every_colour_has_the_variance_asked_for() {
        let ar1 = |t: f64| {
            let p2 = (-2.0 / (RATE_HZ * t)).exp();
            (Colour::Ar1 { time_constant_s: t }, (1.0 + p2) / (1.0 - p2))
        };
        let low_pass = |f: f64| (Colour::LowPass { cutoff_hz: f }, 0.338 * RATE_HZ / f);
        for (colour, sum_rho2) in [(Colour::White, 1.0), ar1(0.02), ar1(1.0), low_pass(10.0)] {
            let sd = [1.0, 0.15];
            let signals = draw(&single(colour), &sd);
            for (j, sd) in sd.iter().enumerate() {
                let variance = mean_product(signals.joint(j), signals.joint(j)) / (sd * sd);
                let bound = SIGMAS * (2.0 * sum_rho2 / SAMPLES as f64).sqrt();
                assert!((variance - 1.0).abs() < bound, "{colour:?} {j}: {variance}, ±{bound}");
            }
        }
    }

    /// Bartlett's variance of the sample autocorrelation of an AR(1) process at lag k:
    /// ((1+φ²)(1−φ²ᵏ)/(1−φ²) − 2kφ²ᵏ)/n.
    #[test]
    fn autoregression_forgets_at_its_time_constant() {
        let time_constant_s = 0.076;
        let signals = draw(&single(Colour::Ar1 { time_constant_s }), &[1.0]);
        let x = signals.joint(0);
        let phi = (-1.0 / (RATE_HZ * time_constant_s)).exp();
        for lag in [1_usize, 5, 20, 100] {
            let k = lag as f64;
            let (p2, p2k) = (phi * phi, phi.powf(2.0 * k));
            let variance = (1.0 + p2) * (1.0 - p2k) / (1.0 - p2) - 2.0 * k * p2k;
            let bound = SIGMAS * (variance / SAMPLES as f64).sqrt();
            let seen = mean_product(&x[lag..], &x[..SAMPLES - lag]) / mean_product(x, x);
            assert!((seen - phi.powf(k)).abs() < bound, "lag {lag}: {seen}, {}", phi.powf(k));
        }
    }

    #[test]
    fn power_over_all_frequencies_is_the_variance() {
        let colours = [
            Colour::White,
            Colour::Ar1 { time_constant_s: 0.02 },
            Colour::LowPass { cutoff_hz: 10.0 },
        ];
        for colour in colours {
            let model = single(colour);
            let bins = 20_000;
            let frequency = |k: usize| (k as f64 + 0.5) / bins as f64 * 0.5 * RATE_HZ;
            let power = model.spectrum(RATE_HZ);
            let mean = (0..bins).map(|k| power(frequency(k))).sum::<f64>() / bins as f64;
            // The mid-point rule is accurate for a smooth spectrum.
            assert!((mean - 1.0).abs() < 1e-5, "{colour:?}: {mean}");
        }
    }

    /// The autocorrelation is the inverse transform of the spectrum, computed here by the mid-point rule on a smooth
    /// periodic function.
    #[test]
    fn autocorrelation_and_spectrum_of_a_low_pass_belong_together() {
        let model = single(Colour::LowPass { cutoff_hz: 10.0 });
        let (power, bins) = (model.spectrum(RATE_HZ), 2000);
        let few = model.autocorrelation(RATE_HZ, 8);
        for (lag, r) in few.iter().enumerate() {
            let phase = |k: usize| (k as f64 + 0.5) / bins as f64 * std::f64::consts::PI;
            let term = |k: usize| {
                power(phase(k) * RATE_HZ / std::f64::consts::TAU) * (lag as f64 * phase(k)).cos()
            };
            let transformed = (0..bins).map(term).sum::<f64>() / bins as f64;
            assert!((r - transformed).abs() < 1e-8, "lag {lag}: {r} {transformed}");
        }
        assert_eq!(few[..], model.autocorrelation(RATE_HZ, 1025)[..8]);
        // Beyond the settling time of 57 samples the autocorrelation is zero.
        assert!(model.autocorrelation(RATE_HZ, 60)[57..].iter().all(|r| *r == 0.0));
    }

    #[test]
    fn the_low_pass_halves_the_power_at_its_cutoff() {
        let cutoff = 0.08;
        let mut filter = Butterworth2::new(cutoff);
        let (mut dc, mut re, mut im) = (0.0, 0.0, 0.0);
        for k in 0..500 {
            let h = filter.next(if k == 0 { 1.0 } else { 0.0 });
            let (sin, cos) = (std::f64::consts::TAU * cutoff * f64::from(k)).sin_cos();
            (dc, re, im) = (dc + h, re + h * cos, im + h * sin);
        }
        assert!((dc - 1.0).abs() < 1e-12, "{dc}");
        assert!((re * re + im * im - 0.5).abs() < 1e-12, "{}", re * re + im * im);
    }

    /// The sample correlation of two series with autocorrelation ρ_k has the variance (1−ρ²)²/n · Σ ρ_k². The sum is
    /// dominated by the slow component with its share of 20 %: 0.2² · 125.
    #[test]
    fn joints_are_correlated_as_asked() {
        let model = NoiseModel::real_arm();
        let signals = draw(&model, &[1.0, 1.0, 0.15]);
        let bound = SIGMAS * (8.0 / SAMPLES as f64).sqrt();
        for (a, b) in [(0, 1), (0, 2), (1, 2)] {
            let [aa, bb, ab] = [(a, a), (b, b), (a, b)]
                .map(|(a, b)| mean_product(signals.joint(a), signals.joint(b)));
            let seen = ab / (aa * bb).sqrt();
            assert!((seen - model.cross_joint_correlation).abs() < bound, "{a} {b}: {seen}");
        }
    }

    #[test]
    fn impossible_noise_is_refused() {
        let of = |share, colour, rho| NoiseModel {
            components: vec![Component { share, colour }],
            cross_joint_correlation: rho,
        };
        for model in [
            of(0.9, Colour::White, 0.0),
            of(f64::NAN, Colour::White, 0.0),
            of(1.0, Colour::White, 1.0),
            of(1.0, Colour::White, -0.1),
            of(1.0, Colour::Ar1 { time_constant_s: 0.0 }, 0.0),
            of(1.0, Colour::LowPass { cutoff_hz: 62.5 }, 0.0),
            of(1.0, Colour::LowPass { cutoff_hz: f64::NAN }, 0.0),
            of(1.0, Colour::LowPass { cutoff_hz: 0.0 }, 0.0),
            of(1.0, Colour::LowPass { cutoff_hz: 1.2e-3 }, 0.0),
        ] {
            assert!(model.validate(RATE_HZ).is_err(), "{model:?}");
        }
        assert_eq!(NoiseModel::real_arm().validate(RATE_HZ), Ok(()));
        let slow = of(1.0, Colour::LowPass { cutoff_hz: 1.25e-3 }, 0.0);
        assert_eq!(slow.validate(RATE_HZ), Ok(()));
    }
}
