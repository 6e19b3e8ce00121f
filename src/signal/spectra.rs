//! The Fourier coefficients of a repeated signal, separated into the part that repeats and the scatter.

use std::ops::RangeInclusive;

use fourier::Complex64;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::readings::resolution;

/// Number of harmonics pooled for one noise estimate and one test.
pub(super) const BAND_HARMONICS: usize = 8;
/// Probability that a joint keeps a band without motion in it.
const FALSE_BAND: f64 = 0.01;

/// A band of neighbouring harmonics, and the F-ratio above which it contains motion.
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

/// Readings may be coarse if at least this fraction of the samples recurs one period later to the last digit. The
/// fraction is 0.49 for noise of half a step; it is 0.09 for noise of three steps, whose rounding does not repeat.
const READ_AGAIN: f64 = 0.05;

/// Factor on the variance of the rounding that repeats in every period, which no scatter between periods shows. Where
/// angles are coarse and velocities are not, the factor makes the velocities, whose noise every test sees, determine
/// the motion from slower harmonics on. Without it, rounding of angles in steps of 0.1 mrad leaves 0.4 mrad/s in the
/// velocity, and where a joint reverses a tenth of a Nm that looks like friction.
const UNSEEN: f64 = 16.0;

/// Energy of the mean coefficients over that of their noise below which they are noise: it is 1 without motion.
const NO_MOTION: f64 = 4.0;
/// Periods whose scatter is less than this share of their power are alike but for the last digits.
const ALIKE: f64 = 1e-20;

/// Variance of the rounding error that is the same in every period.
///
/// `y` is a signal with periods of `n` samples whose noise has the variance `noise`. For readings in steps Δ the
/// variance is Σ_k Δ²/(2π²k²) exp(−(2πkσ/Δ)²), which is Δ²/12 without noise (Widrow 1956). No scatter between periods
/// shows this error, and no average removes it.
pub(super) fn repeated_rounding(y: &[f64], n: usize, noise: f64) -> f64 {
    let again = y.windows(n + 1).filter(|w| w[0] == w[n]).count();
    if (again as f64) < READ_AGAIN * y.len().saturating_sub(n) as f64 {
        return 0.0;
    }
    let step = resolution(y).powi(2);
    let term = |k: usize| {
        let w = std::f64::consts::TAU * k as f64;
        // A constant has no step.
        if step > 0.0 { 2.0 * step / (w * w) * (-w * w * noise / step).exp() } else { 0.0 }
    };
    (1..=20).map(term).sum()
}

/// Fourier coefficients of all periods of one signal, their mean, and their scatter per harmonic.
#[derive(Default)]
pub(super) struct Spectra {
    /// Coefficients 0 … n/2, period after period.
    pub(super) periods: Vec<Complex64>,
    pub(super) mean: Vec<Complex64>,
    pub(super) scatter: Vec<f64>,
    /// Lower bound of the noise power of a coefficient, for errors that no scatter between periods shows: rounding.
    floor: f64,
    /// Power of a coefficient due to rounding that repeats.
    rounding: f64,
    /// Whether the rounding that repeats exceeds the scatter between periods.
    pub(super) is_coarse: bool,
}

impl Spectra {
    /// Computes mean and scatter of the coefficients in `periods`; `y` is the signal, with periods of `n` samples.
    pub(super) fn average(&mut self, y: &[f64], n: usize) {
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
        let digits = (8.0 * f64::EPSILON).powi(2) * power * (1.0 / n as f64);
        let noise = n as f64 / bins as f64 * self.scatter.iter().sum::<f64>();
        // Averaging divides the scatter by P but leaves the repeated rounding whole, hence the factor P.
        let rounding = repeated_rounding(y, n, noise);
        self.rounding = rounding / n as f64;
        let repeated = count as f64 * rounding;
        self.is_coarse = repeated > noise;
        self.floor = digits.max(UNSEEN * repeated / n as f64).max(f64::MIN_POSITIVE.sqrt());
    }

    /// Subtracts the mean from the coefficients of every period.
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

