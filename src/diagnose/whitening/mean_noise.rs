//! Noise of the mean torque: what the neighbouring harmonics predict, corrected by the scatter of the means of the
//! periods.

use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use crate::diagnose::noise_power::Uncertainty;
use crate::signal::LogScatter;

/// A mean torque drifts if noise alone makes it scatter so much more than its neighbours with less than this
/// probability. If it scatters so much less, with less than this probability, it tells nothing, as where the torque of
/// a still joint is rounded.
const RARE: f64 = 1.0 / 300.0;

/// Probability, under noise, below which the scatter of a joint's mean torque is worth a remark.
const REMARKABLE: f64 = 1e-5;

/// Probability that noise makes a mean torque scatter less than `ratio` times the prediction of the neighbouring
/// harmonics, whose logarithm has the variance `unknown`; `None` where nothing scatters at all.
fn below(ratio: f64, freedom: usize, unknown: f64) -> Option<f64> {
    let of_noise = FisherSnedecor::new(freedom as f64, 2.0 / unknown).ok();
    of_noise.filter(|_| ratio.is_finite()).map(|of_noise| of_noise.cdf(ratio))
}

/// Whether a mean torque whose scatter is `ratio` times the prediction varies more than noise can, see
/// [`with_own_scatter`].
pub fn drifts(ratio: f64, freedom: usize, unknown: f64) -> bool {
    below(ratio, freedom, unknown).is_some_and(|below| below > 1.0 - REMARKABLE)
}

