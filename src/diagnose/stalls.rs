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

/// So many rows before or behind a stall a clock that was only read late, or early, is right again.
const REGAINED_ROWS: usize = 50;
/// More than this share of what was lost is then gained back.
const REGAINED: f64 = 0.5;
/// Distances between stalls that are whole multiples of their median, to within this share of it, make a rhythm (a stall is not seen where
/// the arm is slow) ...
const OFF_BEAT: f64 = 0.1;
/// ... where this share of them are.
const IN_RHYTHM: f64 = 0.8;
/// Stalls that are mostly nearer to each other, in rows, come in bursts.
const BURST_ROWS: f64 = 5.0;

/// Rows between which more time passed than the time stamps say, and is not in the steps beside them.
pub fn stalls(m: &Measurement) -> Option<Stalls> {
    let step = |k: usize| m.time_s[k + 1] - m.time_s[k];
    let gap_s = GAP_STEPS * step_s(m);
    let last = m.time_s.len().saturating_sub(1);
    // Accelerations beside a step are from its neighbours.
    let beside_gap = |k: usize| (k.saturating_sub(1)..(k + 2).min(last)).any(|k| step(k) > gap_s);
    let ahead = |k: usize| passed_s(m, k).map_or(0.0, |passed| passed - step(k));
    let ahead: Vec<f64> = (0..last).map(ahead).collect();
    let lost = |k: usize| if beside_gap(k) { 0.0 } else { ahead[k] };
    let lost: Vec<f64> = (0..last).map(lost).collect();
    let sigma_s = sigma_of_changes(&lost);
    let limit = (FAR * sigma_s).max(0.5 * step_s(m));
    let lasts = |&k: &usize| lasting(k, |k| lost.get(k).copied()) > limit;
    // Steps that are too long count, be they as long as a gap: velocities at their ends are near enough where rows are.
    let stays_lost = |&k: &usize| {
        let beside = k.saturating_sub(REGAINED_ROWS)..(k + REGAINED_ROWS + 1).min(last);
        let far = ahead[beside].iter().filter(|ahead| ahead.abs() > limit);
        far.sum::<f64>() > (1.0 - REGAINED) * lost[k]
    };
    let rows: Vec<usize> = (0..last).filter(lasts).filter(stays_lost).collect();
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
        let lost = Estimate { value: *lost_s, unit: "s", ci95: [lost_s - reach, lost_s + reach] };
        let rhythm = rhythm(rows);
        let every = rhythm.ok().map(|rows| ("every_rows", exact(rows, "rows")));
        let parameters: Vec<_> = [("lost_s", lost)].into_iter().chain(every).collect();
        let cause = cause(
            Kind::ClockFault,
            None,
            "time that passed without the time stamps showing it",
            lost_s / sigma_s.max(f64::MIN_POSITIVE),
            &parameters,
        );
        Cause { form: rhythm.err(), ..cause }
    }
}

/// Every how many rows the clock stalls behind `rows`; else in words.
fn rhythm(rows: &[usize]) -> Result<f64, &'static str> {
    let mut between: Vec<f64> = rows.windows(2).map(|w| (w[1] - w[0]) as f64).collect();
    let every = median(&mut between).unwrap_or(f64::NAN);
    if every < BURST_ROWS {
        return Err("in bursts");
    }
    let is_on_beat = |rows: &&f64| {
        let beats = **rows / every;
        beats > 0.5 && (beats - beats.round()).abs() < OFF_BEAT
    };
    let on_beat = between.iter().filter(is_on_beat).count() as f64;
    if on_beat < IN_RHYTHM * between.len() as f64 { Err("at irregular times") } else { Ok(every) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rhythm_is_told_where_there_is_one() {
        // At a slow turn of the arm one is not seen, and rows that were lost move others.
        assert_eq!(rhythm(&[100, 350, 601, 1098, 1350, 1600]), Ok(251.0));
        assert_eq!(rhythm(&[100, 101, 102, 103, 900, 901, 902]), Err("in bursts"));
        assert_eq!(rhythm(&[100, 180, 700, 1030, 1720, 1790]), Err("at irregular times"));
    }
}
