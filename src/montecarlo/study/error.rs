//! Errors of studies.

use thiserror::Error;

use crate::excitation::ExcitationError;
use crate::identify::{FitError, IdentifyError};
use crate::plant::PlantError;
use crate::signal::SignalError;

/// Why a study cannot be made from a scenario.
#[derive(Debug, Error)]
pub enum StudyError {
    /// The simulation of the arm failed.
    #[error(transparent)]
    Plant(#[from] PlantError),
    /// The motion is not possible.
    #[error(transparent)]
    Excitation(#[from] ExcitationError),
    /// A filter is not possible.
    #[error(transparent)]
    Signal(#[from] SignalError),
    /// The least-squares fit failed.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// A log could not be identified.
    #[error(transparent)]
    Identify(#[from] IdentifyError),
    /// The rank of a parameter set is ambiguous.
    #[error(transparent)]
    Base(#[from] crate::base::AmbiguousRank),
    /// The motion has too few periods.
    #[error(
        "scenario {scenario}: this study needs motion.periods ≥ {needed}, found {found}: {why}"
    )]
    Periods {
        /// Name of the scenario.
        scenario: String,
        /// Number of periods found.
        found: usize,
        /// Number of periods needed.
        needed: usize,
        /// What the periods are needed for.
        why: &'static str,
    },
    /// The period is too short for the ends of a low-pass.
    #[error(
        "scenario {scenario}: a period of {period_s} s is too short for this study: the ends of its low-pass at \
         {cutoff_hz} Hz need {needed_s:.2} s"
    )]
    ShortPeriod {
        /// Name of the scenario.
        scenario: String,
        /// Period, s.
        period_s: f64,
        /// Period needed, s.
        needed_s: f64,
        /// Lowest cut-off of the study, Hz.
        cutoff_hz: f64,
    },
    /// The period is not a whole number of samples.
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
