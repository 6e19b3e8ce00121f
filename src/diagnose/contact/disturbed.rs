//! Extends the window of repetitions by periods in which something touched the arm, and which therefore are not among
//! those that repeat throughout.

use std::ops::Range;

use crate::median::{median, robust_sigma};
use crate::robot::JointSignals;
use crate::signal::{cubic_at, variance_of};

/// Number of stretches per period in which the run-in and the stop are located: a contact near an end of the log must
/// not be mistaken for a part of them.
const STRETCHES: usize = 40;
/// Median difference, as a share of a joint's rms amplitude, below which two periods have the same motion.
const SAME_MOTION: f64 = 0.02;
/// The same for the largest difference within a stretch: more than the displacement by a weak contact, less than that
/// by a run-in.
const NO_CONTACT: f64 = 2e-3;
/// A joint that hardly moves may differ by this many σ of its encoder's noise, which happens at one of a million
/// instants.
const NOISE: f64 = 5.0;

/// A joint that moves by less than this, rad, is held: its differences between periods are rounding.
const HELD_RAD: f64 = 1e-6;

/// Extends `window` by whole periods in which most of the motion repeats: a contact moves the arm for a moment, and
/// that period is then not among those that repeat throughout. It is extended further into a partial period, up to the
/// outermost stretch in which all of the motion repeats. Of the added samples, the outermost `edge` are left out.
pub(super) fn with_disturbed_periods(
    q_rad: &JointSignals,
    period: f64,
    window: Range<usize>,
    edge: usize,
) -> Range<usize> {
    let step = period.round() as usize;
    let stretch = (step / STRETCHES).max(1);
    let amplitude = |j: usize| variance_of(q_rad.joint(j)).sqrt() + HELD_RAD;
    let amplitudes: Vec<f64> = (0..q_rad.joints()).map(amplitude).collect();
    // Differences between the samples `own` of joint `j` and those `periods` periods later.
    let differences = |j: usize, own: Range<usize>, periods: f64| -> Vec<f64> {
        let q = q_rad.joint(j);
        own.map(|k| (q[k] - cubic_at(q, k as f64 + periods * period)).abs()).collect()
    };
    let repeated = window.start..window.end.saturating_sub(step).max(window.start);
    let noise_rad: Vec<f64> = (0..q_rad.joints())
        .map(|j| robust_sigma(&mut differences(j, repeated.clone(), 1.0)))
        .collect();
    // Whether `measure` of the differences is below the share `limit` of the amplitude, or below what noise makes of
    // it.
    let is_below = |measure: fn(&mut [f64]) -> f64, limit: f64, own: Range<usize>, periods: f64| {
        (0..q_rad.joints()).all(|j| {
            let limit_rad = (limit * amplitudes[j]).max(NOISE * noise_rad[j]);
            measure(&mut differences(j, own.clone(), periods)) < limit_rad
        })
    };
    let repeats = |own, periods| is_below(largest, NO_CONTACT, own, periods);
    let mostly_repeats = |own, periods| is_below(middle, SAME_MOTION, own, periods);
    let Range { mut start, mut end } = window.clone();
    while start >= step && mostly_repeats(start - step..start, 1.0) {
        start -= step;
    }
    while end + step <= q_rad.samples() && mostly_repeats(end..end + step, -1.0) {
        end += step;
    }
    // A period that mostly repeats may begin with the run-in, or end with the stopping of the arm; and the first and
    // the last period of the log may be incomplete.
    let first = (start.saturating_sub(step)..window.start)
        .step_by(stretch)
        .find(|&k| repeats(k..k + stretch, 1.0) && (k >= start || mostly_repeats(k..start, 1.0)));
    let last_first = end + step.min(q_rad.samples() - end);
    let last = (0..=(last_first - window.end) / stretch)
        .map(|stretches| last_first - stretches * stretch)
        .take_while(|&k| k >= window.end.max(step) + stretch)
        .find(|&k| repeats(k - stretch..k, -1.0) && (k <= end || mostly_repeats(end..k, -1.0)));
    let (start, end) = (first.unwrap_or(window.start), last.unwrap_or(window.end));
    (start + edge).min(window.start)..end.saturating_sub(edge).max(window.end)
}

/// The largest of `values`.
fn largest(values: &mut [f64]) -> f64 {
    values.iter().copied().fold(0.0, f64::max)
}

/// The median of `values`; zero if there are none.
fn middle(values: &mut [f64]) -> f64 {
    median(values).unwrap_or(0.0)
}
