//! How many sampling steps lie between two rows, as the motion tells.
//!
//! From row to row the angles advance by what one sampling step adds, times the number of steps; what one step adds is
//! known from the velocities, or from the advances beside. A row that was lost shows as an advance of two steps at the
//! very place where it is missing, to a hundredth of a step where the arm moves: stamps that are late by a step or so,
//! each by its own, do not show that place at all.

use std::f64::consts::TAU;

use super::clean::Motion;
use crate::median::{median, upper_quantile};

/// Advances that are used on each side where there are no velocities, or where these are late.
const BESIDE: usize = 2;
/// What is usual is taken from the rows that advance by at least this fraction of ...
const FAST: f64 = 0.5;
/// ... the advance that this share of the rows does not exceed. The usual deviation is that of the same share.
const USUAL: f64 = 0.9;
/// The motion tells a number of steps where half a step is this many times the usual deviation.
const SURE: f64 = 3.0;
/// A deviation this many times the usual one is not the motion's.
const FAR: f64 = 8.0;
/// Rows that are lost one or two at a time are counted by the motion alone. The speed changes over longer gaps.
const FEW_LOST: f64 = 2.0;
/// A number is accepted if all joints together agree with it to within this fraction of a step.
const AGREES: f64 = 0.25;

/// Numbers of sampling steps, each from the row before to a row; all vectors have an entry for the first row as well.
pub(super) struct RowSteps {
    /// The number; 0 for the first row.
    pub(super) steps: Vec<f64>,
    /// Whether the motion tells that it is right. At rest all numbers are.
    pub(super) are_clear: Vec<bool>,
    /// Whether the motion contradicts it: a long gap, or a wild or repeated reading.
    pub(super) are_wrong: Vec<bool>,
}

impl RowSteps {
    /// The steps of all rows; `None` for too few rows, or if the angles never change.
    pub(super) fn of(motion: &Motion) -> Option<Self> {
        let rows = motion.rows();
        if rows < 2 * BESIDE + 2 {
            return None;
        }
        // Rows that were set aside still have their place in the file.
        let between = motion.row.windows(2).map(|pair| pair[1].abs_diff(pair[0]) as f64);
        let apart: Vec<f64> = std::iter::once(0.0).chain(between).collect();
        let moved: Vec<Vec<f64>> = motion.q.iter().map(|q| advances(q)).collect();
        let ways = [by_velocities(motion, &moved, &apart), Some(by_neighbours(&moved, &apart))];
        // Velocities that are late, or noisy, predict worse than the rows beside.
        let advance = ways
            .into_iter()
            .flatten()
            .filter_map(|one| Advance::new(&moved, one, &apart))
            .min_by(|a, b| a.usual_along_rad.total_cmp(&b.usual_along_rad))?;
        Some(advance.counted(&apart))
    }
}

/// Advance of an angle from the row before to each row, rad, 0 for the first. A whole turn is a matter of notation.
fn advances(q: &[f64]) -> Vec<f64> {
    let moved = |pair: &[f64]| {
        let moved_rad = pair[1] - pair[0];
        moved_rad - TAU * (moved_rad / TAU).round()
    };
    std::iter::once(0.0).chain(q.windows(2).map(moved)).collect()
}

/// Advance of each joint in one step to each row by the mean velocity of the two rows, rad. The step is the one that fits
/// most rows: stamps say nothing about it, and the unit of the velocities does not matter. `None` without velocities,
/// and if these do not go with the angles.
fn by_velocities(motion: &Motion, moved: &[Vec<f64>], apart: &[f64]) -> Option<Vec<Vec<f64>>> {
    let mean = |qd: &Vec<f64>| -> Vec<f64> {
        let mean = qd.windows(2).map(|pair| 0.5 * (pair[0] + pair[1]));
        std::iter::once(0.0).chain(mean).collect()
    };
    let mut one: Vec<Vec<f64>> = motion.qd.iter().map(mean).collect();
    let square = |k: usize| product(&one, &one, k);
    let sizes: Vec<f64> = (0..apart.len()).map(|k| square(k).sqrt()).collect();
    let step_s = |k: usize| product(moved, &one, k) / (square(k) * apart[k]);
    let mut steps_s: Vec<f64> = fast(&sizes)?.into_iter().map(step_s).collect();
    let step_s = median(&mut steps_s).filter(|step_s| *step_s > 0.0)?;
    one.iter_mut().flatten().for_each(|rate| *rate *= step_s);
    Some(one)
}

