//! Predicts the accuracy of an experiment before it is run.

use std::ops::Range;

use faer::linalg::solvers::DenseSolveCore;
use faer::{Mat, Scale, Side};

use super::criterion::{condition, congruent, equilibration};
use super::information::Information;
use crate::base::BaseSet;
use crate::dynamics::{Model, Motion};
use crate::excitation::{FourierSeries, Reference};

/// The data that an experiment gives: length, sampling rate and torque noise.
#[derive(Debug, Clone, PartialEq)]
pub struct Experiment {
    /// Length of the periodic motion that is recorded, s.
    pub data_s: f64,
    /// Sampling rate, Hz.
    pub rate_hz: f64,
    /// Standard deviation of the white torque noise, joint by joint, Nm.
    pub torque_noise_nm: Vec<f64>,
}

impl Experiment {
    /// Number of samples.
    pub fn samples(&self) -> f64 {
        self.data_s * self.rate_hz
    }

    /// Weight of every joint, 1/σ_j².
    pub(super) fn weights(&self) -> Vec<f64> {
        self.torque_noise_nm.iter().map(|sigma| 1.0 / (sigma * sigma)).collect()
    }
}

/// Predicted standard deviations of the base parameters and the condition numbers of one motion.
#[derive(Debug, Clone, PartialEq)]
pub struct Prediction {
    /// Standard deviation of every base parameter by weighted least squares, in its unit:
    /// σ_i = sqrt([(Θ_BᵀWΘ_B)⁻¹]_ii), the paper's (20) with the noise in it.
    pub sigma: Vec<f64>,
    /// σ_i / |θ_i|, where θ are the arm's own parameters; infinite if θ_i is zero (symmetric bodies have moments that
    /// vanish).
    pub relative_sigma: Vec<f64>,
    /// cond(Θ_BᵀΘ_B), the paper's (22).
    pub condition: f64,
    /// The same condition number with columns scaled to unit length.
    pub scaled_condition: f64,
}

impl Prediction {
    /// Predicts the accuracy of repeating `series`, from samples of one period at the experiment's rate; `None` if some
    /// base parameter remains undetermined.
    pub fn of(
        model: &Model,
        base: &BaseSet,
        experiment: &Experiment,
        series: &FourierSeries,
        prior: Option<&Mat<f64>>,
    ) -> Option<Self> {
        let samples = (series.period_s * experiment.rate_hz).round().max(1.0) as usize;
        let per_sample = |weights: Vec<f64>| {
            summed_in_blocks(&Information::new(model, base, weights), series, samples, BLOCK)
        };
        let raw = per_sample(vec![1.0; model.dof()]);
        let whitened = per_sample(experiment.weights());
        let total = Mat::from_fn(base.rank(), base.rank(), |i, k| {
            whitened[(i, k)] * experiment.samples() + prior.map_or(0.0, |p| p[(i, k)])
        });
        // Columns of very different size are scaled to unit length before the inverse is formed.
        let scales = equilibration(&total)?;
        let inverse = congruent(&total, &scales).llt(Side::Lower).ok()?.inverse();
        let sigma: Vec<f64> =
            (0..base.rank()).map(|i| scales[i] * inverse[(i, i)].sqrt()).collect();
        let theta = base.values(&model.standard_parameters());
        let largest = theta.iter().fold(0.0, |m: f64, t| m.max(t.abs()));
        let zero = |t: f64| t.abs() <= 1e-12 * largest;
        Some(Self {
            relative_sigma: (0..base.rank())
                .map(|i| if zero(theta[i]) { f64::INFINITY } else { sigma[i] / theta[i].abs() })
                .collect(),
            sigma,
            condition: condition(&raw)?,
            scaled_condition: condition(&congruent(&raw, &equilibration(&raw)?))?,
        })
    }

    /// Geometric mean of the σ. It mixes units, so it can only compare designs for the same arm.
    pub fn geometric_mean_sigma(&self) -> f64 {
        (self.sigma.iter().map(|s| s.ln()).sum::<f64>() / self.sigma.len() as f64).exp()
    }

    /// The `fraction` quantile of the relative σ (linear between order statistics) of the parameters
    /// that are not zero.
    pub fn relative_quantile(&self, fraction: f64) -> f64 {
        self.quantile_of(fraction, f64::is_finite)
    }

    /// Number of parameters that will be known better than their own size: σ_i < |θ_i|.
    pub fn known(&self) -> usize {
        self.relative_sigma.iter().filter(|r| is_known(**r)).count()
    }

