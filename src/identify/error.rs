//! Reasons why a log gives no estimate.

use thiserror::Error;

use super::covariance::CovarianceError;
use super::fit::FitError;
use crate::signal::SignalError;

/// A log that gives no estimate, with the numbers that say why.
#[derive(Debug, Error)]
pub enum IdentifyError {
    /// Not enough samples, or not enough of them in motion.
    #[error("{log}: {samples} samples of motion; at least {needed} are needed")]
    TooShort {
        /// The log.
        log: String,
        /// Samples there are.
        samples: usize,
        /// Samples needed.
        needed: usize,
    },
    /// The arm stands still throughout.
    #[error(
        "{log}: the arm never moves, and a log at rest tells neither inertia nor friction; `armid excite` makes a motion that does"
    )]
    NoMotion {
        /// The log.
        log: String,
    },
    /// The torque of a joint never changes although the joint moves.
    #[error(
        "{log}: while joint {joint} moves its torque is {torque_nm} Nm in every row: no torque was recorded there, or its column is another one"
    )]
    DeadTorque {
        /// The log.
        log: String,
        /// The first joint with a constant torque, from 1.
        joint: usize,
        /// The recorded torque, Nm.
        torque_nm: f64,
    },
    /// The log has another number of joints than the arm.
    #[error("{log}: {found} joints, but the arm has {expected}")]
    Joints {
        /// The log.
        log: String,
        /// Joints in the log.
        found: usize,
        /// Joints of the arm.
        expected: usize,
    },
    /// Nothing to identify from.
    #[error("no logs")]
    NoLogs,
    /// Logs of different sampling rates.
    #[error(
        "logs sampled at {expected_hz:.2} and {found_hz:.2} Hz cannot be used together: give one \
         --rate for all"
    )]
    Rates {
        /// Rate of this log, Hz.
        found_hz: f64,
        /// Rate of the first log, Hz.
        expected_hz: f64,
    },
    /// `--rate` asks for too many samples between two rows.
    #[error(
        "{log}: it has {natural_hz:.1} rows a second; a rate of {wanted_hz} Hz is more than can be made of them ({most_hz:.0} Hz)"
    )]
    RateAboveLog {
        /// The log.
        log: String,
        /// Rate asked for, Hz.
        wanted_hz: f64,
        /// Rate of the log, Hz.
        natural_hz: f64,
        /// Highest rate that can be made of it, Hz.
        most_hz: f64,
    },
    /// The low-pass of a single run is too wide for its rate.
    #[error(
        "{log}: a single run is low-passed at {cutoff_hz} Hz (--cutoff), which has to be below half of its rate of {rate_hz:.1} Hz"
    )]
    Cutoff {
        /// The log.
        log: String,
        /// Cut-off of the low-pass, Hz.
        cutoff_hz: f64,
        /// Rate of its samples, Hz.
        rate_hz: f64,
    },
    /// The low-pass of a single run is so narrow that next to nothing of the motion passes.
    #[error(
        "{log}: the low-pass at {cutoff_hz} Hz (--cutoff) leaves {cycles:.2} cycles of {seconds:.2} s of motion, of which at least \
         {needed} are needed: a higher cut-off leaves more, and so does a longer record"
    )]
    CutoffTooLow {
        /// The log.
        log: String,
        /// Cut-off of the low-pass, Hz.
        cutoff_hz: f64,
        /// Length of the motion, s.
        seconds: f64,
        /// Cycles of the cut-off in it.
        cycles: f64,
        /// Cycles needed.
        needed: f64,
    },
    /// `--rate` asks for so few samples that the motion does not show in them.
    #[error(
        "{log}: in samples at {rate_hz} Hz (--rate) the motion of the log does not show: give a higher rate, or none"
    )]
    RateTooLow {
        /// The log.
        log: String,
        /// Rate asked for, Hz.
        rate_hz: f64,
    },
    /// `--period` names a period that the motion does not have.
    #[error(
        "{log}: {}",
        match found_s {
            Some(s) => format!("the period of the motion is {s:.3} s, not {wanted_s} s"),
            None => format!("the motion does not repeat every {wanted_s} s"),
        }
    )]
    NoSuchPeriod {
        /// The log.
        log: String,
        /// Period asked for, s.
        wanted_s: f64,
        /// Period found, s.
        found_s: Option<f64>,
    },
    /// A filter or spectrum could not be computed.
    #[error(transparent)]
    Signal(#[from] SignalError),
    /// The equations have no unique solution.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// The covariance asked for does not exist for these data.
    #[error("{log}: {error}")]
    Covariance {
        /// The log, or the logs that were joined.
        log: String,
        /// What the data lack.
        error: CovarianceError,
    },
}
