//! Noise that is louder at some times than at others; there, a bump has to be higher.
//!
//! The loudness of a signal is the median size of its second differences nearby, to which a bump adds little: those of
//! the shortest bump, 0.1 s, at eight times the height of the noise are as large as those of the noise.

use std::ops::Range;

use crate::median::median;
use crate::robot::JointSignals;

/// Second differences within this time to either side determine the loudness, s.
const NEARBY_S: f64 = 0.35;
/// Interval at which the loudness is evaluated, s.
const STEP_S: f64 = 0.1;
/// Ratio to the usual loudness from which on a stretch counts as louder. The median of 80 correlated second differences
/// is known to 15 %; a difference of less than five times that may be chance.
const CLEARLY: f64 = 1.8;
/// Upper limit of the loudness. An arm that was hit shakes; and where periods are alike to the last digits, a push is
/// the only change, however soft.
const LOUDEST: f64 = 3.0;

/// Loudness of signals relative to their usual one, ℓ.
pub(super) struct Loudness {
    /// Σ ℓ² over the samples before each one, per signal.
    sums: Vec<Vec<f64>>,
}

impl Loudness {
    /// Loudness of `signals`, sampled at `rate_hz`.
    pub(super) fn of(signals: &JointSignals, rate_hz: f64) -> Self {
        let sums = (0..signals.joints()).map(|j| sums(signals.joint(j), rate_hz)).collect();
        Self { sums }
    }

    /// Root mean square of ℓ of a signal over `samples`: the factor by which noise makes higher bumps there.
    pub(super) fn over(&self, signal: usize, samples: Range<usize>) -> f64 {
        let sums = &self.sums[signal];
        let [start, end] = [samples.start, samples.end].map(|k| k.min(sums.len() - 1));
        if start < end { ((sums[end] - sums[start]) / (end - start) as f64).sqrt() } else { 1.0 }
    }
}

fn sums(y: &[f64], rate_hz: f64) -> Vec<f64> {
    let sizes: Vec<f64> = y.windows(3).map(|w| (w[2] - 2.0 * w[1] + w[0]).abs()).collect();
    let usual = median(&mut sizes.clone()).unwrap_or(0.0);
    let reach = (NEARBY_S * rate_hz) as usize + 1;
    let step = (STEP_S * rate_hz) as usize + 1;
    let of_block = |block: usize| {
        let middle = block * step + step / 2;
        let near = middle.saturating_sub(reach).min(sizes.len())..(middle + reach).min(sizes.len());
        let ratio = median(&mut sizes[near].to_vec()).unwrap_or(0.0) / usual;
        // Where the signal changes only here and there, nothing is loud or quiet.
        if ratio.is_finite() && ratio > CLEARLY { ratio.min(LOUDEST).powi(2) } else { 1.0 }
    };
    let blocks: Vec<f64> = (0..y.len().div_ceil(step)).map(of_block).collect();
    // A window that only touches a loud stretch measures little of it; its neighbours count as well.
    let beside = reach.div_ceil(step);
    let loudest = |block: usize| {
        let near = block.saturating_sub(beside)..(block + beside + 1).min(blocks.len());
        blocks[near].iter().copied().fold(1.0, f64::max)
    };
    let squares: Vec<f64> = (0..blocks.len()).map(loudest).collect();
    let mut sum = 0.0;
    let mut sums = vec![0.0];
    sums.extend((0..y.len()).map(|k| {
        sum += squares[k / step];
        sum
    }));
    sums
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{SeedableRng, rngs::ChaCha8Rng};
    use rand_distr::{Distribution, StandardNormal};

    const RATE_HZ: f64 = 125.0;

    /// Loudness of a minute of noise that is three times as loud from 20 s to 22 s, with a bump of `height` σ from 40.0
    /// s to 40.4 s.
    fn loudness(height: f64) -> Loudness {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let y = JointSignals::from_fn(1, (60.0 * RATE_HZ) as usize, |_, k| {
            let noise: f64 = StandardNormal.sample(&mut rng);
            let t = k as f64 / RATE_HZ;
            let u = (t - 40.2) / 0.2;
            let loud = if (20.0..22.0).contains(&t) { 3.0 } else { 1.0 };
            loud * noise + height * (1.0 - u * u).max(0.0)
        });
        Loudness::of(&y, RATE_HZ)
    }

    fn over(loudness: &Loudness, seconds: Range<f64>) -> f64 {
        let at = |t: f64| (t * RATE_HZ) as usize;
        loudness.over(0, at(seconds.start)..at(seconds.end))
    }

    /// Each block is known to 15 %; among neighbouring blocks the loudest counts, up to three.
    #[test]
    fn loud_stretches_are_told_and_no_others() {
        let all = loudness(0.0);
        let ratio = over(&all, 20.3..21.7) / 3.0;
        assert!((0.9..=1.0).contains(&ratio), "{ratio}");
        // Sums of ones, rounded.
        assert!((over(&all, 0.0..19.0) - 1.0).abs() < 1e-12);
        assert!((over(&all, 23.0..60.0) - 1.0).abs() < 1e-12);
    }

    /// A push, however hard, is not loud.
    #[test]
    fn a_push_is_not_loud() {
        assert!((over(&loudness(30.0), 39.5..41.0) - 1.0).abs() < 1e-12);
    }

    #[test]
    fn a_signal_without_noise_is_nowhere_loud() {
        let still = Loudness::of(&JointSignals::zeros(1, 500), RATE_HZ);
        assert_eq!(over(&still, 0.0..4.0), 1.0);
    }
}
