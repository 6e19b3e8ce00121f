//! Checks whether drives reached their torque limits along a log.

use crate::robot::{Arm, Joint, JointSignals};

/// Share of its largest torque beyond which a drive counts as being at its limit: readings scatter there by noise and
/// by the tolerance of the gain.
const NEAR: f64 = 0.99;
/// Readings beyond this many times the largest torque are no torque of this drive.
const BEYOND: f64 = 1.1;

/// A drive that reaches its torque limit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AtLimit {
    /// Joint, 0-based.
    pub joint: usize,
    /// Share of the samples in which it is at its limit.
    pub share: f64,
    /// The limit, Nm.
    pub limit_nm: f64,
}

/// The drives that are at their limits in samples of `torque_nm` (joints × samples).
pub fn drives_at_limits(arm: &Arm, torque_nm: &JointSignals) -> Vec<AtLimit> {
    let samples = torque_nm.samples().max(1) as f64;
    let joints = arm.joints.iter().enumerate().take(torque_nm.joints());
    let of_joint = |(joint, j): (usize, &Joint)| {
        let limit_nm = j.limits.torque_nm;
        let near = NEAR * limit_nm..BEYOND * limit_nm;
        let is_near = |t: &&f64| near.contains(&t.abs());
        let share = torque_nm.joint(joint).iter().filter(is_near).count() as f64 / samples;
        AtLimit { joint, share, limit_nm }
    };
    joints.map(of_joint).filter(|at| at.share > 0.0).collect()
}

/// A remark where drives are at their limits in samples of `torque_nm` (joints × samples); `None` where none is.
///
/// The equations of motion hold there as elsewhere, but the arm does not move as commanded, and the torque leaves the
/// limit within a sample or two, faster than a log can follow.
pub fn drive_limit_remark(arm: &Arm, torque_nm: &JointSignals) -> Option<String> {
    let in_words = |at: &AtLimit| {
        let percent = 100.0 * at.share;
        format!("joint {} in {percent:.1} % ({} Nm)", at.joint + 1, at.limit_nm)
    };
    let joints: Vec<String> = drives_at_limits(arm, torque_nm).iter().map(in_words).collect();
    (!joints.is_empty()).then(|| {
        format!(
            "drives are at their torque limits, to within 1 %, in some samples: {}; where the torque leaves its limit it changes faster than the log can \
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