/// Advance of each joint in one step to each row by the four advances beside, rad: the mean of the two in the middle,
/// which is right if the acceleration is constant, and if a row is missing in one of them.
fn by_neighbours(moved: &[Vec<f64>], apart: &[f64]) -> Vec<Vec<f64>> {
    let rows = apart.len();
    let of_joint = |moved: &Vec<f64>| -> Vec<f64> {
        let one = |k: usize| {
            let from = k.saturating_sub(BESIDE).clamp(1, rows - 2 * BESIDE - 1);
            let beside = (from..=from + 2 * BESIDE).filter(|i| *i != k);
            let mut beside: Vec<f64> = beside.map(|i| moved[i] / apart[i]).collect();
            median(&mut beside).unwrap_or(0.0)
        };
        std::iter::once(0.0).chain((1..rows).map(one)).collect()
    };
    moved.iter().map(of_joint).collect()
}

/// Sum over the joints of the products of two quantities in row `k`.
fn product(a: &[Vec<f64>], b: &[Vec<f64>], k: usize) -> f64 {
    a.iter().zip(b).map(|(a, b)| a[k] * b[k]).sum()
}

/// The rows that the arm reaches fast, by the `sizes` of what one step adds; `None` if it never moves.
fn fast(sizes: &[f64]) -> Option<Vec<usize>> {
    let usual = upper_quantile(&mut sizes.get(1..)?.to_vec(), USUAL)?;
    let is_fast = |k: &usize| sizes[*k] >= FAST * usual;
    (usual > 0.0).then(|| (1..sizes.len()).filter(is_fast).collect())
}

/// How far the angles advanced, and how far one step leads.
struct Advance<'a> {
    /// Advance of each joint to each row, rad.
    moved: &'a [Vec<f64>],
    /// Advance in one step, rad.
    one: Vec<Vec<f64>>,
    /// Size of the latter over all joints, rad.
    sizes_rad: Vec<f64>,
    /// Number of steps by the part of the advance that goes along it.
    along: Vec<f64>,
    /// Usual distance of the advance from a whole number of steps, rad, ...
    usual_rad: f64,
    /// ... and the part of it that goes along.
    usual_along_rad: f64,
}

impl<'a> Advance<'a> {
    fn new(moved: &'a [Vec<f64>], one: Vec<Vec<f64>>, apart: &[f64]) -> Option<Self> {
        let squares: Vec<f64> = (0..apart.len()).map(|k| product(&one, &one, k)).collect();
        let along = |k: usize| match squares[k] > 0.0 {
            true => product(moved, &one, k) / squares[k],
            false => 0.0,
        };
        let along: Vec<f64> = (0..apart.len()).map(along).collect();
        let sizes_rad: Vec<f64> = squares.iter().map(|square| square.sqrt()).collect();
        let fast = fast(&sizes_rad)?;
        let mut new = Self { moved, one, sizes_rad, along, usual_rad: 0.0, usual_along_rad: 0.0 };
        let missed = |k: &usize| new.missed_rad(*k, new.nearest(*k, apart));
        let mut missed_rad: Vec<f64> = fast.iter().map(missed).collect();
        let usual_rad = upper_quantile(&mut missed_rad, USUAL)?;
        let missed = |k: &usize| (new.along[*k] - new.nearest(*k, apart)).abs() * new.sizes_rad[*k];
        let mut missed_rad: Vec<f64> = fast.iter().map(missed).collect();
        let usual_along_rad = upper_quantile(&mut missed_rad, USUAL)?;
        new.usual_rad = usual_rad;
        new.usual_along_rad = usual_along_rad;
        Some(new)
    }

    /// The whole number of steps to row `k` that fits best, if few rows were lost.
    fn nearest(&self, k: usize, apart: &[f64]) -> f64 {
        self.along[k].round().clamp(apart[k], apart[k] + FEW_LOST)
    }

