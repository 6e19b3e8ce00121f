//! Checks that the numbers are in the units stated by the layout.
//!
//! An angle is the integral of its velocity over time. If Δq / ∫q̇ dt, which is 1 in the right units, equals 180/π,
//! 10⁻³ or another factor between units, then one of the three quantities is in another unit than stated. Velocities
//! that are the slopes of the angles agree with them in any unit of time; then the clock and the speed have to tell.

use std::f64::consts::{PI, TAU};

use super::account::LogWarning;
use super::clean::Motion;
use super::layout::{Angle, AngularVelocity, TimeUnit, Units};
use super::unit_suspicion::UnitSuspicion;
use crate::median::{median, median_step};

/// A span in which a joint moves less than this is not used, rad: 200 steps of a 10⁻⁴ rad encoder.
const MOVES_RAD: f64 = 0.02;
/// Relative deviation up to which a ratio is taken to be 1, or a factor between units.
const RATIO_TOLERANCE: f64 = 0.2;
/// If the position moves this many times as far as the integral of the velocity, no velocity was recorded. Times in
/// milliseconds read as seconds make the ratio 10⁻³, and times in nanoseconds make it smaller still.
const NO_VELOCITY: f64 = 1e6;
/// Time steps that a recorder of robot motion can have, s.
const CLOCK_STEP_S: std::ops::Range<f64> = 1e-5..0.9;
/// Time steps up to this, s, can be those of a recorder that is too slow. Longer ones are in another unit.
const SLOW_STEP_S: f64 = 60.0;
/// No joint of a serial arm moves faster than this, rad/s: twice as fast as the fastest arms. Times in minutes read as
/// seconds make 30 rad/s of 0.5 rad/s.
const FASTEST_RAD_S: f64 = 30.0;

/// Δq / ∫q̇ dt of one joint.
struct Ratio {
    joint: usize,
    ratio: f64,
    /// First and last row (indices) of the span with the largest motion.
    span: (usize, usize),
}

/// Compares angles, recorded velocities and clock; returns a warning for each joint whose velocity disagrees.
///
/// # Errors
/// The unit that the numbers contradict, with the remedy.
pub(super) fn check(motion: &Motion, units: &Units) -> Result<Vec<LogWarning>, UnitSuspicion> {
    let ratios: Vec<Ratio> = (0..motion.q.len()).filter_map(|j| ratio_of(motion, j)).collect();
    let mut values: Vec<f64> = ratios.iter().map(|r| r.ratio).collect();
    let typical = median(&mut values);
    match typical {
        Some(ratio) if is_near(ratio, 1.0) => {}
        Some(ratio) => return Err(contradiction(motion, units, &ratios, ratio)),
        None => check_clock(motion, units)?,
    }
    check_degrees(motion, units)?;
    Ok(ratios
        .iter()
        .filter(|r| !is_near(r.ratio, 1.0))
        .map(|r| LogWarning::VelocityDisagrees { joint: r.joint + 1, ratio: r.ratio })
        .collect())
}

fn is_near(ratio: f64, expected: f64) -> bool {
    (ratio / expected - 1.0).abs() <= RATIO_TOLERANCE
}

/// Returns the median ratio over the spans of the log in which the joint moves; `None` if it hardly moves.
fn ratio_of(motion: &Motion, joint: usize) -> Option<Ratio> {
    let (q, qd) = (&motion.q[joint], &motion.qd[joint]);
    let mut ratios = Vec::new();
    let mut widest = (0.0, (0, 0));
    let spans = spans(motion.rows());
    for (first, last) in spans.clone() {
        let moved = q[last] - q[first];
        let integral: f64 = (first..last)
            .map(|k| 0.5 * (qd[k] + qd[k + 1]) * (motion.time_s[k + 1] - motion.time_s[k]))
            .sum();
        if moved.abs().max(integral.abs()) < MOVES_RAD {
            continue;
        }
        ratios.push(moved / integral);
        if moved.abs() > widest.0 {
            widest = (moved.abs(), (first, last));
        }
    }
    if ratios.len() < fewest_of(spans.len()) {
        return None;
    }
    Some(Ratio { joint, ratio: median(&mut ratios)?, span: widest.1 })
}

/// First and last row (indices) of each of the spans into which a log of this many rows is divided.
fn spans(rows: usize) -> impl ExactSizeIterator<Item = (usize, usize)> + Clone {
    let length = (rows / 200).clamp(10, 100);
    (0..rows.saturating_sub(1) / length).map(move |s| (s * length, (s + 1) * length))
}

/// Fewest of the spans of a log that count as motion: in a log at rest, a few spans of garbage must not.
fn fewest_of(spans: usize) -> usize {
    3.max(spans / 20)
}

/// Finds the smallest set of unit changes that explains the ratio and names the first change in it.
fn contradiction(motion: &Motion, units: &Units, ratios: &[Ratio], ratio: f64) -> UnitSuspicion {
    let seen =
        ratios.iter().min_by(|a, b| (a.ratio - ratio).abs().total_cmp(&(b.ratio - ratio).abs()));
    let (joint, (first, last)) = seen.map_or((0, (0, 0)), |r| (r.joint, r.span));
    let (first_row, last_row) = (motion.row[first], motion.row[last]);
    let step_s = median_step(motion.time_s);
    let has_clock = |a: &Alternative| {
        a.time == units.time || step_s.is_none_or(|s| has_plausible_clock(s, units.time, a.time))
    };
    let best = alternatives(units)
        .filter(|a| is_near(ratio, a.ratio) && has_clock(a))
        .min_by_key(|a| a.changes.len());
    match best.and_then(|a| a.changes.first().copied()) {
        Some((quantity, unit)) => UnitSuspicion::Ratio {
            quantity,
            unit,
            joint: joint + 1,
            ratio,
            first_row,
            last_row,
            q_from: motion.q[joint][first],
            q_to: motion.q[joint][last],
        },
        // The integral of the velocity is zero but for accumulated noise.
        None if ratio.abs() > NO_VELOCITY => {
            UnitSuspicion::NoVelocity { joint: joint + 1, first_row, last_row }
        }
        None => UnitSuspicion::Unrelated { joint: joint + 1, ratio, first_row, last_row },
    }
}

