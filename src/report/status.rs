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

    /// A word beside it, for those who only hear the page.
    pub fn label(self) -> &'static str {
        match self {
            Status::Good => "good",
            Status::Warn => "check",
            Status::Bad => "fails",
        }
    }

    /// The judgement of a run of which the trials `missing` have not been run: they may say something else.
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
