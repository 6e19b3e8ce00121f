//! One answer against its truth.

use super::case::{Case, Hidden, Secret};
use super::family::Judged;
use super::record::{Named, Record};
use crate::diagnose::class_holds;
use crate::montecarlo::share::Share;

/// Whether `named`, or something that it says it cannot be told from, is what was hidden.
pub fn is_right(named: &Named, hidden: &Hidden) -> bool {
    let (kind, joint) = (hidden.kind, hidden.joint);
    named.kind == kind && named.joint == joint
        || class_holds(&named.class, named.joint, kind, joint)
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
    /// How it turned out. Of two effects (or a change and a law), both must be named; where the family is withheld no name is
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
            Secret::Two | Secret::Beside => {
                hidden.iter().all(|h| named.iter().any(|n| is_right(n, h)))
            }
        };
        match (right, is_flagged) {
            (true, _) => Outcome::Right,
            (false, true) => Outcome::WrongFlagged,
            (false, false) => Outcome::Wrong,
        }
    }
}

impl Case {
    /// What the effects are judged by together: √λ, or √λ_sim of one that the model absorbs.
    pub fn strength(&self) -> Option<f64> {
        match &self.hidden[..] {
            [only] => only.strength,
            [] => None,
            _ => Some(self.sqrt_lambda),
        }
    }

    /// Whether one effect is hidden that is judged so.
    pub(super) fn is_one(&self, judged: Judged) -> bool {
        self.secret == Secret::One && self.hidden.iter().all(|h| h.judged == judged)
    }

    /// Whether it is at least as strong as `low`.
    pub(super) fn is_from(&self, low: f64) -> bool {
        self.strength().is_some_and(|s| s >= low)
    }
}

impl Record {
    /// Whether nothing was said.
    pub(super) fn is_silent(&self) -> bool {
        self.answer.named.is_empty() && self.answer.left.is_none()
    }

    /// Whether the first name is a good one for the first effect hidden.
    pub(super) fn first_is(&self, good: impl Fn(&Named, &Hidden) -> bool) -> bool {
        match (self.answer.named.first(), self.case.hidden.first()) {
            (Some(named), Some(hidden)) => good(named, hidden),
            _ => false,
        }
    }

    /// `(covered, all)` of the parameters of what was named by its own name.
    pub(super) fn covered(&self) -> Share {
        let mut share = Share::default();
        let Some(hidden) = self.case.hidden.first() else { return share };
        let own = |n: &&Named| n.kind == hidden.kind && n.joint == hidden.joint;
        let Some(named) = self.answer.named.first().filter(own) else { return share };
        for (name, truth) in hidden.effect.parameters() {
            let (Some(truth), Some(p)) = (truth.as_f64(), named.parameters.get(&name)) else {
                continue;
            };
            // An interval without width is no claim about chance, and a force on the flange has no torque
            // that a joint's could be compared with.
            let is_force = hidden.joint.is_none() && name == "peak_nm";
            if p.high <= p.low || is_force {
                continue;
            }
            let truth = if name.ends_with("phase_rad") { same_turn(truth, p.value) } else { truth };
            share.of += 1;
            share.count += u64::from(p.low <= truth && truth <= p.high);
        }
        share
    }
}

/// The angle `a` plus the turns that bring it closest to `b`.
fn same_turn(a: f64, b: f64) -> f64 {
    let turn = std::f64::consts::TAU;
    a + turn * ((b - a) / turn).round()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_are_compared_on_the_same_turn() {
        assert!((same_turn(3.1, -3.1) - (3.1 - std::f64::consts::TAU)).abs() < 1e-12);
    }
}