/// A combination of units that the file might be in, and the Δq / ∫q̇ dt that it would show when read with the stated
/// units.
struct Alternative {
    ratio: f64,
    time: TimeUnit,
    changes: Vec<(&'static str, &'static str)>,
}

fn alternatives(units: &Units) -> impl Iterator<Item = Alternative> {
    let stated = *units;
    let degree = |yes: bool| if yes { PI / 180.0 } else { 1.0 };
    let of_time = move |time: TimeUnit| {
        [false, true].into_iter().flat_map(move |q_deg| {
            AngularVelocity::ALL.into_iter().map(move |qd_unit| {
                let q_stated = stated.q == Angle::Deg;
                let mut changes = Vec::new();
                if time != stated.time {
                    changes.push(("time", time.name()));
                }
                if q_deg != q_stated {
                    changes.push(("q", if q_deg { "deg" } else { "rad" }));
                }
                if qd_unit != stated.qd {
                    changes.push(("qd", qd_unit.name()));
                }
                let q = degree(q_stated) / degree(q_deg);
                let qd = stated.qd.rad_s() / qd_unit.rad_s();
                let t = stated.time.seconds() / time.seconds();
                Alternative { ratio: q / (qd * t), time, changes }
            })
        })
    };
    TimeUnit::ALL.into_iter().flat_map(of_time)
}

/// Whether a step of `step_s`, read in the unit `stated`, is one that a recorder can have if it is in `unit`.
fn has_plausible_clock(step_s: f64, stated: TimeUnit, unit: TimeUnit) -> bool {
    CLOCK_STEP_S.contains(&(step_s / stated.seconds() * unit.seconds()))
}

/// Checks the clock of a log at rest, or without recorded velocities: no recorder of motion has steps of seconds.
///
/// # Errors
/// [`UnitSuspicion::Clock`], if another unit makes the steps those of a recorder.
pub(super) fn check_clock(motion: &Motion, units: &Units) -> Result<(), UnitSuspicion> {
    let Some(step_s) = median_step(motion.time_s).filter(|s| !CLOCK_STEP_S.contains(s)) else {
        return Ok(());
    };
    let better =
        TimeUnit::ALL.into_iter().find(|&unit| has_plausible_clock(step_s, units.time, unit));
    match better {
        Some(unit) => Err(UnitSuspicion::Clock {
            unit: unit.name(),
            step_s,
            may_be_slow: (CLOCK_STEP_S.end..SLOW_STEP_S).contains(&step_s),
            row: motion.row[0],
            time_s: motion.time_s[0],
        }),
        None => Ok(()),
    }
}

/// Refuses angles that move faster than any arm, in a log whose velocities are their slopes. Mean speeds over spans are
/// compared, which neither noise nor readings held over several rows make larger.
pub(super) fn check_speed(motion: &Motion) -> Result<(), UnitSuspicion> {
    let spans = spans(motion.rows());
    for (joint, q) in motion.q.iter().enumerate() {
        let speed_rad_s = |first: usize, last: usize| {
            ((q[last] - q[first]) / (motion.time_s[last] - motion.time_s[first])).abs()
        };
        let fast: Vec<(f64, (usize, usize))> = spans
            .clone()
            .map(|(first, last)| (speed_rad_s(first, last), (first, last)))
            .filter(|(speed, _)| *speed > FASTEST_RAD_S)
            .collect();
        let fastest = fast.iter().max_by(|a, b| a.0.total_cmp(&b.0));
        if let Some(&(speed_rad_s, (first, last))) = fastest
            && fast.len() >= fewest_of(spans.len())
        {
            return Err(UnitSuspicion::TooFast {
                joint: joint + 1,
                speed_rad_s,
                bound_rad_s: FASTEST_RAD_S,
                first_row: motion.row[first],
                last_row: motion.row[last],
            });
        }
    }
    Ok(())
}

/// Detects angles and velocities that are both in degrees, which agree with each other. No arm keeps two joints beyond
/// a whole turn for half of a log, but in degrees read as radians nearly every posture looks like that.
pub(super) fn check_degrees(motion: &Motion, units: &Units) -> Result<(), UnitSuspicion> {
    if units.q == Angle::Deg {
        return Ok(());
    }
    let beyond: Vec<usize> = (0..motion.q.len())
        .filter(|&j| motion.q[j].iter().filter(|q| q.abs() > TAU).count() * 2 > motion.rows())
        .collect();
    if beyond.len() < 2 {
        return Ok(());
    }
    let (joint, k) = beyond
        .iter()
        .filter_map(|&j| motion.q[j].iter().position(|q| q.abs() > TAU).map(|k| (j, k)))
        .min_by_key(|&(_, k)| k)
        .unwrap_or((beyond[0], 0));
    Err(UnitSuspicion::Degrees {
        row: motion.row[k],
        joint: joint + 1,
        q: motion.q[joint][k],
        joints: beyond.len(),
    })
}
