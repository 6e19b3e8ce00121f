//! What can be wrong with a signal or with what is asked of it.

use thiserror::Error;

/// A request to the signal chapter that cannot be met, with the numbers that say why.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SignalError {
    /// The sampling rate is not a positive number.
    #[error("the sampling rate is {rate_hz} Hz; it must be positive and finite")]
    Rate {
        /// The rate, Hz.
        rate_hz: f64,
    },
    /// The cutoff is not between zero and half the sampling rate.
    #[error(
        "a cutoff of {cutoff_hz} Hz cannot be had at {rate_hz} Hz: it must lie above 0 and below {} Hz",
        rate_hz / 2.0
    )]
    Cutoff {
        /// The cutoff, Hz.
        cutoff_hz: f64,
        /// The sampling rate, Hz.
        rate_hz: f64,
    },
    /// The filter order is zero or beyond what double precision carries.
    #[error("filter order {order} is not between 1 and {highest}")]
    Order {
        /// The order asked for.
        order: usize,
        /// The highest order offered.
        highest: usize,
    },
    /// Keep every 0th sample.
    #[error("keeping every 0th sample leaves nothing; the smallest factor is 1")]
    Factor,
    /// The record is too short for the task.
    #[error("{task} needs at least {needed} samples, the record has {samples}")]
    TooFewSamples {
        /// What was to be done.
        task: &'static str,
        /// Samples at hand.
        samples: usize,
        /// Samples needed.
        needed: usize,
    },
    /// Two series that belong together differ in length or number of joints.
    #[error("{what}: {expected} expected, {found} found")]
    Mismatch {
        /// Which two things differ.
        what: &'static str,
        /// What the first one has.
        expected: usize,
        /// What the second one has.
        found: usize,
    },
    /// Time does not increase.
    #[error("time does not increase at sample {index}: {before_s} s is followed by {after_s} s")]
    Time {
        /// Sample (0-based) at which it fails.
        index: usize,
        /// Time of the sample before, s.
        before_s: f64,
        /// Its own time, s.
        after_s: f64,
    },
    /// Time stamps that tell when rows arrived, not when they were measured.
    #[error(
        "time stamps come in bursts: most follow each other at {rate_hz:.0} Hz, and yet there are {rows_hz:.0} rows in a \
         second; log the time at which a row is measured"
    )]
    Bursts {
        /// One over the usual step between time stamps, Hz.
        rate_hz: f64,
        /// Rows per second, pauses left out, Hz.
        rows_hz: f64,
    },
    /// The longest bridged gap is not a positive time.
    #[error("the longest gap to interpolate across is {limit_s} s; it must be positive")]
    GapLimit {
        /// The limit, s.
        limit_s: f64,
    },
    /// Not at least two whole periods.
    #[error(
        "{samples} samples are not two or more whole periods of {samples_per_period} samples each"
    )]
    Periods {
        /// Samples at hand.
        samples: usize,
        /// Samples of one period.
        samples_per_period: usize,
    },
    /// A value is not finite.
    #[error("{what} of joint {} is {value} at sample {sample}", joint + 1)]
    NotFinite {
        /// Which quantity.
        what: &'static str,
        /// Joint (0-based).
        joint: usize,
        /// Sample (0-based).
        sample: usize,
        /// The value.
        value: f64,
    },
}

/// A sampling rate that can be used, or the error that says it cannot.
pub(super) fn checked_rate_hz(rate_hz: f64) -> Result<f64, SignalError> {
    if rate_hz.is_finite() && rate_hz > 0.0 {
        Ok(rate_hz)
    } else {
        Err(SignalError::Rate { rate_hz })
    }
}

/// A cutoff strictly between zero and half the rate.
pub(super) fn checked_cutoff_hz(cutoff_hz: f64, rate_hz: f64) -> Result<f64, SignalError> {
    checked_rate_hz(rate_hz)?;
    if cutoff_hz > 0.0 && cutoff_hz < rate_hz / 2.0 {
        Ok(cutoff_hz)
    } else {
        Err(SignalError::Cutoff { cutoff_hz, rate_hz })
    }
}

/// At least `needed` samples, or the error that names the task.
pub(super) fn enough(task: &'static str, samples: usize, needed: usize) -> Result<(), SignalError> {
    if samples < needed {
        return Err(SignalError::TooFewSamples { task, samples, needed });
    }
    Ok(())
}

/// Two counts that must agree.
pub(super) fn same(what: &'static str, expected: usize, found: usize) -> Result<(), SignalError> {
    if expected != found {
        return Err(SignalError::Mismatch { what, expected, found });
    }
    Ok(())
}
