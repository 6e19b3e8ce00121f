//! Upper limits on the confidence in a cause, given the other causes and what is left unexplained.

use std::collections::BTreeSet;

use super::chance::FALSE_ALARM;
use super::kind::Kind;
use super::verdict::Cause;

/// Limit for a physical cause in a log that shows something unexplained as well, in a record that had to be mended, or
/// among several causes that may share one origin.
const PROVISIONAL: f64 = 0.9;
/// Limit for a cause on the joint with the unexplained effect, for a cause of the arm as a whole, and for one that may
/// be part of an effect on the whole arm: it may be a part of what the dictionary lacks.
const BESIDE_UNKNOWN: f64 = 0.5;
/// A cause that removes less than this share of the explainable mean square leaves more than nine times as much of it.
const NEXT_TO_NOTHING: f64 = 0.1;
/// Causes of a joint that remove less than this share of what can be explained there, all together, leave more than they
/// explain: beside something unexplained, they are as likely a part of it.
const SMALLER_PART: f64 = 0.5;
/// Limit for a cause with so small a gain beside something unexplained. Of eleven such names in three logs of another
/// simulator none was right; by Clopper and Pearson (1934), fewer than one in four are, with 95 % confidence.
const BESIDE_MORE: f64 = 0.25;
/// Delays that are shorter than this, s, ...
const SHORT_S: f64 = 1e-3;
/// ... and fainter than this are in doubt along moves with pauses. In another simulator six of twelve logs of
/// such moves had one that was not there (0.4 to 0.9 ms, 4 to 6 σ); of designed motions, seventeen of seventeen were there.
const FAINT: f64 = 8.0;
/// Probability that a joint has a fault of its own.
const FAULTY: f64 = 0.1;
/// A cause with less than this share of the strength of another one beside it may be what the approximate law of the
/// other leaves.
const OVERSHADOWED: f64 = 0.5;
/// From this many causes on one joint on, they may be parts of a single one that is not in the dictionary.
const SEVERAL: usize = 3;

