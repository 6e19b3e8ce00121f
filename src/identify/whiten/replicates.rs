//! Weights every frequency and joint by the noise that the periods show there.

use nalgebra::DMatrix;

use super::cross_joint::mix;
use super::spectrum::Spectrum;
use crate::identify::problem::Problem;
use crate::signal::{HarmonicPower, pooled, subtract_mean_period};

/// Whitening by the scatter between periods.
///
/// With the Fourier coefficients Y_pk of period p and their mean Ȳ_k, the noise of joint j at harmonic k has the
/// variance s²_jk = Σ_p |Y_jpk − Ȳ_jk|²/(P − 1), averaged over the neighbouring harmonics ([`pooled`]: k ± max(3, k/4),
/// without k itself). The joints have the correlation C of the deviations over s, pooled over all harmonics. Rows
/// become U diag(1/s_k) · row with U C Uᵀ = 1.
///
/// Rows end at 0.08 of the sampling rate. Near a reversal of friction the acceleration is a pulse shorter than a
/// sample, and the derivative of the sampled velocity contains a share of it that falls with frequency. The missing
/// torque is equally large at any frequency; above a few hertz, where the motion has little else, it dominates what a
/// row says about Coulomb friction. Where the noise is low, such rows would get large weights (rows up to 0.2 f_s
/// caused a bias of 1 σ under noise with a memory of 76 ms; rows up to 0.08 f_s cause 0.1 σ, for 4 % of σ). Rows end
/// no later than 0.8 of the harmonics kept in the acceleration, because the harmonics of the mass matrix carry the
/// missing part of the acceleration down to lower frequencies. The rows of joint j end earlier where its acceleration
/// is noisy: noise in a column attenuates its parameter. Noise in q̈ grows with the square of the frequency while the
/// motion fades. The rows therefore end as soon as the noise left in the averaged acceleration, weighted like the
/// rows, is more than [`HARMLESS_NOISE`] of it.
///
/// For Gaussian noise Ȳ and the scatter are independent, so that least squares on the whitened rows is unbiased
/// whatever the scatter is. Because k is left out of its own weight, the scatter of the whitened rows remains an
/// unbiased measure of their noise.
#[derive(Default)]
pub struct ReplicateWhitening {
    spectrum: Spectrum,
    rows: Option<Problem>,
    weights: Vec<Vec<f64>>,
}

/// Highest frequency of the rows used, over the sampling rate.
pub const ROWS_END: f64 = 0.08;
/// Largest noise in the acceleration of the rows used, as a share of its mean square. Ten times as much (velocity
/// noise of 0.01 rad/s, eight periods) attenuated the inertia about joint 1 by 5e-5, a tenth of its σ; half as much
/// costs 1 % of σ under noise with a memory.
const HARMLESS_NOISE: f64 = 5e-6;
/// Share of the acceleration's harmonics whose rows are used.
const USED_HARMONICS: f64 = 0.8;
/// Harmonics that are always used, so that a motion of few harmonics still gives equations for all parameters.
const LEAST_HARMONICS: usize = 16;
/// Rows almost without noise are weighted as if they had this share of the noisiest row's noise.
const LEAST_NOISE: f64 = 1e-9;

impl ReplicateWhitening {
    /// Writes the whitened mean and harmonics of `problem` into `out`, which has the cumulative plan of `problem`.
    /// Needs two periods or more, and the power of the averaged acceleration per joint.
    pub fn whiten(&mut self, problem: &Problem, acceleration: &[HarmonicPower], out: &mut Problem) {
        let moving = acceleration.iter().map(|power| power.noise.len()).filter(|h| *h > 0);
        let highest = moving.min().unwrap_or(0) as f64;
        let harmonics = (USED_HARMONICS * highest).min(ROWS_END * problem.samples as f64);
        let harmonics = (harmonics as usize).max(LEAST_HARMONICS);
        let rows = self.rows.get_or_insert_with(|| Problem::new(problem.plan.clone(), 0.0));
        self.spectrum.transform(problem, harmonics, rows);
        let n = rows.samples;
        let mut deviations: Vec<Vec<f64>> = rows.panels.iter().map(|p| p.y.clone()).collect();
        self.weights.resize(rows.joints(), Vec::new());
        let mut noisiest: f64 = 0.0;
        for (deviations, weights) in deviations.iter_mut().zip(&mut self.weights) {
            subtract_mean_period(deviations, n);
            *weights = noise_of_rows(deviations, n);
            noisiest = weights.iter().fold(noisiest, |a, w| a.max(*w));
        }
        let floor = (LEAST_NOISE.powi(2) * noisiest).max(f64::MIN_POSITIVE);
        for weight in self.weights.iter_mut().flatten() {
            *weight = if noisiest > 0.0 { 1.0 / weight.max(floor).sqrt() } else { 1.0 };
        }
        for (weights, power) in self.weights.iter_mut().zip(acceleration) {
            cut(weights, power);
        }
        let correlation = DMatrix::from_fn(rows.joints(), rows.joints(), |i, k| {
            if i == k {
                1.0
            } else {
                correlation_of([i, k].map(|j| (&*deviations[j], &*self.weights[j])))
            }
        });
        mix(rows, &self.weights, &correlation, out);
    }
}

