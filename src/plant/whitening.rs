//! Whitening of coloured torque noise.

use super::error::PlantError;
use super::noise::NoiseModel;

/// The whitening transformation W, with W Cov(e) Wᵀ = 1 for the torque noise e of a [`NoiseModel`].
///
/// All joints have the same colour, so the covariance is a Kronecker product: D (C ⊗ Γ) D, with the standard deviations
/// D, the correlation C = (1 − ρ) 1 + ρ 11ᵀ between joints and the autocorrelation Γ in time. In time, each sample is
/// replaced by the error of its best linear prediction from the preceding samples, divided by the standard deviation of
/// that error (Durbin–Levinson recursion). Across the joints, C^(−1/2) D⁻¹ is applied.
#[derive(Debug, Clone)]
pub struct Whitening {
    /// Coefficients of the best linear predictor from the last 1, 2, … samples, the most recent sample first.
    predictors: Vec<Vec<f64>>,
    /// Variance of the prediction error from 0, 1, 2, … samples.
    variances: Vec<f64>,
    /// C^(−1/2) D⁻¹ (joints × joints), row by row.
    across: Vec<Vec<f64>>,
}

/// Largest order of the predictor, samples.
const LONGEST_MEMORY: usize = 1024;
/// The order stops growing when the error variance falls by less than the share [`NO_GAIN`] over this many orders.
const GAIN_OVER: usize = 16;
const NO_GAIN: f64 = 1e-9;

impl Whitening {
    /// The whitening for noise of the colour `model` with standard deviations `sd` (Nm, all positive), sampled at
    /// `rate_hz`.
    ///
    /// # Errors
    /// [`PlantError::Setting`] if a joint has no noise.
    pub fn new(model: &NoiseModel, sd: &[f64], rate_hz: f64) -> Result<Self, PlantError> {
        if let Some(&value) = sd.iter().find(|s| s.is_nan() || **s <= 0.0) {
            let requirement = "must be positive on every joint for the noise to be whitened";
            return Err(PlantError::Setting { key: "torque_sd_nm", value, requirement });
        }
        let correlation = model.autocorrelation(rate_hz, LONGEST_MEMORY + 1);
        let (predictors, variances) = predictors(&correlation);
        let (n, rho) = (sd.len() as f64, model.cross_joint_correlation);
        // C has the eigenvalue 1 − ρ + nρ for (1, 1, …) and 1 − ρ in all orthogonal directions.
        let (common, own) = (1.0 / (1.0 - rho + n * rho).sqrt(), 1.0 / (1.0 - rho).sqrt());
        let across = (0..sd.len())
            .map(|i| {
                let entry = |k: usize| (common - own) / n + if i == k { own } else { 0.0 };
                sd.iter().enumerate().map(|(k, sd)| entry(k) / sd).collect()
            })
            .collect();
        Ok(Self { predictors, variances, across })
    }

    /// Whitens one joint's series in time, in place.
    pub fn in_time(&self, series: &mut [f64]) {
        let longest = self.predictors.len();
        // Go backwards, so that the preceding samples are still unchanged when they are needed.
        for t in (0..series.len()).rev() {
            let order = t.min(longest);
            let mut error = series[t];
            if order > 0 {
                let past = series[t - order..t].iter().rev();
                error -=
                    self.predictors[order - 1].iter().zip(past).map(|(a, y)| a * y).sum::<f64>();
            }
            series[t] = error / self.variances[order].sqrt();
        }
    }

    /// Weights (1/Nm) with which the time-whitened series of all joints add up to the whitened series number `joint`.
    pub fn across(&self, joint: usize) -> &[f64] {
        &self.across[joint]
    }
}

