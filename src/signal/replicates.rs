//! Noise estimated without a model, from the differences between periods of one repeated motion.

use super::error::SignalError;
use crate::robot::JointSignals;

/// Mean period of a repeated signal and its scatter about that mean.
#[derive(Debug, Clone, PartialEq)]
pub struct Replicates {
    /// Number of periods P.
    pub periods: usize,
    /// Mean over the periods, one period long; its noise is `sigma`/√P.
    pub mean: JointSignals,
    /// Rms noise of one raw sample, per joint: √(Σ (y − ȳ)² / n(P − 1)), unit of the signal.
    pub sigma: Vec<f64>,
    /// y − ȳ of every sample, as long as the input. Its variance is (P − 1)/P of the noise's.
    pub deviations: JointSignals,
}

impl Replicates {
    /// Scatter below this fraction of a signal's rms is rounding in a file that repeats one period.
    const ROUNDING: f64 = 1e-9;

    /// Rms noise of one raw sample of signal `j` at the instants whose mean `is_kept`; `None` if there are none.
    pub fn sigma_where(&self, j: usize, is_kept: impl Fn(f64) -> bool) -> Option<f64> {
        let mean = self.mean.joint(j);
        let deviations = self.deviations.joint(j).iter().zip(mean.iter().cycle());
        let kept = deviations.filter(|(_, mean)| is_kept(**mean)).map(|(d, _)| d * d);
        let (square, count) = kept.fold((0.0, 0.0), |(square, count), d| (square + d, count + 1.0));
        let periods = self.periods as f64;
        (count > 0.0).then(|| (square / count * periods / (periods - 1.0)).sqrt())
    }

    /// Whether the periods agree to the last digit, so that their scatter says nothing about noise.
    pub fn are_alike(&self) -> bool {
        let scatters = |(j, sigma): (usize, &f64)| {
            let mean = self.mean.joint(j);
            let square = mean.iter().map(|v| v * v).sum::<f64>() / mean.len() as f64;
            *sigma > Self::ROUNDING * square.sqrt()
        };
        !self.sigma.iter().enumerate().any(scatters)
    }
}

/// Number of whole periods in `samples`; an error unless there are at least 2 and nothing remains.
pub(super) fn whole_periods(samples: usize, per_period: usize) -> Result<usize, SignalError> {
    if per_period == 0 || !samples.is_multiple_of(per_period) || samples < 2 * per_period {
        return Err(SignalError::Periods { samples, samples_per_period: per_period });
    }
    Ok(samples / per_period)
}

/// Splits `y`, which holds two or more whole periods, into its mean period and the scatter.
///
/// Everything that repeats, modelled or not, is in the mean; the scatter is noise of any colour, with its correlation
/// between joints.
pub fn replicate_noise(
    y: &JointSignals,
    samples_per_period: usize,
) -> Result<Replicates, SignalError> {
    let periods = whole_periods(y.samples(), samples_per_period)?;
    let n = samples_per_period;
    let mut mean = JointSignals::zeros(y.joints(), n);
    let mut deviations = y.clone();
    let mut sigma = Vec::with_capacity(y.joints());
    for j in 0..y.joints() {
        let average = mean.joint_mut(j);
        for period in y.joint(j).chunks_exact(n) {
            average.iter_mut().zip(period).for_each(|(a, v)| *a += v);
        }
        average.iter_mut().for_each(|a| *a /= periods as f64);
        let mut square = 0.0;
        for period in deviations.joint_mut(j).chunks_exact_mut(n) {
            for (d, a) in period.iter_mut().zip(average.iter()) {
                *d -= a;
                square += *d * *d;
            }
        }
        sigma.push((square / (n * (periods - 1)) as f64).sqrt());
    }
    Ok(Replicates { periods, mean, sigma, deviations })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};

    #[test]
    fn a_period_that_is_copied_is_told_from_noise() {
        let copied = |noise: f64| {
            let value = |k: usize| ((k % 100) as f64 * 0.07).sin() + noise * (k as f64).sin();
            replicate_noise(&JointSignals::from_fn(1, 400, |_, k| value(k)), 100).unwrap()
        };
        assert!(copied(0.0).are_alike());
        assert!(!copied(1e-6).are_alike());
    }

    #[test]
    fn mean_and_deviations_add_up_and_the_scatter_is_the_noise() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let (n, p) = (500, 8);
        // Uniform on ±√3/2: σ = 0.5.
        let y = JointSignals::from_fn(2, n * p, |j, k| {
            (k % n) as f64 * (j + 1) as f64 + 3.0_f64.sqrt() * (rng.random::<f64>() - 0.5)
        });
        let r = replicate_noise(&y, n).unwrap();
        for j in 0..2 {
            for k in 0..n * p {
                let sum = r.mean.joint(j)[k % n] + r.deviations.joint(j)[k];
                assert!((sum - y.joint(j)[k]).abs() < 1e-11);
            }
            let all = r.sigma_where(j, |_| true).unwrap();
            assert!((all / r.sigma[j] - 1.0).abs() < 1e-12);
            // Relative sd of a uniform's rms over 3500 degrees: √(0.8/4/3500) = 0.8 %; 5 sd.
            assert!((r.sigma[j] / 0.5 - 1.0).abs() < 0.04, "{}", r.sigma[j]);
            // Half of the samples: √2 times that.
            let half = r.sigma_where(j, |mean| mean < 250.0 * (j + 1) as f64).unwrap();
            assert!((half / 0.5 - 1.0).abs() < 0.06, "{half}");
            assert!(r.sigma_where(j, |mean| mean > 1e6).is_none());
        }
    }

    #[test]
    fn parts_of_a_period_are_refused() {
        let y = JointSignals::zeros(1, 1001);
        for n in [0, 500, 1001] {
            assert!(matches!(replicate_noise(&y, n), Err(SignalError::Periods { .. })));
        }
    }
}
