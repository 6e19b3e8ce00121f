//! Separates motion from rest by the log's own noise and speed.

use std::ops::Range;

use super::error::{SignalError, checked_rate_hz, enough};
use super::noise::block_noise;
use super::readings::resolution;
use crate::median::nearest_quantile;
use crate::robot::JointSignals;

/// Length of the blocks in which the noise is estimated, s.
const NOISE_BLOCK_S: f64 = 0.25;
/// Fraction of the blocks that counts as quiet; a log with less rest than that is treated as having none.
const QUIET_SHARE: f64 = 0.1;
/// Fraction of the fastest joint's rms speed below which nothing counts as motion: brakes, settling and sensor flicker
/// at rest are not noise of a fixed size.
const CREEP_SHARE: f64 = 0.005;
/// Steps of the recorded numbers up to which a reading at rest may flicker: more than one step, less than two. Printed
/// decimals make steps unequal, and the smallest of them, which is known, a little smaller than the others.
const FLICKER_STEPS: f64 = 1.5;
/// A rest is at least this long, s: shorter ones are reversals.
const SHORTEST_REST_S: f64 = 0.5;
/// Consecutive samples above the threshold that make a motion; fewer are outliers.
const SHORTEST_MOTION: usize = 3;

/// The stretches of motion and rest in one log.
#[derive(Debug, Clone, PartialEq)]
pub struct Activity {
    /// Velocity noise per joint in the quietest tenth of the log, rad/s.
    pub noise_rad_s: Vec<f64>,
    /// Velocity above which a joint counts as moving, rad/s: σ√(2 ln N), which the largest of N noise values hardly
    /// exceeds, plus one and a half times the resolution of the recorded numbers; but at least half a percent of the
    /// fastest joint's rms speed.
    pub threshold_rad_s: Vec<f64>,
    /// Stretches of samples in which no joint moves for half a second or longer.
    pub rests: Vec<Range<usize>>,
    moving: Option<Range<usize>>,
    samples: usize,
}

impl Activity {
    /// Finds motion and rest from the velocities `qd_rad_s` (joints × samples) recorded at `rate_hz`.
    ///
    /// There is nothing to set: the noise is estimated from sixth differences, in which motion cancels, and the
    /// resolution is the smallest distance between recorded values in the log.
    pub fn of(qd_rad_s: &JointSignals, rate_hz: f64) -> Result<Self, SignalError> {
        checked_rate_hz(rate_hz)?;
        let samples = qd_rad_s.samples();
        let block = (NOISE_BLOCK_S * rate_hz).ceil() as usize;
        enough("telling rest from motion", samples, 2 * block.max(16))?;
        let creep_rad_s = CREEP_SHARE
            * (0..qd_rad_s.joints()).map(|j| rms(qd_rad_s.joint(j))).fold(0.0, f64::max);
        let peak = (2.0 * ((samples * qd_rad_s.joints()) as f64).ln()).sqrt();

        let mut noise_rad_s = Vec::with_capacity(qd_rad_s.joints());
        let mut threshold_rad_s = Vec::with_capacity(qd_rad_s.joints());
        let mut moves = vec![false; samples];
        for j in 0..qd_rad_s.joints() {
            let series = qd_rad_s.joint(j);
            if let Some(sample) = series.iter().position(|v| !v.is_finite()) {
                let value = series[sample];
                return Err(SignalError::NotFinite { what: "velocity", joint: j, sample, value });
            }
            let noise = nearest_quantile(&block_noise(series, block.max(16)), QUIET_SHARE);
            let flicker_rad_s = FLICKER_STEPS * resolution(series);
            let threshold = (peak * noise + flicker_rad_s).max(creep_rad_s);
            for (moves, v) in moves.iter_mut().zip(series) {
                *moves |= v.abs() > threshold;
            }
            noise_rad_s.push(noise);
            threshold_rad_s.push(threshold);
        }

        let motions: Vec<Range<usize>> =
            runs(&moves).filter(|run| run.len() >= SHORTEST_MOTION).collect();
        let shortest_rest = (SHORTEST_REST_S * rate_hz).ceil() as usize;
        let starts = std::iter::once(0).chain(motions.iter().map(|m| m.end));
        let ends = motions.iter().map(|m| m.start).chain(std::iter::once(samples));
        let rests = starts.zip(ends).map(|(a, b)| a..b).filter(|r| r.len() >= shortest_rest);
        let moving = match (motions.first(), motions.last()) {
            (Some(first), Some(last)) => Some(first.start..last.end),
            _ => None,
        };
        Ok(Self { noise_rad_s, threshold_rad_s, rests: rests.collect(), moving, samples })
    }

