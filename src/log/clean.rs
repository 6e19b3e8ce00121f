//! Decides which rows of a log belong to the recorded motion, and unwraps its angles.

use crate::median::{UsualStep, median, median_step};
use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};

use super::account::{LogWarning, Reason};

/// Largest angle of a joint, rad: 159 turns. A larger number is not a position.
pub(super) const ANGLE_BOUND_RAD: f64 = 1e3;
/// Largest velocity of a joint, rad/s; the fastest arms reach about 15.
pub(super) const VELOCITY_BOUND_RAD_S: f64 = 100.0;

/// Mismatch of angle that is always accepted between rows, rad. It is above encoder noise, quantisation and the lag of
/// a filtered velocity (1 rad/s late by 20 ms is 0.02 rad), and far below the steps of uninitialised or shifted rows.
const STEP_TOLERANCE_RAD: f64 = 0.05;
/// Acceleration up to which a motion is plausible over a step, rad/s²; arms stay below about 20.
const ACCELERATION_RAD_S2: f64 = 20.0;
/// Change of velocity that is always accepted between rows, rad/s; it covers a collision or an emergency stop.
const VELOCITY_TOLERANCE_RAD_S: f64 = 1.0;
/// A row continues a stretch only if it is at most this many rows of the file after the last row of the stretch.
const BRIDGED_LINES: usize = 8;
/// A stretch with fewer rows than this that nothing connects to the other rows is garbage.
const SHORT_STRETCH: usize = 10;
/// Number of stretches that are kept open for continuation at any time.
const OPEN_STRETCHES: usize = 16;
/// A time step longer than this many median steps counts as far ahead.
const FAR_AHEAD_STEPS: f64 = 20.0;
/// Largest number of consecutive rows far ahead whose time is taken to be wrong. A longer run is a genuine pause, after
/// which the clock was set back.
const AHEAD_ROWS: usize = 8;

/// The columns that describe the motion of a log, one entry per row.
pub(super) struct Motion<'a> {
    pub(super) time_s: &'a [f64],
    /// Angle of each joint.
    pub(super) q: &'a [Vec<f64>],
    /// Velocity of each joint; empty for a file without velocities until they are computed from the angles.
    pub(super) qd: &'a [Vec<f64>],
    /// Number of the row in the file.
    pub(super) row: &'a [usize],
}

impl Motion<'_> {
    pub(super) fn rows(&self) -> usize {
        self.time_s.len()
    }

    /// Mismatch between angle and velocity, q_j(k) − q_j(i) − ½ (q̇_j(i) + q̇_j(k)) (t_k − t_i): zero for constant
    /// acceleration.
    pub(super) fn defect(&self, joint: usize, i: usize, k: usize) -> f64 {
        let (q, qd) = (&self.q[joint], &self.qd[joint]);
        q[k] - q[i] - 0.5 * (qd[i] + qd[k]) * (self.time_s[k] - self.time_s[i])
    }

    /// Largest mismatch of angle, or change of velocity, of any joint relative to its tolerance. Row `k` can follow row
    /// `i` if the result is at most 1. One whole turn does not count, because a wrapped angle is only a matter of
    /// notation.
    fn strain(&self, i: usize, k: usize) -> f64 {
        let step_s = self.time_s[k] - self.time_s[i];
        let tolerance_rad_s = VELOCITY_TOLERANCE_RAD_S + ACCELERATION_RAD_S2 * step_s;
        (0..self.q.len())
            .map(|joint| {
                let defect = self.defect(joint, i, k).abs();
                let change = (self.qd[joint][k] - self.qd[joint][i]).abs();
                let angle = defect.min((defect - TAU).abs()) / angle_tolerance_rad(step_s);
                angle.max(change / tolerance_rad_s)
            })
            .fold(0.0, f64::max)
    }

    /// The turn (+1 or −1) that the recorded angle lost from row `k` − 1 to row `k`: only a wrapped angle jumps that
    /// far.
    fn lost_turn(&self, joint: usize, k: usize) -> Option<f64> {
        if self.qd.is_empty() {
            // No joint moves by half a turn from one row to the next.
            let jump_rad = self.q[joint][k] - self.q[joint][k - 1];
            return (jump_rad.abs() > PI).then(|| -jump_rad.signum());
        }
        let tolerance_rad = angle_tolerance_rad(self.time_s[k] - self.time_s[k - 1]);
        let jump_rad = self.defect(joint, k - 1, k);
        let is_turn = (jump_rad.abs() - TAU).abs() <= tolerance_rad;
        (is_turn && jump_rad.abs() > tolerance_rad).then(|| -jump_rad.signum())
    }

    fn is_plausible(&self, k: usize) -> bool {
        self.q.iter().all(|q| q[k].abs() <= ANGLE_BOUND_RAD)
            && self.qd.iter().all(|qd| qd[k].abs() <= VELOCITY_BOUND_RAD_S)
    }
}

