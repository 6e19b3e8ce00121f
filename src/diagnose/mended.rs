//! A log for identification: what can be corrected within its rows is corrected, and every other fault of the record is
//! told.

use std::ops::Range;

use super::data_faults::{Faults, find_by, step_s};
use super::kind::Kind;
use super::record::Record;
use super::record_fault::RecordFault;
use super::verdict::Cause;
use crate::identify::{Measurement, Untorn};
use crate::robot::JointSignals;
use crate::signal::SignalError;

/// A log after correction, row for row, and what the user should know about its record.
pub struct Mended {
    /// Time (s), with what stalls of the clock lost given back.
    pub time_s: Vec<f64>,
    /// Angles (rad), velocities (rad/s) and torques (Nm).
    pub channels: [JointSignals; 3],
    /// Remarks on what was corrected and on what was not.
    pub remarks: Vec<String>,
}

/// Velocities that are late by less than this share of a step are moved, and not computed from the angles: a filter that
/// short rounds no kink, and angles in coarse steps have noisy slopes (with steps of 1 mrad, along a single run, the
/// slopes made parameters wrong by 20 σ where 0.3 ms did by 2).
const SHORT_LAG: f64 = 0.2;

impl Mended {
    /// Replaces wild readings of `m` and stale ones by what their neighbours say, gives time back that the clock lost, and
    /// corrects velocities that come late. Where the angles jump, as where another recording begins, that is done along
    /// the longest run between two jumps, which alone is identified from.
    ///
    /// # Errors
    /// [`SignalError`] if the signals cannot be processed.
    pub fn of(m: &Measurement) -> Result<Self, SignalError> {
        let untorn = Untorn::of(m);
        let run = untorn.as_ref().map_or(*m, |run| run.measurement(m.source));
        // As along a single run, nothing is filled in.
        let Faults { causes, mut record, warnings, .. } =
            find_by(&run, true, SHORT_LAG * step_s(m))?;
        let first = untorn.as_ref().map_or(0, |run| run.first_row);
        record.rows.iter_mut().for_each(|row| *row += first);
        let mut all = Record::without_rows(m, &[]);
        let is_whole = put_back(&record, first..first + run.time_s.len(), &mut all);
        let is_told = |fault: &&Cause| match fault.kind {
            Kind::VelocityLag => false,
            // Rows that are missing are told where the log is prepared.
            Kind::DroppedSamples => fault.record_fault != Some(RecordFault::MissingRows),
            _ => true,
        };
        let of_fault = |fault: &Cause| {
            let is_corrected = match fault.kind {
                Kind::Quantisation => false,
                Kind::Outliers => true,
                _ => is_whole,
            };
            format!("{} {}", fault.sentence(false), if is_corrected { CORRECTED } else { STAYS })
        };
        let is_lag = |fault: &&Cause| fault.kind == Kind::VelocityLag;
        let lags: Vec<&Cause> = causes.iter().filter(is_lag).collect();
        let remarks = warnings.into_iter().chain(of_lags(&lags));
        let remarks = remarks.chain(causes.iter().filter(is_told).map(of_fault)).collect();
        let Record { time_s, q_rad, qd_rad_s, torque_nm, .. } = all;
        Ok(Self { time_s, channels: [q_rad, qd_rad_s, torque_nm], remarks })
    }
}

/// Longest run of rows that are left out of a record and can be put back between their neighbours.
const SHORT_RUN: usize = 3;

/// Puts the rows of the corrected `record` in place of those of the `log` from whose rows `range` it was made, and rows
/// that were left out of it on straight lines between these. Runs of such rows longer than [`SHORT_RUN`] stay as they
/// are; returns whether there are none.
fn put_back(record: &Record, range: Range<usize>, log: &mut Record) -> bool {
    let mut is_whole = true;
    let (mut next, mut lost_s) = (0, 0.0);
    for row in range.clone() {
        if record.rows.get(next) == Some(&row) {
            // What the clock has lost so far, which rows that stay have to be given back too.
            lost_s = record.time_s[next] - log.time_s[row];
            log.set_row(row, record, |y| y[next]);
            next += 1;
            continue;
        }
        let place = |k: usize| record.rows.get(k).copied();
        let Some(last) = next.checked_sub(1) else {
            is_whole = false;
            continue;
        };
        match (place(last), place(next)) {
            (Some(left), Some(right)) if right - left - 1 <= SHORT_RUN => {
                let u = (row - left) as f64 / (right - left) as f64;
                log.set_row(row, record, |y| y[last] + u * (y[next] - y[last]));
            }
            _ => {
                is_whole = false;
                log.time_s[row] += lost_s;
            }
        }
    }
    log.time_s[range.end..].iter_mut().for_each(|time| *time += lost_s);
    is_whole
}

/// What becomes of a fault of the record.
const CORRECTED: &str = "This is corrected as far as the log allows.";
const STAYS: &str =
    "Identification takes this as it is recorded; `armid diagnose` takes it into account.";

/// The remark about velocities that come late, if there are any.
fn of_lags(lags: &[&Cause]) -> Option<String> {
    let mut delays_ms: Vec<f64> =
        lags.iter().map(|lag| 1e3 * lag.parameters["delay_s"].value).collect();
    delays_ms.sort_by(f64::total_cmp);
    let [least, most] = [delays_ms.first()?, delays_ms.last()?].map(|ms| {
        let when = if *ms < 0.0 { "early" } else { "late" };
        format!("{:.2} ms {when}", ms.abs())
    });
    let joints: Vec<String> =
        lags.iter().filter_map(|lag| lag.joint).map(|j| j.to_string()).collect();
    let comes = match &joints[..] {
        [] => format!("velocities of all joints come {most}"),
        [joint] => format!("velocity of joint {joint} comes {most}"),
        _ => format!("velocities of joints {} come {least} to {most}", joints.join(", ")),
    };
    Some(format!(
        "The {comes} against the angles. This is corrected: it would make friction and inertias wrong."
    ))
}
