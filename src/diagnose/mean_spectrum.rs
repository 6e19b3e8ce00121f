//! Power of the mean of repeated periods, and of the noise in that mean, by band of harmonics.
//!
//! With the coefficients c_p of P periods and their mean c̄, the noise in c̄ has the mean square
//! Σ_p |c_p − c̄|²/(P (P − 1)). A single harmonic tells it with 2 (P − 1) degrees of freedom only, so neighbouring
//! harmonics are judged together.

use std::ops::Range;

use fourier::Complex64;

use crate::signal::FineClock;

/// Number of neighbouring harmonics that are judged together.
pub const BAND: usize = 8;

/// Fourier coefficients of the mean of repeated periods, and their scatter.
pub struct MeanSpectrum {
    /// Coefficients of the mean period, from harmonic 0 on.
    pub mean: Vec<Complex64>,
    /// Sum over the periods of |c_p − c̄|², by harmonic.
    scatter: Vec<f64>,
    /// Number P of periods.
    periods: f64,
}

/// A band of neighbouring harmonics.
pub struct Band {
    /// Its harmonics.
    pub harmonics: Range<usize>,
    /// Power of the mean of the periods in all of them, with its noise.
    pub power: f64,
    /// Power of the noise in that mean.
    pub noise: f64,
}

impl MeanSpectrum {
    /// The spectrum of at least two `periods`, which follow one after another.
    pub fn of(clock: &FineClock, periods: &[f64]) -> Self {
        let spectra: Vec<Vec<Complex64>> =
            periods.chunks_exact(clock.samples()).map(|y| clock.spectrum(y)).collect();
        let count = spectra.len() as f64;
        let harmonics = 0..clock.samples() / 2 + 1;
        let mean: Vec<Complex64> = harmonics
            .clone()
            .map(|h| spectra.iter().map(|s| s[h]).sum::<Complex64>() / count)
            .collect();
        let scatter = |h: usize| spectra.iter().map(|s| (s[h] - mean[h]).norm_sqr()).sum::<f64>();
        Self { scatter: harmonics.map(scatter).collect(), mean, periods: count }
    }

    /// Bands of [`BAND`] harmonics from the harmonic `first` on; the last band may have fewer.
    pub fn bands(&self, first: usize) -> impl Iterator<Item = Band> {
        let end = self.mean.len();
        (first..end).step_by(BAND).map(move |start| {
            let harmonics = start..(start + BAND).min(end);
            let power = self.mean[harmonics.clone()].iter().map(Complex64::norm_sqr).sum();
            let scatter: f64 = self.scatter[harmonics.clone()].iter().sum();
            Band { harmonics, power, noise: scatter / (self.periods * (self.periods - 1.0)) }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two periods of 40 samples have heights of 3 and 1 in harmonic 9: coefficients of 1.5 and 0.5, of which the mean
    /// is 1 and the noise in the mean has the mean square (0.5² + 0.5²)/2. Phases of up to 55 rad are rounded to 4e-15,
    /// and the tolerance is 25 times that.
    #[test]
    fn a_band_has_the_power_of_its_harmonics() {
        let clock = FineClock::new(40, 1);
        let wave = |k: usize| (9.0 * std::f64::consts::TAU * k as f64 / 40.0).cos();
        let periods: Vec<f64> =
            [3.0, 1.0].iter().flat_map(|height| (0..40).map(move |k| height * wave(k))).collect();
        let spectrum = MeanSpectrum::of(&clock, &periods);
        for (first, bands) in [(0, [0..8, 8..16, 16..21]), (1, [1..9, 9..17, 17..21])] {
            let found: Vec<Band> = spectrum.bands(first).collect();
            assert_eq!(found.iter().map(|band| band.harmonics.clone()).collect::<Vec<_>>(), bands);
            for (k, band) in found.iter().enumerate() {
                let [power, noise] = if k == 1 { [1.0, 0.25] } else { [0.0, 0.0] };
                assert!((band.power - power).abs() < 1e-13, "{k}: {}", band.power);
                assert!((band.noise - noise).abs() < 1e-13, "{k}: {}", band.noise);
            }
        }
    }
}
