//! Judges one answer against the truth.

use super::case::{Case, Hidden, Secret};
use super::family::Judged;
use super::record::{Named, Record};
use crate::diagnose::class_holds;
use crate::montecarlo::share::Share;

/// Whether the cause `named`, or one of the aliases in its class, is the hidden effect.
pub fn is_right(named: &Named, hidden: &Hidden) -> bool {
    let (kind, joint) = (hidden.kind, hidden.joint);
    named.kind == kind && named.joint == joint
        || class_holds(&named.class, named.joint, kind, joint)
}

/// Whether `named` is at the joint of `hidden`, regardless of its kind, or is right by an alias.
pub fn is_at(named: &Named, hidden: &Hidden) -> bool {
    named.joint == hidden.joint || is_right(named, hidden)
}

/// Outcome of one answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Outcome {
    /// The first cause named is the hidden effect. With two effects: both are named. With none: nothing is said.
    Right,
    /// Nothing was said, although something was hidden.
    Silent,
    /// The answer says that something is unexplained, but gives it no name.
    Unexplained,
    /// A wrong name is given, but the answer says that something is left unexplained.
    WrongFlagged,
    /// A wrong name is given without any reservation.
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
    /// Outcome of the trial. With two effects (or a change and a law) both must be named; if the family is withheld, no
    /// name is right.
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
            Secret::One | Secret::Strong => hidden.iter().all(|h| is_right(first, h)),
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
    /// Strength of all hidden effects together: √λ, or √λ_sim of a single effect that the null model absorbs. `None`
    /// without effects, and for a fault of the record.
    pub fn strength(&self) -> Option<f64> {
        match &self.hidden[..] {
            [only] => only.strength,
            [] => None,
            _ => Some(self.sqrt_lambda),
        }
    }

    /// Whether the case hides one effect, its family not withheld, and this effect is seen by `judged`.
    pub(super) fn is_one(&self, judged: Judged) -> bool {
        self.secret == Secret::One && self.hidden.iter().all(|h| h.judged == judged)
    }

    /// Whether the strength is at least `low`.
    pub(super) fn is_from(&self, low: f64) -> bool {
        self.strength().is_some_and(|s| s >= low)
    }
}

impl Record {
    /// Whether every cause named is a hidden effect, and nothing is said to be left unexplained.
    pub(super) fn is_all_right(&self) -> bool {
        let is_hidden = |named: &Named| self.case.hidden.iter().any(|h| is_right(named, h));
        self.answer.left.is_none() && self.answer.named.iter().all(is_hidden)
    }

    /// Whether nothing was said.
    pub(super) fn is_silent(&self) -> bool {
        self.answer.named.is_empty() && self.answer.left.is_none()
    }

    /// Whether `good` holds for the first cause named and the first effect hidden.
    pub(super) fn first_is(&self, good: impl Fn(&Named, &Hidden) -> bool) -> bool {
        match (self.answer.named.first(), self.case.hidden.first()) {
            (Some(named), Some(hidden)) => good(named, hidden),
            _ => false,
        }
    }

    /// Counts the parameters of the first hidden effect whose 95 % interval holds the true value. Only counted if the
    /// first cause named is that effect itself, not an alias of it.
    pub(super) fn covered(&self) -> Share {
        let mut share = Share::default();
        let Some(hidden) = self.case.hidden.first() else { return share };
        let own = |n: &&Named| n.kind == hidden.kind && n.joint == hidden.joint;
        let Some(named) = self.answer.named.first().filter(own) else { return share };
        for (name, truth) in hidden.effect.parameters() {
            let (Some(truth), Some(p)) = (truth.as_f64(), named.parameters.get(&name)) else {
                continue;
            };
            // An interval without width makes no claim about chance. For a force on the flange, the estimated
            // torque at a joint cannot be compared with the hidden peak.
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

/// The angle `a` plus the whole number of turns that brings it closest to `b`.
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
