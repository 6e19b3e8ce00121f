//! The record of a log, and corrections of its faults as far as they are possible.

use super::kind::Kind;
use super::verdict::Cause;
use crate::identify::Measurement;
use crate::robot::JointSignals;
use crate::signal::{Filled, Gap, SignalError, Tears, fill_gaps};

/// A joint that turns between two rows by more than this beyond what its speed explains jumps in the record, rad.
const JUMP_RAD: f64 = 0.05;
/// Factor by which a joint may have been faster between two rows than at either of them.
const FASTER: f64 = 3.0;
/// How far in time a filter spreads the effect of a jump in the record, s.
const REACH_S: f64 = 0.5;

/// Whether the angles of `m` jump, as no arm can, between `start_s` and `end_s` or nearby. Rows are then missing or put
/// together wrongly, and what the torque shows there is the jump.
pub fn is_torn(m: &Measurement, [start_s, end_s]: [f64; 2]) -> bool {
    let near = |k: &usize| (start_s - REACH_S..end_s + REACH_S).contains(&m.time_s[*k]);
    (1..m.time_s.len()).filter(near).any(|k| {
        let step_s = m.time_s[k] - m.time_s[k - 1];
        (0..m.q_rad.joints()).any(|j| {
            let (q, qd) = (m.q_rad.joint(j), m.qd_rad_s.joint(j));
            let speed = qd[k].abs().max(qd[k - 1].abs());
            (q[k] - q[k - 1]).abs() > JUMP_RAD + FASTER * speed * step_s
        })
    })
}

/// Rows on either side of a row from which its slope is computed.
const REACH_ROWS: usize = 24;
/// Limit of a row's distance in time from an evenly spaced grid, over the step of the grid.
const UNEVEN: f64 = 0.02;

/// dy/dt at row `k`: the derivative of the interpolation by sin(πx)/(πx), under a Hann window, accurate to 1 % up to
/// 0.45 of the sampling rate. `None` near the ends, near `tears`, and where the rows are not evenly spaced.
fn slope(time_s: &[f64], y: &[f64], k: usize, tears: &Tears) -> Option<f64> {
    let (first, last) = (k.checked_sub(REACH_ROWS)?, k + REACH_ROWS);
    if tears.are_between(first, last) {
        return None;
    }
    let step_s = (time_s.get(last)? - time_s[first]) / (2 * REACH_ROWS) as f64;
    let is_even = |i: usize| {
        (time_s[i] - time_s[first] - (i - first) as f64 * step_s).abs() < UNEVEN * step_s
    };
    if !(first..=last).all(is_even) {
        return None;
    }
    let term = |i: usize| {
        let window = 0.5 + 0.5 * (std::f64::consts::PI * i as f64 / (REACH_ROWS + 1) as f64).cos();
        let sign = if i % 2 == 1 { 1.0 } else { -1.0 };
        sign * window / i as f64 * (y[k + i] - y[k - i])
    };
    Some((1..=REACH_ROWS).map(term).sum::<f64>() / step_s)
}

/// The channels of a log, which corrections may change.
pub struct Record {
    /// Time, s.
    pub time_s: Vec<f64>,
    /// Angles, rad.
    pub q_rad: JointSignals,
    /// Velocities, rad/s.
    pub qd_rad_s: JointSignals,
    /// Torques, Nm.
    pub torque_nm: JointSignals,
    /// Gaps that were filled with rows of other periods.
    pub filled: Vec<Gap>,
    /// The row of the log that each row is; empty where gaps were filled.
    pub rows: Vec<usize>,
}

impl Record {
    /// The record of `m` without the rows `left_out`, which are in ascending order.
    pub fn without_rows(m: &Measurement, left_out: &[usize]) -> Self {
        let rows: Vec<usize> =
            (0..m.time_s.len()).filter(|k| left_out.binary_search(k).is_err()).collect();
        let of = |signals: &JointSignals| {
            JointSignals::from_fn(signals.joints(), rows.len(), |j, k| signals.joint(j)[rows[k]])
        };
        Self {
            time_s: rows.iter().map(|&k| m.time_s[k]).collect(),
            q_rad: of(m.q_rad),
            qd_rad_s: of(m.qd_rad_s),
            torque_nm: of(m.torque_nm),
            filled: Vec::new(),
            rows,
        }
    }

    /// The record without the rows `left_out` of its own, which are in ascending order.
    pub fn leave_out(&self, left_out: &[usize]) -> Self {
        let less = Self::without_rows(&self.measurement(""), left_out);
        let rows = less.rows.iter().map(|k| self.rows[*k]).collect();
        Self { rows, ..less }
    }

