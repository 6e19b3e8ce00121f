//! Time stamps that are rounded more coarsely than rows follow each other: `0.01 s` at 125 rows a second.
//!
//! Such stamps repeat, and where they do not they are off by up to half of their step. Rows that were recorded evenly lie on the straight
//! line through all of them. Whether they were, the motion tells: rows that are missing regularly, or written twice, have the same
//! pattern of stamps, but their angles follow from their velocities with the stamps as they are.

use std::ops::Range;

use super::clean::Motion;

/// Fewer rows do not tell a pattern.
pub(super) const FEWEST_ROWS: usize = 64;
/// Stamps that are rounded to this share of what rows are apart, or more coarsely, are looked at.
const COARSE: f64 = 0.5;
/// Rounded stamps lie within one step of the line. A recorder that is late now and then by a quarter of it is believed.
const WITHIN_STEPS: f64 = 1.25;
/// Their rms distance from it is that of rounding, 1/√12 of a step, or half as much; of a few wrong stamps it is less.
const LEAST_RMS_STEPS: f64 = 0.14;
/// How far off whole steps a stamp may be, in steps: decimal fractions of times of 10⁹ s.
const ROUNDING: f64 = 1e-3;
/// On the line angles follow from velocities this much better, or the stamps stay.
const BETTER: f64 = 0.5;
/// Share of rows that count: at rest nothing tells the time, and where an angle is wrapped it jumps by a turn.
const TELLING: f64 = 0.9;

/// Rows that were recorded evenly.
pub(super) struct EvenStamps {
    /// When, s.
    pub(super) time_s: Vec<f64>,
    /// What their own stamps were rounded to, s.
    pub(super) resolution_s: f64,
    /// Rows a second.
    pub(super) rate_hz: f64,
}

/// Even stamps for rows whose own are rounded; `None` where they are not, or not rounded alone.
pub(super) fn even_stamps(motion: &Motion) -> Option<EvenStamps> {
    let (time_s, rows) = (motion.time_s, motion.row);
    let (first_s, first_row) = (*time_s.first()?, *rows.first()?);
    if time_s.len() < FEWEST_ROWS {
        return None;
    }
    let steps = time_s.windows(2).map(|pair| pair[1] - pair[0]);
    let resolution_s = steps.filter(|step| *step > 0.0).fold(f64::INFINITY, f64::min);
    let is_on_grid = |t: &f64| {
        let steps = (t - first_s) / resolution_s;
        (steps - steps.round()).abs() < ROUNDING
    };
    let apart_s = (time_s[time_s.len() - 1] - first_s) / (time_s.len() - 1) as f64;
    let is_coarse = resolution_s >= COARSE * apart_s;
    if !is_coarse || !time_s.iter().all(is_on_grid) {
        return None;
    }
    // Rows that were set aside have their place in the file.
    let place: Vec<f64> = rows.iter().map(|row| row.abs_diff(first_row) as f64).collect();
    let count = time_s.len() as f64;
    let middle = place.iter().sum::<f64>() / count;
    let mean_s = first_s + time_s.iter().map(|t| t - first_s).sum::<f64>() / count;
    let square: f64 = place.iter().map(|k| (k - middle).powi(2)).sum();
    let product: f64 = place.iter().zip(time_s).map(|(k, t)| (k - middle) * (t - mean_s)).sum();
    let step_s = product / square;
    let even: Vec<f64> = place.iter().map(|k| mean_s + (k - middle) * step_s).collect();
    let off_s: Vec<f64> = time_s.iter().zip(&even).map(|(t, even)| t - even).collect();
    let ends = |[low, high]: [f64; 2], off: &f64| [low.min(*off), high.max(*off)];
    let [low, high] = off_s.iter().fold([f64::INFINITY, f64::NEG_INFINITY], ends);
    let rms_s = (off_s.iter().map(|off| off * off).sum::<f64>() / count).sqrt();
    let is_rounded =
        high - low <= WITHIN_STEPS * resolution_s && rms_s >= LEAST_RMS_STEPS * resolution_s;
    if step_s.is_nan() || step_s <= 0.0 || !is_rounded {
        return None;
    }
    let on_the_line = Motion { time_s: &even, ..*motion };
    let is_better = defect(&on_the_line) < BETTER * defect(motion);
    is_better.then(|| EvenStamps { resolution_s, rate_hz: 1.0 / step_s, time_s: even })
}

/// [`row_defect`] of [`TELLING`] of the rows is less, rad.
pub(super) fn defect(motion: &Motion) -> f64 {
    let mut defects: Vec<f64> = told_rows(motion).map(|k| row_defect(motion, k)).collect();
    let place = (TELLING * defects.len() as f64) as usize;
    let (_, defect, _) = defects.select_nth_unstable_by(place, f64::total_cmp);
    *defect
}

/// The rows that have a [`row_defect`].
pub(super) fn told_rows(motion: &Motion) -> Range<usize> {
    1..if motion.qd.is_empty() { motion.rows() - 1 } else { motion.rows() }
}

/// How far angles are from where velocities bring them from row `k` − 1 to row `k`, or, of a log without these, from the straight line
/// between the rows beside it, rad: the sum over the joints.
pub(super) fn row_defect(motion: &Motion, k: usize) -> f64 {
    let of_joint = |j: usize| match motion.qd.is_empty() {
        false => motion.defect(j, k - 1, k),
        true => between(motion, j, k),
    };
    (0..motion.q.len()).map(|j| of_joint(j).abs()).sum()
}

/// How far the angle of a joint in row `k` is from the straight line between the rows beside it, rad: a h²/2 where the stamps are right, and
/// q̇ times what they are off where they are not.
fn between(motion: &Motion, joint: usize, k: usize) -> f64 {
    let (t, q) = (motion.time_s, &motion.q[joint]);
    let span_s = t[k + 1] - t[k - 1];
    let share = if span_s > 0.0 { (t[k] - t[k - 1]) / span_s } else { 0.5 };
    q[k] - q[k - 1] - share * (q[k + 1] - q[k - 1])
}
