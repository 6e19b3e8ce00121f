//! Good, doubtful, bad.

use serde::Serialize;

use crate::montecarlo::calibration::Verdict;

/// A judgement, with one colour in tables, figures and on the page.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Status {
    /// As it should be.
    Good,
    /// Usable with the reservation that is stated beside it.
    Warn,
    /// Not as it should be.
    Bad,
}

impl From<Verdict> for Status {
    fn from(verdict: Verdict) -> Self {
        match verdict {
            Verdict::Pass => Self::Good,
            Verdict::Fail => Self::Bad,
            Verdict::NotEvaluated => Self::Warn,
        }
    }
}

impl Status {
    /// One character for where there is no colour.
    pub fn symbol(self) -> char {
        match self {
            Status::Good => '✓',
            Status::Warn => '!',
            Status::Bad => '✗',
        }
    }
}
