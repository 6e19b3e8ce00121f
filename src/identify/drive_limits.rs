//! Checks whether drives reached their torque limits along a log.

use crate::robot::{Arm, JointSignals};

/// Share of its largest torque beyond which a drive counts as being at its limit: readings scatter there by noise and
/// by the tolerance of the gain.
const NEAR: f64 = 0.99;

/// A remark where drives are at their limits in samples of `torque_nm` (joints × samples); `None` where none is.
///
/// The equations of motion hold there as elsewhere, but the arm does not move as commanded, and the torque leaves the
/// limit within a sample or two, faster than a log can follow.
pub fn drive_limit_remark(arm: &Arm, torque_nm: &JointSignals) -> Option<String> {
    let samples = torque_nm.samples().max(1) as f64;
    let of_joint = |(j, joint): (usize, &crate::robot::Joint)| {
        let limit_nm = joint.limits.torque_nm;
        let at_limit = torque_nm.joint(j).iter().filter(|t| t.abs() > NEAR * limit_nm).count();
        let percent = 100.0 * at_limit as f64 / samples;
        (at_limit > 0).then(|| format!("joint {} in {percent:.1} % ({limit_nm} Nm)", j + 1))
    };
    let joints: Vec<String> =
        arm.joints.iter().enumerate().take(torque_nm.joints()).filter_map(of_joint).collect();
    (!joints.is_empty()).then(|| {
        format!(
            "drives are at their torque limits in some samples: {}; where the torque leaves its limit it changes faster than the log can \
             follow, which may look like a soft gear or a late torque; move more slowly or with less load",
            joints.join(", ")
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn joints_at_their_limits_are_named_with_their_share() {
        let arm = Arm::built_in("ur5").unwrap();
        let limit = |j: usize| arm.joints[j].limits.torque_nm;
        let mut torque_nm =
            JointSignals::from_fn(6, 1000, |j, k| 0.9 * limit(j) * (0.1 * k as f64).sin());
        assert_eq!(drive_limit_remark(&arm, &torque_nm), None);
        for k in 100..125 {
            torque_nm.joint_mut(1)[k] = -limit(1);
        }
        let remark = drive_limit_remark(&arm, &torque_nm).unwrap();
        assert!(remark.contains("joint 2 in 2.5 % (150 Nm)"), "{remark}");
        assert!(!remark.contains("joint 1 "), "{remark}");
    }
}
