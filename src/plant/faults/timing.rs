//! Timing errors: channels that are not read at the instants that the log states.

use serde::{Deserialize, Serialize};

use super::assembly::Assembly;
use super::effect::{Complaint, Fault, not_negative, require};
use crate::plant::Recording;
use crate::robot::JointSignals;

/// A torque that is read late: the log at time t shows the torque of t − δ next to the angles of t.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TimeSkew {
    /// Joint, from 1; if left out, all joints.
    pub joint: Option<usize>,
    /// δ, s; negative if the angles are late.
    pub delay_s: f64,
}

/// Longest delay allowed, s; a log with a longer one would be useless.
const LONGEST_DELAY_S: f64 = 0.5;

impl Fault for TimeSkew {
    fn joint(&self) -> Option<usize> {
        self.joint
    }

    fn check(&self) -> Result<(), Complaint> {
        let ok = self.delay_s.abs() <= LONGEST_DELAY_S;
        require(ok, "delay_s", self.delay_s, "must be between -0.5 s and 0.5 s")
    }

    fn install(&self, assembly: &mut Assembly) -> Result<(), Complaint> {
        for j in assembly.indices(self.joint) {
            assembly.timing.torque_delay_s[j] += self.delay_s;
        }
        Ok(())
    }
}

/// A velocity that passes a first-order low-pass with time constant δ before it is logged: δ ẏ = q̇ − y. At the low
/// frequencies of a motion this is a delay of δ.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct VelocityLag {
    /// Joint, from 1; if left out, all joints.
    pub joint: Option<usize>,
    /// δ, s.
    pub delay_s: f64,
}

impl Fault for VelocityLag {
    fn joint(&self) -> Option<usize> {
        self.joint
    }

    fn check(&self) -> Result<(), Complaint> {
        let ok = (0.0..=LONGEST_DELAY_S).contains(&self.delay_s);
        require(ok, "delay_s", self.delay_s, "must be between 0 and 0.5 s")
    }

    fn install(&self, assembly: &mut Assembly) -> Result<(), Complaint> {
        for j in assembly.indices(self.joint) {
            assembly.timing.velocity_lag_s[j] += self.delay_s;
        }
        Ok(())
    }
}

/// A logger that stalls without showing it: after every n rows it misses `lost_s` of the motion, while the time column
/// continues at even steps.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ClockFault {
    /// Time missed at each stall, s.
    pub lost_s: f64,
    /// n: number of rows from one stall to the next.
    pub every_rows: usize,
}

impl Fault for ClockFault {
    fn joint(&self) -> Option<usize> {
        None
    }

    fn check(&self) -> Result<(), Complaint> {
        not_negative("lost_s", self.lost_s)?;
        let rows = self.every_rows as f64;
        require(self.every_rows > 0, "every_rows", rows, "must be at least 1")
    }

    fn install(&self, assembly: &mut Assembly) -> Result<(), Complaint> {
        assembly.timing.stalls.push(*self);
        Ok(())
    }
}

/// The instants at which each channel is really read.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Timing {
    pub(super) torque_delay_s: Vec<f64>,
    pub(super) velocity_lag_s: Vec<f64>,
    pub(super) stalls: Vec<ClockFault>,
}

impl Timing {
    /// The timing in which every channel is read at the instant that the log states.
    pub(super) fn exact(joints: usize) -> Self {
        let zeros = vec![0.0; joints];
        Self { torque_delay_s: zeros.clone(), velocity_lag_s: zeros, stalls: Vec::new() }
    }

    /// Whether there are no timing errors.
    pub(super) fn is_exact(&self) -> bool {
        let delays = self.torque_delay_s.iter().chain(&self.velocity_lag_s);
        delays.chain(self.stalls.iter().map(|s| &s.lost_s)).all(|d| *d == 0.0)
    }

    /// The true instant of row `k` of a log with `step_s` between its time stamps, s.
    fn instant_s(&self, k: usize, step_s: f64) -> f64 {
        let lost = self.stalls.iter().map(|s| (k / s.every_rows) as f64 * s.lost_s).sum::<f64>();
        k as f64 * step_s + lost
    }

