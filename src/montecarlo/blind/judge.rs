//! One answer against its truth.

use super::case::{Hidden, Secret};
use super::record::{Named, Record};

/// Whether `named`, or something that it says it cannot be told from, is what was hidden.
pub fn is_right(named: &Named, hidden: &Hidden) -> bool {
    let name = hidden.kind.name();
    if named.kind == hidden.kind && named.joint == hidden.joint {
        return true;
    }
    let elsewhere = hidden.joint.map(|j| format!("{name}@{j}"));
    let here = named.joint == hidden.joint || hidden.joint.is_none();
    named.class.iter().any(|c| here && c == name || Some(c) == elsewhere.as_ref())
}

/// Whether `named` sits where `hidden` does, whatever it is.
pub fn is_at(named: &Named, hidden: &Hidden) -> bool {
    named.joint == hidden.joint || is_right(named, hidden)
}

/// How an answer turned out.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Outcome {
    /// The first cause named is what was hidden (of two: both are named); of nothing, nothing.
    Right,
    /// Nothing was said.
    Silent,
    /// Something is there, says the answer, without a name.
    Unexplained,
    /// A wrong name, and the answer says that something is left unexplained.
    WrongFlagged,
    /// A wrong name and no doubt.
    Wrong,
}

impl std::fmt::Display for Outcome {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(match self {
            Self::Right => "right",
            Self::Silent => "nothing said",
            Self::Unexplained => "unexplained, no name",
            Self::WrongFlagged => "wrong name, but something left unexplained",
            Self::Wrong => "wrong name",
        })
    }
}

impl Record {
    /// How it turned out. Of two effects, both must be named; where the family is withheld no name is
    /// right.
    pub fn outcome(&self) -> Outcome {
        let (named, hidden) = (&self.answer.named, &self.case.hidden);
        let is_flagged = self.answer.left.is_some();
        let Some(first) = named.first() else {
            return match (is_flagged, self.case.secret) {
                (false, Secret::Nothing) => Outcome::Right,
                (false, _) => Outcome::Silent,
                (true, _) => Outcome::Unexplained,
            };
        };
        let right = match self.case.secret {
            Secret::Nothing | Secret::Withheld => false,
            Secret::One => hidden.iter().all(|h| is_right(first, h)),
            Secret::Two => hidden.iter().all(|h| named.iter().any(|n| is_right(n, h))),
        };
        match (right, is_flagged) {
            (true, _) => Outcome::Right,
            (false, true) => Outcome::WrongFlagged,
            (false, false) => Outcome::Wrong,
        }
    }
}
