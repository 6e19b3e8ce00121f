//! Contacts in a periodic motion: torque that one period has and the others do not.
//!
//! The deviation of the torque from the trimmed mean of the other periods is noise, coloured and correlated between
//! joints, plus events that happened once. Matched filters search it for bumps of every length: in one joint, with the
//! noise removed that is predicted from the other joints, and in all joints together. The highest bump is set aside
//! with its samples, until none is left that noise would not make.

use std::ops::Range;

use super::bump::Push;
use super::disturbed::with_disturbed_periods;
use super::repeats::{FEWEST_PERIODS, Repeats};
use super::{Touch, are_near};
use crate::diagnose::verdict::Cause;
use crate::identify::{FrictionDrift, Measurement};
use crate::robot::JointSignals;
use crate::signal::{
    Resampler, SignalError, bridged_gap_s, find_period, linear_at, natural_rate_hz,
};

/// Bumps closer than this are one contact, s: an arm that was hit keeps swinging for a while.
const TOGETHER_S: f64 = 0.5;
/// Maximum number of bumps that are examined in one log.
const MOST: usize = 40;
/// Time left out at an end where the repetitions were extended, s. The last part of a run-in differs so little from the
/// repetitions that the angles do not show it, but it takes torque.
const EDGE_S: f64 = 0.5;
/// What lies within this time of an end of the repetitions, s, behind a run-in or before a stop, belongs to these: a soft
/// gear swings on. It is taken out of the torque, and is no touch.
const SWINGS_S: f64 = 0.3;
/// A last period that lacks no more than this share counts as complete.
const WHOLE_WITHIN: f64 = 0.01;

/// Contacts in a log whose motion repeats, and the torque as it would be without them.
pub struct WithoutContacts {
    /// One cause per contact.
    pub causes: Vec<Cause>,
    /// Torque in which the contacts are replaced by the trimmed mean of the other periods, Nm.
    pub torque_nm: JointSignals,
}

/// Result of comparing the repetitions.
pub enum Compared {
    /// No statement: the motion does not repeat often enough without a gap.
    TooFew,
    /// Nothing touched the arm.
    Alike,
    /// Something did.
    Touched(WithoutContacts),
}

/// Looks for contacts by comparing repetitions, on all joints but those `left_out` (0-based).
pub fn between_periods(m: &Measurement, left_out: &[usize]) -> Result<Compared, SignalError> {
    let Some(repetitions) = Repetitions::of(m, left_out)? else { return Ok(Compared::TooFew) };
    let Repetitions { grid, q_rad, mut repeats, inside } = repetitions;
    let (window, period) = (repeats.window.clone(), repeats.period);
    let drift = || {
        let qd_rad_s = grid.instants().smooth(m.qd_rad_s)?.slice(window.clone());
        Ok(FrictionDrift::beside_others(qd_rad_s, period))
    };
    let (moves, of_moves) = repeats.find_moves(q_rad, drift)?;
    repeats.moves = moves;
    let time_s = grid.time_s();
    if repeats.search(&vec![false; time_s.len()], &[], &[], 1.0)?.is_none() {
        return Ok(Compared::Alike);
    }
    repeats.drift = Some(of_moves.map_or_else(drift, Ok)?);
    let (touches, aside) = find_touches(&mut repeats, &time_s)?;
    if touches.is_empty() {
        return Ok(Compared::Alike);
    }
    let contacts = joined(touches, (TOGETHER_S * repeats.rate_hz) as usize);
    let is_touch =
        |touch: &&Touch| touch.samples.end > inside.start && touch.samples.start < inside.end;
    let causes = contacts.iter().filter(is_touch).map(Touch::cause).collect();
    let torque_nm = torque_without(m, &time_s, &repeats, &aside);
    Ok(Compared::Touched(WithoutContacts { causes, torque_nm }))
}

/// A log with enough repetitions to be compared.
struct Repetitions {
    /// Its evenly spaced clock.
    grid: Resampler,
    /// Angles on this clock, rad.
    q_rad: JointSignals,
    /// Torques on this clock, whose periods are compared.
    repeats: Repeats,
    /// Where a touch is one: what lies wholly before or behind is due to a run-in or a stop.
    inside: Range<usize>,
}

