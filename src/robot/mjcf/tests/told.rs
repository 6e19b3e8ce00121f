//! What is told of an MJCF beside its arm.

use super::{BODY, one, read};

/// The lines that are told, with `sections` ahead of the world and the attributes of the joint "j".
fn told(sections: &str, joint: &str) -> Vec<String> {
    let text = one(sections, "", &format!("{BODY}<joint name=\"j\" {joint}/>"));
    read(&text).notices.iter().map(ToString::to_string).collect()
}

/// A joint of MuJoCo Menagerie's UR5e: with π rad/s, which are assumed, 628 Nm.
#[test]
fn damping_that_a_drive_could_not_carry_is_told() {
    let servo = r#"<actuator><position joint="j" kp="3500" forcerange="-150 150"/></actuator>"#;
    let is_told = |sections: &str, joint: &str| {
        let lines = told(sections, joint);
        lines.iter().any(|line| line.contains("a simulated servo's and not the arm's"))
    };
    let lines = told(servo, r#"damping="200""#);
    let line = lines.iter().find(|line| line.contains("simulated servo")).unwrap();
    assert!(line.ends_with(": j (200 Nm s/rad: 150 Nm at 0.75 rad/s)"), "{line}");
    assert!(!is_told(servo, r#"damping="47""#));
    assert!(is_told(servo, r#"damping="48""#));
    // Without a torque limit there is nothing to compare with.
    assert!(!is_told("", r#"damping="200""#));
}
