//! Repairs time stamps rounded more coarsely than the sampling interval: to `0.01 s` at 125 rows per second, for
//! example.
//!
//! Such stamps repeat, and those that do not are off by up to half of the resolution. Rows that were sampled evenly lie
//! on the straight line through all stamps. The motion decides whether they were: rows that are missing regularly, or
//! written twice, produce the same pattern of stamps, but then the angles follow from the velocities on the stamps as
//! they are.

use std::ops::Range;

use super::clean::Motion;

/// With fewer rows than this no pattern is recognisable.
pub(super) const FEWEST_ROWS: usize = 64;
/// Stamps are examined if their resolution is at least this fraction of the sampling interval.
const COARSE: f64 = 0.5;
/// Rounded stamps deviate from the line by at most one unit of resolution, peak to peak. A recorder that is
/// occasionally late by a quarter of that is still accepted.
const WITHIN_STEPS: f64 = 1.25;
/// Lowest rms deviation from the line, in units of the resolution: about half of 1/√12, the value for rounding. A few
/// wrong stamps give less.
const LEAST_RMS_STEPS: f64 = 0.14;
/// How far a stamp may be off the grid of its resolution, in units of the resolution: allows for decimal fractions of
/// times around 10⁹ s.
const ROUNDING: f64 = 1e-3;
/// The line is accepted only if it reduces the mismatch between angles and velocities to less than this fraction.
const BETTER: f64 = 0.5;
/// Quantile of the rows whose mismatch is compared. A high quantile is needed because an arm at rest says nothing about
/// time; the rows above it are ignored because a wrapped angle jumps by a turn.
const TELLING: f64 = 0.9;

/// Time stamps of rows that were sampled evenly.
pub(super) struct EvenStamps {
    /// The even time stamps, s.
    pub(super) time_s: Vec<f64>,
    /// Resolution of the original stamps, s.
    pub(super) resolution_s: f64,
    /// Rows per second.
    pub(super) rate_hz: f64,
}

/// Returns even stamps for rows whose own stamps are rounded; `None` if they are not rounded, or if rounding alone does
/// not explain them.
pub(super) fn even_stamps(motion: &Motion) -> Option<EvenStamps> {
    let time_s = motion.time_s;
    let first_s = *time_s.first()?;
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
    let line = StampLine::through(motion)?;
    let is_rounded = spread(line.off_s.iter().copied()) <= WITHIN_STEPS * resolution_s
        && line.rms_s() >= LEAST_RMS_STEPS * resolution_s;
    (is_rounded && line.is_told_by(motion)).then(|| EvenStamps {
        resolution_s,
        rate_hz: 1.0 / line.step_s,
        time_s: line.even_s,
    })
}

/// Distance of the largest of the `values` from the smallest.
pub(super) fn spread(values: impl Iterator<Item = f64>) -> f64 {
    let ends = |[low, high]: [f64; 2], value: f64| [low.min(value), high.max(value)];
    let [low, high] = values.fold([f64::INFINITY, f64::NEG_INFINITY], ends);
    high - low
}

/// The straight line through the stamps of all rows, by their places in the file.
pub(super) struct StampLine {
    /// The line at each row, s.
    pub(super) even_s: Vec<f64>,
    /// Its slope: the time between two rows, s.
    pub(super) step_s: f64,
    /// Stamp of each row minus the line, s.
    pub(super) off_s: Vec<f64>,
}

impl StampLine {
    /// The line of least squares through the stamps of rows that are evenly apart in the file; `None` if time does not
    /// pass along it.
    pub(super) fn through(motion: &Motion) -> Option<Self> {
        let first_row = *motion.row.first()?;
        // Rows that were set aside still have their place in the file.
        let place: Vec<f64> = motion.row.iter().map(|row| row.abs_diff(first_row) as f64).collect();
        Self::along(motion.time_s, &place)
    }

    /// The line of least squares through stamps over the places of their rows, in steps; `None` if time does not pass
    /// along it.
    pub(super) fn along(time_s: &[f64], place: &[f64]) -> Option<Self> {
        let first_s = *time_s.first()?;
        let count = time_s.len() as f64;
        let middle = place.iter().sum::<f64>() / count;
        let mean_s = first_s + time_s.iter().map(|t| t - first_s).sum::<f64>() / count;
        let square: f64 = place.iter().map(|k| (k - middle).powi(2)).sum();
        let product: f64 = place.iter().zip(time_s).map(|(k, t)| (k - middle) * (t - mean_s)).sum();
        let step_s = product / square;
        if step_s.is_nan() || step_s <= 0.0 {
            return None;
        }
        let even_s: Vec<f64> = place.iter().map(|k| mean_s + (k - middle) * step_s).collect();
        let off_s = time_s.iter().zip(&even_s).map(|(t, even)| t - even).collect();
        Some(Self { even_s, step_s, off_s })
    }

    /// Root mean square of the stamps about the line, s.
    pub(super) fn rms_s(&self) -> f64 {
        let squares: f64 = self.off_s.iter().map(|off| off * off).sum();
        (squares / self.off_s.len() as f64).sqrt()
    }

    /// Whether the `motion` tells that its rows were sampled along the line, and not when their stamps say.
    pub(super) fn is_told_by(&self, motion: &Motion) -> bool {
        let on_the_line = Motion { time_s: &self.even_s, ..*motion };
        defect(&on_the_line) < BETTER * defect(motion)
    }
}

/// The mismatch that the fraction [`TELLING`] of the rows does not exceed, rad (see [`row_defect`]).
pub(super) fn defect(motion: &Motion) -> f64 {
    let mut defects: Vec<f64> = told_rows(motion).map(|k| row_defect(motion, k)).collect();
    let place = (TELLING * defects.len() as f64) as usize;
    let (_, defect, _) = defects.select_nth_unstable_by(place, f64::total_cmp);
    *defect
}

/// The rows for which [`row_defect`] is defined.
pub(super) fn told_rows(motion: &Motion) -> Range<usize> {
    1..if motion.qd.is_empty() { motion.rows() - 1 } else { motion.rows() }
}

/// Mismatch of row `k`, rad, summed over the joints: the distance of the angles from where the velocities lead from row
/// `k` − 1 to row `k` or, in a log without velocities, from the straight line between the neighbouring rows.
pub(super) fn row_defect(motion: &Motion, k: usize) -> f64 {
    let of_joint = |j: usize| match motion.qd.is_empty() {
        false => motion.defect(j, k - 1, k),
        true => between(motion, j, k),
    };
    (0..motion.q.len()).map(|j| of_joint(j).abs()).sum()
}

/// Distance of a joint's angle in row `k` from the straight line between the neighbouring rows, rad. It is about q̈
/// h²/2 if the stamps are right, and q̇ times their error if they are not.
fn between(motion: &Motion, joint: usize, k: usize) -> f64 {
    let (t, q) = (motion.time_s, &motion.q[joint]);
    let span_s = t[k + 1] - t[k - 1];
    let share = if span_s > 0.0 { (t[k] - t[k - 1]) / span_s } else { 0.5 };
    q[k] - q[k - 1] - share * (q[k + 1] - q[k - 1])
}