/// Variance of the noise in each of the `n` rows of a period: that of the neighbouring harmonics, by the `deviations` of
/// all periods from their mean.
pub fn noise_of_rows(deviations: &[f64], n: usize) -> Vec<f64> {
    let mut variances = vec![0.0; n];
    for period in deviations.chunks_exact(n) {
        variances.iter_mut().zip(period).for_each(|(w, d)| *w += d * d);
    }
    let periods = deviations.len() / n;
    variances.iter_mut().for_each(|w| *w /= (periods - 1) as f64);
    smooth(&mut variances);
    variances
}

/// Correlation of the deviations of two joints, period after period, over the rows in which both have weight; 0 if one
/// of them has no deviations there.
fn correlation_of([(a, weights_a), (b, weights_b)]: [(&[f64], &[f64]); 2]) -> f64 {
    let mut sums = [0.0; 3];
    let weights = weights_a.iter().zip(weights_b).cycle();
    for ((a, b), (wa, wb)) in
        a.iter().zip(b).zip(weights).filter(|(_, (wa, wb))| **wa * **wb != 0.0)
    {
        let (a, b) = (a * wa, b * wb);
        sums[0] += a * b;
        sums[1] += a * a;
        sums[2] += b * b;
    }
    let scale = (sums[1] * sums[2]).sqrt();
    if scale > 0.0 { sums[0] / scale } else { 0.0 }
}

/// Sets the weights of all harmonics above the last one whose acceleration can be trusted to zero.
fn cut(weights: &mut [f64], acceleration: &HarmonicPower) {
    let used = (weights.len() / 2).min(acceleration.noise.len());
    let (mut estimate, mut noise) = (0.0, 0.0);
    for h in 1..=used {
        let weight = weights[2 * h] * weights[2 * h];
        estimate += weight * acceleration.estimate[h - 1];
        noise += weight * acceleration.noise[h - 1];
        if h > LEAST_HARMONICS && noise > HARMLESS_NOISE * estimate {
            weights[2 * h - 1..].fill(0.0);
            return;
        }
    }
}

/// Replaces the variance of each row by the mean over the neighbouring harmonics, without its own.
fn smooth(variances: &mut [f64]) {
    let last = variances.len() / 2;
    let first_row = |h: usize| if h == 0 { 0 } else { 2 * h - 1 };
    let mut sums = Vec::with_capacity(variances.len() + 1);
    let mut sum = 0.0;
    sums.push(sum);
    for v in variances.iter() {
        sum += v;
        sums.push(sum);
    }
    for h in 0..=last {
        let reach = pooled(h);
        let window = first_row(h.saturating_sub(reach))..2 * (h + reach).min(last) + 1;
        let own = first_row(h)..2 * h + 1;
        let others = (window.len() - own.len()).max(1) as f64;
        let over = |r: &std::ops::Range<usize>| sums[r.end] - sums[r.start];
        let mean = (over(&window) - over(&own)).max(0.0) / others;
        variances[own].fill(mean);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_weight_knows_its_neighbours_but_not_itself() {
        let mut variances = vec![1.0; 41];
        variances[19] = 8.0;
        variances[20] = 8.0;
        smooth(&mut variances);
        // Harmonic 10 itself, then 8 … 12 with windows of ± 3.
        assert!((variances[19] - 1.0).abs() < 1e-12 && (variances[20] - 1.0).abs() < 1e-12);
        assert!((variances[21] - (10.0 + 16.0) / 12.0).abs() < 1e-12);
        // The mean (row 0) sees harmonics 1 to 3.
        assert!((variances[0] - 1.0).abs() < 1e-12);
    }

    #[test]
    fn deviations_sum_to_zero() {
        let mut y: Vec<f64> = (0..12).map(|k| (k * k) as f64).collect();
        subtract_mean_period(&mut y, 4);
        for k in 0..4 {
            assert!((y[k] + y[k + 4] + y[k + 8]).abs() < 1e-12);
        }
    }
}
