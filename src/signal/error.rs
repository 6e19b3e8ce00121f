//! Errors of signals and of requests for their processing.

use thiserror::Error;

/// A request to the module `signal` that cannot be met, with the numbers that show why.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum SignalError {
    /// The sampling rate is not a positive number.
    #[error("the sampling rate is {rate_hz} Hz; it must be positive and finite")]
    Rate {
        /// The rate, Hz.
        rate_hz: f64,
    },
    /// The cut-off is not between zero and half the sampling rate.
    #[error(
        "a cutoff of {cutoff_hz} Hz cannot be had at {rate_hz} Hz: it must lie above 0 and below {} Hz",
        rate_hz / 2.0
    )]
    Cutoff {
        /// The cut-off, Hz.
        cutoff_hz: f64,
        /// The sampling rate, Hz.
        rate_hz: f64,
    },
    /// The filter order is zero or above the highest order offered.
    #[error("filter order {order} is not between 1 and {highest}")]
    Order {
        /// The order asked for.
        order: usize,
        /// The highest order offered.
        highest: usize,
    },
    /// Decimation by zero.
    #[error("keeping every 0th sample leaves nothing; the smallest factor is 1")]
    Factor,
    /// The record is too short for the task.
    #[error("{task} needs at least {needed} samples, the record has {samples}")]
    TooFewSamples {
        /// What was to be done.
        task: &'static str,
        /// Samples available.
        samples: usize,
        /// Samples needed.
        needed: usize,
    },
    /// Two series that belong together differ in length or number of joints.
    #[error("{what}: {expected} expected, {found} found")]
    Mismatch {
        /// Which two things differ.
        what: &'static str,
        /// Count of the first.
        expected: usize,
        /// Count of the second.
        found: usize,
    },
    /// Time does not increase.
    #[error("time does not increase at sample {index}: {before_s} s is followed by {after_s} s")]
    Time {
        /// The sample (0-based) that is not later than the one before.
        index: usize,
        /// Time of the sample before, s.
        before_s: f64,
        /// Time of this sample, s.
        after_s: f64,
    },
    /// Time stamps show when rows arrived, not when they were measured.
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
    /// The longest gap to bridge is not a positive time.
    #[error("the longest gap to interpolate across is {limit_s} s; it must be positive")]
    GapLimit {
        /// The limit, s.
        limit_s: f64,
    },
    /// The samples are not two or more whole periods.
    #[error(
        "{samples} samples are not two or more whole periods of {samples_per_period} samples each"
    )]
    Periods {
        /// Samples available.
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

/// Returns the sampling rate if it can be used.
pub(super) fn checked_rate_hz(rate_hz: f64) -> Result<f64, SignalError> {
    if rate_hz.is_finite() && rate_hz > 0.0 {
        Ok(rate_hz)
    } else {
        Err(SignalError::Rate { rate_hz })
    }
}

/// Returns the cut-off if it is strictly between zero and half the sampling rate.
pub(super) fn checked_cutoff_hz(cutoff_hz: f64, rate_hz: f64) -> Result<f64, SignalError> {
    checked_rate_hz(rate_hz)?;
    if cutoff_hz > 0.0 && cutoff_hz < rate_hz / 2.0 {
        Ok(cutoff_hz)
    } else {
        Err(SignalError::Cutoff { cutoff_hz, rate_hz })
    }
}

/// Checks that there are at least `needed` samples; the error names the task.
pub(super) fn enough(task: &'static str, samples: usize, needed: usize) -> Result<(), SignalError> {
    if samples < needed {
        return Err(SignalError::TooFewSamples { task, samples, needed });
    }
    Ok(())
}

/// Checks that two counts agree.
pub(super) fn same(what: &'static str, expected: usize, found: usize) -> Result<(), SignalError> {
    if expected != found {
        return Err(SignalError::Mismatch { what, expected, found });
    }
    Ok(())
}
