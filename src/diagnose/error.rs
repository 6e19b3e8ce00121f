//! Errors: why a log cannot be diagnosed.

use thiserror::Error;

use crate::identify::{FitError, IdentifyError, Misreading};
use crate::signal::SignalError;

/// Reason why a log has no diagnosis, with the numbers that explain it.
#[derive(Debug, Error)]
pub enum DiagnoseError {
    /// The identification failed: there is no model to diagnose.
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
    /// The log fits its arm only if it is read differently.
    #[error("{log}: declined. {}", misreading.sentence())]
    Misread {
        /// The log.
        log: String,
        /// How the log has to be read.
        misreading: Box<Misreading>,
    },
    /// Several logs together do not determine the unknowns.
    #[error("{log}: the motions do not determine the {unknowns} unknowns that are asked for")]
    Singular {
        /// The log.
        log: String,
        /// Number of unknowns.
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

/// Advice for a motion that excites too little.
const WHAT_TO_DO: &str =
    "`armid identify` names all that is not excited, `armid excite` plans a motion that excites it";

impl DiagnoseError {
    /// The sentence that says why the log `log` is declined, for an error that [`Self::is_declined`].
    pub fn declined(&self, log: &str) -> String {
        match self {
            Self::Identify(error) => format!("{log}: declined, {error}; {WHAT_TO_DO}"),
            error => error.to_string(),
        }
    }

    /// How the log has to be read, if it was read wrongly.
    pub fn misreading(&self) -> Option<&Misreading> {
        match self {
            Self::Misread { misreading, .. } => Some(misreading),
            _ => None,
        }
    }

    /// Whether the log is declined: its motion does not identify the unknowns, or it is not read as it was recorded.
    pub fn is_declined(&self) -> bool {
        let of_the_fit = |error: &IdentifyError| {
            matches!(
                error,
                IdentifyError::NoMotion { .. }
                    | IdentifyError::Fit(FitError::NotExcited { .. } | FitError::StandsStill)
            )
        };
        match self {
            Self::Singular { .. } | Self::NotExcited { .. } | Self::Misread { .. } => true,
            Self::Identify(error) => of_the_fit(error),
            Self::Signal(_) | Self::NoNoise { .. } => false,
        }
    }
}