    /// From the first moving sample to the last, widened by `margin` samples at both ends as far
    /// as the log goes; `None` if nothing moves.
    pub fn moving_window(&self, margin: usize) -> Option<Range<usize>> {
        let moving = self.moving.as_ref()?;
        Some(moving.start.saturating_sub(margin)..(moving.end + margin).min(self.samples))
    }
}

/// Root mean square.
pub fn rms(y: &[f64]) -> f64 {
    (y.iter().map(|v| v * v).sum::<f64>() / y.len() as f64).sqrt()
}

/// Runs of consecutive `true`.
fn runs(flags: &[bool]) -> impl Iterator<Item = Range<usize>> {
    let mut end = 0;
    flags.chunk_by(|a, b| a == b).filter_map(move |chunk| {
        let start = end;
        end += chunk.len();
        chunk[0].then_some(start..end)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{SeedableRng, rngs::ChaCha8Rng};
    use rand_distr::{Distribution, StandardNormal};
    use std::f64::consts::PI;

    /// Rest, motion from 3 s to 9 s interrupted by a rest from 5 s to 6 s, then rest; optionally quantised.
    fn log(sigma: f64, resolution: f64) -> JointSignals {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        JointSignals::from_fn(2, 1500, |j, k| {
            let t = k as f64 / 125.0;
            let moves = (3.0..9.0).contains(&t) && !(5.0..6.0).contains(&t);
            let noise: f64 = StandardNormal.sample(&mut rng);
            let v = if moves && j == 1 { 0.5 * (PI * t).sin() } else { 0.0 } + sigma * noise;
            if resolution > 0.0 { (v / resolution).round() * resolution } else { v }
        })
    }

    #[test]
    fn rest_and_motion_are_told_apart_by_the_noise_of_the_log() {
        for (sigma, resolution) in
            [(1e-3, 0.0), (1e-5, 1e-4), (0.0, 1e-4), (0.0, 0.0), (5e-3, 1e-3)]
        {
            let activity = Activity::of(&log(sigma, resolution), 125.0).unwrap();
            let window = activity.moving_window(0).unwrap();
            // The speed rises by 0.0126 rad/s per sample: within ⌈threshold/0.0126⌉ + 1 samples.
            let slack = (activity.threshold_rad_s[1] / 0.0126).ceil() as usize + 1;
            assert!(slack <= 4, "threshold {}", activity.threshold_rad_s[1]);
            assert!(window.start >= 375 && window.start <= 375 + slack, "{window:?}");
            assert!(window.end <= 1126 && window.end + slack >= 1125, "{window:?}");
            assert_eq!(activity.rests.len(), 3, "{:?}", activity.rests);
            assert_eq!(activity.moving_window(10).unwrap().start, window.start - 10);
            assert_eq!(activity.moving_window(9999).unwrap(), 0..1500);
        }
    }

    /// A standing encoder that flickers by one step, for as many rows as make a motion, and by two steps in single
    /// rows. Six decimals make steps of 0.958 and 0.959 mrad/s of a step of 0.95874 mrad/s.
    #[test]
    fn a_printed_step_is_no_motion_and_two_are() {
        const STEP_RAD_S: f64 = 0.00095874;
        let printed = |steps: i32| (1e6 * f64::from(steps) * STEP_RAD_S).round() / 1e6;
        let flicker = |k: usize| match k % 100 {
            20..23 => 1,
            60..63 => -1,
            80 => 2,
            _ => 0,
        };
        let still = JointSignals::from_fn(2, 1500, |_, k| printed(flicker(k)));
        let activity = Activity::of(&still, 125.0).unwrap();
        assert_eq!(activity.moving_window(0), None, "{:?}", activity.threshold_rad_s);
        let slow = JointSignals::from_fn(2, 1500, |_, k| {
            printed(if (700..703).contains(&k) { 2 } else { flicker(k) })
        });
        assert_eq!(Activity::of(&slow, 125.0).unwrap().moving_window(0), Some(700..703));
    }

    #[test]
    fn a_log_of_rest_has_no_moving_window() {
        let mut rng = ChaCha8Rng::seed_from_u64(6);
        let still = JointSignals::from_fn(6, 5000, |_, _| {
            let noise: f64 = StandardNormal.sample(&mut rng);
            1e-3 * noise
        });
        let activity = Activity::of(&still, 125.0).unwrap();
        assert_eq!(activity.moving_window(5), None);
        assert_eq!(activity.rests, std::slice::from_ref(&(0..5000)));
    }
}
