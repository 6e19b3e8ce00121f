//! The Fourier coefficients of a repeated signal: what repeats in them, and what scatters.

use std::ops::RangeInclusive;

use realfft::num_complex::Complex64;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

/// Harmonics pooled for one noise estimate and one test.
pub(super) const BAND_HARMONICS: usize = 8;
/// Chance that a joint keeps a band without motion in it.
const FALSE_BAND: f64 = 0.01;

/// Neighbouring harmonics and the F-ratio above which there is motion in them.
pub(super) struct Band {
    pub(super) harmonics: RangeInclusive<usize>,
    threshold: f64,
}

impl Band {
    /// Harmonics 1 … `highest` in bands of [`BAND_HARMONICS`]; the last takes the remainder.
    pub(super) fn all(highest: usize, periods: usize) -> Vec<Self> {
        let count = (highest / BAND_HARMONICS).max(1);
        let level = FALSE_BAND / (2 * count) as f64;
        let threshold = |width: usize| {
            let freedom = 2.0 * width as f64;
            FisherSnedecor::new(freedom, freedom * (periods - 1) as f64)
                .expect("both degrees of freedom are positive")
                .inverse_cdf(1.0 - level)
        };
        let regular = threshold(BAND_HARMONICS);
        (0..count)
            .map(|b| {
                let first = 1 + b * BAND_HARMONICS;
                if b + 1 == count {
                    Self { harmonics: first..=highest, threshold: threshold(highest + 1 - first) }
                } else {
                    Self { harmonics: first..=first + BAND_HARMONICS - 1, threshold: regular }
                }
            })
            .collect()
    }
}

/// Coefficients of all periods of one signal, their mean, and the scatter per harmonic.
#[derive(Default)]
pub(super) struct Spectra {
    /// Coefficients 0 … n/2 of one period after the other.
    pub(super) periods: Vec<Complex64>,
    pub(super) mean: Vec<Complex64>,
    pub(super) scatter: Vec<f64>,
    /// Scatter that rounding alone makes.
    floor: f64,
}

impl Spectra {
    /// Mean and scatter of the coefficients in `periods`, of periods of `n` samples.
    pub(super) fn average(&mut self, n: usize) {
        let bins = n / 2 + 1;
        let count = self.periods.len() / bins;
        self.mean.clear();
        self.mean.resize(bins, Complex64::ZERO);
        self.scatter.clear();
        self.scatter.resize(bins, 0.0);
        for spectrum in self.periods.chunks_exact(bins) {
            self.mean.iter_mut().zip(spectrum).for_each(|(mean, c)| *mean += c);
        }
        self.mean.iter_mut().for_each(|mean| *mean /= count as f64);
        for spectrum in self.periods.chunks_exact(bins) {
            for ((c, mean), scatter) in spectrum.iter().zip(&self.mean).zip(&mut self.scatter) {
                *scatter += (c - mean).norm_sqr();
            }
        }
        let freedom = (count - 1) as f64;
        self.scatter.iter_mut().for_each(|s| *s /= freedom);
        let power: f64 = self.mean.iter().map(|c| c.norm_sqr()).sum();
        let rounding = (8.0 * f64::EPSILON).powi(2) * power * (1.0 / n as f64);
        self.floor = rounding.max(f64::MIN_POSITIVE.sqrt());
    }

    /// Leaves of every period what it is off the mean.
    pub(super) fn subtract_mean(&mut self) {
        for spectrum in self.periods.chunks_exact_mut(self.mean.len()) {
            spectrum.iter_mut().zip(&self.mean).for_each(|(c, mean)| *c -= mean);
        }
    }

    /// Noise power of one coefficient of one period, pooled over the band.
    pub(super) fn noise(&self, band: &RangeInclusive<usize>) -> f64 {
        let scatter = &self.scatter[band.clone()];
        (scatter.iter().sum::<f64>() / scatter.len() as f64).max(self.floor)
    }

    /// Whether the mean's energy in the band exceeds what noise makes of it.
    pub(super) fn stands_out(&self, band: &Band, periods: f64) -> bool {
        let mean = &self.mean[band.harmonics.clone()];
        let energy = periods * mean.iter().map(|c| c.norm_sqr()).sum::<f64>() / mean.len() as f64;
        energy > band.threshold * self.noise(&band.harmonics)
    }
}
