//! Repairs stamps that are times of arrival in a log of which rows were lost, or whose clock was set: the line of
//! [`arrival_stamps`](super::arrival_stamps) in pieces.
//!
//! The rows lie on a grid of even steps. How many steps lie between two rows is known from the motion where the arm
//! moves ([`RowSteps`]). What is left is seen in the stamps: no row arrives before it is sampled, and the promptest of
//! some rows is hardly late, so that the lateness of the promptest makes a step where time is missing.
//!
//! - Where the motion contradicts the number of steps, or where the arm rests, rows are missing: the grid goes on behind
//!   the gap, which lasts as long as the stamps say.
//! - Where the motion goes on from row to row, the clock of the stamps was set: the grid goes on as if it had not been.
//!   A clock that is slewed makes no step, and needs no repair: its rows are as even as the motion.

use super::account::LogWarning;
use super::arrival_stamps::{LOST, WINDOW, prompt_s, wander_s};
use super::clean::Motion;
use super::even_stamps::{FEWEST_ROWS, StampLine};
use super::row_steps::RowSteps;
use super::running::Running;
use crate::cumulative_sum::accumulate;
use crate::median::{median, robust_sigma};

/// Rows over which the step of the grid is measured. Many stretches of a motion last that long without a rest or a gap.
const SPAN: usize = 32;
/// The step is known if there are at least this many such stretches, which overlap, ...
const FEWEST_SPANS: usize = 64;
/// ... and this many pairs of them, one behind the other. These begin this many rows apart.
const FEWEST_PAIRS: usize = 16;
const STRIDE: usize = 8;
/// Beside a gap, at least this many rows tell how late it makes the stamps, even if they are beyond the next gap. The
/// promptest of them is rarely late by more than a tenth of the scatter.
const FEWEST_BESIDE: usize = 16;
/// A gap that brings the rows within this fraction of a step of the grid is a number of lost rows. Promptest rows are
/// known to about a tenth of the step if stamps scatter by as much as the step.
const WHOLE: f64 = 0.25;
/// A step of the lateness is more than this many of the standard deviations of windows where the motion is clear.
const STEADY: f64 = 6.0;
/// The row of a step is known from the stamps to within those rows that fit worse than the best one by this many times
/// the usual scatter. Each row that is taken for one of the other side costs about as much as the step is large.
const MARGIN: f64 = 8.0;

/// Returns even stamps for rows whose own stamps scatter about pieces of a line, and the warnings that report the repair;
/// `None` if the motion does not tell that the rows were sampled there.
pub(super) fn stamp_pieces(motion: &Motion) -> Option<(Vec<f64>, Vec<LogWarning>)> {
    if motion.rows() < FEWEST_ROWS {
        return None;
    }
    let mut pieces = Pieces::new(motion)?;
    pieces.find_gaps();
    pieces.follow_clock()?;
    let line = pieces.line(motion.time_s)?;
    if !line.is_told_by(motion) {
        return None;
    }
    let (rms_s, wander_s) = (line.rms_s(), wander_s(&line.off_s));
    let mut warnings = vec![LogWarning::ArrivalStamps { rms_s, rate_hz: 1.0 / line.step_s }];
    if let Some(&(first, first_s)) = pieces.set_s.first() {
        let (times, after_row) = (pieces.set_s.len(), motion.row[first - 1]);
        warnings.push(LogWarning::ClockSet { times, after_row, first_s });
    }
    if wander_s > pieces.least_s {
        warnings.push(LogWarning::ClockWanders { wander_s });
    }
    Some((line.even_s, warnings))
}

/// How much later the promptest rows `behind` are than those `before`, s.
fn later_s(before: &[f64], behind: &[f64]) -> f64 {
    prompt_s(behind) - prompt_s(before)
}

/// The grid on which the rows lie, and how late their stamps are.
struct Pieces {
    counted: RowSteps,
    /// Place of each row on the grid, in steps.
    place: Running,
    /// Stamp of each row minus its place, s.
    late_s: Running,
    /// The step of the grid, s.
    step_s: f64,
    /// A step of the lateness is larger than this, s.
    least_s: f64,
    /// The rows in front of which the clock was set, and by how much, s.
    set_s: Vec<(usize, f64)>,
}

