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

    /// The bands in which the mean of the periods in `y`, of `n` samples each, is known: all up to the first with which
    /// the noise of the mean exceeds `most` (rms) and which does not stand out of its own noise. Also the noise of the
    /// mean in them (rms). `None` if these are all bands.
    pub fn quieter_than(most: f64, y: &[f64], n: usize) -> Option<(Self, f64)> {
        let clock = FineClock::new(n, 1);
        let all: Vec<Band> = MeanSpectrum::of(&clock, y).bands(1).collect();
        let (mut quiet, mut square) = (0, 0.0);
        for band in &all {
            // A coefficient and its conjugate have the same power.
            let with_it = square + 2.0 * band.noise;
            if with_it > most * most && band.power < STANDS_OUT * band.noise {
                break;
            }
            (quiet, square) = (quiet + 1, with_it);
        }
        if quiet == all.len() {
            return None;
        }
        let kept = (0..all.len()).map(|band| band < quiet).collect();
        Some((Self { kept, clock }, square.sqrt()))
    }

    /// The highest harmonic that is kept.
    pub fn highest(&self) -> usize {
        self.kept.iter().rposition(|kept| *kept).map_or(0, |last| (last + 1) * BAND)
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

    /// White noise of standard deviation s in the mean has s √(2 · 8/1000) in each band of eight harmonics: a tenth of
    /// its square fills 6.25 bands. The noise of six bands is known, from 2 · 7 · 48 deviations, to 4 % in rms, so that
    /// five to seven are kept. Harmonic 101 stands out but lies beyond the first band that does not.
    #[test]
    fn bands_end_where_their_noise_is_too_much() {
        let wave = |h: f64, k: usize| (TAU * h * k as f64 / SAMPLES as f64).sin();
        let noise = 0.05;
        let y = periods(|k| wave(3.0, k) + wave(101.0, k), noise);
        let of_mean = noise / (PERIODS as f64).sqrt();
        let most = of_mean * 0.1f64.sqrt();
        let (bands, left) = KeptBands::quieter_than(most, &y, SAMPLES).unwrap();
        assert!((5 * BAND..=7 * BAND).contains(&bands.highest()), "{}", bands.highest());
        assert!(left <= most && left > 0.8 * most, "{left}");
        let told = bands.of(&mean_period(&y, SAMPLES));
        let off = rms(told.iter().enumerate().map(|(k, told)| told - wave(3.0, k)));
        // The rms of 112 numbers is known to 7 %; three of these.
        assert!(off < 1.2 * most, "{off}");
        // What stands out is kept, however much noise it has.
        let (bands, _) = KeptBands::quieter_than(0.0, &y, SAMPLES).unwrap();
        assert!(bands.kept[0] && !bands.kept[12]);
        // Bands of which none has too much noise.
        assert!(KeptBands::quieter_than(2.0 * of_mean, &y, SAMPLES).is_none());
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
