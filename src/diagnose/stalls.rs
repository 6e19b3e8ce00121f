//! A clock that stood still while the arm moved on: angles and velocities tell for how long.

use super::data_faults::{FAR, step_s};
use super::record_fault::RecordFault;
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
    /// Half-width of the 95 % interval of `lost_s`, from the scatter between the stalls, s.
    reach_s: f64,
    /// σ of the time between two rows where nothing is lost, s.
    sigma_s: f64,
}

/// In gaps longer than this many usual steps, the velocities at the ends do not tell how far the joints went.
const GAP_STEPS: f64 = 4.5;

/// A clock that was only read late or early is right again within this many rows before or behind the apparent stall.
const REGAINED_ROWS: usize = 50;
/// In that case at least this share of the lost time is regained there.
const REGAINED: f64 = 0.5;
/// The stalls have a rhythm if the distances between them are whole multiples of the median distance, to within this
/// share of it (multiples, because a stall is not seen where the arm is slow) ...
const OFF_BEAT: f64 = 0.1;
/// ... for at least this share of the distances.
const IN_RHYTHM: f64 = 0.8;
/// Stalls whose median distance is below this, in rows, come in bursts.
const BURST_ROWS: f64 = 5.0;

/// Square of the speed of all joints together, (rad/s)², up to which only the resolution of the angle is seen: of
/// 0.1 rad/s.
const SEEN_SQUARE: f64 = 1e-2;

/// Finds the rows behind which more time passed than the time stamps say, and is not made up for by the steps beside
/// them. `None` for fewer than three.
pub fn stalls(m: &Measurement) -> Option<Stalls> {
    let step = |k: usize| m.time_s[k + 1] - m.time_s[k];
    let gap_s = GAP_STEPS * step_s(m);
    let last = m.time_s.len().saturating_sub(1);
    // The accelerations that enter step k come from the steps beside it.
    let beside_gap = |k: usize| (k.saturating_sub(1)..(k + 2).min(last)).any(|k| step(k) > gap_s);
    let ahead = |k: usize| passed_s(m, k).map_or(0.0, |passed| passed - step(k));
    let ahead: Vec<f64> = (0..last).map(ahead).collect();
    let lost = |k: usize| if beside_gap(k) { 0.0 } else { ahead[k] };
    let lost: Vec<f64> = (0..last).map(lost).collect();
    let sigma_s = sigma_of_changes(&lost);
    let limit = (FAR * sigma_s).max(0.5 * step_s(m));
    let lasts = |&k: &usize| lasting(k, |k| lost.get(k).copied()) > limit;
    // Stamps that regain the time make steps that are too long. They count even if they are as long as a gap: for this
    // sum the velocities at the ends are accurate enough.
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

/// Time between rows k and k + 1 from the distances that the joints travelled; `None` if they are at rest, or too slow
/// ([`SEEN_SQUARE`]).
///
/// Least squares over the joints of q₁ − q₀ = h (q̇₀ + q̇₁)/2 − h³ q⃛/12 (the trapezoidal rule with its correction),
/// with q⃛ from the accelerations of the steps on either side, whose middles are h plus one step apart.
fn passed_s(m: &Measurement, k: usize) -> Option<f64> {
    let t = m.time_s;
    let acceleration = |qd: &[f64], k: usize| match (qd.get(k + 1), t.get(k + 1)) {
        (Some(next), Some(later)) => (next - qd[k]) / (later - t[k]),
        _ => 0.0,
    };
    // Mean velocity, distance and change of the acceleration of every joint.
    let joints = (0..m.q_rad.joints()).map(|j| {
        let (q, qd) = (m.q_rad.joint(j), m.qd_rad_s.joint(j));
        let before = if k > 0 { acceleration(qd, k - 1) } else { 0.0 };
        let change = acceleration(qd, k + 1) - before;
        (0.5 * (qd[k] + qd[k + 1]), q[k + 1] - q[k], change)
    });
    let joints: Vec<(f64, f64, f64)> = joints.collect();
    let square: f64 = joints.iter().map(|(mean, ..)| mean * mean).sum();
    if square <= SEEN_SQUARE {
        return None;
    }
    let mut passed = t[k + 1] - t[k];
    let step = passed;
    // The correction is small, so three rounds of iteration settle it.
    for _ in 0..3 {
        let correction = passed.powi(3) / (12.0 * (passed + step));
        let along = |(mean, way, change): &(f64, f64, f64)| mean * (way + correction * change);
        passed = joints.iter().map(along).sum::<f64>() / square;
    }
    Some(passed)
}

impl Stalls {
    /// The stalls as a cause.
    pub fn cause(&self) -> Cause {
        let Self { rows, lost_s, reach_s: reach, sigma_s } = self;
        let lost = Estimate { value: *lost_s, unit: "s", ci95: [lost_s - reach, lost_s + reach] };
        let rhythm = rhythm(rows);
        let every = rhythm.ok().map(|rows| ("every_rows", Estimate::exact(rows, "rows")));
        let parameters: Vec<_> = [("lost_s", lost)].into_iter().chain(every).collect();
        let strength = lost_s / sigma_s.max(f64::MIN_POSITIVE);
        let cause = Cause::of_the_record(RecordFault::LostTime, None, strength, &parameters);
        Cause { form: rhythm.err(), ..cause }
    }
}

/// The number of rows from stall to stall if the `rows` have a rhythm; otherwise a description in words.
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
        // One stall is missing because it falls on a slow turn of the arm, and lost rows shift others.
        assert_eq!(rhythm(&[100, 350, 601, 1098, 1350, 1600]), Ok(251.0));
        assert_eq!(rhythm(&[100, 101, 102, 103, 900, 901, 902]), Err("in bursts"));
        assert_eq!(rhythm(&[100, 180, 700, 1030, 1720, 1790]), Err("at irregular times"));
    }
}
