//! Checks whether a log has anything to do with the arm that it is said to come from.

use crate::robot::Arm;

/// Residual share of a joint's torque (rms) that no rigid arm with friction shows. In seven logs of a UR10e the
/// median joint has 5 % left, and two joints of a wrist that hardly moved a fifth or more.
const MUCH: f64 = 0.2;

/// Asks whether the log is of this arm, where much of the torque is left unexplained on half of the joints or more.
/// `left` holds the unexplained shares of the torque, joint by joint, without what is known to be noise.
pub fn unlike_remark(arm: &Arm, left: &[f64]) -> Option<String> {
    let joints: Vec<usize> = (0..left.len()).filter(|j| left[*j] > MUCH).collect();
    if 2 * joints.len() < left.len() {
        return None;
    }
    let names: Vec<String> =
        joints.iter().map(|j| format!("{} ({:.0} %)", j + 1, 100.0 * left[*j])).collect();
    Some(format!(
        "Is this log of {}, and read as it was recorded? The model leaves much of the torque of joint {}; of a rigid arm with friction a few \
         percent are left. No single mistake in reading it was found that explains this: look at the order, signs and zeros of the joints, at \
         how the arm is mounted, and at its description.",
        arm.name,
        names.join(", ")
    ))
}

#[cfg(test)]
mod tests {
    use super::unlike_remark;
    use crate::robot::Arm;

    #[test]
    fn half_of_the_joints_make_a_question_and_a_wrist_does_not() {
        let arm = Arm::built_in("ur5").unwrap();
        assert_eq!(unlike_remark(&arm, &[0.08, 0.04, 0.03, 0.05, 0.21, 0.41]), None);
        let remark = unlike_remark(&arm, &[0.08, 0.04, 0.03, 0.25, 0.21, 0.41]).unwrap();
        assert!(remark.contains("Is this log of ur5"), "{remark}");
        assert!(remark.contains("joint 4 (25 %), 5 (21 %), 6 (41 %);"), "{remark}");
        assert_eq!(unlike_remark(&arm, &[0.0; 6]), None);
    }
}
