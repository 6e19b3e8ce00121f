//! Harmonics of a torque, and which of them stand out of their noise.

use fourier::Complex64;
use rayon::prelude::*;

use crate::diagnose::mean_spectrum::{BAND, Band, MeanSpectrum};
use crate::diagnose::reversal_answer::TorqueHarmonic;
use crate::robot::JointSignals;
use crate::signal::FineClock;

/// A band of harmonics whose power is more than this many times its noise is used as it is.
pub(super) const WELL_KNOWN: f64 = 100.0;
/// The same for [`Loads::bending`](super::Loads::bending).
pub(super) const KNOWN: f64 = 10.0;

/// The harmonics of a torque and how well they are known.
pub(super) struct Harmonics {
    /// How well they are known.
    pub(super) known: Known,
    /// Coefficients of the mean period.
    mean: Vec<Complex64>,
    /// Mean square of the noise in each coefficient.
    noise: Vec<f64>,
}

impl Harmonics {
    /// The harmonics of `periods`, which follow one after another.
    pub(super) fn of(clock: &FineClock, periods: &[f64]) -> Self {
        let spectrum = MeanSpectrum::of(clock, periods);
        let (mut known, mut noise) = (Vec::new(), Vec::new());
        for Band { harmonics, power, noise: of_band } in spectrum.bands(0) {
            known.push(if power > 0.0 { power / of_band - 1.0 } else { 0.0 });
            noise.resize(harmonics.end, of_band / harmonics.len() as f64);
        }
        let mean = spectrum.mean;
        // Without noise all harmonics are known equally well, to within their rounding.
        let rounding = f64::EPSILON * mean.iter().map(Complex64::norm_sqr).fold(0.0, f64::max);
        noise.iter_mut().for_each(|noise| *noise = noise.max(rounding));
        Self { known: Known(known), mean, noise }
    }

    /// The harmonics of the periods in `signals`, by joint.
    pub(super) fn of_joints(clock: &FineClock, signals: &JointSignals) -> Vec<Self> {
        let of_joint = |j: usize| Self::of(clock, signals.joint(j));
        (0..signals.joints()).into_par_iter().map(of_joint).collect()
    }

    /// The harmonics up to `last` in which a `load` is not known to `level`.
    pub(super) fn beyond(&self, load: &Known, level: f64, last: usize) -> Vec<TorqueHarmonic> {
        let harmonic =
            |h: usize| TorqueHarmonic { number: h, mean: self.mean[h], noise: self.noise[h] };
        let is_beyond = |h: &TorqueHarmonic| !load.holds(h.number, level) && h.noise > 0.0;
        (1..=last).map(harmonic).filter(is_beyond).collect()
    }
}

/// How well the harmonics of a torque are known: the ratio of power, without its noise, to noise, by band.
pub(super) struct Known(Vec<f64>);

impl Known {
    /// How well the harmonics of the periods in `signals` are known, by joint.
    pub(super) fn of_joints(clock: &FineClock, signals: &JointSignals) -> Vec<Self> {
        Harmonics::of_joints(clock, signals).into_iter().map(|of| of.known).collect()
    }

    /// The same with nothing known in bands beyond that of the harmonic `last`.
    pub(super) fn up_to(&self, last: usize) -> Self {
        let bands = last / BAND + 1;
        let known = |(band, known): (usize, &f64)| if band < bands { *known } else { 0.0 };
        Self(self.0.iter().enumerate().map(known).collect())
    }

    /// Whether the power of harmonic `h`, judged with its band, is more than `level` times its noise.
    pub(super) fn holds(&self, h: usize, level: f64) -> bool {
        self.0[h / BAND] > level
    }

    /// `y` with only the harmonics that are known to `level`.
    pub(super) fn part(&self, clock: &FineClock, y: &[f64], level: f64) -> Vec<f64> {
        let gain = |h: usize| if self.holds(h, level) { Complex64::ONE } else { Complex64::ZERO };
        clock.filtered(y, gain)
    }

