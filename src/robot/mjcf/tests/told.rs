//! Notices about an MJCF.

use super::{BODY, MjcfArm, one, read};
use crate::robot::mjcf::read_mjcf_up_to;

/// The notices about a model with `sections` ahead of the world and these attributes of the joint "j".
fn told(sections: &str, joint: &str) -> Vec<String> {
    let text = one(sections, "", &format!("{BODY}<joint name=\"j\" {joint}/>"));
    read(&text).notices.iter().map(ToString::to_string).collect()
}

/// A joint of MuJoCo Menagerie's UR5e: at the assumed speed limit of π rad/s, its damping would take 628 Nm.
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

/// MuJoCo 4.0 gives this joint 1.38 Nm s/rad and 1.38 Nm/rad instead of the written values.
#[test]
fn damping_that_mujoco_works_out_itself_is_told() {
    let joint = r#"armature="0.3" damping="7" stiffness="3" springdamper="0.5 1""#;
    let text = one("", "", &format!("{BODY}<joint name=\"j\" {joint}/>"));
    assert_eq!(read(&text).arm.joints[0].drive.viscous_nm_s_rad, 0.0);
    let lines = told("", joint);
    let is_told = |line: &String| line.contains("(springdamper)") && line.ends_with(": j");
    assert!(lines.iter().any(is_told), "{lines:?}");
}

/// As in MuJoCo 4.0 (`passive`: as in older versions): the flag `constraint` disables dry friction as much as its own
/// flag does.
#[test]
fn what_flags_disable_is_zero_and_told() {
    let of = |flags: &str, joint: &str| {
        let option = format!("<option><flag {flags}/></option>");
        let text = one(&option, "", &format!("{BODY}<joint name=\"j\" {joint}/>"));
        let MjcfArm { arm, notices, .. } = read(&text);
        let line = "friction that the file switches off (<flag>) is taken as 0: j";
        let is_told = notices.iter().any(|notice| notice.to_string() == line);
        let drive = arm.joints[0].drive;
        (drive.viscous_nm_s_rad, drive.coulomb_nm, is_told)
    };
    let both = r#"damping="2" frictionloss="1""#;
    assert_eq!(of(r#"contact="disable" damper="enable""#, both), (2.0, 1.0, false));
    assert_eq!(of(r#"damper="disable""#, both), (0.0, 1.0, true));
    assert_eq!(of(r#"passive="disable""#, both), (0.0, 1.0, true));
    assert_eq!(of(r#"frictionloss="disable""#, both), (2.0, 0.0, true));
    assert_eq!(of(r#"constraint="disable""#, both), (2.0, 0.0, true));
    assert_eq!(of(r#"constraint="disable""#, r#"damping="2""#), (2.0, 0.0, false));
}

/// Angles are in degrees unless the compiler says otherwise.
#[test]
fn a_range_in_degrees_is_told_where_it_should_be_in_radians() {
    let is_told = |sections: &str, range: &str| {
        let lines = told(sections, &format!("range=\"{range}\""));
        let line = "ranges of more than two turns, are they in degrees? The file's unit is rad: j (-170 to 170 rad)";
        lines.iter().any(|said| said == line)
    };
    let radian = r#"<compiler angle="radian"/>"#;
    assert!(is_told(radian, "-170 170"));
    assert!(!is_told(radian, "-6.3 6.3"));
    assert!(!told("", r#"range="-2000 2000""#).iter().any(|line| line.contains("in degrees")));
}

#[test]
fn a_medium_is_told() {
    let is_told = |option: &str| {
        told(&format!("<option {option}/>"), "").iter().any(|line| line.contains("drag"))
    };
    assert!(is_told(r#"density="1.2""#) && is_told(r#"viscosity="2e-5""#));
    assert!(!is_told(r#"density="0" wind="1 0 0""#));
}

/// A tendon over the joint "j", and one over the fingers of a gripper, which is locked.
#[test]
fn tendons_and_actuators_at_sites_are_told_where_they_move_the_arm() {
    let told = |sections: &str| -> Vec<String> {
        let finger = format!(r#"<body name="f"><joint name="f" type="slide"/>{BODY}</body>"#);
        let inside = format!(r#"<joint name="j"/><site name="s"/>{BODY}{finger}"#);
        let read = read_mjcf_up_to(&one(sections, "", &inside), "toy.xml", "a").unwrap();
        let lines = read.notices.iter().map(ToString::to_string);
        lines.filter(|line| line.contains("are not read, ")).collect()
    };
    let tendon = |attributes: &str, joint: &str| {
        format!(
            r#"<tendon><fixed name="t" {attributes}><joint joint="{joint}" coef="1"/></fixed></tendon>"#
        )
    };
    let tells = |sections: &str, what: &str, name: &str| {
        let lines = told(sections);
        let is_told =
            |line: &String| line.starts_with(what) && line.ends_with(&format!(": {name}"));
        assert!(lines.len() == 1 && lines.iter().all(is_told), "{lines:?}");
    };
    for acting in [r#"frictionloss="1""#, r#"damping="0 2""#, r#"stiffness="3""#, r#"range="-1 1""#]
    {
        tells(&tendon(acting, "j"), "tendons", "t");
        assert!(told(&tendon(acting, "f")).is_empty());
    }
    let idle = tendon("", "j");
    assert!(told(&idle).is_empty());
    let motor = r#"<actuator><motor tendon="t"/></actuator>"#;
    tells(&format!("{idle}{motor}"), "tendons", "t");
    let held = r#"<equality><tendon tendon1="t"/></equality>"#;
    tells(&format!("{idle}{held}"), "tendons", "t");
    tells(&format!(r#"<default><tendon damping="1"/></default>{idle}"#), "tendons", "t");
    let cable =
        r#"<tendon><spatial stiffness="9"><site site="w"/><site site="s"/></spatial></tendon>"#;
    tells(cable, "tendons", "line 1: <spatial>");
    let jet = r#"<actuator><general name="jet" site="s"/><motor name="k" site="w"/></actuator>"#;
    tells(jet, "actuators at sites", "jet");
}