/// Predictors and their error variances by the Durbin–Levinson recursion, up to the order beyond which nothing is
/// gained.
fn predictors(correlation: &[f64]) -> (Vec<Vec<f64>>, Vec<f64>) {
    let mut all: Vec<Vec<f64>> = Vec::new();
    let mut variances = vec![correlation[0]];
    for order in 1..correlation.len() {
        let last = all.last().map_or(&[][..], Vec::as_slice);
        let variance = variances[order - 1];
        let known: f64 = last.iter().enumerate().map(|(i, a)| a * correlation[order - 1 - i]).sum();
        let reflection = (correlation[order] - known) / variance;
        let mut next: Vec<f64> =
            last.iter().zip(last.iter().rev()).map(|(a, b)| a - reflection * b).collect();
        next.push(reflection);
        all.push(next);
        variances.push(variance * (1.0 - reflection * reflection));
        if order >= GAIN_OVER && variances[order] > (1.0 - NO_GAIN) * variances[order - GAIN_OVER] {
            break;
        }
    }
    (all, variances)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::{Colour, Component};
    use crate::random::TrialStreams;
    use crate::robot::JointSignals;

    const RATE_HZ: f64 = 125.0;

    /// Noise from the sensors' own generator becomes white with unit variance. Sample correlations of white noise have
    /// a standard deviation of 1/√n, and the bounds are 5 standard deviations (60 checks: a failure by chance in one of
    /// 30 000 seeds).
    #[test]
    fn the_sensors_noise_becomes_white() {
        let ar1 = |t| Colour::Ar1 { time_constant_s: t };
        let single = |colour| NoiseModel {
            components: vec![Component { share: 1.0, colour }],
            cross_joint_correlation: 0.5,
        };
        for model in [NoiseModel::white(), NoiseModel::real_arm(), single(ar1(0.076))] {
            let (sd, samples) = ([1.0, 0.7, 0.15], 60_000);
            let mut noise = JointSignals::zeros(3, samples);
            let streams = TrialStreams::new(5, b"whitening", 0);
            model.add_to(&streams, RATE_HZ, &sd, &mut Vec::new(), &mut noise);
            let whitening = Whitening::new(&model, &sd, RATE_HZ).unwrap();
            (0..3).for_each(|j| whitening.in_time(noise.joint_mut(j)));
            let white = JointSignals::from_fn(3, samples, |j, k| {
                let weights = whitening.across(j).iter().enumerate();
                weights.map(|(i, w)| w * noise.joint(i)[k]).sum()
            });
            let bound = 5.0 / (samples as f64).sqrt();
            for (a, b) in [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)] {
                for lag in [0_usize, 1, 7, 125] {
                    let (x, y) = (&white.joint(a)[lag..], &white.joint(b)[..samples - lag]);
                    let seen = x.iter().zip(y).map(|(x, y)| x * y).sum::<f64>() / x.len() as f64;
                    let (wanted, bound) = if a == b && lag == 0 {
                        (1.0, bound * 2.0_f64.sqrt())
                    } else {
                        (0.0, bound)
                    };
                    assert!((seen - wanted).abs() < bound, "{model:?} {a} {b} lag {lag}: {seen}");
                }
            }
        }
    }

    /// AR(1): the best prediction is φ times the last sample; earlier samples do not improve it.
    #[test]
    fn an_autoregression_needs_one_sample() {
        let colour = Colour::Ar1 { time_constant_s: 0.05 };
        let components = vec![Component { share: 1.0, colour }];
        let model = NoiseModel { components, cross_joint_correlation: 0.0 };
        let whitening = Whitening::new(&model, &[1.0], RATE_HZ).unwrap();
        let phi = (-1.0 / (RATE_HZ * 0.05)).exp();
        let mut series = [1.0, 3.0, -2.0];
        whitening.in_time(&mut series);
        let scale = (1.0 - phi * phi).sqrt();
        for (seen, wanted) in
            series.iter().zip([1.0, (3.0 - phi) / scale, (-2.0 - 3.0 * phi) / scale])
        {
            assert!((seen - wanted).abs() < 1e-12, "{seen} is not {wanted}");
        }
    }
}