impl Pieces {
    /// The grid by the motion alone; `None` if the motion is nowhere clear for long enough to tell its step.
    fn new(motion: &Motion) -> Option<Self> {
        let counted = RowSteps::of(motion)?;
        let (time_s, rows) = (motion.time_s, motion.rows());
        let mut place = counted.steps.clone();
        accumulate(&mut place);
        let mut clear_until: Vec<usize> =
            counted.are_clear.iter().copied().map(usize::from).collect();
        accumulate(&mut clear_until);
        let are_clear = |from: usize, to: usize| clear_until[to] - clear_until[from] == to - from;
        let slope_s = |k: usize| (time_s[k + SPAN] - time_s[k]) / (place[k + SPAN] - place[k]);
        let spans = (0..rows - SPAN).filter(|k| are_clear(*k, *k + SPAN));
        let mut slopes_s: Vec<f64> = spans.map(slope_s).collect();
        let pairs = (SPAN..rows - SPAN).step_by(STRIDE);
        let pairs: Vec<usize> = pairs.filter(|k| are_clear(*k - SPAN, *k + SPAN - 1)).collect();
        if slopes_s.len() < FEWEST_SPANS || pairs.len() < FEWEST_PAIRS {
            return None;
        }
        let late_s = |step_s: f64| -> Vec<f64> {
            let late_s = |(t, place): (&f64, &f64)| t - time_s[0] - place * step_s;
            time_s.iter().zip(&place).map(late_s).collect()
        };
        let changes_s = |step_s: f64| -> Vec<f64> {
            let late_s = late_s(step_s);
            let change_s = |k: &usize| later_s(&late_s[k - SPAN..*k], &late_s[*k..k + SPAN]);
            pairs.iter().map(change_s).collect()
        };
        let mut step_s = median(&mut slopes_s)?;
        // Promptest rows tell the step better than single rows, but only where the step is nearly right already.
        for _ in 0..2 {
            let changes_s = changes_s(step_s);
            let error_s = |(change_s, k): (&f64, &usize)| {
                2.0 * change_s / (place[k + SPAN] - place[k - SPAN])
            };
            let mut errors_s: Vec<f64> = changes_s.iter().zip(&pairs).map(error_s).collect();
            step_s += median(&mut errors_s)?;
        }
        if step_s.is_nan() || step_s <= 0.0 {
            return None;
        }
        let mut sizes_s: Vec<f64> = changes_s(step_s).iter().map(|change| change.abs()).collect();
        let sigma_s = robust_sigma(&mut sizes_s) * (SPAN as f64 / WINDOW as f64).sqrt();
        let late_s = Running::new(late_s(step_s));
        let least_s = (LOST * step_s).max(STEADY * sigma_s);
        Some(Self {
            counted,
            place: Running::new(place),
            late_s,
            step_s,
            least_s,
            set_s: Vec::new(),
        })
    }

    fn rows(&self) -> usize {
        self.counted.steps.len()
    }

    /// Finds how long the gaps last in front of the rows that the motion contradicts. A wild reading makes none.
    fn find_gaps(&mut self) {
        let rows = self.rows();
        let wrong: Vec<usize> = (1..rows).filter(|k| self.counted.are_wrong[*k]).collect();
        for k in wrong {
            let is_clear = |k: &usize| self.counted.are_clear[*k];
            let before = 1 + (1..k).rev().take_while(is_clear).take(WINDOW - 1).count();
            let behind = 1 + (k + 1..rows).take_while(is_clear).take(WINDOW - 1).count();
            let before = before.max(FEWEST_BESIDE).min(k);
            let behind = behind.max(FEWEST_BESIDE).min(rows - k);
            let late_s = self.late_s.of(k - before..k + behind);
            let lasts_s = later_s(&late_s[..before], &late_s[before..]);
            if lasts_s > LOST * self.step_s {
                self.add_gap(k, lasts_s);
            }
        }
        self.place.rewind();
        self.late_s.rewind();
    }

    /// Takes account of a gap that lasts this long in front of row `k`.
    fn add_gap(&mut self, k: usize, lasts_s: f64) {
        let place = self.place.of(k..k + 1)[0];
        let by_stamps = place + lasts_s / self.step_s;
        let on_grid = by_stamps.round();
        let is_whole = (by_stamps - on_grid).abs() < WHOLE;
        let steps = if is_whole { on_grid - place } else { by_stamps - place };
        self.counted.steps[k] += steps;
        self.place.add(k, steps);
        self.late_s.add(k, -steps * self.step_s);
    }

    /// How much later the rows from `k` on are than the rows before, s.
    fn later_from(&mut self, k: usize) -> f64 {
        let (before, behind) = (WINDOW.min(k), WINDOW.min(self.rows() - k));
        let late_s = self.late_s.of(k - before..k + behind);
        later_s(&late_s[..before], &late_s[before..])
    }

