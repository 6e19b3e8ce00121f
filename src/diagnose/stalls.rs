//! A clock that stood still while the arm moved on: angles and velocities tell how long.

use super::data_faults::{FAR, cause, exact, step_s};
use super::kind::Kind;
use super::verdict::{Cause, Estimate};
use crate::identify::Measurement;
use crate::identify::covariance::quantile_95;
use crate::median::{lasting, median, sigma_of_changes};

/// A clock that stalled.
pub struct Stalls {
    /// Rows behind which time is lost.
    pub rows: Vec<usize>,
    /// Mean time lost, s.
    pub lost_s: f64,
    /// Half of its 95 % interval, by the scatter between the stalls, s.
    reach_s: f64,
    /// σ of the time between two rows where nothing is lost, s.
    sigma_s: f64,
}

/// Across a longer gap, in usual steps, velocities at its ends do not tell how far joints went.
const GAP_STEPS: f64 = 4.5;

/// Rows between which more time passed than the time stamps say.
pub fn stalls(m: &Measurement) -> Option<Stalls> {
    let step = |k: usize| m.time_s[k + 1] - m.time_s[k];
    let gap_s = GAP_STEPS * step_s(m);
    let last = m.time_s.len().saturating_sub(1);
    // Accelerations beside a step are from its neighbours.
    let beside_gap = |k: usize| (k.saturating_sub(1)..(k + 2).min(last)).any(|k| step(k) > gap_s);
    let lost = |k: usize| match passed_s(m, k) {
        Some(passed) if !beside_gap(k) => passed - step(k),
        _ => 0.0,
    };
    let lost: Vec<f64> = (0..last).map(lost).collect();
    let sigma_s = sigma_of_changes(&lost);
    let limit = (FAR * sigma_s).max(0.5 * step_s(m));
    let lasts = |&k: &usize| lasting(k, |k| lost.get(k).copied()) > limit;
    let rows: Vec<usize> = (0..lost.len()).filter(lasts).collect();
    if rows.len() < 3 {
        return None;
    }
    let count = rows.len() as f64;
    let lost_s = rows.iter().map(|&k| lost[k]).sum::<f64>() / count;
    let square: f64 = rows.iter().map(|&k| (lost[k] - lost_s).powi(2)).sum();
    let reach_s = quantile_95(count - 1.0) * (square / (count - 1.0) / count).sqrt();
    Some(Stalls { rows, lost_s, reach_s, sigma_s })
}

/// Time between rows k and k + 1 by how far the joints went; `None` where they stand.
///
/// Least squares of q₁ − q₀ = h (q̇₀ + q̇₁)/2 − h³ q⃛/12 (the trapezoid with its correction) over the joints, q⃛
/// from the accelerations of the steps on either side, whose middles lie a step more than h apart.
fn passed_s(m: &Measurement, k: usize) -> Option<f64> {
    let t = m.time_s;
    let acceleration = |qd: &[f64], k: usize| match (qd.get(k + 1), t.get(k + 1)) {
        (Some(next), Some(later)) => (next - qd[k]) / (later - t[k]),
        _ => 0.0,
    };
    // Mean velocity, way and change of the acceleration of every joint.
    let joints = (0..m.q_rad.joints()).map(|j| {
        let (q, qd) = (m.q_rad.joint(j), m.qd_rad_s.joint(j));
        let before = if k > 0 { acceleration(qd, k - 1) } else { 0.0 };
        let change = acceleration(qd, k + 1) - before;
        (0.5 * (qd[k] + qd[k + 1]), q[k + 1] - q[k], change)
    });
    let joints: Vec<(f64, f64, f64)> = joints.collect();
    let square: f64 = joints.iter().map(|(mean, ..)| mean * mean).sum();
    // Slower than this, the resolution of the angle is all that is seen.
    if square <= 1e-2 {
        return None;
    }
    let mut passed = t[k + 1] - t[k];
    let step = passed;
    // The correction is small: three rounds settle it.
    for _ in 0..3 {
        let correction = passed.powi(3) / (12.0 * (passed + step));
        let along = |(mean, way, change): &(f64, f64, f64)| mean * (way + correction * change);
        passed = joints.iter().map(along).sum::<f64>() / square;
    }
    Some(passed)
}

impl Stalls {
    /// What is said of it.
    pub fn cause(&self) -> Cause {
        let Self { rows, lost_s, reach_s: reach, sigma_s } = self;
        let mut between: Vec<f64> = rows.windows(2).map(|w| (w[1] - w[0]) as f64).collect();
        let every = median(&mut between).unwrap_or(f64::NAN);
        let lost = Estimate { value: *lost_s, unit: "s", ci95: [lost_s - reach, lost_s + reach] };
        cause(
            Kind::ClockFault,
            None,
            "time that passed without the time stamps showing it",
            lost_s / sigma_s.max(f64::MIN_POSITIVE),
            &[("lost_s", lost), ("every_rows", exact(every, "rows"))],
        )
    }
}
