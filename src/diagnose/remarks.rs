//! Remarks about a log that bear on what a diagnosis says of it: drives at their limits, contacts that are not looked
//! for, torques that drift, angles in coarse steps.

use super::cleaned::Cleaned;
use super::coarse_angles::CoarseAngles;
use super::contact::Compared;
use super::kind::Kind;
use super::rms::rms_where;
use super::study::Study;
use super::verdict::{Cause, Unexplained};
use crate::identify::{HeldAtRest, MOVING_RAD_S, drives_at_limits, resting_joints};
use crate::number::significant;
use crate::robot::{Arm, JointSignals};

/// Time over which a slow error is averaged, in periods of the low-pass: longer than its memory, and with the usual
/// 10 Hz (0.5 s) shorter than the motion of an arm.
const SLOW_PERIODS: f64 = 5.0;
/// A residual is slow if these averages hold this many times the share of its square that they hold of white noise.
const SLOWER_THAN_NOISE: f64 = 3.0;
/// Share of a joint's torque from which on a slow residual is told.
const WORTH_TELLING: f64 = 0.02;

/// Share of the samples from which on a drive at its limit is told before what is named on its joint.
const OFTEN_LIMITED: f64 = 0.01;

/// The sentences about drives that are often at their limits, if something is named or `unexplained` where they act.
pub(super) fn limited_drives(
    arm: &Arm,
    torque_nm: &JointSignals,
    causes: &[Cause],
    unexplained: Option<&Unexplained>,
) -> Vec<String> {
    let laws = causes.iter().filter(|cause| cause.kind.is_a_law()).map(|cause| cause.joint);
    let places: Vec<Option<usize>> = laws.chain(unexplained.map(Unexplained::site)).collect();
    let limited = drives_at_limits(arm, torque_nm).into_iter();
    limited
        .filter(|at| at.share > OFTEN_LIMITED)
        .filter(|at| places.iter().any(|place| place.is_none_or(|joint| joint == at.joint + 1)))
        .map(|at| {
            format!(
                "Joint {}'s drive is at its torque limit ({} Nm) in {:.1} % of the samples. Where it leaves the limit, the torque changes \
                 faster than the log can follow, and what is named or unexplained may come from that: move more slowly or with less load.",
                at.joint + 1,
                at.limit_nm,
                100.0 * at.share
            )
        })
        .collect()
}

/// States why contacts were not looked for, if they were not.
pub(super) fn contact_remark(study: &Study, log: &Cleaned) -> Option<String> {
    if log.is_mended {
        let remark = "the clock was mended: contacts are not looked for, because what is left of its error looks like one, and causes named \
                      beside it are less sure";
        return Some(remark.to_owned());
    }
    (study.scene.periodic && matches!(log.compared, Compared::TooFew)).then(|| {
        "contacts are not looked for: too few periods follow each other without a gap to be compared; repeat the motion three \
         times or more"
            .to_owned()
    })
}

/// States on which joints no friction and no gear is looked at because they rest.
pub(super) fn rest_remark(qd_rad_s: &JointSignals) -> Option<String> {
    let in_words = |j: usize| format!("joint {}", j + 1);
    let joints: Vec<String> = resting_joints(qd_rad_s).into_iter().map(in_words).collect();
    (!joints.is_empty()).then(|| {
        format!(
            "friction and gears are not looked at where joints do not move faster than {MOVING_RAD_S} rad/s, and their friction is not \
             identified: {}",
            joints.join(", ")
        )
    })
}

/// States which joints stick between the moves of a single run, where nothing is tested.
pub(super) fn held_remark(held: &[HeldAtRest]) -> Option<String> {
    let joints: Vec<String> = held.iter().map(HeldAtRest::in_words).collect();
    (!joints.is_empty()).then(|| {
        format!(
            "friction is held in pauses: {}. Along a single run no cause is looked for where a joint rests; along a motion that repeats, \
             it would be named with its size",
            joints.join(", ")
        )
    })
}

