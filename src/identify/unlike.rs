//! Checks whether a log has anything to do with the arm that it is said to come from.

use super::doubt::Doubt;
use crate::robot::Arm;

/// Residual share of a joint's torque (rms) that no rigid arm with friction shows. In seven logs of a UR10e the
/// median joint has 5 % left, and two joints of a wrist that hardly moved a fifth or more.
const MUCH: f64 = 0.2;

/// The same, beyond which the model has found next to nothing of what makes the torque.
const MOST: f64 = 0.5;

/// Asks whether the log is of this arm, where much of the torque is left unexplained on half of the joints or more. If
/// it is most of their torque, parameters fitted to it are those of no arm, which is a contradiction. `left` holds the
/// unexplained shares of the torque, joint by joint, without what is known to be noise.
pub fn unlike(arm: &Arm, left: &[f64]) -> Option<Doubt> {
    let beyond = |share: f64| (0..left.len()).filter(move |j| left[*j] > share);
    let is_half = |count: usize| count > 0 && 2 * count >= left.len();
    let joints: Vec<usize> = beyond(MUCH).collect();
    if !is_half(joints.len()) {
        return None;
    }
    let names: Vec<String> =
        joints.iter().map(|j| format!("{} ({:.0} %)", j + 1, 100.0 * left[*j])).collect();
    let question = format!(
        "Is this log of {}, and read as it was recorded? The model leaves much of the torque of joint {}; of a rigid arm with friction a few \
         percent are left. No single mistake in reading it was found that explains this: look at the order, signs and zeros of the joints, at \
         how the arm is mounted, and at its description.",
        arm.name,
        names.join(", ")
    );
    Some(match is_half(beyond(MOST).count()) {
        true => Doubt::contradiction(question),
        false => Doubt::question(question),
    })
}

#[cfg(test)]
mod tests {
    use super::unlike;
    use crate::robot::Arm;

    #[test]
    fn half_of_the_joints_make_a_question_and_a_wrist_does_not() {
        let arm = Arm::built_in("ur5").unwrap();
        assert_eq!(unlike(&arm, &[0.08, 0.04, 0.03, 0.05, 0.21, 0.41]), None);
        let much = unlike(&arm, &[0.08, 0.04, 0.03, 0.25, 0.51, 0.61]).unwrap();
        let sentence = much.sentence();
        assert!(sentence.contains("Is this log of ur5"), "{sentence}");
        assert!(sentence.contains("joint 4 (25 %), 5 (51 %), 6 (61 %);"), "{sentence}");
        assert!(!much.is_contradiction(), "{much:?}");
        let most = unlike(&arm, &[0.08, 0.04, 0.03, 0.55, 0.51, 0.61]).unwrap();
        assert!(most.is_contradiction(), "{most:?}");
        assert_eq!(unlike(&arm, &[0.0; 6]), None);
    }
}
