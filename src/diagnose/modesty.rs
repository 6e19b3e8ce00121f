//! How sure a name may be beside the others.

use super::kind::Kind;
use super::verdict::Cause;

/// No physical cause is surer than this in a log that shows something unexplained as well, in a record that had to be mended, or as
/// one of several that may share one origin.
const PROVISIONAL: f64 = 0.9;
/// Nor surer than this where what is unexplained sits on its own joint, or where it is one of the arm as a whole: it may be a part of
/// what the dictionary lacks.
const BESIDE_UNKNOWN: f64 = 0.5;
/// A cause of less than this share of the strength of another one beside it may be what the other's law
/// leaves.
const OVERSHADOWED: f64 = 0.5;
/// So many causes on one joint may be the parts of one that is not in the dictionary.
const SEVERAL: usize = 3;

/// Takes back what steady causes beside each other cannot be sure of.
///
/// Each confidence weighs a cause against its rivals with the other causes taken for granted. It is no more
/// than [`PROVISIONAL`] where those may be wrong as well: for all of three or more that share a joint, for one
/// beside another twice as strong, for two of the arm as a whole (a payload moves what a tilted base or a
/// longer link moves), and wherever a clock was mended or a torque is rounded. A contact is not sure on a joint with
/// wild readings, or where rows are missing; beside a clock that was mended none is named.
pub(super) fn make_modest(causes: &mut [Cause]) {
    let is_spoilt = |kind: Kind| matches!(kind, Kind::ClockFault | Kind::Quantisation);
    let beside_a_spoilt_record = causes.iter().any(|c| is_spoilt(c.kind));
    let of_the_arm = |kind: Kind| {
        matches!(kind, Kind::Payload | Kind::Gravity | Kind::BaseTilt | Kind::LinkLength)
    };
    let steady: Vec<(Kind, Option<usize>, f64)> = causes
        .iter()
        .filter(|c| c.kind.is_a_law())
        .map(|c| (c.kind, c.joint, c.strength))
        .collect();
    let of_kind = |kind: Kind| causes.iter().filter(move |c| c.kind == kind).map(|c| c.joint);
    let wild: Vec<Option<usize>> = of_kind(Kind::Outliers).collect();
    let has_gaps = of_kind(Kind::DroppedSamples).next().is_some();
    for cause in causes.iter_mut() {
        if cause.kind == Kind::Contact {
            if has_gaps || wild.contains(&cause.joint) {
                cause.make_provisional();
            }
            continue;
        }
        let of_both = |kind: Kind| of_the_arm(kind) && of_the_arm(cause.kind);
        let beside = steady.iter().filter(|(kind, joint, _)| {
            let shares = *joint == cause.joint || joint.is_none() || cause.joint.is_none();
            (*kind, *joint) != (cause.kind, cause.joint) && (shares || of_both(*kind))
        });
        let (mut count, mut strongest, mut is_akin) = (1, 0.0f64, false);
        for &(kind, _, strength) in beside {
            count += 1;
            strongest = strongest.max(strength);
            is_akin |= of_both(kind);
        }
        let is_overshadowed = cause.strength < OVERSHADOWED * strongest;
        if beside_a_spoilt_record || is_akin || is_overshadowed || count >= SEVERAL {
            cause.make_provisional();
        }
    }
}

impl Cause {
    /// Takes back what cannot be known while other things may be wrong as well.
    pub(super) fn make_provisional(&mut self) {
        self.is_no_surer_than(PROVISIONAL);
    }

    /// Takes back what cannot be known while something is left unexplained on `joint` (from 1).
    pub(super) fn make_modest_beside_unknown(&mut self, joint: usize) {
        let is_there = self.joint.is_none_or(|own| own == joint);
        self.is_no_surer_than(if is_there { BESIDE_UNKNOWN } else { PROVISIONAL });
    }

    fn is_no_surer_than(&mut self, most: f64) {
        if !self.kind.is_of_the_record() {
            self.confidence = self.confidence.min(most);
        }
    }
}