/// States that what looks like a touch at some `tears` of the angles is none.
pub(super) fn tear_remark(tears: usize) -> Option<String> {
    let remark = "the angles jump as no arm can; what looks like a touch there is none";
    (tears > 0).then(|| remark.to_owned())
}

/// States on which joints friction is less well known because their angles were read in steps of `resolution_rad`. The
/// arm's friction turns round over `width_rad_s` and is `coulomb_nm`.
pub(super) fn coarse_remark(
    coarse: &[CoarseAngles],
    resolution_rad: &[f64],
    (width_rad_s, coulomb_nm): (f64, &[f64]),
) -> Option<String> {
    let in_words = |of: &CoarseAngles| {
        let step_rad = resolution_rad[of.joint];
        let friction_nm = coulomb_nm[of.joint].abs() * of.error_rad_s / width_rad_s;
        format!(
            "joint {} (steps of {}° or {} mrad): velocity up to {} Hz, friction to {} Nm",
            of.joint + 1,
            significant(step_rad.to_degrees(), 3),
            significant(1e3 * step_rad, 3),
            significant(of.highest_hz, 2),
            significant(friction_nm, 2)
        )
    };
    let joints: Vec<String> = coarse.iter().map(in_words).collect();
    (!joints.is_empty()).then(|| {
        format!(
            "angles are read in coarse steps, whose rounding is the same in every period, and nothing tells the velocities better. How much \
             of them is used, and how well friction is known where joints reverse (one standard deviation): {}. Angles with more digits, or \
             recorded velocities, would show smaller effects",
            joints.join("; ")
        )
    })
}

/// Warns of mean torques that drift, except on joints with a thermal drift among the causes.
pub(super) fn drift_remark(study: &Study, causes: &[Cause]) -> Option<String> {
    let is_said = |joint: usize| {
        causes.iter().any(|c| c.kind == Kind::ThermalDrift && c.joint == Some(joint))
    };
    let drifting = study.whitening.drifting().iter().map(|&(j, sd_nm)| (j + 1, sd_nm));
    let own: Vec<String> = drifting
        .filter(|(joint, _)| !is_said(*joint))
        .map(|(joint, sd_nm)| format!("joint {joint} by {sd_nm:.3} Nm rms"))
        .collect();
    (!own.is_empty()).then(|| {
        format!(
            "The mean torque drifts: from period to period it changes by more than the noise beside it ({}). A current sensor whose zero \
             drifts does that, or a load that changes; what is constant there, offsets and gravity, is less well known, as its intervals say.",
            own.join(", ")
        )
    })
}

/// States the joint of a single run of which most is left, if what is left is no white noise: a single run does not
/// tell whether noise is slow or the model lacks something, but how much is left.
///
/// White noise behind a low-pass of f_c has 1/(2 D f_c) of its square in its means over D.
pub(super) fn slow_remark(
    study: &Study,
    measured_nm: &JointSignals,
    after_nm: &JointSignals,
) -> Option<String> {
    let processing = &study.regression.prepared.processing;
    let (false, Some(cutoff_hz)) = (study.scene.periodic, processing.cutoff_hz) else {
        return None;
    };
    let mean_s = SLOW_PERIODS / cutoff_hz;
    let block =
        |k: usize| (study.regression.sample(k) as f64 / (mean_s * processing.rate_hz)) as usize;
    let slow = |j: usize| {
        let counts = |k: usize| study.whitening.counts(j, k);
        let [left_nm, torque_nm] = [after_nm, measured_nm].map(|y| rms_where(y.joint(j), counts));
        let residual = after_nm.joint(j).iter().enumerate().filter(|(k, _)| counts(*k));
        let share = share_of_means(residual.map(|(k, nm)| (block(k), *nm)));
        let is_slow = share > SLOWER_THAN_NOISE / (2.0 * mean_s * cutoff_hz);
        (is_slow && left_nm > WORTH_TELLING * torque_nm).then_some((
            j,
            left_nm,
            left_nm / torque_nm,
        ))
    };
    let all = (0..after_nm.joints()).filter_map(slow);
    let (j, left_nm, share) = all.max_by(|a, b| a.2.total_cmp(&b.2))?;
    Some(format!(
        "Of joint {}'s torque the model leaves {:.0} % ({left_nm:.3} Nm rms), and that changes more slowly than white noise would: either \
         the noise is slow, or something acts there that has no name here. A motion that repeats tells the two apart.",
        j + 1,
        100.0 * share
    ))
}