/// Mismatch of angle tolerated over a time step: the error of the trapezoidal rule is at most a Δt²/4 if the
/// acceleration stays within ±a.
fn angle_tolerance_rad(step_s: f64) -> f64 {
    STEP_TOLERANCE_RAD + ACCELERATION_RAD_S2 * step_s * step_s / 4.0
}

/// For every row the reason why its time is rejected, if it is; the remaining times increase strictly.
///
/// A time that is not after the one before it is set aside. The exception is a run of up to [`AHEAD_ROWS`] preceding
/// rows that are far ahead of the rows on both sides, provided that at least as many rows continue normally after it;
/// then the run is set aside instead.
pub(super) fn order_of_time(time_s: &[f64]) -> Vec<Option<Reason>> {
    let mut verdicts = vec![None; time_s.len()];
    let far = FAR_AHEAD_STEPS * median_step(time_s).unwrap_or(0.0);
    // The rows kept so far.
    let mut kept: Vec<usize> = Vec::with_capacity(time_s.len());
    for (k, &t) in time_s.iter().enumerate() {
        let (before, ahead) = kept.split_at(kept.partition_point(|&i| time_s[i] < t));
        let Some(&first) = ahead.first() else {
            kept.push(k);
            continue;
        };
        let goes_on = |next: &[f64]| next.iter().all(|&s| s > t && s < time_s[first]);
        let are_wrong = ahead.len() <= AHEAD_ROWS
            && time_s[first] - t > far
            && before.last().is_none_or(|&i| time_s[first] - time_s[i] > far)
            && time_s.get(k + 1..=k + ahead.len()).is_some_and(goes_on);
        if are_wrong {
            for &i in ahead {
                verdicts[i] = Some(Reason::TimeAhead);
            }
            let stay = before.len();
            kept.truncate(stay);
            kept.push(k);
        } else {
            let is_repeated = ahead.last().is_some_and(|&i| time_s[i] == t);
            verdicts[k] =
                Some(if is_repeated { Reason::TimeRepeated } else { Reason::TimeBackwards });
        }
    }
    verdicts
}

/// A sequence of rows that follow from one another.
struct Stretch {
    first: usize,
    last: usize,
    rows: usize,
}

/// For every row the reason why its motion is rejected, if it is.
///
/// Rows are linked into stretches: each row is appended to the stretch whose last row it follows best. A log is one
/// motion, so a stretch that is short compared with the longest, or interleaved with a longer one, is garbage (rows of
/// uninitialised memory, shifted fields, zeros).
pub(super) fn consistency(motion: &Motion) -> Vec<Option<Reason>> {
    let mut verdicts = vec![None; motion.rows()];
    let mut stretch_of = vec![0_usize; motion.rows()];
    let mut stretches: Vec<Stretch> = Vec::new();
    // Stretches that may be continued, least recently used first.
    let mut open: Vec<usize> = Vec::with_capacity(OPEN_STRETCHES);
    for k in 0..motion.rows() {
        if !motion.is_plausible(k) {
            verdicts[k] = Some(Reason::Implausible);
            continue;
        }
        let best = open
            .iter()
            .enumerate()
            .map(|(place, &stretch)| (place, stretches[stretch].last))
            .filter(|&(_, last)| motion.row[k] - motion.row[last] <= BRIDGED_LINES)
            .map(|(place, last)| (place, motion.strain(last, k)))
            .filter(|&(_, strain)| strain <= 1.0)
            .min_by(|a, b| a.1.total_cmp(&b.1));
        let stretch = match best {
            Some((place, _)) => open.remove(place),
            None => {
                stretches.push(Stretch { first: k, last: k, rows: 0 });
                stretches.len() - 1
            }
        };
        if open.len() == OPEN_STRETCHES {
            open.remove(0);
        }
        open.push(stretch);
        stretch_of[k] = stretch;
        stretches[stretch].last = k;
        stretches[stretch].rows += 1;
    }
    let believed = believed(&stretches);
    for (verdict, &stretch) in verdicts.iter_mut().zip(&stretch_of) {
        if verdict.is_none() && !believed[stretch] {
            *verdict = Some(Reason::Inconsistent);
        }
    }
    verdicts
}

