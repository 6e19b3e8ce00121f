//! Arms that are part of a larger model, and joints that are not an arm's.

use approx::assert_abs_diff_eq;
use nalgebra::{Matrix3, Vector3};

use super::{BODY, model, one, read, says};
use crate::robot::UrdfNotice;
use crate::robot::mjcf::{LeftOut, MjcfArm, MjcfNotice, read_mjcf_up_to};

/// A gripper with two fingers, the second of which follows the first.
fn gripper() -> String {
    let finger = |name: &str| {
        format!(
            r#"<body name="{name}" pos="0 0 0.1"><joint name="{name}_slide" type="slide" axis="0 1 0" range="0.01 0.04"/>
               <inertial pos="0 0 0" mass="0.1" diaginertia="1e-4 1e-4 1e-4"/></body>"#
        )
    };
    let coupling = r#"<equality><joint joint1="right_slide" joint2="left_slide" polycoef="0.02 -1 0 0 0"/></equality>"#;
    let hand = format!(r#"<body name="hand">{}{}</body>"#, finger("left"), finger("right"));
    one(coupling, "", &format!(r#"<joint name="j"/>{BODY}{hand}"#))
}

#[test]
fn an_arm_is_named_by_its_last_body() {
    says(
        &gripper(),
        &["one chain of hinges", "\"left_slide\" is a slide", "toy.xml#hand", "taken as locked"],
    );
    let MjcfArm { arm, notices, .. } = read_mjcf_up_to(&gripper(), "toy.xml", "hand").unwrap();
    assert_abs_diff_eq!(arm.joints[0].link.mass_kg(), 2.2, epsilon = 1e-15);
    let locked = notices.iter().find(|notice| matches!(notice, UrdfNotice::Locked { .. })).unwrap();
    let text = locked.to_string();
    assert!(text.contains("left_slide (0.01 m), right_slide (0.01 m)"), "{text}");
    let refused =
        |last: &str| read_mjcf_up_to(&gripper(), "toy.xml", last).unwrap_err().to_string();
    assert!(refused("tool").contains("no body or site \"tool\""), "{}", refused("tool"));
    assert!(refused("tool").contains("name the last body of the arm: a"), "{}", refused("tool"));
    let finger = refused("left");
    assert!(finger.contains("on the way to \"left\"") && finger.contains("a slide"), "{finger}");
    let world = refused("world");
    assert!(world.contains("\"world\" stands still"), "{world}");
}

/// A robot that floats at (1, 0, 0) with an arm on it, and a ball beside it.
#[test]
fn what_is_free_is_locked_where_it_is() {
    let arm = format!(r#"<body name="arm" pos="0 0 0.5"><joint name="j"/>{BODY}</body>"#);
    let robot = format!(
        r#"<body name="robot" pos="1 0 0" quat="1 0 0 1"><freejoint name="root"/>{BODY}{arm}</body>"#
    );
    let ball = r#"<body name="ball" pos="2 0 0"><joint type="free"/><geom size="0.1"/></body>"#;
    let text = model("", &format!("{robot}{ball}"));
    for last in ["arm", ""] {
        let MjcfArm { arm, notices, .. } = match last {
            "" => read(&text),
            last => read_mjcf_up_to(&text, "toy.xml", last).unwrap(),
        };
        assert_eq!(arm.dof(), 1);
        let placement = arm.joints[0].placement;
        assert_eq!(placement.translation_m, Vector3::new(1.0, 0.0, 0.5));
        assert_eq!(placement.rotation * Vector3::x(), Vector3::y());
        let notice = MjcfNotice::FreeJoints { joints: vec!["root".into(), "ball_joint".into()] };
        assert!(notices.contains(&UrdfNotice::Mjcf(notice)));
        assert!(!notices.iter().any(|notice| matches!(notice, UrdfNotice::Locked { .. })));
    }
    let alone = one("", "", &format!(r#"<freejoint name="root"/>{BODY}"#));
    says(&alone, &["no hinge is in it"]);
}

#[test]
fn two_joints_of_one_body_have_nothing_between_them() {
    let text = one("", "", &format!(r#"<joint name="j"/><joint name="k" axis="0 1 0"/>{BODY}"#));
    says(&text, &["a behind j", "joint \"j\"", "give each joint a body"]);
    // Locked, they are two rotations about their axes, at the distance that the file gives these.
    let wrist = r#"<joint name="k" axis="0 1 0" pos="0 0 0.1" ref="90"/><joint name="l" axis="1 0 0" pos="0 0.2 0"/>"#;
    let hand = format!(r#"<body name="b" pos="1 0 0">{wrist}{BODY}<site name="tip"/></body>"#);
    let text = one("", "", &format!(r#"<joint name="j"/>{BODY}{hand}"#));
    let MjcfArm { frames, .. } = read_mjcf_up_to(&text, "toy.xml", "a").unwrap();
    let tip = frames.fixed.iter().find(|frame| frame.name == "tip").unwrap();
    // −90° about y through (1, 0, 0.1): the origin of the body goes from (1, 0, 0) to (1.1, 0, 0.1).
    assert_abs_diff_eq!(tip.placement.translation_m, Vector3::new(1.1, 0.0, 0.1), epsilon = 1e-15);
}

#[test]
fn what_an_arm_does_not_have_is_told() {
    let joint = r#"<joint name="j" stiffness="2" damping="1 0.5"/>"#;
    let text = one(
        r#"<equality><joint joint1="j"/></equality>"#,
        r#"gravcomp="1""#,
        &format!("{joint}{BODY}"),
    );
    let MjcfArm { notices, .. } = read(&text);
    for what in [LeftOut::Stiffness, LeftOut::HigherDamping, LeftOut::Held] {
        let notice = MjcfNotice::LeftOut { what, joints: vec!["j".into()] };
        assert!(notices.contains(&UrdfNotice::Mjcf(notice)), "{what}");
    }
    let compensated = MjcfNotice::GravityCompensation { bodies: vec!["a".into()] };
    assert!(notices.contains(&UrdfNotice::Mjcf(compensated)));
    let arm = one(
        r#"<equality><joint joint1="j" joint2="k"/></equality>"#,
        "",
        &format!(r#"<joint name="j"/>{BODY}<body><joint name="k"/>{BODY}</body>"#),
    );
    says(&arm, &["joint \"j\" follows \"k\" by an <equality>"]);
}

/// MuJoCo leaves such a joint unnamed, so its generated name must not be that of any other joint.
#[test]
fn a_joint_without_a_name_is_called_as_no_other() {
    let hand = format!(r#"<body name="b"><joint name="a_joint"/>{BODY}</body>"#);
    let arm = read(&one("", "", &format!("<joint/>{BODY}{hand}"))).arm;
    let names: Vec<&str> = arm.joints.iter().map(|joint| joint.name.as_str()).collect();
    assert_eq!(names, ["a_joint2", "a_joint"]);
}

/// As in MuJoCo 4.0.
#[test]
fn equalities_have_the_defaults_of_their_class() {
    let counted = |default: &str, equality: &str| {
        let sections = format!(
            r#"<default><equality {default}/><default class="off"><equality active="false"/></default></default>
               <equality><weld body1="a" {equality}/></equality>"#
        );
        let notices = read(&one(&sections, "", &format!("<joint/>{BODY}"))).notices;
        notices.contains(&UrdfNotice::Mjcf(MjcfNotice::Loops { count: 1 }))
    };
    assert!(counted(r#"solref="0.1 1""#, ""));
    assert!(!counted(r#"active="false""#, ""));
    assert!(counted(r#"active="false""#, r#"active="true""#));
    assert!(!counted("", r#"class="off""#));
}

#[test]
fn a_name_that_a_site_has_too_is_the_bodys() {
    let hand = format!(r#"<body name="b" pos="0 0 1"><joint name="k"/>{BODY}</body>"#);
    let inside = format!(r#"<joint name="j"/>{BODY}<site name="b"/><site name="s"/>{hand}"#);
    let text = one("", "", &inside);
    let MjcfArm { arm, frames, notices, .. } = read_mjcf_up_to(&text, "toy.xml", "b").unwrap();
    assert_eq!(arm.dof(), 2);
    let names: Vec<&str> = frames.fixed.iter().map(|frame| frame.name.as_str()).collect();
    assert_eq!(names, ["s"]);
    let notice = MjcfNotice::Namesakes { sites: vec!["b".into()] };
    assert!(notice.to_string().ends_with("the name means the body: b"), "{notice}");
    assert!(notices.contains(&UrdfNotice::Mjcf(notice)));
}

/// The frame as MuJoCo 4.0 prints it: the origin in the middle, z from the second point to the first.
#[test]
fn a_site_between_two_points_has_its_frame_in_the_middle() {
    let site = r#"<site name="s" type="capsule" size="0.01" fromto="0 0 0 0.1 0.3 0.2"/>"#;
    let text = one("", "", &format!(r#"<joint name="j"/>{BODY}{site}"#));
    let placement = read(&text).frames.fixed[0].placement;
    assert_abs_diff_eq!(placement.translation_m, Vector3::new(0.05, 0.15, 0.1), epsilon = 1e-15);
    let expected = Matrix3::new(
        0.84654775,
        -0.46035675,
        -0.26726124,
        -0.46035675,
        -0.38107024,
        -0.80178373,
        0.26726124,
        0.80178373,
        -0.53452248,
    );
    assert_abs_diff_eq!(placement.rotation, expected, epsilon = 1e-8);
    let ball = one("", "", &format!("<joint/>{BODY}<site name=\"s\" fromto=\"0 0 0 0 0 1\"/>"));
    says(&ball, &["line 1: site \"s\"", "those that fromto can stretch"]);
}