    /// How much of the scatter of `other` follows this one's through some filter: |Σ D*E|² over Σ|D|² Σ|E|², D and E being
    /// the deviations of both from their means, summed over all periods and the harmonics of a band, and pooled over the
    /// fastest third of the `bands`, where no arm moves. 1 for a signal that was computed from the other, about
    /// 1/(8 (P − 1)) for two sensors. Of periods that are alike to the last digit, the coefficients themselves are
    /// compared: what they have there is rounding. 0 where the signal has more than noise and rounding there: both then
    /// show the same motion.
    pub(super) fn coherence(&self, other: &Self, bands: &[Band]) -> f64 {
        let bins = self.mean.len();
        let power = self.mean.iter().map(|c| c.norm_sqr()).sum::<f64>();
        let are_alike = self.scatter.iter().sum::<f64>() < ALIKE * power;
        let mean = |of: &Self, h: usize| if are_alike { Complex64::ZERO } else { of.mean[h] };
        let count = self.periods.len() as f64 / bins as f64;
        let (mut energy, mut noise) = (0.0, 0.0);
        let (mut common, mut all) = (0.0, 0.0);
        for Band { harmonics, .. } in &bands[2 * bands.len() / 3..] {
            let (mut cross, mut squares) = (Complex64::ZERO, [0.0; 2]);
            for (own, others) in
                self.periods.chunks_exact(bins).zip(other.periods.chunks_exact(bins))
            {
                for h in harmonics.clone() {
                    let (d, e) = (own[h] - mean(self, h), others[h] - mean(other, h));
                    cross += d.conj() * e;
                    squares = [squares[0] + d.norm_sqr(), squares[1] + e.norm_sqr()];
                }
            }
            common += cross.norm_sqr();
            all += squares[0] * squares[1];
            for h in harmonics.clone() {
                energy += count * self.mean[h].norm_sqr();
                noise += self.scatter[h] + count * self.rounding;
            }
        }
        if all > 0.0 && energy < NO_MOTION * noise { common / all } else { 0.0 }
    }

    /// Takes away all that the signal tells: its noise becomes infinite.
    pub(super) fn silence(&mut self) {
        self.floor = f64::INFINITY;
        self.is_coarse = false;
    }

    /// Whether the energy of the mean in the band exceeds what noise explains.
    pub(super) fn stands_out(&self, band: &Band, periods: f64) -> bool {
        let mean = &self.mean[band.harmonics.clone()];
        let energy = periods * mean.iter().map(|c| c.norm_sqr()).sum::<f64>() / mean.len() as f64;
        energy > band.threshold * self.noise(&band.harmonics)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{SeedableRng, rngs::ChaCha8Rng};
    use rand_distr::{Distribution, StandardNormal};

    /// The error of the mean of many periods is the repeated rounding, and its variance is the one predicted.
    #[test]
    fn rounding_repeats_as_far_as_noise_leaves_it() {
        const STEP: f64 = 1e-3;
        let (n, periods) = (500, 400);
        let truth = |k: usize| (0.0126 * k as f64 + 0.3).sin() + 0.4 * (0.0503 * k as f64).cos();
        for sigma in [0.0, 0.2, 0.35] {
            let mut rng = ChaCha8Rng::seed_from_u64(3);
            let mut noise =
                || -> f64 { sigma * STEP * Distribution::<f64>::sample(&StandardNormal, &mut rng) };
            let read = |k: usize| ((truth(k % n) + noise()) / STEP).round() * STEP;
            let y: Vec<f64> = (0..n * periods).map(read).collect();
            let off = |k: usize| y[k..].iter().step_by(n).sum::<f64>() / periods as f64 - truth(k);
            let square = (0..n).map(|k| off(k).powi(2)).sum::<f64>() / n as f64;
            // The part that does not repeat scatters over the periods by no more than noise and one step.
            let scatter = (sigma * sigma + 1.0 / 12.0) * STEP * STEP / periods as f64;
            let said = repeated_rounding(&y, n, (sigma * STEP).powi(2));
            let left = f64::from(u8::from(sigma > 0.0)) * scatter;
            // The mean square of 500 samples is known to 6 %; twice that is allowed.
            assert!((square - said).abs() < 0.13 * said + left, "{sigma}: {square:e} {said:e}");
        }
    }

    /// Readings as fine as their noise have no repeated rounding.
    #[test]
    fn fine_readings_have_no_rounding_that_repeats() {
        let y: Vec<f64> = (0..1000).map(|k| (0.1 * k as f64).sin()).collect();
        assert_eq!(repeated_rounding(&y, 100, 0.0), 0.0);
        assert_eq!(repeated_rounding(&[2.0; 500], 100, 0.0), 0.0);
    }
}