    /// `y` without the harmonics known to `level`, up to the harmonic `highest`.
    pub(super) fn rest(
        &self,
        clock: &FineClock,
        y: &[f64],
        level: f64,
        highest: usize,
    ) -> Vec<f64> {
        let is_rest = |h: usize| h <= highest && !self.holds(h, level);
        clock.filtered(y, |h| if is_rest(h) { Complex64::ONE } else { Complex64::ZERO })
    }
}

/// The part of `y` whose power is more than ten times that of differentiated white noise, selected band by band.
/// `noise` is the power density of the white noise, per Hz.
///
/// `y` is followed by its own mirror image, which avoids a jump between its ends.
pub(super) fn beside_differentiated_noise(y: &[f64], noise: f64, rate_hz: f64) -> Vec<f64> {
    let there_and_back: Vec<f64> = y.iter().chain(y.iter().rev()).copied().collect();
    let n = there_and_back.len();
    let clock = FineClock::new(n, 1);
    let spectrum = clock.spectrum(&there_and_back);
    let omega = std::f64::consts::TAU * rate_hz / n as f64;
    // The noise is mirrored as well: each coefficient has the mean square σ²/n, with σ² = density · f_s/2.
    let of_noise = |h: usize| (h as f64 * omega).powi(2) * noise * 0.5 * rate_hz / n as f64;
    let holds: Vec<bool> = spectrum
        .chunks(BAND)
        .zip((0..).step_by(BAND))
        .map(|(band, first)| {
            let power: f64 = band.iter().map(Complex64::norm_sqr).sum();
            let noise: f64 = (first..first + band.len()).map(of_noise).sum();
            power > (1.0 + KNOWN) * noise
        })
        .collect();
    let gain = |h: usize| if holds[h / BAND] { Complex64::ONE } else { Complex64::ZERO };
    let mut known = clock.filtered(&there_and_back, gain);
    known.truncate(y.len());
    known
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{SeedableRng, rngs::ChaCha8Rng};
    use rand_distr::{Distribution, StandardNormal};

    const RATE_HZ: f64 = 125.0;

    /// A slow swing plus differentiated white noise: the swing is what remains. Its band is 0.1 Hz wide, a little wider
    /// because of the kink at the ends, and the noise in this band is a ten thousandth of the swing.
    #[test]
    fn what_is_known_beside_differentiated_noise() {
        const NOISE: f64 = 1e-3;
        let swing = |k: usize| 20.0 * (0.8 * std::f64::consts::TAU * k as f64 / RATE_HZ).cos();
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let velocity: Vec<f64> = (0..4000).map(|_| StandardNormal.sample(&mut rng)).collect();
        let noise = |k: usize| NOISE * 0.5 * RATE_HZ * (velocity[k + 1] - velocity[k - 1]);
        let y: Vec<f64> = (1..3999).map(|k| swing(k) + noise(k)).collect();
        let density = 2.0 * NOISE.powi(2) / RATE_HZ;
        let known = beside_differentiated_noise(&y, density, RATE_HZ);
        let rms =
            |y: &mut dyn Iterator<Item = f64>| (y.map(|y| y * y).sum::<f64>() / 3998.0).sqrt();
        let before = rms(&mut y.iter().zip(1..).map(|(y, k)| y - swing(k)));
        let after = rms(&mut known.iter().zip(1..).map(|(y, k)| y - swing(k)));
        assert!(after < 0.01 * 20.0 && after < 0.5 * before, "{before} {after}");
        // Next to nothing remains of noise alone: the slowest harmonics, where differentiated noise is weaker than the
        // jump at the ends. Without noise everything remains.
        let alone: Vec<f64> = (1..3999).map(noise).collect();
        let left = beside_differentiated_noise(&alone, density, RATE_HZ);
        assert!(rms(&mut left.into_iter()) < 0.01 * rms(&mut alone.into_iter()));
        let all = beside_differentiated_noise(&y, 0.0, RATE_HZ);
        assert!(rms(&mut all.iter().zip(&y).map(|(a, b)| a - b)) < 1e-12);
    }
}