/// Corrects the noise power of the mean by its own scatter over the periods. Returns the factor for each joint, and
/// updates `unknown` to the uncertainty that remains. `ratio` is the scatter of every joint's mean relative to the
/// prediction of the neighbouring harmonics, with ν degrees of `freedom`.
///
/// A joint whose mean drifts gets the power of its scatter. For the others, x = ln ratio scatters about s + c with the
/// variance ψ'(ν/2), where s is the error that all joints share and c that of the joint alone; `unknown` gives their
/// prior variances. The power is multiplied by the exponential of the posterior mean of s + c. The full posterior
/// variance of s is kept, although a joint's own ratio reduces its part of it.
pub fn with_own_scatter(ratio: &[f64], freedom: usize, unknown: &mut Uncertainty) -> Vec<f64> {
    let (mut steady, mut drifting) = (Vec::new(), Vec::new());
    for (j, &ratio) in ratio.iter().enumerate() {
        match below(ratio, freedom, unknown.of(j)).unwrap_or(0.0) {
            below if below > 1.0 - RARE => drifting.push(j),
            below if below < RARE => {}
            _ => steady.push(j),
        }
    }
    let scatter = LogScatter::of(freedom);
    let beyond = |j: usize| scatter.logarithm(ratio[j]);
    let own = |unknown: &Uncertainty, j: usize| unknown.level + unknown.colour[j];

    // Joints with coherent noise carry the same information on the shared error.
    let alike = 1.0 + (steady.len() as f64 - 1.0) * unknown.likeness;
    let weight = |j: &usize| 1.0 / (alike * (own(unknown, *j) + scatter.variance));
    let weights: f64 = steady.iter().map(weight).sum();
    let sum: f64 = steady.iter().map(|j| weight(j) * beyond(*j)).sum();
    let known = unknown.shared / (1.0 + unknown.shared * weights);
    let shared = known * sum;
    unknown.shared = known;

    let mut factor = vec![shared.exp(); ratio.len()];
    for &j in &steady {
        let before = own(unknown, j);
        let kept = before / (before + scatter.variance);
        factor[j] = (shared + kept * (beyond(j) - shared)).exp();
        unknown.colour[j] = (before * (1.0 - kept) - unknown.level).max(0.0);
    }
    for j in drifting {
        factor[j] = ratio[j];
        unknown.colour[j] = unknown.colour[j].max(2.0 / freedom as f64);
    }
    factor
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{SeedableRng, rngs::ChaCha8Rng};
    use rand_distr::{Distribution, StandardNormal};

    const JOINTS: usize = 6;
    const FREEDOM: usize = 7;

    fn before() -> Uncertainty {
        Uncertainty { shared: 0.03, level: 0.01, likeness: 0.0, colour: vec![0.04; JOINTS] }
    }

    /// The claimed remaining uncertainty of the noise is the actual one, and is less than before.
    #[test]
    fn errors_are_as_large_as_they_are_said_to_be() {
        const TRIALS: usize = 4000;
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let mut normal = || -> f64 { StandardNormal.sample(&mut rng) };
        let (mut squares, mut claimed) = (0.0, 0.0);
        for _ in 0..TRIALS {
            let mut unknown = before();
            let shared = unknown.shared.sqrt() * normal();
            let error: Vec<f64> = (0..JOINTS).map(|_| shared + 0.05f64.sqrt() * normal()).collect();
            let mut square = || (0..FREEDOM).map(|_| normal().powi(2)).sum::<f64>();
            let ratio: Vec<f64> =
                error.iter().map(|error| error.exp() * square() / FREEDOM as f64).collect();
            let factor = with_own_scatter(&ratio, FREEDOM, &mut unknown);
            for (j, (factor, error)) in factor.iter().zip(&error).enumerate() {
                squares += (factor.ln() - error).powi(2);
                claimed += unknown.of(j);
            }
        }
        let count = (TRIALS * JOINTS) as f64;
        let [square, claimed] = [squares / count, claimed / count];
        // By hand: 1/(1/0.03 + 6/(0.05 + 0.330)) for the shared error and 0.05 · 0.330/(0.05 + 0.330) for each joint's
        // own; one joint in 300 counts as drifting and has 2/7 instead of its own.
        let own = 0.043_42 + (2.0 / 7.0 - 0.043_42) / 300.0;
        assert!((claimed - (0.020_35 + own)).abs() < 3e-4, "{claimed}");
        // The square scatters by 1 %. The share (1 − 0.05/0.380)² of the shared variance actually remains, while all of
        // it is claimed, so that 0.92 of the claim is expected. As ln χ²₇ is skewed, the linear estimate loses a part
        // of this again, and noise that is taken for drift (one joint in 300) has an error of ln 3 and more.
        assert!((square / claimed - 0.97).abs() < 0.05, "{square} {claimed}");
    }

    /// Neither a drifting mean nor one without any noise says anything about the other joints.
    #[test]
    fn means_unlike_noise_are_left_to_themselves() {
        let mut unknown = before();
        let factor = with_own_scatter(&[1.0, 1.0, 30.0, 0.0, 1.0, 1.0], FREEDOM, &mut unknown);
        assert_eq!(factor[2], 30.0);
        assert!((factor[3].ln() - 0.036).abs() < 1e-3, "{factor:?}");
        assert_eq!(unknown.colour[2..4], [2.0 / 7.0, 0.04]);
        // E ln(χ²₇/7) is −0.149. From a ratio of one, the four joints attribute 0.149 · 4 · 0.030/0.380/(1 + 4 ·
        // 0.030/0.380) = 0.036 to the shared error, and 0.05/0.380 of the remainder each to their own.
        for j in [0, 1, 4, 5] {
            assert!((factor[j].ln() - 0.051).abs() < 1e-3, "{factor:?}");
        }
    }

    /// With two periods, the scatter of a mean is a single number. Without any joint that tells something, or without a
    /// shared error, nothing changes but by the joint's own scatter.
    #[test]
    fn few_periods_and_silent_joints_leave_numbers() {
        let mut unknown = before();
        let silent = [0.0, f64::NAN, 0.0, 0.0, 0.0, f64::NAN];
        assert_eq!(with_own_scatter(&silent, 1, &mut unknown), [1.0; JOINTS]);
        assert_eq!(unknown.shared, 0.03);
        let mut alone = Uncertainty { shared: 0.0, level: 0.1, likeness: 1.0, colour: vec![0.2] };
        let factor = with_own_scatter(&[0.5], 1, &mut alone);
        assert!(factor[0] > 0.9 && factor[0] < 1.1 && alone.of(0) < 0.3, "{factor:?} {alone:?}");
    }

    /// Six joints with the same noise tell as much as one.
    #[test]
    fn noise_that_is_alike_tells_once() {
        let known = |joints: usize, likeness: f64| {
            let colour = vec![0.04; joints];
            let mut unknown = Uncertainty { likeness, colour, ..before() };
            with_own_scatter(&vec![1.0; joints], FREEDOM, &mut unknown);
            unknown.shared
        };
        assert!((known(6, 1.0) / known(1, 0.0) - 1.0).abs() < 1e-12);
        assert!(known(6, 0.0) < 0.8 * known(6, 1.0));
    }
}
