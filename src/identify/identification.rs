//! What comes out of identification.

use super::covariance::Covariance;
use super::drifting_friction::DriftingFriction;
use super::fit::{Estimator, Fit};
use super::held_at_rest::HeldAtRest;
use super::lack_of_fit::LackOfFit;
use super::pooled::Agreement;
use super::prepared::Processing;
use super::residual::Residual;
use crate::signal::Replicates;

/// The result of identification from a log.
#[derive(Debug, Clone)]
pub struct Identification {
    /// Which estimator made the solution.
    pub estimator: Estimator,
    /// The least-squares solution.
    pub fit: Fit,
    /// Its covariance.
    pub covariance: Covariance,
    /// Why this covariance was chosen.
    pub covariance_reason: &'static str,
    /// What was done to the log.
    pub processing: Processing,
    /// Torque samples per joint that were used.
    pub samples: usize,
    /// Scatter of the torque between periods, without friction that drifts; `None` for a single run.
    pub replicates: Option<Replicates>,
    /// Rms per joint of the repeating torque that the model does not explain, Nm; `None` for a single run.
    pub explainable_nm: Option<Vec<f64>>,
    /// Test of the model against the scatter between periods; known for the spectral estimator.
    pub lack_of_fit: Option<LackOfFit>,
    /// Test whether several logs come from one arm; known where each of them repeats its motion.
    pub agreement: Option<Agreement>,
    /// Friction that drifts along the log. The estimate then has its mean over the log, and covariance, scatter and tests
    /// know only the noise beside it; the residual contains it. Not looked for in a motion that repeats less than
    /// [`MANY_PERIODS`](super::MANY_PERIODS) times.
    pub drifting_friction: Vec<DriftingFriction>,
    /// Friction that joints hold in their pauses. These rows are left out of estimate, covariance and tests; the residual
    /// contains them.
    pub held_at_rest: Vec<HeldAtRest>,
    /// Friction that joints may hold in their pauses, unless it is something else that the model lacks. These rows count.
    pub may_be_held: Vec<HeldAtRest>,
    /// What the user should know about how the log was used.
    pub warnings: Vec<String>,
}

impl Identification {
    /// Residual of the fit over all samples used.
    pub fn residual(&self) -> Residual {
        Residual::from_squares(&self.fit.residual_squares, &self.fit.torque_squares, self.samples)
    }

    /// Share of each joint's torque (rms) that the model leaves, without noise as far as the log reveals it.
    pub fn left(&self) -> Vec<f64> {
        let Residual { rms_nm, torque_rms_nm, .. } = self.residual();
        let beyond_noise = |j: usize| self.explainable_nm.as_ref().map_or(rms_nm[j], |nm| nm[j]);
        let share = |j: usize| beyond_noise(j) / torque_rms_nm[j];
        (0..rms_nm.len()).map(share).collect()
    }

    /// σ of every base parameter.
    pub fn sigma(&self) -> Vec<f64> {
        self.covariance.sigma()
    }
}

/// Rms per joint of the repeating torque that is not explained, Nm. `residual_squares` are ‖e_j‖² over all periods,
/// left by a fit of `parameters` parameters. From them the scatter between periods is subtracted, and from the mean
/// period the share of its noise σ²/P that the fit leaves. Filled-in rows lower P and the scatter to the parts that
/// are `kept` ([`Prepared::kept`](super::Prepared::kept)). Where friction is held in pauses, `shares` are those of the rows
/// of joint j that are left, and of their scatter in the residual.
pub(super) fn explainable(
    residual_squares: &[f64],
    parameters: usize,
    replicates: &Replicates,
    kept: [f64; 2],
    shares: impl Fn(usize) -> [f64; 2],
) -> Vec<f64> {
    let n = replicates.mean.samples() as f64;
    let periods = replicates.periods as f64;
    let joints = replicates.sigma.len() as f64;
    let pairs = residual_squares.iter().zip(&replicates.sigma).enumerate();
    pairs
        .map(|(j, (squares, sigma))| {
            let variance = sigma * sigma;
            let [used, scattered] = shares(j).map(|share| share * n);
            let fitted = parameters as f64 / (joints * used);
            let scatter = kept[1] * variance * scattered * (periods - 1.0);
            let of_mean = (squares - scatter) / (used * periods);
            (of_mean - variance / (kept[0] * periods) * (1.0 - fitted)).max(0.0).sqrt()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::JointSignals;
    use crate::signal::replicate_noise;
    use rand::{SeedableRng, rngs::ChaCha8Rng};
    use rand_distr::{Distribution, StandardNormal};

    /// Eight periods of an error of 0.3 Nm rms that repeats, under noise of 1 Nm. A twelfth of the rows, at other
    /// phases in each period, is the mean of the other periods. The mean square of the mean period is 0.09 and
    /// 1/(8 · 11/12) Nm², known to √(2/8000) of the second term and twice the root of both terms' product over 8000:
    /// 0.0048 Nm². Five of these standard deviations leave 0.257 to 0.338; without `kept` the result would be 0.16.
    #[test]
    fn rows_that_were_filled_in_explain_nothing() {
        const N: usize = 8000;
        const PERIODS: usize = 8;
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let mut noise = || -> f64 { StandardNormal.sample(&mut rng) };
        let error = |k: usize| 0.3 * std::f64::consts::SQRT_2 * (0.01 * k as f64).sin();
        let mut y: Vec<f64> = (0..N * PERIODS).map(|k| error(k % N) + noise()).collect();
        let is_filled = |k: usize, period: usize| k % 12 == period;
        for k in 0..N {
            for period in (0..PERIODS).filter(|period| is_filled(k, *period)) {
                let others = (0..PERIODS).filter(|other| *other != period);
                y[period * N + k] = others.map(|other| y[other * N + k]).sum::<f64>() / 7.0;
            }
        }
        let filled = (0..N * PERIODS).filter(|k| is_filled(k % N, k / N)).count();
        let f = filled as f64 / (N * PERIODS) as f64;
        let kept = [1.0 - f, 1.0 - f * 8.0 / 7.0];
        let signals = JointSignals::from_fn(1, N * PERIODS, |_, k| y[k]);
        let mut replicates = replicate_noise(&signals, N).unwrap();
        replicates.sigma[0] /= kept[1].sqrt();
        let squares = y.iter().map(|y| y * y).sum::<f64>();
        let found = explainable(&[squares], 0, &replicates, kept, |_| [1.0; 2])[0];
        assert!((0.257..0.338).contains(&found), "{found}");
    }
}