    /// A view of the record as a measurement from `source`.
    pub fn measurement<'a>(&'a self, source: &'a str) -> Measurement<'a> {
        Measurement {
            source,
            time_s: &self.time_s,
            q_rad: &self.q_rad,
            qd_rad_s: &self.qd_rad_s,
            torque_nm: &self.torque_nm,
        }
    }

    /// Sets row `to` to what `at` reads from every channel of `other`.
    pub fn set_row(&mut self, to: usize, other: &Self, at: impl Fn(&[f64]) -> f64) {
        self.time_s[to] = at(&other.time_s);
        let channels = [
            (&mut self.q_rad, &other.q_rad),
            (&mut self.qd_rad_s, &other.qd_rad_s),
            (&mut self.torque_nm, &other.torque_nm),
        ];
        for (own, other) in channels {
            for j in 0..other.joints() {
                own.joint_mut(j)[to] = at(other.joint(j));
            }
        }
    }

    /// Adds `lost_s` behind each of `rows`, where time passed without the clock showing it.
    pub fn give_back_time(&mut self, rows: &[usize], lost_s: f64) {
        for (k, time) in self.time_s.iter_mut().enumerate() {
            *time += lost_s * rows.partition_point(|row| *row < k) as f64;
        }
    }

    /// Fills gaps with rows of other periods where the motion repeats; returns a warning for the user.
    pub fn fill_gaps(&mut self) -> Result<Option<String>, SignalError> {
        let Self { time_s, q_rad, qd_rad_s, torque_nm, .. } = &*self;
        let Some(filled) = fill_gaps(time_s, q_rad, qd_rad_s, torque_nm)? else {
            return Ok(None);
        };
        let warning = filled.warning();
        let Filled { time_s, q_rad, qd_rad_s, torque_nm, gaps } = filled;
        *self = Self { time_s, q_rad, qd_rad_s, torque_nm, filled: gaps, rows: Vec::new() };
        Ok(Some(warning))
    }

    /// Undoes the velocity lags among `causes`. Velocities that are late by less than `least_s` are moved in any case.
    pub fn undo_lags(&mut self, causes: &[Cause], least_s: f64) {
        let mut lags = causes.iter().filter(|cause| cause.kind == Kind::VelocityLag).peekable();
        if lags.peek().is_none() {
            return;
        }
        let tears = self.measurement("").tears();
        for lag in lags {
            let (joint, lag_s) = (lag.joint.map(|j| j - 1), lag.parameters["delay_s"].value);
            self.undo_lag(joint, lag_s, least_s, &tears);
        }
    }

    /// Undoes a lag by which the velocity of `joint` (`None`: of all joints) came `lag_s` late.
    ///
    /// Where rows are evenly spaced, the velocity is computed from the angles, because what makes a velocity late is
    /// usually a filter, which also rounds the kinks at which friction is tested. Elsewhere, and if it is late by less than
    /// `least_s`, the late velocity is moved, linearly between its samples. Neither goes across one of the `tears`.
    fn undo_lag(&mut self, joint: Option<usize>, lag_s: f64, least_s: f64, tears: &Tears) {
        let t = &self.time_s;
        for j in joint.map_or(0..self.qd_rad_s.joints(), |j| j..j + 1) {
            let late = self.qd_rad_s.joint(j).to_vec();
            let q = self.q_rad.joint(j);
            for (k, value) in self.qd_rad_s.joint_mut(j).iter_mut().enumerate() {
                let slope = slope(t, q, k, tears).filter(|_| lag_s.abs() >= least_s);
                *value = slope.unwrap_or_else(|| {
                    let at = t[k] + lag_s;
                    let run = tears.run_of(k);
                    let right = t.partition_point(|s| *s < at).clamp(run.start + 1, run.end - 1);
                    let u = ((at - t[right - 1]) / (t[right] - t[right - 1])).clamp(0.0, 1.0);
                    late[right - 1] * (1.0 - u) + late[right] * u
                });
            }
        }
    }
}

