//! Judgements: good, doubtful, bad.

use serde::Serialize;

use crate::montecarlo::calibration::Verdict;

/// A judgement, with the same colour in tables, figures and on the page.
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
    /// One character that replaces the colour where there is none.
    pub fn symbol(self) -> char {
        match self {
            Status::Good => '✓',
            Status::Warn => '!',
            Status::Bad => '✗',
        }
    }

    /// A word that states the judgement, for screen readers.
    pub fn label(self) -> &'static str {
        match self {
            Status::Good => "good",
            Status::Warn => "check",
            Status::Bad => "fails",
        }
    }

    /// The judgement of a run in which the trials `missing` have not been run. A good judgement becomes doubtful,
    /// because the missing trials may change it.
    pub fn of_a_part(self, missing: &[[u64; 2]]) -> Self {
        match self {
            Self::Good if !missing.is_empty() => Self::Warn,
            status => status,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_part_is_not_good() {
        let part = |status: Status| status.of_a_part(&[[3, 5]]);
        assert_eq!([Status::Good, Status::Bad].map(part), [Status::Warn, Status::Bad]);
        assert_eq!(Status::Good.of_a_part(&[]), Status::Good);
    }
}