    /// Finds the steps of lateness that are left, and takes account of them; `None` if the clock went back where the
    /// motion does not tell.
    fn follow_clock(&mut self) -> Option<()> {
        let rows = self.rows();
        let mut k = SPAN;
        while k + SPAN <= rows {
            let mut largest_s = self.later_from(k);
            if largest_s.abs() <= self.least_s {
                k += STRIDE;
                continue;
            }
            // A step shows in all windows that it divides.
            let (begin, sign) = (k, largest_s.signum());
            let mut end = begin;
            while end + STRIDE + SPAN <= rows && end < begin + WINDOW {
                let next_s = self.later_from(end + STRIDE);
                if next_s * sign <= self.least_s {
                    break;
                }
                end += STRIDE;
                if next_s.abs() > largest_s.abs() {
                    largest_s = next_s;
                }
            }
            let (from, to) = (begin.saturating_sub(SPAN).max(1), (end + SPAN).min(rows - 1));
            let (row, is_gap) = self.step_between(from, to, largest_s)?;
            let is_inside = (SPAN..=rows - SPAN).contains(&row);
            let size_s = if is_inside { self.later_from(row) } else { largest_s };
            if size_s.abs() <= self.least_s {
                k = end + STRIDE;
                continue;
            }
            if is_gap {
                self.add_gap(row, size_s);
            } else {
                self.late_s.add(row, -size_s);
                self.set_s.push((row, size_s));
            }
            k = begin.max(row) + STRIDE;
        }
        Some(())
    }

    /// The row in front of which the lateness makes a step of this size, of the rows `from` to `to`, and whether it is a
    /// gap: it is one if there are likely rows for which the motion does not say that it goes on. `None` if the step
    /// goes back and the motion does not tell.
    fn step_between(&mut self, from: usize, to: usize, size_s: f64) -> Option<(usize, bool)> {
        let first = from.saturating_sub(WINDOW);
        let last = (to + WINDOW).min(self.rows());
        let late_s = self.late_s.of(first..last).to_vec();
        let before_s = match from >= SPAN {
            true => median(&mut late_s[..from - first].to_vec())?,
            false => median(&mut late_s[to - first..].to_vec())? - size_s,
        };
        let off_s = |k: usize, level_s: f64| (late_s[k - first] - level_s).abs();
        // How badly the stamps fit if the step is in front of a row.
        let costs = |k: usize| off_s(k, before_s) - off_s(k, before_s + size_s);
        let mut costs: Vec<f64> = (from..to).map(costs).collect();
        accumulate(&mut costs);
        let cost = |k: usize| if k == from { 0.0 } else { costs[k - from - 1] };
        let scatter_s = |k: usize| off_s(k, before_s).min(off_s(k, before_s + size_s));
        let usual_s = median(&mut (from..=to).map(scatter_s).collect::<Vec<f64>>())?;
        let least_s = (from..=to).map(cost).fold(f64::INFINITY, f64::min);
        let is_likely = |k: &usize| cost(*k) <= least_s + MARGIN * usual_s;
        let likely: Vec<usize> = (from..=to).filter(is_likely).collect();
        let best =
            |rows: &[usize]| rows.iter().copied().min_by(|a, b| cost(*a).total_cmp(&cost(*b)));
        let untold = likely.iter().copied().filter(|k| !self.counted.are_clear[*k]);
        let untold: Vec<usize> = untold.collect();
        if untold.is_empty() {
            return Some((best(&likely)?, false));
        }
        // A gap that was found too long may be shortened, but time passes from row to row.
        let steps = size_s / self.step_s;
        let is_possible = |k: &usize| self.counted.steps[*k] + steps >= LOST;
        let possible: Vec<usize> = untold.into_iter().filter(is_possible).collect();
        Some((best(&possible)?, true))
    }

    /// The line through all stamps, less what the clock was set by, over the places of the rows on the grid.
    fn line(&mut self, time_s: &[f64]) -> Option<StampLine> {
        let mut set_s: Vec<f64> = vec![0.0; time_s.len()];
        for (k, by_s) in &self.set_s {
            set_s[*k] += by_s;
        }
        accumulate(&mut set_s);
        let unset_s: Vec<f64> = time_s.iter().zip(&set_s).map(|(t, set)| t - set).collect();
        StampLine::along(&unset_s, self.place.of(0..time_s.len()))
    }
}

#[cfg(test)]
mod tests {
    use super::super::arrival_stamps::scatter_is_common;
    use super::super::arrival_stamps::tests::{ROWS, STEP_S, arrivals, even};
    use super::*;
    use std::f64::consts::PI;

    type Repaired = Option<(Vec<f64>, Vec<LogWarning>)>;