/// Selects the stretches that make up the motion: the longest, and every other that is not short and does not overlap a
/// longer one.
fn believed(stretches: &[Stretch]) -> Vec<bool> {
    let mut believed = vec![false; stretches.len()];
    let mut order: Vec<usize> = (0..stretches.len()).collect();
    order.sort_by_key(|&s| std::cmp::Reverse(stretches[s].rows));
    // First row → last row of the selected stretches, which are disjoint.
    let mut taken: BTreeMap<usize, usize> = BTreeMap::new();
    for (rank, s) in order.into_iter().enumerate() {
        let Stretch { first, last, rows } = stretches[s];
        if rank > 0 && rows < SHORT_STRETCH {
            break;
        }
        let overlaps = taken.range(..=last).next_back().is_some_and(|(_, &end)| end >= first);
        if !overlaps {
            taken.insert(first, last);
            believed[s] = true;
        }
    }
    believed
}

/// One joint's angles without jumps of a turn.
pub(super) struct Unwrapped {
    /// Counted from 0.
    pub(super) joint: usize,
    /// Angle in every row, rad.
    pub(super) q: Vec<f64>,
}

impl Unwrapped {
    /// Shifts the target angles by whole turns to within half a turn of these angles. Targets may be wrapped at other
    /// rows, or not at all.
    pub(super) fn bring_along(&self, target_q: &mut [f64]) {
        for (target, q) in target_q.iter_mut().zip(&self.q) {
            *target += TAU * ((q - *target) / TAU).round();
        }
    }
}

/// Unwraps all joints whose angles jump by one turn between the remaining rows; returns them and the warning that
/// reports it.
pub(super) fn unwrapped(motion: &Motion) -> (Vec<Unwrapped>, Option<LogWarning>) {
    let mut joints = Vec::new();
    let mut count = 0;
    // The first row after a jump, and its joint.
    let mut first: Option<(usize, usize)> = None;
    for joint in 0..motion.q.len() {
        let jumps: Vec<(usize, f64)> =
            (1..motion.rows()).filter_map(|k| Some((k, motion.lost_turn(joint, k)?))).collect();
        let Some(&(earliest, _)) = jumps.first() else { continue };
        first = first.filter(|&(k, _)| k <= earliest).or(Some((earliest, joint)));
        count += jumps.len();
        let mut q = motion.q[joint].clone();
        let mut turns = 0.0;
        let mut jumps = jumps.into_iter().peekable();
        for (k, angle) in q.iter_mut().enumerate() {
            turns += jumps.next_if(|&(at, _)| at == k).map_or(0.0, |(_, turn)| turn);
            *angle += turns * TAU;
        }
        joints.push(Unwrapped { joint, q });
    }
    let warning = first.map(|(k, joint)| LogWarning::Unwrapped {
        count,
        after_row: motion.row[k - 1],
        joint: joint + 1,
    });
    (joints, warning)
}

/// Number of rows whose median an angle is compared with.
const BESIDE: usize = 5;

/// For every row of a log without velocities the reason why its angles are rejected, if they are. An angle far from the
/// median of five rows, each carried to its own instant by their middle step, is wild; it would corrupt the slopes of
/// four neighbouring rows.
pub(super) fn wild_angles(motion: &Motion) -> Vec<Option<Reason>> {
    let rows = motion.rows();
    let is_wild = |q: &Vec<f64>, k: usize| {
        let from = k.saturating_sub(BESIDE / 2).min(rows.saturating_sub(BESIDE));
        let beside = &q[from..rows.min(from + BESIDE)];
        let mut steps: Vec<f64> = beside.windows(2).map(|w| w[1] - w[0]).collect();
        steps.sort_by(f64::total_cmp);
        // Of the two in the middle the smaller one: two wild angles in a row make four steps that are not the motion's.
        let middle = [steps.len().saturating_sub(1) / 2, steps.len() / 2];
        let smaller = |a: f64, b: f64| if a.abs() <= b.abs() { a } else { b };
        let step = middle.into_iter().filter_map(|k| steps.get(k).copied()).reduce(smaller);
        let step = step.unwrap_or(0.0);
        let carried = beside.iter().zip(from..).map(|(q, at)| q + step * (k as f64 - at as f64));
        let beside = median(&mut carried.collect::<Vec<f64>>());
        beside.is_some_and(|beside| (q[k] - beside).abs() > STEP_TOLERANCE_RAD)
    };
    let verdict = |k: usize| match k {
        k if !motion.is_plausible(k) => Some(Reason::Implausible),
        k if motion.q.iter().any(|q| is_wild(q, k)) => Some(Reason::Inconsistent),
        _ => None,
    };
    (0..rows).map(verdict).collect()
}

