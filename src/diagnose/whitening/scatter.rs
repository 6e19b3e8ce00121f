//! The noise covariance of one period's Fourier coefficients, from the scatter between periods.

use nalgebra::{Complex, DMatrix, DVector};

use super::coherence::coherence;
use super::mean_noise::{drifts, with_own_scatter};
use crate::diagnose::image::Column;
use crate::diagnose::noise_power::Uncertainty;
use crate::identify::FrictionDrift;
use crate::signal::{NoisePower, noise_trends, pooled_level};

/// Torque below this share of a joint's rms torque cannot be distinguished from rounding in a model.
pub const FLOOR: f64 = 1e-4;

/// The torque of all periods, prepared for the estimate of its noise.
pub(super) struct Periods<'a> {
    /// Torque of every joint, without the drifting friction that `drift` describes.
    pub(super) torque: &'a Column,
    pub(super) drift: &'a FrictionDrift,
    /// Samples of a period.
    pub(super) samples: usize,
    pub(super) periods: usize,
    /// Share of the periods' degrees of freedom that makes their scatter
    /// ([`Prepared::kept`](crate::identify::Prepared::kept)).
    pub(super) kept: f64,
    /// Mean square of the torque, per joint.
    pub(super) power: &'a [f64],
    /// Highest harmonic in use.
    pub(super) last: usize,
}

/// Scatter of the coefficients between periods, harmonic by harmonic.
pub(super) struct Scatter {
    joints: usize,
    samples: usize,
    periods: usize,
    /// S of single harmonics, divided by the standard deviations of `trends`.
    normalised: Vec<DMatrix<Complex<f64>>>,
    /// Trend of the power over the harmonics, by joint and harmonic.
    trends: Vec<Vec<NoisePower>>,
    /// Mean squared coherence of the joints' noise, where it can be determined.
    likeness: Vec<Option<f64>>,
}

/// What is known of the noise of one harmonic.
pub(super) struct Noise {
    /// Noise covariance S, N × N, scaled by M/(M − N) for its inverse.
    pub(super) covariance: DMatrix<Complex<f64>>,
    /// Uncertainty of its power.
    pub(super) unknown: Uncertainty,
    /// Joints (0-based) whose mean torque drifts, and by how much, Nm rms; empty for all harmonics but the mean.
    pub(super) drifting: Vec<(usize, f64)>,
}

impl Scatter {
    /// The scatter of `periods`, with `spectrum` the Fourier coefficients of one period.
    pub(super) fn of(periods: &Periods, spectrum: impl Fn(&[f64]) -> Vec<Complex<f64>>) -> Self {
        let &Periods { samples, kept, power, last, .. } = periods;
        let count = periods.periods;
        let joints = periods.torque.parts.len();
        let mut scatter = between(periods, spectrum);
        scatter.iter_mut().for_each(|scatter| *scatter /= Complex::from(kept));
        let likeness = coherence(&scatter[..=last], count - 1, pooled_level);
        // Powers are averaged as logarithms: where nothing scatters, a trace of the torque's power takes their place.
        let of_joint = |(j, power): (usize, &f64)| -> Vec<f64> {
            let floor = (FLOOR * FLOOR * power).max(f64::MIN_POSITIVE);
            scatter.iter().map(|s| s[(j, j)].re.max(1e-6 * floor)).collect()
        };
        let own: Vec<Vec<f64>> = power.iter().enumerate().map(of_joint).collect();
        let trends = noise_trends(&own, count - 1, &likeness, last);
        scatter.truncate(last + 1);
        let mut all =
            Self { joints, samples, periods: count, normalised: Vec::new(), trends, likeness };
        for (k, scatter) in scatter.iter_mut().enumerate() {
            let sd = all.sd(k);
            for (i, j) in pairs(joints) {
                scatter[(i, j)] /= sd[i] * sd[j];
            }
        }
        all.normalised = scatter;
        all
    }

    /// Standard deviation of every joint at harmonic `k`, by the trend.
    fn sd(&self, k: usize) -> Vec<f64> {
        self.trends.iter().map(|trend| trend[k].value.sqrt()).collect()
    }