    /// The `fraction` quantile of the relative σ of the parameters that will be known better than their own size. The
    /// relative σ of the others says how small they are, not how well they will be known.
    pub fn known_quantile(&self, fraction: f64) -> f64 {
        self.quantile_of(fraction, is_known)
    }

    /// The `fraction` quantile of the relative σ that `counts`; NaN if there is none.
    fn quantile_of(&self, fraction: f64, counts: fn(f64) -> bool) -> f64 {
        let mut sorted = self.relative_sigma.clone();
        sorted.retain(|r| counts(*r));
        sorted.sort_by(f64::total_cmp);
        if sorted.is_empty() {
            return f64::NAN;
        }
        let at = fraction * (sorted.len() - 1) as f64;
        let low = sorted[at.floor() as usize];
        low + (sorted[at.ceil() as usize] - low) * at.fract()
    }
}

/// Whether a parameter with this relative σ is known better than its own size.
fn is_known(relative_sigma: f64) -> bool {
    relative_sigma < 1.0
}

/// Samples whose regressor is formed at once. That of a whole period can fill gigabytes: with six joints a sample takes
/// some 3 kB.
const BLOCK: usize = 4096;

/// Λ per sample along one period of `series`, from `samples` equidistant samples in blocks of at most `block`.
fn summed_in_blocks(
    information: &Information,
    series: &FourierSeries,
    samples: usize,
    block: usize,
) -> Mat<f64> {
    let of_block = |first: usize| {
        let motion = sampled(series, first..samples.min(first + block), samples);
        let mut ws = information.workspace(motion.samples());
        let mut torque_nm = vec![0.0; motion.joints() * motion.samples()];
        let share = motion.samples() as f64 / samples as f64;
        information.evaluate(&mut ws, &motion, &mut torque_nm) * Scale(share)
    };
    let mut sum = of_block(0);
    for first in (block..samples).step_by(block) {
        sum += &of_block(first);
    }
    sum
}

/// The samples `range` of `samples` equidistant ones of one period.
fn sampled(series: &FourierSeries, range: Range<usize>, samples: usize) -> Motion {
    let n = series.joints();
    let mut motion = Motion::at_rest(n, range.len());
    let (mut q, mut qd, mut qdd) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    for (k, at) in range.enumerate() {
        series.sample(series.period_s * at as f64 / samples as f64, &mut q, &mut qd, &mut qdd);
        motion.q_rad.set_sample(k, &q);
        motion.qd_rad_s.set_sample(k, &qd);
        motion.qdd_rad_s2.set_sample(k, &qdd);
    }
    motion
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::Parameterisation;
    use crate::robot::Arm;

    /// A parameter that is zero, and one that is half as large as its σ, say nothing about how well the others will be
    /// known.
    #[test]
    fn small_parameters_are_not_known_badly() {
        let relative_sigma = vec![0.5, f64::INFINITY, 0.25, 2.0, 0.75];
        let sigma = vec![1.0; relative_sigma.len()];
        let p = Prediction { sigma, relative_sigma, condition: 1.0, scaled_condition: 1.0 };
        assert_eq!(p.known(), 3);
        assert_eq!([p.known_quantile(0.5), p.known_quantile(1.0)], [0.5, 0.75]);
        assert_eq!(p.relative_quantile(0.5), 0.625);
        let p = Prediction { relative_sigma: vec![f64::INFINITY, 2.0], ..p };
        assert!(p.known() == 0 && p.known_quantile(0.5).is_nan());
    }

    /// A sum of N products rounds by at most N · 1.1e-16 of the sum of their magnitudes, which is at most √(Λ_ii Λ_kk):
    /// with N = 1000 by 1.1e-13 in either order.
    #[test]
    fn the_information_is_the_sum_of_its_blocks() {
        let arm = Arm::built_in("ur5").unwrap();
        let base = BaseSet::find(&arm, Parameterisation::full(6, false)).unwrap();
        let information = Information::new(&Model::new(&arm), &base, vec![1.0; 6]);
        let series = FourierSeries::built_in("ur5_identification").unwrap();
        let [whole, blocks] =
            [1000, 300].map(|block| summed_in_blocks(&information, &series, 1000, block));
        for i in 0..base.rank() {
            for k in 0..base.rank() {
                let scale = (whole[(i, i)] * whole[(k, k)]).sqrt();
                let error = (whole[(i, k)] - blocks[(i, k)]).abs();
                assert!(error <= 3e-13 * scale, "{i} {k}: {error:e} of {scale:e}");
            }
        }
    }
}