/// Among the rows in which the arm moves, the share that may repeat the angles of the row before.
const MOST_HELD: f64 = 0.3;
/// The arm moves where a joint is faster than this, rad/s, which is far above the noise of velocities, and fast enough
/// to advance in one step by [`MOVES`] times the smallest change ever seen in its angle.
const MOVES_RAD_S: f64 = 0.05;
const MOVES: f64 = 5.0;

/// Detects a file that is written faster than the arm is sampled, so that many rows repeat an earlier reading.
pub(super) fn held(motion: &Motion) -> Option<LogWarning> {
    let change = |joint: usize, k: usize| (motion.q[joint][k] - motion.q[joint][k - 1]).abs();
    let least = |joint: usize| {
        let changes = (1..motion.rows()).map(|k| change(joint, k));
        changes.filter(|change| *change > 0.0).fold(f64::INFINITY, f64::min)
    };
    let least: Vec<f64> = (0..motion.q.len()).map(least).collect();
    let moves = |k: &usize| {
        let step_s = motion.time_s[*k] - motion.time_s[*k - 1];
        let mut joints = motion.qd.iter().zip(&least);
        joints.any(|(qd, least)| qd[*k].abs() > (MOVES * least / step_s).max(MOVES_RAD_S))
    };
    let moving: Vec<usize> = (1..motion.rows()).filter(moves).collect();
    let holds = |k: &&usize| (0..motion.q.len()).all(|joint| change(joint, **k) == 0.0);
    let held = moving.iter().filter(holds).count();
    let share = held as f64 / moving.len() as f64;
    (share > MOST_HELD).then(|| {
        let rate_hz = median_step(motion.time_s).map_or(0.0, |step_s| (1.0 - share) / step_s);
        LogWarning::Held { share, rate_hz }
    })
}

/// Detects jumps of the angles between the remaining rows.
pub(super) fn jumps(motion: &Motion) -> Option<LogWarning> {
    let mut first = None;
    let mut count = 0;
    for k in 1..motion.rows() {
        let step_s = motion.time_s[k] - motion.time_s[k - 1];
        let (joint, jump_rad) = (0..motion.q.len())
            .map(|joint| (joint, motion.defect(joint, k - 1, k)))
            .max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()))?;
        if jump_rad.abs() > angle_tolerance_rad(step_s) {
            count += 1;
            first = first.or(Some((motion.row[k - 1], joint + 1, jump_rad)));
        }
    }
    first.map(|(after_row, joint, jump_rad)| LogWarning::PositionJumps {
        count,
        after_row,
        joint,
        jump_rad,
    })
}

/// Counts the rows that the recorder left out: the time between two rows in usual steps, less the rows between them
/// that were set aside.
pub(super) fn missed_samples(motion: &Motion) -> Option<(usize, LogWarning)> {
    let usual = UsualStep::of(motion.time_s)?;
    let (mut missed, mut gaps, mut longest_s, mut after_row) = (0_usize, 0, 0.0, 0);
    for k in 1..motion.rows() {
        let step_s = motion.time_s[k] - motion.time_s[k - 1];
        let set_aside = motion.row[k] - motion.row[k - 1] - 1;
        // Converting a float beyond the range of integers saturates, so a clock that leaps cannot overflow.
        let here = (usual.missing_rows(motion.time_s, k) as usize).saturating_sub(set_aside);
        if here > 0 {
            missed = missed.saturating_add(here);
            gaps += 1;
            if step_s > longest_s {
                longest_s = step_s;
                after_row = motion.row[k - 1];
            }
        }
    }
    (missed > 0)
        .then_some((missed, LogWarning::MissedSamples { missed, gaps, longest_s, after_row }))
}