/// Share of the square of a series that is in its means over blocks; the values come with the number of their block, in
/// order.
fn share_of_means(values: impl Iterator<Item = (usize, f64)>) -> f64 {
    let (mut of_means, mut all) = (0.0, 0.0);
    let (mut current, mut sum, mut count) = (None, 0.0, 0.0);
    for (block, value) in values {
        if current != Some(block) {
            of_means += sum * sum / f64::max(count, 1.0);
            (current, sum, count) = (Some(block), 0.0, 0.0);
        }
        sum += value;
        count += 1.0;
        all += value * value;
    }
    of_means += sum * sum / f64::max(count, 1.0);
    if all > 0.0 { of_means / all } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Joint 2 is at its limit of 150 Nm in 20 of 1000 samples. That matters for a law on this joint or on the arm, and
    /// for something unexplained there, but neither for a touch nor for a law on another joint.
    #[test]
    fn a_drive_at_its_limit_is_told_where_something_is_named() {
        let arm = Arm::built_in("ur5").unwrap();
        let torque = |samples: usize| {
            JointSignals::from_fn(6, 1000, |j, k| if j == 1 && k < samples { -150.0 } else { 1.0 })
        };
        let of = |kind: Kind, joint| [Cause::certain(kind, joint, "an effect", 9.0, &[])];
        let told = |causes: &[Cause]| limited_drives(&arm, &torque(20), causes, None);
        for causes in [of(Kind::Elasticity, Some(1)), of(Kind::BaseTilt, None)] {
            let said = told(&causes);
            assert_eq!(said.len(), 1);
            let begin = "Joint 2's drive is at its torque limit (150 Nm) in 2.0 % of the samples.";
            assert!(said[0].starts_with(begin), "{said:?}");
            assert!(limited_drives(&arm, &torque(5), &causes, None).is_empty());
        }
        assert!(told(&of(Kind::Contact, Some(1))).is_empty());
        assert!(told(&of(Kind::Elasticity, Some(2))).is_empty());
        let unknown = Unexplained {
            axis: "angle",
            unit: "rad",
            joint: 2,
            of_all_joints: false,
            rms_nm: 1.0,
            curve: Vec::new(),
        };
        assert_eq!(limited_drives(&arm, &torque(20), &[], Some(&unknown)).len(), 1);
        let elsewhere = Unexplained { joint: 3, ..unknown };
        assert!(limited_drives(&arm, &torque(20), &[], Some(&elsewhere)).is_empty());
        let everywhere = Unexplained { of_all_joints: true, ..elsewhere };
        assert_eq!(limited_drives(&arm, &torque(20), &[], Some(&everywhere)).len(), 1);
    }

    /// A constant is all in its means, an alternation not at all, and of ten values that are independent each mean
    /// holds a tenth.
    #[test]
    fn means_hold_what_is_slow() {
        let blocks = |y: &dyn Fn(usize) -> f64| {
            share_of_means((0..1000).map(|k| (k / 10, y(k))).collect::<Vec<_>>().into_iter())
        };
        assert_eq!(blocks(&|_| 0.5), 1.0);
        assert_eq!(blocks(&|k| if k % 2 == 0 { 1.0 } else { -1.0 }), 0.0);
        assert_eq!(blocks(&|_| 0.0), 0.0);
        // 100 means of ten: the share is 0.1 ± 0.014, and the tolerance five of these.
        let mixed =
            |k: usize| ((k as u32 + 1).wrapping_mul(2_654_435_761) >> 16) as f64 / 65_536.0 - 0.5;
        let share = blocks(&|k| mixed(k * k + 7 * k));
        assert!((share - 0.1).abs() < 0.07, "{share}");
    }
}
