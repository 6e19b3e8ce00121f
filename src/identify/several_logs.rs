//! Several logs of one arm, identified together.

use super::error::IdentifyError;
use super::identification::Identification;
use super::identifier::Identifier;
use super::measurement::Measurement;
use super::options::{Options, Repetition};
use super::pooled::{Several, each_alone, pooled};
use super::regression::Regression;

/// Logs of one arm, laid out to be identified as one.
///
/// Logs that repeat their motion often enough are identified one by one and pooled; otherwise the rows of all logs
/// are stacked. A single log is itself.
pub struct SeveralLogs {
    /// The rows of all logs.
    pub regression: Regression,
    several: Several,
}

impl SeveralLogs {
    /// Lays out each of the `logs`. The warnings about one of several name it.
    ///
    /// # Errors
    /// As [`Identifier::regression`].
    pub fn each(
        identifier: &mut Identifier,
        logs: &[Measurement],
    ) -> Result<Vec<Regression>, IdentifyError> {
        let lay_out = |log: &Measurement| {
            let mut regression = identifier.regression(log)?;
            if logs.len() > 1 {
                let of_log = |warning: &mut String| *warning = format!("{}: {warning}", log.source);
                regression.prepared.warnings.iter_mut().for_each(of_log);
            }
            Ok(regression)
        };
        logs.iter().map(lay_out).collect()
    }

    /// Brings the `logs` together, of which [`Self::each`] was laid out.
    ///
    /// If some of them repeat and some do not, and all have to be weighted together, all are laid out anew as single
    /// runs: the rows of a run that is filtered scatter less than those of a mean over periods.
    ///
    /// # Errors
    /// Logs of different rates, and those of [`Identifier::regression`] and of an identification of each log.
    ///
    /// # Panics
    /// If `each` is not as many as the `logs`.
    pub fn together(
        identifier: &mut Identifier,
        logs: &[Measurement],
        each: Vec<Regression>,
    ) -> Result<Self, IdentifyError> {
        assert_eq!(each.len(), logs.len(), "one regression for every log");
        let several = each_alone(identifier, &each)?;
        let is_run = |regression: &&Regression| regression.prepared.processing.period_s.is_none();
        let runs = each.iter().filter(is_run).count();
        let are_mixed = 0 < runs && runs < each.len();
        let each = if are_mixed && !matches!(several, Several::Apart(_)) {
            let alike = Options { repetition: Repetition::Never, ..identifier.options().clone() };
            Self::each(&mut identifier.with_options(alike), logs)?
        } else {
            each
        };
        let mut regression = Regression::joined(each)?;
        if let Several::Together { log, reason } = &several {
            regression.prepared.warnings.push(format!(
                "all logs count as single runs together, because {} cannot stand alone: {reason}",
                logs[*log].source
            ));
        }
        Ok(Self { regression, several })
    }

    /// Identifies the arm from all logs.
    ///
    /// # Errors
    /// As [`Identifier::identify_regression`].
    pub fn identify(&self, identifier: &mut Identifier) -> Result<Identification, IdentifyError> {
        match &self.several {
            Several::Apart(parts) => Ok(pooled(parts, &self.regression)),
            Several::AsOne | Several::Together { .. } => {
                identifier.identify_regression(&self.regression)
            }
        }
    }
}
