//! Properties of a sensor that the values of a recorded series reveal.

use crate::median::sigma_of_changes;

/// The resolution of a series as recorded: the smallest distance between two different values. Zero for a constant.
pub fn resolution(series: &[f64]) -> f64 {
    let mut values = series.to_vec();
    values.sort_by(f64::total_cmp);
    let scale =
        [values.first(), values.last()].into_iter().flatten().fold(0.0, |s: f64, v| s.max(v.abs()));
    // Values that differ only by rounding count as equal.
    let distances = values.windows(2).map(|v| v[1] - v[0]).filter(|d| *d > 1e-12 * scale);
    let smallest = distances.fold(f64::INFINITY, f64::min);
    if smallest.is_finite() { smallest } else { 0.0 }
}

/// Standard deviation of the noise of single readings.
///
/// It is estimated from fourth differences, Σ (−1)^i C(4, i) y_{k+i}: white noise is amplified by √70, and a motion at
/// a twentieth of the sampling rate is reduced to 1 % of its amplitude. The median of the differences that are not zero
/// is used, so half of them may be outliers, and a joint at rest may give constant readings.
pub fn reading_noise(series: &[f64]) -> f64 {
    let fourth = |y: &[f64]| y[0] - 4.0 * y[1] + 6.0 * y[2] - 4.0 * y[3] + y[4];
    let changes: Vec<f64> = series.windows(5).map(fourth).collect();
    sigma_of_changes(&changes) / 70f64.sqrt()
}

/// Smallest number of readings at the limit that is no coincidence, and its smallest ratio to the number at the next
/// value: with coarse steps the highest value is no more frequent than the one below it.
const AT_LIMIT: usize = 4;
const MORE_THAN_NEXT: usize = 3;

/// The magnitude at which the series is clipped: its largest magnitude, if exactly that number occurs again and again.
/// `None` if nothing is clipped.
pub fn reading_limit(series: &[f64]) -> Option<f64> {
    let mut sizes: Vec<f64> = series.iter().map(|v| v.abs()).collect();
    sizes.sort_by(|a, b| b.total_cmp(a));
    let largest = *sizes.first().filter(|v| **v > 0.0)?;
    // Values that differ only by rounding count as equal.
    let is_same = |a: f64, b: f64| (a - b).abs() <= 1e-12 * largest;
    let count = |of: &[f64]| of.iter().take_while(|v| is_same(**v, of[0])).count();
    let at_limit = count(&sizes);
    let next = sizes.get(at_limit..).filter(|rest| !rest.is_empty()).map_or(0, count);
    (at_limit >= AT_LIMIT && at_limit > MORE_THAN_NEXT * next).then_some(largest)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{SeedableRng, rngs::ChaCha8Rng};
    use rand_distr::{Distribution, StandardNormal};

    /// 5000 differences, each correlated with the next four: their median determines σ to some 2.5 %; the limit is four
    /// times that.
    #[test]
    fn noise_is_told_beside_a_motion_and_a_jump() {
        let mut rng = ChaCha8Rng::seed_from_u64(8);
        let reading = |k: usize| {
            let noise: f64 = StandardNormal.sample(&mut rng);
            let motion = (0.02 * k as f64).sin() + if k < 2000 { 0.0 } else { 1.0 };
            motion + 1e-3 * noise
        };
        let series: Vec<f64> = (0..5000).map(reading).collect();
        assert!((reading_noise(&series) / 1e-3 - 1.0).abs() < 0.1);
        assert_eq!(reading_noise(&[1.0; 40]), 0.0);
        // Rest for twice as long as the motion.
        let rested = [vec![0.0; 10_000], series].concat();
        assert!((reading_noise(&rested) / 1e-3 - 1.0).abs() < 0.1);
    }

    fn wave(limit: f64, step: f64) -> Vec<f64> {
        let value = |k: usize| 3.0 * (0.0371 * k as f64).sin() + 0.1 * (7.3 * k as f64).sin();
        let round = |v: f64| if step > 0.0 { step * (v / step).round() } else { v };
        (0..2000).map(|k| round(value(k)).clamp(-limit, limit)).collect()
    }

    #[test]
    fn a_reading_that_is_cut_off_shows_its_limit() {
        assert_eq!(reading_limit(&wave(2.8, 0.0)), Some(2.8));
        assert_eq!(reading_limit(&wave(9.0, 0.0)), None);
    }

    #[test]
    fn coarse_steps_are_no_limit() {
        assert_eq!(reading_limit(&wave(9.0, 0.05)), None);
        assert_eq!(reading_limit(&[0.0; 10]), None);
    }
}
