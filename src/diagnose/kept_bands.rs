//! The harmonics of a repeated motion that stand out of their noise.

use fourier::Complex64;

use super::mean_spectrum::{BAND, Band, MeanSpectrum};
use crate::signal::FineClock;

/// Least ratio of a band's power in the mean of the periods to the power of the noise in that mean: from here on the
/// band contains more motion than noise.
const STANDS_OUT: f64 = 2.0;

/// Bands of harmonics in which a motion is kept.
pub struct KeptBands {
    /// Whether each band is kept, from harmonic 1 on.
    kept: Vec<bool>,
    clock: FineClock,
}

impl KeptBands {
    /// Finds the bands in which the mean of the periods in `y`, of `n` samples each, stands out of its noise, which is
    /// known from the scatter between the periods.
    pub fn that_stand_out(y: &[f64], n: usize) -> Self {
        let clock = FineClock::new(n, 1);
        let stands_out = |band: Band| band.power >= STANDS_OUT * band.noise;
        // The mean velocity, harmonic 0, is always kept.
        let kept = MeanSpectrum::of(&clock, y).bands(1).map(stands_out).collect();
        Self { kept, clock }
    }

    /// One period of a motion, reduced to the bands that are kept.
    pub fn of(&self, period: &[f64]) -> Vec<f64> {
        let is_kept = |h: usize| h == 0 || self.kept[(h - 1) / BAND];
        self.clock.filtered(period, |h| if is_kept(h) { Complex64::ONE } else { Complex64::ZERO })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::noisy_periods::{PERIODS, SAMPLES, periods, rms};
    use crate::signal::mean_period;
    use std::f64::consts::TAU;

    /// Harmonics 3 and 101 contain motion; their two bands, with 14 harmonics of noise, stand out. In a band of noise
    /// alone, F with 16 and 112 degrees of freedom exceeds 2 by chance in 2 of 100 cases; more than eight of the 61
    /// bands of noise do so once in 10⁵ times. With this many bands the motion keeps at most √(11 · 16/1000) of the
    /// noise of its mean.
    #[test]
    fn noise_without_motion_goes() {
        let wave = |h: f64, k: usize| (TAU * h * k as f64 / SAMPLES as f64).sin();
        let motion = |k: usize| wave(3.0, k) + 0.1 * wave(101.0, k);
        let noise = 0.05;
        let y = periods(motion, noise);
        let bands = KeptBands::that_stand_out(&y, SAMPLES);
        let kept = bands.kept.iter().filter(|kept| **kept).count();
        assert!(bands.kept[0] && bands.kept[12] && kept <= 2 + 8, "{kept} of {}", bands.kept.len());
        let mean = mean_period(&y, SAMPLES);
        let told = bands.of(&mean);
        let off = rms(told.iter().enumerate().map(|(k, told)| told - motion(k)));
        let of_mean = noise / (PERIODS as f64).sqrt();
        assert!(off < of_mean * (11.0 * 16.0 / SAMPLES as f64).sqrt(), "{off}");
    }

    /// A motion that repeats exactly has no noise to stand out of, up to the rounding of a sum over n samples.
    #[test]
    fn a_motion_without_noise_stays_what_it_is() {
        let kink = |k: usize| (k as f64 - 300.0).abs() / 300.0;
        let y = periods(kink, 0.0);
        let bands = KeptBands::that_stand_out(&y, SAMPLES);
        let off =
            bands.of(&y[..SAMPLES]).iter().zip(&y).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        assert!(off < SAMPLES as f64 * f64::EPSILON, "{off}");
    }
}