    /// Two joints that swing by 0.5 rad every two seconds and rest from 3 s to 5 s, with a quarter of a second to stop
    /// and to start. They are sampled at `sampled_s` and stamped with `stamps_s`.
    fn repaired(sampled_s: &[f64], stamps_s: &[f64]) -> Repaired {
        let speed = |t: &f64| (((t - 4.0).abs() - 1.0) / 0.25).clamp(0.0, 1.0);
        let way = |t: &f64| {
            let moved_s = ((t - 4.0).abs() - 1.0).max(0.0);
            let way_s = if moved_s < 0.25 { 2.0 * moved_s * moved_s } else { moved_s - 0.125 };
            PI * way_s.copysign(t - 4.0)
        };
        let of = |f: &dyn Fn(&f64) -> f64| sampled_s.iter().map(f).collect::<Vec<f64>>();
        let q = [of(&|t| 0.5 * way(t).sin()), of(&|t| 0.5 * way(t).cos())];
        let half = 0.5 * PI;
        let qd =
            [of(&|t| half * speed(t) * way(t).cos()), of(&|t| -half * speed(t) * way(t).sin())];
        let row: Vec<usize> = (2..sampled_s.len() + 2).collect();
        let motion = Motion { time_s: stamps_s, q: &q, qd: &qd, row: &row };
        assert!(scatter_is_common(&motion));
        stamp_pieces(&motion)
    }

    /// All rows may be late by the same time.
    fn assert_close(time_s: &[f64], sampled_s: &[f64], bound_s: f64) {
        let late_s = |k: usize| time_s[k] - sampled_s[k];
        for k in 0..time_s.len() {
            assert!((late_s(k) - late_s(0)).abs() < bound_s, "{k}: {} {}", late_s(k), late_s(0));
        }
    }

    fn without(is_lost: impl Fn(usize) -> bool) -> Vec<f64> {
        let even_s = even();
        (0..ROWS).filter(|k| !is_lost(*k)).map(|k| even_s[k]).collect()
    }

    /// Single rows and twenty rows are lost while the arm moves, or a hundred while it rests. The line is as right as
    /// that of a log without gaps: five times its uncertainty is 1.2 ms (see `arrival_stamps`).
    #[test]
    fn lost_rows_leave_gaps_where_they_are_missing() {
        let moving = without(|k| [400, 1700].contains(&k) || (1600..1620).contains(&k));
        let resting = without(|k| (950..1050).contains(&k));
        for sampled_s in [moving, resting] {
            let (time_s, warnings) = repaired(&sampled_s, &arrivals(&sampled_s)).unwrap();
            assert_close(&time_s, &sampled_s, 1.2e-3);
            assert!(matches!(warnings[..], [LogWarning::ArrivalStamps { .. }]), "{warnings:?}");
        }
    }

    /// A tenth of 128 exponential times of 3 ms is known to 0.09 ms, and a step between two windows to 0.12 ms; five
    /// times that is 0.6 ms. It turns the line by at most 0.7 ms over the log, beside the 1.2 ms above.
    #[test]
    fn a_clock_that_is_set_moves_no_row() {
        for by_s in [0.3, -0.3] {
            let mut stamps_s = arrivals(&even());
            stamps_s[1500..].iter_mut().for_each(|t| *t += by_s);
            let (time_s, warnings) = repaired(&even(), &stamps_s).unwrap();
            assert_close(&time_s, &even(), 1.9e-3);
            // Sample 1499, after which the clock was set, is in row 1501.
            let [
                LogWarning::ArrivalStamps { .. },
                LogWarning::ClockSet { times: 1, after_row: 1501, first_s },
            ] = warnings[..]
            else {
                panic!("{warnings:?}")
            };
            assert!((first_s - by_s).abs() < 0.6e-3, "{first_s}");
        }
    }

    /// A clock that gains 10 ms in 4 s: the steps stay equal, and are longer by less than what the clock gained.
    #[test]
    fn a_clock_that_is_slewed_keeps_rows_even() {
        let gained_s = |t: &f64| 2.5e-3 * (t - 2.0).clamp(0.0, 4.0);
        let arrivals = arrivals(&even());
        let stamps_s: Vec<f64> =
            arrivals.iter().zip(&even()).map(|(t, sampled)| t + gained_s(sampled)).collect();
        let (time_s, warnings) = repaired(&even(), &stamps_s).unwrap();
        let step_s = time_s[1] - time_s[0];
        assert!((STEP_S..1.0025 * STEP_S).contains(&step_s), "{step_s}");
        assert!(time_s.windows(2).all(|pair| (pair[1] - pair[0] - step_s).abs() < 1e-12));
        assert!(
            matches!(
                warnings[..],
                [LogWarning::ArrivalStamps { .. }, LogWarning::ClockWanders { .. }]
            ),
            "{warnings:?}"
        );
    }

    /// At rest, nothing tells whether a clock that goes back was set or another recording begins.
    #[test]
    fn a_clock_that_goes_back_at_rest_stays() {
        let mut stamps_s = arrivals(&even());
        stamps_s[1000..].iter_mut().for_each(|t| *t -= 0.3);
        assert!(repaired(&even(), &stamps_s).is_none());
    }

    #[test]
    fn uneven_samples_keep_their_stamps() {
        let stamps_s = arrivals(&even());
        assert!(repaired(&stamps_s, &stamps_s).is_none());
    }
}
