//! Steps between periods that are caused by noise slower than a period.

use super::periods::PeriodWhitening;
use crate::diagnose::image::{Column, Image, dot};
use crate::diagnose::statistic::upper_chi_squared;
use crate::median::median;

/// Largest probability, under S, of steps as large as those of most joints (or of one joint) at which the steps count
/// as noise of their own.
const BY_CHANCE: f64 = 0.01;
/// Number of a joint's own steps to which the evidence of all joints is equivalent.
const OF_ALL: f64 = 7.0;

/// Step that noise makes in one period, per joint. Its height is the standard deviation beyond that which `whitening`
/// predicts for `torque`, Nm, along all periods; zero where the observed one is not larger. Empty where no joint steps.
///
/// Noise slower than a period ends it at another level than it began. To Fourier coefficients, that is a step, shared
/// by all harmonics, although S takes them to be independent. For Brownian motion, the square of the step is as large
/// as everything else, and without it the coefficients are independent (Watson 1961). Where steps are larger than S
/// predicts, they are treated as separate noise.
pub fn steps(whitening: &PeriodWhitening, torque: &Column) -> Vec<Image> {
    let (n, freedom, joints) = (whitening.samples(), whitening.periods() - 1, whitening.joints());
    let ramp: Vec<f64> = (0..n).map(|k| (k as f64 + 0.5) / n as f64 - 0.5).collect();
    let contrasts = whitening.image_in_noise(torque).contrast;
    let on_joint = |j| whitening.image_in_noise(&Column::on(j, ramp.clone()));
    let mut steps: Vec<Image> = (0..joints).map(on_joint).collect();
    // Mean of z² for every joint, with z the height of its steps relative to the σ given by S.
    let own = freedom as f64;
    let square = |step: &mut Image| {
        step.scale(1.0 / step.square().sqrt());
        let heights = contrasts.chunks_exact(step.mean.len());
        heights.map(|contrast| dot(&step.mean, contrast).powi(2)).sum::<f64>() / own
    };
    let squares: Vec<f64> = steps.iter_mut().map(square).collect();
    let by_chance =
        |square: f64, freedom: usize| upper_chi_squared(square * freedom as f64, freedom);
    // One drifting sensor says nothing of the noise of the others; hence the median.
    let usual = median(&mut squares.clone()).unwrap_or(0.0);
    let all_step = by_chance(usual, joints * freedom) < BY_CHANCE;
    let steps_alone = |square: f64| by_chance(square, freedom) < BY_CHANCE / joints as f64;
    if !all_step && !squares.iter().any(|square| steps_alone(*square)) {
        return Vec::new();
    }
    for (step, &square) in steps.iter_mut().zip(&squares) {
        let square = match (all_step, steps_alone(square)) {
            (true, _) => (own * square + OF_ALL * usual) / (own + OF_ALL),
            (false, true) => square,
            (false, false) => 1.0,
        };
        step.scale((square - 1.0).max(0.0).sqrt());
    }
    steps
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{SeedableRng, rngs::ChaCha8Rng};
    use rand_distr::{Distribution, StandardNormal};

    const SAMPLES: usize = 200;
    const PERIODS: usize = 8;
    const JOINTS: usize = 6;

    /// Joints (0-based) that step, where the torque of joint j performs a random walk with steps of `walk(j)` per
    /// sample, added to white noise of one.
    fn stepping(seed: u64, walk: impl Fn(usize) -> f64) -> Vec<usize> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut of_joint = |j: usize| {
            let mut noise = || -> f64 { StandardNormal.sample(&mut rng) };
            let mut slow = 0.0;
            let torque = (0..SAMPLES * PERIODS).map(|_| {
                slow += walk(j) * noise();
                slow + noise()
            });
            (j, torque.collect())
        };
        let torque = Column { parts: (0..JOINTS).map(&mut of_joint).collect() };
        let white = PeriodWhitening::of_white_noise(SAMPLES, PERIODS, JOINTS);
        let steps = steps(&white, &torque);
        let is_high = |(j, step): (usize, &Image)| (step.square() > 0.0).then_some(j);
        steps.iter().enumerate().filter_map(is_high).collect()
    }

    /// White noise ends a period where it began. By chance, 2 % of records show a step (1 % that of all joints, 1 %
    /// that of one of them), and two or more of ten records once in 62 times: 1 − 0.98¹⁰ − 10 · 0.02 · 0.98⁹ = 1.6 %.
    #[test]
    fn white_noise_does_not_step() {
        let records = (0..10).filter(|seed| !stepping(*seed, |_| 0.0).is_empty()).count();
        assert!(records < 2, "{records}");
    }

    /// A random walk with a tenth of the noise per sample reaches 1.4 of the noise after a period. The height of a step
    /// is known to √(12/200) = 0.24.
    #[test]
    fn what_walks_steps() {
        assert_eq!(stepping(21, |_| 0.1), [0, 1, 2, 3, 4, 5]);
        // One sensor alone, which the evidence of the others does not support.
        assert_eq!(stepping(22, |j| if j == 2 { 0.1 } else { 0.0 }), [2]);
    }
}
