//! The Fourier coefficients of a repeated signal, separated into the part that repeats and the scatter.

use std::ops::RangeInclusive;

use fourier::Complex64;
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

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

/// Energy of the mean coefficients over that of their noise below which they are noise: it is 1 without motion.
const NO_MOTION: f64 = 4.0;

/// Fourier coefficients of all periods of one signal, their mean, and their scatter per harmonic.
#[derive(Default)]
pub(super) struct Spectra {
    /// Coefficients 0 … n/2, period after period.
    pub(super) periods: Vec<Complex64>,
    pub(super) mean: Vec<Complex64>,
    pub(super) scatter: Vec<f64>,
    /// Lower bound of the noise power of a coefficient: its last digits.
    floor: f64,
    /// Power of a coefficient due to rounding that repeats.
    rounding: f64,
}

impl Spectra {
    /// Computes mean and scatter of the coefficients in `periods`, of periods of `n` samples, whose `rounding` is the
    /// same in every period and has this variance.
    pub(super) fn average(&mut self, n: usize, rounding: f64) {
        let bins = n / 2 + 1;
        let count = self.periods.len() / bins;
        self.mean.clear();
        self.mean.resize(bins, Complex64::ZERO);
        for spectrum in self.periods.chunks_exact(bins) {
            self.mean.iter_mut().zip(spectrum).for_each(|(mean, c)| *mean += c);
        }
        self.mean.iter_mut().for_each(|mean| *mean /= count as f64);
        self.set_scatter();
        let power: f64 = self.mean.iter().map(|c| c.norm_sqr()).sum();
        let digits = (8.0 * f64::EPSILON).powi(2) * power * (1.0 / n as f64);
        self.rounding = rounding / n as f64;
        self.floor = digits.max(f64::MIN_POSITIVE.sqrt());
    }

    /// Lets the periods scatter as they would if the rounding that repeats were noise: P times its power, so that the
    /// scatter says how far rounding sets the mean off. The mean itself stays as it is.
    pub(super) fn scatter_rounding(&mut self, mut rng: ChaCha8Rng) {
        if self.rounding == 0.0 {
            return;
        }
        let bins = self.mean.len();
        let count = self.periods.len() / bins;
        // Half of the power is in the real part; what the mean of the draws takes away is made up for.
        let power = count as f64 * self.rounding * count as f64 / (count - 1) as f64;
        let sd = (0.5 * power).sqrt();
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let mut draws = vec![Complex64::ZERO; count];
        for h in 0..bins {
            draws.fill_with(|| Complex64::new(sd * normal(), sd * normal()));
            let mean = draws.iter().sum::<Complex64>() / count as f64;
            for (spectrum, draw) in self.periods.chunks_exact_mut(bins).zip(&draws) {
                spectrum[h] += draw - mean;
            }
        }
        self.set_scatter();
    }

    /// Computes the scatter of the periods about their mean.
    fn set_scatter(&mut self) {
        let bins = self.mean.len();
        let freedom = (self.periods.len() / bins - 1) as f64;
        self.scatter.clear();
        self.scatter.resize(bins, 0.0);
        for spectrum in self.periods.chunks_exact(bins) {
            for ((c, mean), scatter) in spectrum.iter().zip(&self.mean).zip(&mut self.scatter) {
                *scatter += (c - mean).norm_sqr();
            }
        }
        self.scatter.iter_mut().for_each(|s| *s /= freedom);
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

    /// How much of the scatter of `other` follows this one's through some filter: |Σ D*E|² over Σ|D|² Σ|E|², D and E
    /// being the deviations of both from their means, summed over all periods and the harmonics of a band, and pooled
    /// over the fastest third of the `bands`, where no arm moves. 1 for a signal that was computed from the other,
    /// about 1/(8 (P − 1)) for two sensors. 0 where the signal has more than noise and rounding there: both then show
    /// the same motion. Where most of the noise is rounding that repeats, the coefficients themselves are compared, and
    /// the result is how much of the noise of this signal follows the other: of two sensors nothing, whatever motion
    /// both show.
    pub(super) fn coherence(&self, other: &Self, bands: &[Band]) -> f64 {
        let bins = self.mean.len();
        let count = self.periods.len() as f64 / bins as f64;
        let repeats = self.scatter.iter().sum::<f64>() < count * self.rounding * bins as f64;
        let mean = |of: &Self, h: usize| if repeats { Complex64::ZERO } else { of.mean[h] };
        let (mut energy, mut noise) = (0.0, 0.0);
        let (mut common, mut all, mut apart) = (0.0, 0.0, 0.0);
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
            apart += squares[0] - cross.norm_sqr() / squares[1].max(f64::MIN_POSITIVE);
            for h in harmonics.clone() {
                energy += count * self.mean[h].norm_sqr();
                noise += self.scatter[h] + count * self.rounding;
            }
        }
        match repeats {
            true if noise > 0.0 => (1.0 - apart / noise).max(0.0),
            false if all > 0.0 && energy < NO_MOTION * noise => common / all,
            _ => 0.0,
        }
    }

    /// Takes away all that the signal tells: its noise becomes infinite.
    pub(super) fn silence(&mut self) {
        self.floor = f64::INFINITY;
    }

    /// Whether the energy of the mean in the band exceeds what noise explains.
    pub(super) fn stands_out(&self, band: &Band, periods: f64) -> bool {
        let mean = &self.mean[band.harmonics.clone()];
        let energy = periods * mean.iter().map(|c| c.norm_sqr()).sum::<f64>() / mean.len() as f64;
        energy > band.threshold * self.noise(&band.harmonics)
    }
}