    /// The noise of harmonic `k`.
    pub(super) fn noise(&self, k: usize) -> Noise {
        let (mut covariance, freedom) = self.averaged(k);
        let mut sd = self.sd(k);
        let mut unknown = Uncertainty {
            shared: self.trends[0][k].shared_variance,
            // The level is that of S, whatever the level of the trend.
            level: 1.0 / freedom,
            likeness: self.likeness[k].unwrap_or(1.0),
            colour: self.trends.iter().map(|trend| trend[k].colour_variance).collect(),
        };
        let mut drifting = Vec::new();
        if k == 0 {
            let factor;
            (factor, drifting) = self.of_mean(&covariance, freedom, &mut unknown);
            sd.iter_mut().zip(factor).for_each(|(sd, factor)| *sd *= factor.sqrt());
        }
        for (i, j) in pairs(self.joints) {
            covariance[(i, j)] *= sd[i] * sd[j];
        }
        Noise { covariance, unknown, drifting }
    }

    /// Factors by which the noise power of the mean differs from `averaged`, per joint, and the joints whose mean
    /// torques drift.
    fn of_mean(
        &self,
        averaged: &DMatrix<Complex<f64>>,
        freedom: f64,
        unknown: &mut Uncertainty,
    ) -> (Vec<f64>, Vec<(usize, f64)>) {
        let joints = self.joints;
        let sd = self.sd(0);
        // S is scaled up from the scatter by M/(M − N).
        let scale = freedom / (freedom - joints as f64).max(1.0);
        let own = |j: usize| self.normalised[0][(j, j)].re;
        let ratio: Vec<f64> = (0..joints).map(|j| scale * own(j) / averaged[(j, j)].re).collect();
        // The mean is one real number per period.
        let freedom = self.periods - 1;
        let is_drift = |j: &usize| drifts(ratio[*j], freedom, unknown.of(*j));
        let of_mean = |j: usize| (j, (own(j) / self.samples as f64).sqrt() * sd[j]);
        let drifting = (0..joints).filter(is_drift).map(of_mean).collect();
        (with_own_scatter(&ratio, freedom, unknown), drifting)
    }

    /// S averaged over the neighbourhood of harmonic `k`, scaled for its inverse, and its complex degrees of freedom M.
    fn averaged(&self, k: usize) -> (DMatrix<Complex<f64>>, f64) {
        let reach = pooled_level(k);
        // The mean torque drifts more than its neighbours, and is left out of their average.
        let range = k.saturating_sub(reach).max(1)..(k + reach + 1).min(self.normalised.len());
        let count = range.len();
        let mut s = DMatrix::<Complex<f64>>::zeros(self.joints, self.joints);
        for scatter in &self.normalised[range] {
            s += scatter;
        }
        let freedom = (count * (self.periods - 1)) as f64;
        s *= Complex::from(1.0 / count as f64 * freedom / (freedom - self.joints as f64).max(1.0));
        if k == 0 {
            s.iter_mut().for_each(|v| v.im = 0.0);
        }
        (s, freedom)
    }
}

/// Σ_p D Dᴴ/(P − 1) of every harmonic, N × N, with D the deviation from the mean period.
fn between(
    all: &Periods,
    spectrum: impl Fn(&[f64]) -> Vec<Complex<f64>>,
) -> Vec<DMatrix<Complex<f64>>> {
    let &Periods { torque, drift, samples: n, periods, .. } = all;
    let joints = torque.parts.len();
    let freedom = (periods - 1) as f64;
    let mut spectra: Vec<Vec<Complex<f64>>> = Vec::new();
    // Share of the noise's standard deviation that is left after removing drifting friction, by joint and harmonic.
    let mut kept: Vec<Vec<f64>> = Vec::new();
    for (j, y) in &torque.parts {
        spectra.extend(y.chunks_exact(n).map(&spectrum));
        kept.push(drift.kept(*j, n, &spectrum));
    }
    let of_harmonic = |k: usize| {
        let mut scatter = DMatrix::zeros(joints, joints);
        for p in 0..periods {
            let deviation = DVector::from_fn(joints, |j, _| {
                let of = |p: usize| spectra[j * periods + p][k];
                of(p) - (0..periods).map(of).sum::<Complex<f64>>() / periods as f64
            });
            scatter += &deviation * deviation.adjoint() / Complex::from(freedom);
        }
        for (i, j) in pairs(joints) {
            scatter[(i, j)] /= kept[i][k] * kept[j][k];
        }
        scatter
    };
    (0..n / 2 + 1).map(of_harmonic).collect()
}

/// All index pairs (i, j) of a square matrix.
fn pairs(n: usize) -> impl Iterator<Item = (usize, usize)> {
    (0..n).flat_map(move |i| (0..n).map(move |j| (i, j)))
}
