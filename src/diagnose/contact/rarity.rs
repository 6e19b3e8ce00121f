//! Height of a bump that noise does not make.

use statrs::distribution::{ChiSquared, ContinuousCDF, Normal};

/// Rate, per length of the bump and relative to e^{−z²/2}, at which a bump searched for with 1 − u² passes a height of
/// ±z σ in white noise: 2 √(∫b'²/∫b²)/(2π) = √10/π (Rice 1945). Bumps whitened by coloured noise are narrower, and pass
/// up to eight times as often. On the other hand, bumps of neighbouring lengths are the same one half of the time, and
/// heights count as lower where few samples determine the noise. In simulated noise of several colours, the three
/// effects together leave a quarter to one and a half of the nominal chance.
const PASSES: f64 = 1.006_6;

/// Expected number of bumps of `length_s` made by noise during `duration_s`, relative to e^{−z²/2} for a height of z σ,
/// when `kinds` of them (lengths, joints) are searched for. Bumps that are already high at the beginning are not
/// counted; in the shortest places, they add a fifth.
pub(super) fn bumps(length_s: f64, duration_s: f64, kinds: usize) -> f64 {
    PASSES * duration_s / length_s * kinds as f64
}

/// Height in σ that noise exceeds with at most the probability `chance`, if it makes so many [`bumps`].
pub(super) fn far(bumps: f64, chance: f64) -> f64 {
    (2.0 * (bumps.max(1.0) / chance).ln()).sqrt()
}

/// Value of √(zᵀ C⁻¹ z) of `joints` joints that noise exceeds as rarely as a single joint exceeds `far`.
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

    /// Bumps in white noise pass 2.5 σ as often as expected.
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
        // 425 are expected. The Poisson σ is 5 %. σ estimated from 160 heights per signal adds 2.5² · 6 %/√60 = 5 %.
        // Together they give 7 %, of which 25 % is more than three and a half.
        assert!((passes / expected - 1.0).abs() < 0.25, "{passes} of {expected}");
    }

    /// χ²₆ exceeds x with the probability exp(−x/2) (1 + x/2 + x²/8). It exceeds 7.0181² as rarely as a Gaussian
    /// exceeds ±5.8: with the probability 6.63 · 10⁻⁹.
    #[test]
    fn a_bump_in_all_joints_is_as_rare_as_one_in_one() {
        assert!((as_far_in(1, 5.8) - 5.8).abs() < 1e-3);
        assert!((as_far_in(6, 5.8) - 7.0181).abs() < 1e-3, "{}", as_far_in(6, 5.8));
    }

    /// In a log of the length used in the paper, a push of a second may be lower than a knock.
    #[test]
    fn what_lasts_has_fewer_places() {
        let heights = [0.1, 1.0, 6.0].map(|length_s| far(bumps(length_s, 80.0, 12 * 6), 0.000_3));
        // √(2 ln(72 · 1.0066 · 80/L/0.0003)), by hand.
        for (height, by_hand) in heights.iter().zip([6.177, 5.793, 5.475]) {
            assert!((height - by_hand).abs() < 1e-3, "{heights:?}");
        }
    }
}
