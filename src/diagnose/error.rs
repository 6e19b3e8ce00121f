//! Why a log cannot be diagnosed.

use thiserror::Error;

use crate::identify::{FitError, IdentifyError, Misreading};
use crate::signal::SignalError;

/// A log without a diagnosis, with the numbers that say why.
#[derive(Debug, Error)]
pub enum DiagnoseError {
    /// There is no model to diagnose.
    #[error(transparent)]
    Identify(#[from] IdentifyError),
    /// A filter or spectrum could not be computed.
    #[error(transparent)]
    Signal(#[from] SignalError),
    /// The scatter between periods gives no covariance.
    #[error(
        "{log}: the scatter between periods at {frequency_hz:.3} Hz is singular: a channel of \
         torque is constant or a copy of another"
    )]
    NoNoise {
        /// The log.
        log: String,
        /// Frequency, Hz.
        frequency_hz: f64,
    },
    /// The log fits its arm when it is read otherwise.
    #[error("{log}: declined. {}", misreading.sentence())]
    Misread {
        /// The log.
        log: String,
        /// How it has to be read.
        misreading: Box<Misreading>,
    },
    /// Several logs together do not determine the unknowns.
    #[error("{log}: the motions do not determine the {unknowns} unknowns that are asked for")]
    Singular {
        /// The log.
        log: String,
        /// Unknowns.
        unknowns: usize,
    },
    /// A parameter's column vanishes in the whitened equations.
    #[error(
        "{log}: declined, the motion does not excite {parameter}: without the rigid model there is nothing to \
         diagnose; {WHAT_TO_DO}"
    )]
    NotExcited {
        /// The log.
        log: String,
        /// Name of the base parameter.
        parameter: String,
    },
}

/// What helps where a motion tells too little.
const WHAT_TO_DO: &str =
    "`armid identify` names all that is not excited, `armid excite` plans a motion that excites it";

impl DiagnoseError {
    /// The sentence about the log `log` whose motion tells too little.
    pub fn declined(&self, log: &str) -> String {
        match self {
            Self::Identify(error) => format!("{log}: declined, {error}; {WHAT_TO_DO}"),
            error => error.to_string(),
        }
    }

    /// How the log has to be read, where that is what is wrong.
    pub fn misreading(&self) -> Option<&Misreading> {
        match self {
            Self::Misread { misreading, .. } => Some(misreading),
            _ => None,
        }
    }

    /// Whether there is nothing to diagnose: the motion does not identify what was asked for, or the log is not read as it was
    /// recorded.
    pub fn is_declined(&self) -> bool {
        let of_the_fit = |error: &IdentifyError| {
            matches!(error, IdentifyError::Fit(FitError::NotExcited { .. } | FitError::StandsStill))
        };
        match self {
            Self::Singular { .. } | Self::NotExcited { .. } | Self::Misread { .. } => true,
            Self::Identify(error) => of_the_fit(error),
            Self::Signal(_) | Self::NoNoise { .. } => false,
        }
    }
}