impl Repetitions {
    /// Those of the log `m`, on all joints but those `left_out` (0-based); `None` if the motion does not repeat often
    /// enough without a gap.
    fn of(m: &Measurement, left_out: &[usize]) -> Result<Option<Self>, SignalError> {
        let rate_hz = natural_rate_hz(m.time_s)?;
        let grid = Resampler::new(m.time_s, rate_hz, bridged_gap_s(rate_hz))?;
        let whole = 0..grid.samples();
        if grid.segments() != [whole] {
            return Ok(None);
        }
        let q_rad = grid.instants().angles(m.q_rad, m.qd_rad_s)?;
        let Some(found) = find_period(&q_rad)? else { return Ok(None) };
        let period = found.refined_samples;
        let edge = (EDGE_S * rate_hz) as usize;
        let window = with_disturbed_periods(&q_rad, period, found.window, edge);
        if ((window.len() as f64 / period + WHOLE_WITHIN) as usize) < FEWEST_PERIODS {
            return Ok(None);
        }
        let swings = (SWINGS_S * rate_hz) as usize;
        let begin = if window.start > 0 { window.start + swings } else { 0 };
        let is_stopped = window.end < grid.samples();
        let stop = if is_stopped { window.end.saturating_sub(swings) } else { usize::MAX };
        let repeats = Repeats {
            signals: grid.instants().straight(m.torque_nm)?,
            between_samples: linear_at,
            joints: (0..m.torque_nm.joints()).filter(|j| !left_out.contains(j)).collect(),
            window,
            period,
            rate_hz,
            drift: None,
            moves: Vec::new(),
        };
        Ok(Some(Self { grid, q_rad, repeats, inside: begin..stop }))
    }
}

/// Finds the touches in a log with the time stamps `time_s`, the clearest first, and whether each of its samples is set
/// aside because of them.
///
/// A move without a torque is removed from `repeats`, and so is a joint whose torque shows rounding alone.
fn find_touches(
    repeats: &mut Repeats,
    time_s: &[f64],
) -> Result<(Vec<Touch>, Vec<bool>), SignalError> {
    let mut touches: Vec<Touch> = Vec::new();
    let mut known: Vec<Push> = Vec::new();
    let mut looked_at: Vec<Range<usize>> = Vec::new();
    let mut aside = vec![false; time_s.len()];
    while looked_at.len() < MOST
        && let Some(candidate) = repeats.search(&aside, &known, &looked_at, 1.0)?
    {
        // The torque of the contact moves the mean of the other periods.
        let mut aside_with_it = aside.clone();
        aside_with_it[candidate.samples(repeats)].fill(true);
        let Some(push) = repeats.weigh(&candidate, &aside_with_it, &known)? else {
            match candidate.of_move {
                Some(number) => drop(repeats.moves.remove(number)),
                None => looked_at.push(candidate.samples(repeats)),
            }
            continue;
        };
        if repeats.is_rounding(&push) {
            repeats.joints.retain(|j| !push.is_felt_on(*j));
            continue;
        }
        aside = aside_with_it;
        let touch = repeats.touch(&candidate, &push, time_s[repeats.window.start]);
        aside[touch.disturbed(repeats.rate_hz, time_s.len())].fill(true);
        looked_at.push(touch.samples.clone());
        known.push(push);
        touches.push(touch);
    }
    Ok((touches, aside))
}

/// The contacts, in the order of time, that these touches are: those closer than `together` samples are one.
fn joined(mut touches: Vec<Touch>, together: usize) -> Vec<Touch> {
    touches.sort_by_key(|touch| touch.samples.start);
    let mut contacts: Vec<Touch> = Vec::new();
    for touch in touches {
        let is_near = |last: &&mut Touch| are_near(&last.samples, &touch.samples, together);
        match contacts.last_mut().filter(is_near) {
            Some(last) => last.join(touch),
            None => contacts.push(touch),
        }
    }
    contacts
}

/// The torque of the log `m`, Nm, with the trimmed mean of the other periods in place of the samples set `aside`.
/// `time_s` are the time stamps of the evenly spaced clock.
fn torque_without(
    m: &Measurement,
    time_s: &[f64],
    repeats: &Repeats,
    aside: &[bool],
) -> JointSignals {
    let mut torque_nm = m.torque_nm.clone();
    for j in 0..torque_nm.joints() {
        let of_joint = repeats.signals.joint(j);
        for (value, &t) in torque_nm.joint_mut(j).iter_mut().zip(m.time_s) {
            let k = time_s.partition_point(|g| *g < t).min(time_s.len() - 1);
            if aside[k] && repeats.window.contains(&k) {
                *value -= repeats.deviation(of_joint, k, aside);
            }
        }
    }
    torque_nm
}

#[cfg(test)]
mod tests;
