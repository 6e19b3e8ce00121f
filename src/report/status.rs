//! Good, doubtful, bad.

use serde::Serialize;

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