    /// The log with one row for every `every`-th sample of the run `dense`, each read at the instants of this timing.
    /// Between the samples of `dense`, angles are interpolated by Hermite cubics, speeds by Lagrange cubics, and
    /// torques (means over the hold) linearly. Readings of the controller keep their errors.
    pub(super) fn sample(&self, dense: &Recording, rate_hz: f64, every: usize) -> Recording {
        let n = dense.q_rad.joints();
        let step_s = every as f64 / rate_hz;
        let last = dense.time_s.len() - 1;
        let rows = (0..=last / every)
            .take_while(|&k| self.instant_s(k, step_s) * rate_hz <= last as f64 + 1e-6)
            .count();
        // Position on the grid of `dense` at which row `k` is read with the delay `delay_s`.
        let at = |k: usize, delay_s: f64| {
            Place::new((self.instant_s(k, step_s) - delay_s) * rate_hz, last)
        };
        let lagged = dense.qd_rad_s.map_joints(|j, y| lag(y, self.velocity_lag_s[j] * rate_hz));
        let signals = |f: &dyn Fn(usize, usize) -> f64| JointSignals::from_fn(n, rows, f);
        let hermite = |q: &JointSignals, qd: &JointSignals| {
            signals(&|j, k| at(k, 0.0).hermite(q.joint(j), qd.joint(j), rate_hz))
        };
        let mut log = Recording {
            time_s: (0..rows).map(|k| dense.time_s[k * every]).collect(),
            q_rad: hermite(&dense.q_rad, &dense.qd_rad_s),
            qd_rad_s: signals(&|j, k| at(k, 0.0).lagrange(lagged.joint(j))),
            torque_nm: signals(&|j, k| {
                at(k, self.torque_delay_s[j]).linear(dense.torque_nm.joint(j))
            }),
            target_q_rad: hermite(&dense.target_q_rad, &dense.target_qd_rad_s),
            target_qd_rad_s: signals(&|j, k| at(k, 0.0).lagrange(dense.target_qd_rad_s.joint(j))),
            target_qdd_rad_s2: signals(&|j, k| {
                at(k, 0.0).lagrange(dense.target_qdd_rad_s2.joint(j))
            }),
            readings: None,
            saturated_decisions: dense.saturated_decisions,
        };
        log.readings = dense.readings.as_ref().map(|read| {
            let with_errors =
                |true_log: &JointSignals, truth: &JointSignals, read: &JointSignals| {
                    JointSignals::from_fn(n, rows, |j, k| {
                        let error = read.joint(j)[k * every] - truth.joint(j)[k * every];
                        true_log.joint(j)[k] + error
                    })
                };
            crate::plant::Readings {
                q_rad: with_errors(&log.q_rad, &dense.q_rad, &read.q_rad),
                qd_rad_s: with_errors(&log.qd_rad_s, &dense.qd_rad_s, &read.qd_rad_s),
            }
        });
        log
    }

    /// One more channel `dense` of the run given to [`Self::sample`], at the instants at which the rows of `log` are
    /// read.
    pub(super) fn sample_one(
        &self,
        dense: &JointSignals,
        log: &Recording,
        rate_hz: f64,
        every: usize,
    ) -> JointSignals {
        let step_s = every as f64 / rate_hz;
        let last = dense.samples() - 1;
        JointSignals::from_fn(dense.joints(), log.time_s.len(), |j, k| {
            Place::new(self.instant_s(k, step_s) * rate_hz, last).lagrange(dense.joint(j))
        })
    }
}

/// Exact output of a first-order low-pass with a time constant of c = `constant` samples, for an input that is linear
/// between its samples and constant before the first one. A deviation decays by the factor exp(−1/c) per sample.
fn lag(u: &[f64], constant: f64) -> Vec<f64> {
    if constant == 0.0 {
        return u.to_vec();
    }
    let decay = (-1.0 / constant).exp();
    let mut y = u.first().copied().unwrap_or(0.0);
    let mut out = Vec::with_capacity(u.len());
    out.push(y);
    for pair in u.windows(2) {
        // For a ramp of slope m the output settles m c below the input.
        let slope = pair[1] - pair[0];
        let ahead = y - (pair[0] - slope * constant);
        y = pair[1] - slope * constant + ahead * decay;
        out.push(y);
    }
    out
}

/// A position between two samples of an even grid.
#[derive(Debug, Clone, Copy)]
struct Place {
    index: usize,
    fraction: f64,
    last: usize,
}

impl Place {
    /// Smaller deviations from a whole sample, in samples, count as round-off of the time.
    const ROUND_OFF: f64 = 1e-7;

    /// The place `position` samples after the first one; positions outside the grid are moved to its ends.
    fn new(position: f64, last: usize) -> Self {
        let position = position.clamp(0.0, last as f64);
        let nearest = position.round();
        if (position - nearest).abs() < Self::ROUND_OFF {
            return Self { index: nearest as usize, fraction: 0.0, last };
        }
        Self { index: position.floor() as usize, fraction: position.fract(), last }
    }

    fn linear(self, y: &[f64]) -> f64 {
        if self.fraction == 0.0 {
            return y[self.index];
        }
        y[self.index] + self.fraction * (y[self.index + 1] - y[self.index])
    }

    fn hermite(self, y: &[f64], slope_per_s: &[f64], rate_hz: f64) -> f64 {
        let (i, x) = (self.index, self.fraction);
        if x == 0.0 {
            return y[i];
        }
        let (m0, m1) = (slope_per_s[i] / rate_hz, slope_per_s[i + 1] / rate_hz);
        let step = y[i + 1] - y[i];
        y[i] + x * (m0 + x * (3.0 * step - 2.0 * m0 - m1 + x * (m0 + m1 - 2.0 * step)))
    }

    fn lagrange(self, y: &[f64]) -> f64 {
        let (i, x) = (self.index, self.fraction);
        if x == 0.0 {
            return y[i];
        }
        let (before, behind) = (i.saturating_sub(1), (i + 2).min(self.last));
        let [a, b, c, d] = [y[before], y[i], y[i + 1], y[behind]];
        -a * x * (x - 1.0) * (x - 2.0) / 6.0 + b * (x + 1.0) * (x - 1.0) * (x - 2.0) / 2.0
            - c * (x + 1.0) * x * (x - 2.0) / 2.0
            + d * (x + 1.0) * x * (x - 1.0) / 6.0
    }
}
