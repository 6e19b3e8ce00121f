//! A log for identification: what can be corrected within its rows is corrected, and every other fault of the record is
//! told.

use super::data_faults::{self, Faults, MISSING};
use super::kind::Kind;
use super::outliers;
use super::record::Record;
use super::verdict::Cause;
use crate::identify::Measurement;
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

impl Mended {
    /// Replaces the wild readings of `m` by what their neighbours say, and velocities that come late by the slopes of
    /// the angles. Where no rows need to be left out, time that the clock lost is given back as well.
    ///
    /// # Errors [`SignalError`] if the signals cannot be processed.
    pub fn of(m: &Measurement) -> Result<Self, SignalError> {
        // As along a single run, nothing is filled in.
        let Faults { causes, record: without_faults, .. } = data_faults::find(m, true)?;
        let (lags, others): (Vec<Cause>, Vec<Cause>) =
            causes.into_iter().partition(|fault| fault.kind == Kind::VelocityLag);
        let mut record = Record::without_rows(m, &[]);
        let strays = outliers::mend(&mut record);
        let has_all_rows = without_faults.time_s.len() == m.time_s.len();
        if has_all_rows {
            record = without_faults;
        } else {
            record.undo_lags(&lags);
        }
        let is_told = |fault: &&Cause| match fault.kind {
            Kind::Outliers => false,
            // Rows that are missing are told where the log is prepared.
            Kind::DroppedSamples => fault.in_words != MISSING,
            _ => true,
        };
        let of_fault = |fault: &Cause| {
            let is_corrected = has_all_rows && fault.kind != Kind::Quantisation;
            format!("{} {}", fault.sentence(false), if is_corrected { CORRECTED } else { STAYS })
        };
        let remarks = strays.iter().map(|few| few.in_words(m.time_s));
        let remarks =
            remarks.chain(of_lags(&lags)).chain(others.iter().filter(is_told).map(of_fault));
        let remarks = remarks.collect();
        let Record { time_s, q_rad, qd_rad_s, torque_nm, .. } = record;
        Ok(Self { time_s, channels: [q_rad, qd_rad_s, torque_nm], remarks })
    }
}

/// What becomes of a fault of the record.
const CORRECTED: &str = "This is corrected as far as the log allows.";
const STAYS: &str =
    "Identification takes this as it is recorded; `armid diagnose` takes it into account.";

/// The remark about velocities that come late, if there are any.
fn of_lags(lags: &[Cause]) -> Option<String> {
    let delays_ms: Vec<f64> =
        lags.iter().map(|lag| 1e3 * lag.parameters["delay_s"].value).collect();
    let (least, most) =
        delays_ms.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), ms| {
            (ms.min(least), ms.max(most))
        });
    let joints: Vec<String> =
        lags.iter().filter_map(|lag| lag.joint).map(|j| j.to_string()).collect();
    let whose = match joints.len() {
        0 => "The velocities of all joints".to_owned(),
        1 => format!("The velocity of joint {}", joints[0]),
        _ => format!("The velocities of joints {}", joints.join(", ")),
    };
    let when = match lags {
        [] => return None,
        [_] => format!("{most:.2} ms"),
        _ => format!("{least:.2} to {most:.2} ms"),
    };
    let (verb, they) = if joints.len() == 1 { ("lags", "is") } else { ("lag", "are") };
    Some(format!(
        "{whose} {verb} behind the angle by {when}, and {they} taken from the angle instead: late velocities make friction wrong"
    ))
}