    /// Distance of the advance to row `k` from that of this number of `steps`, rad.
    fn missed_rad(&self, k: usize, steps: f64) -> f64 {
        let of_joint = |(moved, one): (&Vec<f64>, &Vec<f64>)| (moved[k] - steps * one[k]).powi(2);
        self.moved.iter().zip(&self.one).map(of_joint).sum::<f64>().sqrt()
    }

    /// Counts the steps to all rows, which are `apart` in the file.
    fn counted(&self, apart: &[f64]) -> RowSteps {
        let rows = apart.len();
        let is_told = |k: usize| 0.5 * self.sizes_rad[k] > SURE * self.usual_along_rad;
        // Behind a reading that is repeated the angles catch up, which is no lost row.
        let goes_on = |k: usize| k == 0 || k >= rows || !is_told(k) || self.along[k] > 0.5;
        let steps = |k: usize| {
            let nearest = self.nearest(k, apart);
            let bound_rad = (AGREES * self.sizes_rad[k]).max(FAR * self.usual_rad);
            let agrees = is_told(k) && self.missed_rad(k, nearest) <= bound_rad;
            if agrees && goes_on(k - 1) && goes_on(k + 1) { nearest } else { apart[k] }
        };
        let steps: Vec<f64> = std::iter::once(0.0).chain((1..rows).map(steps)).collect();
        let is_wrong = |k: usize| {
            let bound_rad = (FAR * self.usual_rad).max(0.5 * self.sizes_rad[k]);
            self.missed_rad(k, steps[k]) > bound_rad
                || is_told(k) && (self.along[k] - steps[k]).abs() > 0.5
        };
        let are_wrong: Vec<bool> = (0..rows).map(is_wrong).collect();
        let are_clear = (0..rows).map(|k| is_told(k) && !are_wrong[k]).collect();
        RowSteps { steps, are_clear, are_wrong }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ROWS: usize = 1000;
    const STEP_S: f64 = 0.004;

    /// Steps between the rows `kept` of a joint that swings by 0.5 rad once a second, with velocities that are late by
    /// `late_s`, or without any.
    fn steps(kept: &[usize], late_s: Option<f64>) -> RowSteps {
        let omega = TAU;
        let time_s: Vec<f64> = kept.iter().map(|k| *k as f64 * STEP_S).collect();
        let q = [time_s.iter().map(|t| 0.5 * (omega * t).sin()).collect::<Vec<f64>>()];
        let rate = |late_s: f64| -> Vec<f64> {
            time_s.iter().map(|t| 0.5 * omega * (omega * (t - late_s)).cos()).collect()
        };
        let qd: Vec<Vec<f64>> = late_s.map(rate).into_iter().collect();
        let row: Vec<usize> = (2..kept.len() + 2).collect();
        RowSteps::of(&Motion { time_s: &time_s, q: &q, qd: &qd, row: &row }).unwrap()
    }

    /// Single rows and pairs that were lost are counted where they are missing. The motion contradicts a longer gap, but
    /// does not say how long it lasts. Velocities may be missing, or late by five rows.
    #[test]
    fn lost_rows_are_counted_where_they_are_missing() {
        let is_lost = |k: &usize| [100, 333, 334, 620].contains(k) || (500..520).contains(k);
        let kept: Vec<usize> = (0..ROWS).filter(|k| !is_lost(k)).collect();
        for late_s in [Some(0.0), Some(5.0 * STEP_S), None] {
            let RowSteps { steps, are_wrong, .. } = steps(&kept, late_s);
            for k in 1..kept.len() {
                let missing = kept[k] - kept[k - 1];
                if missing > 3 {
                    assert!(are_wrong[k], "{late_s:?}");
                } else {
                    assert_eq!(steps[k], missing as f64, "{late_s:?} row {k}");
                }
            }
        }
    }

    /// A reading that is repeated is followed by an advance of two steps: no row is missing.
    #[test]
    fn repeated_readings_are_no_lost_rows() {
        let read: Vec<usize> = (0..ROWS).map(|k| if k == 500 { 499 } else { k }).collect();
        let RowSteps { steps, are_wrong, .. } = steps(&read, Some(0.0));
        assert!(steps[1..].iter().all(|steps| *steps == 1.0));
        assert!(are_wrong[500] && are_wrong[501]);
    }
}
