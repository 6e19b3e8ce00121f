//! What can stop a study.

use thiserror::Error;

use crate::excitation::ExcitationError;
use crate::identify::{FitError, IdentifyError};
use crate::plant::PlantError;
use crate::signal::SignalError;

/// A study that cannot be made from this scenario.
#[derive(Debug, Error)]
pub enum StudyError {
    /// The simulation of the arm.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// The motion.
    #[error(transparent)]
    Excitation(#[from] ExcitationError),
    /// Filters.
    #[error(transparent)]
    Signal(#[from] SignalError),
    /// Least squares.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// A log.
    #[error(transparent)]
    Identify(#[from] IdentifyError),
    /// Rank of a parameter set.
    #[error(transparent)]
    Base(#[from] crate::base::AmbiguousRank),
    /// Too short a motion.
    #[error(
        "scenario {scenario}: this study needs motion.periods ≥ {needed}, found {found}: {why}"
    )]
    Periods {
        /// Name of the scenario.
        scenario: String,
        /// Periods found.
        found: usize,
        /// Periods needed.
        needed: usize,
        /// What they are for.
        why: &'static str,
    },
    /// A period is no whole number of samples.
    #[error(
        "scenario {scenario}: a period of {period_s} s is not a whole number of samples at {rate_hz} Hz"
    )]
    UnevenPeriod {
        /// Name of the scenario.
        scenario: String,
        /// Period, s.
        period_s: f64,
        /// Rate of the log, Hz.
        rate_hz: f64,
    },
}