/// For tests: a record of a joint that moves for `moves_s` and then rests for as long, three times, at 125 samples per
/// second, with torque noise of `noise_nm`.
#[cfg(test)]
pub fn moves_and_rests(moves_s: f64, noise_nm: f64) -> Record {
    use rand::{SeedableRng, rngs::ChaCha8Rng};
    use rand_distr::{Distribution, StandardNormal};
    use std::f64::consts::TAU;
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let mut noise = || -> f64 { StandardNormal.sample(&mut rng) };
    let rate_hz = 125.0;
    let samples = (6.0 * moves_s * rate_hz) as usize;
    let time_s: Vec<f64> = (0..samples).map(|k| k as f64 / rate_hz).collect();
    let phase = |t: f64| TAU * (t % (2.0 * moves_s)).min(moves_s) / moves_s;
    let of = |f: &dyn Fn(f64) -> f64| JointSignals::from_fn(1, samples, |_, k| f(phase(time_s[k])));
    let speed = TAU / moves_s;
    let q_rad = of(&|p| 1.0 - p.cos());
    let qd_rad_s = of(&|p| if p < TAU { speed * p.sin() } else { 0.0 });
    let clean = of(&|p| 8.0 * (0.7 * p).cos());
    let torque_nm = clean.map_joints(|_, y| y.iter().map(|y| y + noise_nm * noise()).collect());
    let rows = (0..samples).collect();
    Record { time_s, q_rad, qd_rad_s, torque_nm, filled: Vec::new(), rows }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The slope is right up to 0.42 of the rate, and `None` where a row is missing or near the ends.
    #[test]
    fn angles_tell_their_slope() {
        let (n, step_s) = (200, 0.008);
        for share in [0.01, 0.2, 0.42] {
            let w = std::f64::consts::TAU * share / step_s;
            let time_s: Vec<f64> = (0..n).map(|k| k as f64 * step_s).collect();
            let y: Vec<f64> = time_s.iter().map(|t| (w * t).sin()).collect();
            let slope = |time_s: &[f64], k: usize| slope(time_s, &y, k, &Tears::of(time_s, &[&y]));
            for k in REACH_ROWS..n - REACH_ROWS {
                let truth = w * (w * time_s[k]).cos();
                assert!((slope(&time_s, k).unwrap() - truth).abs() < 0.01 * w, "{share} {k}");
            }
            assert!(slope(&time_s, 5).is_none() && slope(&time_s, n - 5).is_none());
            let torn: Vec<f64> =
                time_s.iter().map(|t| if *t > 0.8 { t + 0.008 } else { *t }).collect();
            assert!(slope(&torn, 100).is_none() && slope(&torn, 40).is_some());
        }
    }

    /// A joint swings, and from row 200 on it is another recording that swings elsewhere. Velocities that come a step
    /// late are put right on both sides, to (ω h)²/8 of 1.5 rad/s between two rows, except for the last rows of each
    /// recording, which nothing follows.
    #[test]
    fn late_velocities_are_not_mended_across_a_tear() {
        let (n, step_s) = (400, 0.008);
        let time_s: Vec<f64> = (0..n).map(|k| k as f64 * step_s).collect();
        let other = |k: usize| if k < 200 { 0.0 } else { 2.0 };
        let of = |f: &dyn Fn(usize) -> f64| JointSignals::from_fn(1, n, |_, k| f(k));
        let speed = |k: usize, t: f64| 1.5 * (3.0 * t + other(k)).cos();
        for least_s in [0.0, 1.0] {
            let mut record = Record {
                time_s: time_s.clone(),
                q_rad: of(&|k| other(k) + 0.5 * (3.0 * time_s[k] + other(k)).sin()),
                qd_rad_s: of(&|k| speed(k, time_s[k] - step_s)),
                torque_nm: JointSignals::zeros(1, n),
                filled: Vec::new(),
                rows: (0..n).collect(),
            };
            let tears = record.measurement("").tears();
            assert_eq!(tears.run_of(200), 200..400);
            record.undo_lag(None, step_s, least_s, &tears);
            for k in (0..199).chain(200..399) {
                let off = record.qd_rad_s.joint(0)[k] - speed(k, time_s[k]);
                assert!(off.abs() < 1.5 * (3.0 * step_s).powi(2) / 8.0, "{k}: {off}");
            }
        }
    }

    /// A joint that turns at 2 rad/s is where it has to be behind a gap of one second; if it turned by another 0.3 rad
    /// within a row, it is not.
    #[test]
    fn a_gap_is_no_tear_and_a_jump_is_one() {
        let time_s: Vec<f64> = (0..500).map(|k| 0.01 * k as f64 + f64::from(k >= 250)).collect();
        let angles = |jump: f64| {
            let after = |t: f64| if t > 4.0 { jump } else { 0.0 };
            JointSignals::from_fn(1, 500, |_, k| 2.0 * time_s[k] + after(time_s[k]))
        };
        let (even, torn) = (angles(0.0), angles(0.3));
        let speed = JointSignals::from_fn(1, 500, |_, _| 2.0);
        let torque = JointSignals::zeros(1, 500);
        let is_torn_at = |q_rad: &JointSignals, window: [f64; 2]| {
            let (qd_rad_s, torque_nm) = (&speed, &torque);
            is_torn(
                &Measurement { source: "", time_s: &time_s, q_rad, qd_rad_s, torque_nm },
                window,
            )
        };
        assert!(!is_torn_at(&even, [0.0, 6.0]));
        assert!(is_torn_at(&torn, [4.2, 4.4]) && !is_torn_at(&torn, [1.0, 3.0]));
    }
}
