//! Periods in which something touched the arm, and which therefore are not among those that repeat throughout.

use std::ops::Range;

use crate::median::median;
use crate::robot::JointSignals;

/// Stretches of a period in which the run-in and the stop are found: a contact near an end of the log is not to be
/// taken for a part of them.
const STRETCHES: usize = 40;
/// Joints that differ by less than this share of their rms amplitude, in the median, move alike.
const SAME_MOTION: f64 = 0.02;
/// The same, at every instant of a stretch: more than a weak contact moves the arm, less than a run-in.
const NO_CONTACT: f64 = 2e-3;

/// `window`, longer by whole periods in which most of the motion repeats (a contact moves the arm for a
/// moment, and that period is then not among those that repeat throughout) and by what is there of another one, up to
/// the outermost stretch in which all of it does, less `edge` samples of what is added.
pub(super) fn with_disturbed_periods(
    q_rad: &JointSignals,
    period: f64,
    window: Range<usize>,
    edge: usize,
) -> Range<usize> {
    let step = period.round() as usize;
    let stretch = (step / STRETCHES).max(1);
    let amplitude = |q: &[f64]| {
        let mean = q.iter().sum::<f64>() / q.len() as f64;
        (q.iter().map(|q| (q - mean).powi(2)).sum::<f64>() / q.len() as f64).sqrt()
    };
    let amplitudes: Vec<f64> =
        (0..q_rad.joints()).map(|j| amplitude(q_rad.joint(j)) + 1e-6).collect();
    // Whether `measure` of the differences between the samples `own` and those from `other` on is below `limit`.
    let is_below = |measure: fn(&mut [f64]) -> f64, limit: f64, own: Range<usize>, other: usize| {
        amplitudes.iter().enumerate().all(|(j, amplitude)| {
            let q = q_rad.joint(j);
            let pairs = q[own.clone()].iter().zip(&q[other..]);
            let mut differences: Vec<f64> = pairs.map(|(a, b)| (a - b).abs() / amplitude).collect();
            measure(&mut differences) < limit
        })
    };
    let repeats = |own, other| is_below(largest, NO_CONTACT, own, other);
    let mostly_repeats = |own, other| is_below(middle, SAME_MOTION, own, other);
    let Range { mut start, mut end } = window.clone();
    while start >= step && mostly_repeats(start - step..start, start) {
        start -= step;
    }
    while end + step <= q_rad.samples() && mostly_repeats(end..end + step, end - step) {
        end += step;
    }
    // A period most of which repeats may begin with the run-in, or end with the arm stopping; and of the first and the
    // last period of the log only a part may be there.
    let first = (start.saturating_sub(step)..window.start).step_by(stretch).find(|&k| {
        repeats(k..k + stretch, k + step) && (k >= start || mostly_repeats(k..start, k + step))
    });
    let last_first = end + step.min(q_rad.samples() - end);
    let last = (0..=(last_first - window.end) / stretch)
        .map(|stretches| last_first - stretches * stretch)
        .take_while(|&k| k >= window.end.max(step) + stretch)
        .find(|&k| {
            repeats(k - stretch..k, k - stretch - step)
                && (k <= end || mostly_repeats(end..k, end - step))
        });
    let (start, end) = (first.unwrap_or(window.start), last.unwrap_or(window.end));
    (start + edge).min(window.start)..end.saturating_sub(edge).max(window.end)
}

/// The largest of `values`.
fn largest(values: &mut [f64]) -> f64 {
    values.iter().copied().fold(0.0, f64::max)
}

/// Their median; zero of none.
fn middle(values: &mut [f64]) -> f64 {
    median(values).unwrap_or(0.0)
}