/// Limits the confidence in causes that stand beside each other.
///
/// Each confidence weighs a cause against its rivals and takes the other causes for granted. Where these may be wrong
/// as well, it is limited to [`PROVISIONAL`]: for all of three or more causes that share a joint, for a cause beside
/// another one more than twice as strong, for two causes of the arm as a whole (a payload moves the same parameters as
/// a tilted base or a longer link), and wherever a clock was mended or a torque is rounded. A contact is limited on a
/// joint with wild readings, and where rows are missing. (Beside a mended clock no contact is named at all.)
///
/// Gravity and the length of a link are limited as well unless they are changes of a simulation that the log
/// `is_compared` with. The parameters take up nearly all of them; what is left is the weight of the links out of
/// proportion to their inertia, by which one is told from the other as long as both are known: with one of the two
/// taken out of the dictionary, the other explained all that the log showed of it (√λ of 14 to 38, in each of five
/// logs). Other errors of an arm's geometry would do the same. With both taken out, gravity looked like torque gains of
/// two or three joints (√λ of 18, in two of two logs), which therefore share that limit.
pub(super) fn make_modest(causes: &mut [Cause], is_compared: bool) {
    let is_spoilt = |kind: Kind| matches!(kind, Kind::ClockFault | Kind::Quantisation);
    let beside_a_spoilt_record = causes.iter().any(|c| is_spoilt(c.kind));
    let of_the_arm = |kind: Kind| {
        matches!(kind, Kind::Payload | Kind::Gravity | Kind::BaseTilt | Kind::LinkLength)
    };
    let steady: Vec<(usize, Kind, Option<usize>, f64)> = causes
        .iter()
        .enumerate()
        .filter(|(_, c)| c.kind.is_a_law())
        .map(|(index, c)| (index, c.kind, c.joint, c.strength))
        .collect();
    let of_kind = |kind: Kind| causes.iter().filter(move |c| c.kind == kind).map(|c| c.joint);
    let wild: Vec<Option<usize>> = of_kind(Kind::Outliers).collect();
    let has_gaps = of_kind(Kind::DroppedSamples).next().is_some();
    let has_several_gains = of_kind(Kind::TorqueGain).count() > 1;
    for (index, cause) in causes.iter_mut().enumerate() {
        let is_of_weight = match cause.kind {
            Kind::Gravity | Kind::LinkLength => true,
            Kind::TorqueGain => has_several_gains,
            _ => false,
        };
        if is_of_weight && !is_compared {
            cause.make_provisional();
        }
        if cause.kind == Kind::Contact {
            if has_gaps || wild.contains(&cause.joint) {
                cause.make_provisional();
            }
            continue;
        }
        let of_both = |kind: Kind| of_the_arm(kind) && of_the_arm(cause.kind);
        let beside = steady.iter().filter(|(other, kind, joint, _)| {
            let shares = *joint == cause.joint || joint.is_none() || cause.joint.is_none();
            *other != index && (shares || of_both(*kind))
        });
        let (mut count, mut strongest, mut is_akin) = (1, 0.0f64, false);
        for &(_, kind, _, strength) in beside {
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

/// Limits the confidence in short and faint delays along moves with pauses between them, where they are as likely the start
/// of moves that is not known well enough.
pub(super) fn make_modest_along_moves(causes: &mut [Cause]) {
    for cause in causes.iter_mut().filter(|cause| cause.kind == Kind::TimeSkew) {
        let delay_s = cause.parameters.get("delay_s").map_or(f64::INFINITY, |delay| delay.value);
        if delay_s.abs() < SHORT_S && cause.strength < FAINT {
            cause.is_no_surer_than(BESIDE_UNKNOWN);
        }
    }
}

/// Limits the confidence in causes while something is left unexplained at `site`: a joint (1-based), or the arm as a
/// whole, of which a touch is no part. The small gain of causes and the number of the arm's `joints` with causes are
/// evidence only where `noise_is_known`: along single runs of real arms, friction has laws on all joints.
pub(super) fn make_modest_beside_unknown(
    causes: &mut [Cause],
    site: Option<usize>,
    (joints, noise_is_known): (usize, bool),
) {
    let all: &[Cause] = causes;
    let has_parts = noise_is_known && !scattered_joints(all, joints).is_empty();
    let explained = |cause: &Cause| -> f64 {
        // Contacts and faults of the record remove nothing of what a law could explain.
        let laws = all.iter().filter(|other| other.kind.is_a_law());
        let on_joint = laws.filter(|other| other.joint == cause.joint);
        on_joint.map(|other| other.gain_fraction.unwrap_or(1.0)).sum()
    };
    let is_part = |cause: &Cause| {
        let is_smaller = noise_is_known && cause.kind.is_a_law() && explained(cause) < SMALLER_PART;
        is_smaller || has_parts && is_of_few_joints(all, cause, joints)
    };
    let parts: Vec<bool> = all.iter().map(is_part).collect();
    for (cause, is_part) in causes.iter_mut().zip(parts) {
        let is_there = match site {
            None => cause.kind.is_a_law(),
            Some(_) => cause.joint.is_none() || cause.joint == site,
        };
        cause.is_no_surer_than(if is_there || is_part { BESIDE_UNKNOWN } else { PROVISIONAL });
        let gains_nothing = cause.gain_fraction.is_some_and(|gain| gain < NEXT_TO_NOTHING);
        if noise_is_known && gains_nothing {
            cause.is_no_surer_than(BESIDE_MORE);
        }
    }
}

/// The joints (1-based) of an arm with this number of `joints` whose laws are likely parts of one effect on the arm as a
/// whole if something is left unexplained beside them; empty if these are fewer than [many](many_of).
pub(super) fn scattered_joints(causes: &[Cause], joints: usize) -> BTreeSet<usize> {
    let scattered = causes.iter().filter(|cause| is_of_few_joints(causes, cause, joints));
    let on: BTreeSet<usize> = scattered.filter_map(|cause| cause.joint).collect();
    if on.len() < many_of(joints) { BTreeSet::new() } else { on }
}

/// Whether `cause` is a law on a joint, of a kind that fewer than [many](many_of) of the `joints` have. A kind that many
/// joints have alike is a property of their drives that the model lacks.
fn is_of_few_joints(causes: &[Cause], cause: &Cause, joints: usize) -> bool {
    let alike = causes.iter().filter(|other| other.kind == cause.kind);
    let on: BTreeSet<usize> = alike.filter_map(|other| other.joint).collect();
    cause.kind.is_a_law() && cause.joint.is_some() && on.len() < many_of(joints)
}

/// From this many joints with causes of their own on, the causes count not as many faults but as one effect on the arm
/// as a whole: the least number of `joints` that have faults of their own in fewer arms than a good log is given a fault
/// by chance. With six joints this is four (0.13 % of all arms); three of them have one in 1.6 %.
fn many_of(joints: usize) -> usize {
    // Of the binomial distribution: of exactly `count` faults, then of fewer than `count`.
    let (mut exactly, mut fewer) = ((1.0 - FAULTY).powi(joints as i32), 0.0);
    let mut count = 0;
    while count <= joints && 1.0 - fewer > FALSE_ALARM {
        fewer += exactly;
        exactly *= (joints - count) as f64 / (count + 1) as f64 * FAULTY / (1.0 - FAULTY);
        count += 1;
    }
    count
}

impl Cause {
    /// Limits the confidence to what can be known while other things may be wrong as well.
    pub(super) fn make_provisional(&mut self) {
        self.is_no_surer_than(PROVISIONAL);
    }

    fn is_no_surer_than(&mut self, most: f64) {
        if !self.kind.is_of_the_record() {
            self.confidence = self.confidence.min(most);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::verdict::Estimate;

    #[test]
    fn short_delays_along_moves_are_in_doubt() {
        let limited = |delay_s: f64, strength: f64| {
            let delay = Estimate { value: delay_s, unit: "s", ci95: [delay_s; 2] };
            let mut causes =
                [Cause::certain(Kind::TimeSkew, None, "", strength, &[("delay_s", delay)])];
            make_modest_along_moves(&mut causes);
            causes[0].confidence
        };
        assert_eq!([limited(-8e-4, 6.0), limited(8e-4, 9.0), limited(2e-3, 6.0)], [0.5, 1.0, 1.0]);
    }

    /// A cause on `joint` (1-based) with this gain.
    fn cause(kind: Kind, joint: usize, gain: f64) -> Cause {
        let sure = Cause::certain(kind, Some(joint - 1), "an effect", 20.0, &[]);
        Cause { gain_fraction: Some(gain), ..sure }
    }

    fn confidences(mut causes: Vec<Cause>, joint: usize, noise_is_known: bool) -> Vec<f64> {
        make_modest_beside_unknown(&mut causes, Some(joint), (6, noise_is_known));
        causes.iter().map(|cause| cause.confidence).collect()
    }

    /// Four of the causes named for a pendulum on the tool: it got eight names on five joints, most with a confidence
    /// of 0.9.
    fn of_a_pendulum() -> Vec<Cause> {
        vec![
            cause(Kind::AsymmetricFriction, 6, 0.26),
            cause(Kind::TorqueGain, 5, 0.3),
            cause(Kind::TorqueGain, 3, 0.3),
            cause(Kind::Stribeck, 2, 0.005),
        ]
    }

    #[test]
    fn causes_on_many_joints_are_parts_of_one() {
        let causes = of_a_pendulum();
        assert_eq!(scattered_joints(&causes, 6), BTreeSet::from([2, 3, 5, 6]));
        assert_eq!(confidences(causes.clone(), 4, true), [0.5, 0.5, 0.5, 0.25]);
        // A single run tells nothing about this, and three joints may each have a fault.
        assert_eq!(confidences(causes.clone(), 4, false), [0.9; 4]);
        assert!(scattered_joints(&causes[..3], 6).is_empty());
        // Of seven joints, four have faults of their own more often, and of three hardly ever all.
        assert!(scattered_joints(&causes, 7).is_empty());
        assert_eq!([1, 2, 3, 4, 6, 7].map(many_of), [2, 3, 3, 4, 4, 5]);
        // But they remove less than they leave.
        assert_eq!(confidences(causes[..3].to_vec(), 5, true), [0.5; 3]);
        let faults = [6, 5, 3].map(|j| cause(Kind::TorqueGain, j, 0.6)).to_vec();
        assert_eq!(confidences(faults, 5, true), [0.9, 0.5, 0.9]);
    }

    /// Ripples of a joint are laws beside each other as any others are.
    #[test]
    fn laws_of_one_kind_limit_each_other() {
        let confidences = |strengths: &[f64]| -> Vec<f64> {
            let of_strength = |s: &f64| Cause { strength: *s, ..cause(Kind::Ripple, 4, 0.3) };
            let mut causes: Vec<Cause> = strengths.iter().map(of_strength).collect();
            make_modest(&mut causes, false);
            causes.iter().map(|cause| cause.confidence).collect()
        };
        assert_eq!(confidences(&[20.0]), [1.0]);
        assert_eq!(confidences(&[20.0, 15.0]), [1.0; 2]);
        assert_eq!(confidences(&[20.0, 9.0]), [1.0, 0.9]);
        assert_eq!(confidences(&[20.0, 15.0, 15.0]), [0.9; 3]);
    }

    /// An error of the arm's geometry looks like gains of several joints. A simulation that the log is compared with has
    /// none.
    #[test]
    fn gains_of_several_joints_may_be_one_error() {
        let of_gains = |joints: &[usize], is_compared: bool| -> Vec<f64> {
            let mut causes: Vec<Cause> =
                joints.iter().map(|j| cause(Kind::TorqueGain, *j, 0.9)).collect();
            make_modest(&mut causes, is_compared);
            causes.iter().map(|cause| cause.confidence).collect()
        };
        assert_eq!(of_gains(&[3, 4], false), [0.9; 2]);
        assert_eq!(of_gains(&[3, 4], true), [1.0; 2]);
        assert_eq!(of_gains(&[3], false), [1.0]);
    }

    /// Who knows what acts on the arm as a whole does not know which joint's cause is a part of it.
    #[test]
    fn beside_something_unknown_on_all_joints_no_cause_is_sure() {
        let mut causes = vec![cause(Kind::TorqueGain, 3, 0.9), cause(Kind::Stribeck, 5, 0.9)];
        make_modest_beside_unknown(&mut causes, None, (6, true));
        assert!(causes.iter().all(|cause| cause.confidence == 0.5), "{causes:?}");
        let mut touch = [cause(Kind::Contact, 3, 0.9)];
        make_modest_beside_unknown(&mut touch, None, (6, true));
        assert_eq!(touch[0].confidence, 0.9);
    }

    /// Bristles on all joints and a time skew of the arm as a whole, beside two faults of one joint each and two faults
    /// of the record.
    #[test]
    fn what_joints_have_alike_is_no_part_of_an_unknown_effect() {
        let mut causes: Vec<Cause> = (1..=6).map(|j| cause(Kind::Presliding, j, 0.9)).collect();
        causes.push(Cause { joint: None, ..cause(Kind::TimeSkew, 1, 0.9) });
        causes.push(cause(Kind::TorqueGain, 1, 0.9));
        causes.push(cause(Kind::Stribeck, 2, 0.9));
        let record = [3, 4].map(|j| cause(Kind::VelocityLag, j, 0.9));
        causes.extend(record);
        assert!(scattered_joints(&causes, 6).is_empty());
        let expected = [0.9, 0.9, 0.9, 0.5, 0.9, 0.9, 0.5, 0.9, 0.9, 1.0, 1.0];
        assert_eq!(confidences(causes, 4, true), expected);
    }

    /// A touch of a joint says nothing for a law that leaves more than it explains.
    #[test]
    fn a_touch_makes_no_law_surer() {
        let touch = Cause { gain_fraction: None, ..cause(Kind::Contact, 3, 0.0) };
        let causes = vec![cause(Kind::Stribeck, 3, 0.3), touch];
        assert_eq!(confidences(causes[..1].to_vec(), 5, true), [0.5]);
        assert_eq!(confidences(causes, 5, true), [0.5, 0.9]);
    }

    /// The first cause removes less than a tenth of what can be explained.
    #[test]
    fn a_name_that_gains_nothing_beside_an_unexplained_rest_is_unsure() {
        let causes = vec![cause(Kind::Stribeck, 2, 0.0087), cause(Kind::Stribeck, 3, 0.62)];
        assert_eq!(confidences(causes.clone(), 2, true), [0.25, 0.9]);
        assert_eq!(confidences(causes, 2, false), [0.5, 0.9]);
    }
}
