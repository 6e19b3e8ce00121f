//! How high a bump has to be that noise does not make.

use statrs::distribution::{ChiSquared, ContinuousCDF, Normal};

/// How often per length of itself a bump that is looked for with 1 − u² passes a height of z σ either way in white noise, over
/// e^{−z²/2}: 2 √(∫b'²/∫b²)/(2π) = √10/π (Rice 1945). Whitened by coloured noise bumps are narrower, and pass up to eight times
/// as often. Bumps of neighbouring lengths are half of the time the same one, and heights of noise that few samples tell count as
/// lower: in simulated noise of several colours the three together leave a quarter to one and a half of the chance.
const PASSES: f64 = 1.006_6;

/// How often noise makes bumps of `length_s`, over e^{−z²/2} of their height z σ, where so many `kinds` of them (lengths, joints) are
/// looked for during `duration_s`; but for those that are high already when it begins, which add a fifth in the shortest places.
pub(super) fn bumps(length_s: f64, duration_s: f64, kinds: usize) -> f64 {
    PASSES * duration_s / length_s * kinds as f64
}

/// σ from which on a bump is made by noise with the `chance` at most, if noise makes so many [`bumps`].
pub(super) fn far(bumps: f64, chance: f64) -> f64 {
    (2.0 * (bumps.max(1.0) / chance).ln()).sqrt()
}

/// √(zᵀ C⁻¹ z) of `joints` joints that noise passes as rarely as one joint passes `far`.
pub(super) fn as_far_in(joints: usize, far: f64) -> f64 {
    let chance = 2.0 * Normal::standard().cdf(-far);
    ChiSquared::new(joints as f64).map_or(far, |chi2| chi2.inverse_cdf(1.0 - chance).sqrt())
}

#[cfg(test)]
mod tests {
    use rand::{SeedableRng, rngs::ChaCha8Rng};
    use rand_distr::{Distribution, StandardNormal};

    use super::super::bump::{ORDINARY, bump};
    use super::*;
    use crate::robot::JointSignals;
    use crate::signal::MatchedFilter;

    /// Bumps of white noise pass 2.5 σ as often as they are expected to.
    #[test]
    fn noise_passes_a_height_as_often_as_expected() {
        const RATE_HZ: f64 = 100.0;
        const SIGNALS: usize = 60;
        const SAMPLES: usize = 8000;
        const LENGTH_S: f64 = 0.5;
        const HEIGHT: f64 = 2.5;
        let mut rng = ChaCha8Rng::seed_from_u64(11);
        let noise = JointSignals::from_fn(SIGNALS, SAMPLES, |_, _| StandardNormal.sample(&mut rng));
        let filter = MatchedFilter::new(&noise, RATE_HZ).unwrap();
        let heights = filter.heights(|t_s| bump(ORDINARY, LENGTH_S, t_s));
        let passes = (0..SIGNALS).map(|j| {
            let sigma = heights.scale(j) / heights.information[j].sqrt();
            let is_far = |h: &f64| h.abs() > HEIGHT * sigma;
            let heights = heights.height.joint(j);
            heights.windows(2).filter(|both| !is_far(&both[0]) && is_far(&both[1])).count()
        });
        let passes = passes.sum::<usize>() as f64;
        let expected = PASSES * SIGNALS as f64 * SAMPLES as f64 / (RATE_HZ * LENGTH_S)
            * (-0.5 * HEIGHT * HEIGHT).exp();
        // 425 are expected. Poisson's σ is 5 %, and σ known from 160 heights a signal moves them by 2.5² · 6 %/√60 = 5 %:
        // of both, 7 %, 25 % are more than three and a half.
        assert!((passes / expected - 1.0).abs() < 0.25, "{passes} of {expected}");
    }

    /// χ²₆ exceeds x with the probability exp(−x/2) (1 + x/2 + x²/8); 7.0181² does so as one Gaussian exceeds 5.8: with 6.63 · 10⁻⁹.
    #[test]
    fn a_bump_in_all_joints_is_as_rare_as_one_in_one() {
        assert!((as_far_in(1, 5.8) - 5.8).abs() < 1e-3);
        assert!((as_far_in(6, 5.8) - 7.0181).abs() < 1e-3, "{}", as_far_in(6, 5.8));
    }

    /// In the log of the paper's length a push of a second has to be less high than a knock.
    #[test]
    fn what_lasts_has_fewer_places() {
        let heights = [0.1, 1.0, 6.0].map(|length_s| far(bumps(length_s, 80.0, 12 * 6), 0.000_3));
        // √(2 ln(72 · 1.0066 · 80/L/0.0003)), by hand.
        for (height, by_hand) in heights.iter().zip([6.177, 5.793, 5.475]) {
            assert!((height - by_hand).abs() < 1e-3, "{heights:?}");
        }
    }
}
