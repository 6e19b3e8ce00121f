//! Robots of which the arm is a part: joints that are not on the way to its last link are locked.

use approx::assert_abs_diff_eq;
use nalgebra::Vector3;
use proptest::prelude::*;

use super::{BODY, LIMIT, fault, joint, link, read, robot, two_joints, with};
use crate::robot::urdf::{LockedJoint, Obstacle, Stand, UrdfArm, UrdfFault, UrdfNotice};
use crate::robot::{Arm, LinkInertia, RobotError, read_urdf_up_to};

const FINGER: &str = r#"<inertial><origin xyz="0 0.02 0.03" rpy="0.3 0 0"/><mass value="0.1"/>
    <inertia ixx="1e-4" ixy="0" ixz="0" iyy="1e-4" iyz="0" izz="5e-5"/></inertial>"#;
const SLIDE: &str = r#"<limit lower="0" upper="0.04" effort="20" velocity="0.2"/>"#;

/// The arm with a hand and two fingers, which `joints` connect to the hand.
fn with_hand(joints: &[String]) -> String {
    let hand = [
        link("hand", BODY),
        joint("mount", "fixed", "b", "hand", ""),
        link("left", FINGER),
        link("right", FINGER),
        link("tip", ""),
        joint("tip_mount", "fixed", "left", "tip", ""),
    ];
    with(&[&hand[..], joints].concat())
}

/// A joint of the left finger and one of the right.
fn fingers(left: (&str, &str), right: (&str, &str)) -> Vec<String> {
    vec![
        joint("f1", left.0, "hand", "left", left.1),
        joint("f2", right.0, "hand", "right", right.1),
    ]
}

fn fixed_fingers() -> Vec<String> {
    fingers(("fixed", ""), ("fixed", ""))
}

/// A gripper whose second finger mimics the first.
fn gripper() -> String {
    let follows = format!(r#"{SLIDE}<mimic joint="f1"/>"#);
    with_hand(&fingers(("prismatic", SLIDE), ("prismatic", &follows)))
}

fn up_to(text: &str, last: &str) -> UrdfArm {
    read_urdf_up_to(text, "toy.urdf", last).unwrap()
}

fn refused(text: &str, last: &str) -> UrdfFault {
    match read_urdf_up_to(text, "toy.urdf", last) {
        Err(RobotError::UrdfArm { fault, .. }) => fault,
        other => panic!("{other:?}"),
    }
}

/// Names and positions of the joints that are reported as locked.
fn locked(read: &UrdfArm) -> Vec<(&str, Stand)> {
    let joints = read.notices.iter().flat_map(|notice| match notice {
        UrdfNotice::Locked { joints, .. } => joints.as_slice(),
        _ => &[],
    });
    joints.map(|LockedJoint { name, stand }| (name.as_str(), *stand)).collect()
}

/// Asserts that two arms differ by no more than a few roundings of numbers below 10.
fn assert_same(one: &Arm, other: &Arm) {
    assert_eq!(one.dof(), other.dof());
    for (a, b) in one.joints.iter().zip(&other.joints) {
        assert_eq!((&a.name, a.placement, a.limits), (&b.name, b.placement, b.limits));
        for (x, y) in a.link.parameters.iter().zip(&b.link.parameters) {
            assert_abs_diff_eq!(*x, *y, epsilon = 1e-14);
        }
    }
}

#[test]
fn joints_at_zero_are_as_if_they_were_fixed() {
    let fixed = read(&with_hand(&fixed_fingers()));
    let at_zero = [("f1", Stand::DistanceM(0.0)), ("f2", Stand::DistanceM(0.0))];
    for last in ["hand", "b"] {
        let found = up_to(&gripper(), last);
        assert_eq!(
            (&found.arm, &found.frames, &found.links),
            (&fixed.arm, &fixed.frames, &fixed.links)
        );
        assert_eq!(locked(&found), at_zero);
        let said = found.notices[0].to_string();
        let words = [format!("\"{last}\""), "f1 (0 m), f2 (0 m)".to_owned()];
        assert!(words.iter().all(|word| said.contains(word)), "{said}");
    }
    let all = "<limit velocity=\"1\"/>";
    for kinds in [["revolute", "continuous"], ["floating", "planar"]] {
        let text = with_hand(&fingers((kinds[0], all), (kinds[1], all)));
        assert_eq!(up_to(&text, "hand").arm, fixed.arm, "{kinds:?}");
    }
    // Where nothing is locked, naming the last link changes nothing.
    let plain = with_hand(&fixed_fingers());
    assert_eq!(up_to(&plain, "tip"), fixed);
}

/// The same robot with fixed joints in place of the locked ones has the same arm.
#[test]
fn joints_that_do_not_reach_zero_stand_at_the_nearest_limit() {
    let along = r#"<axis xyz="0.6 0 0.8"/><limit lower="0.01" upper="0.04" velocity="0.2"/>"#;
    let about = r#"<limit lower="-2" upper="-0.3" velocity="1"/>"#;
    let found = up_to(&with_hand(&fingers(("prismatic", along), ("revolute", about))), "hand");
    let stands = [("f1", Stand::DistanceM(0.01)), ("f2", Stand::AngleRad(-0.3))];
    assert_eq!(locked(&found), stands);
    let moved = r#"<origin xyz="0.006 0 0.508"/>"#;
    let turned = r#"<origin xyz="0 0 0.5" rpy="0 0 -0.3"/>"#;
    let fixed = read(&with_hand(&fingers(("fixed", moved), ("fixed", turned))));
    assert_same(&found.arm, &fixed.arm);
    assert_ne!(found.arm, read(&with_hand(&fixed_fingers())).arm);
    let tip = &found.frames.fixed[0];
    assert_eq!((tip.name.as_str(), tip.body), ("tip", 2));
    assert_abs_diff_eq!(
        tip.placement.translation_m,
        Vector3::new(0.006, 0.0, 1.508),
        epsilon = 1e-15
    );
}

#[test]
fn a_joint_that_mimics_another_follows_it() {
    let open = r#"<limit lower="0.01" upper="0.04" velocity="0.2"/>"#;
    let follows =
        |of: &str| format!(r#"{SLIDE}<mimic joint="{of}" multiplier="-1" offset="0.002"/>"#);
    let text = with_hand(&fingers(("prismatic", open), ("prismatic", &follows("f1"))));
    let stands = [("f1", Stand::DistanceM(0.01)), ("f2", Stand::DistanceM(0.002 - 0.01))];
    assert_eq!(locked(&up_to(&text, "hand")), stands);
    // Also through another mimic joint, wherever that is in the file; a mimicked joint of the arm counts as zero.
    let text = with_hand(&fingers(("prismatic", &follows("f2")), ("prismatic", &follows("j1"))));
    let stands = [("f1", Stand::DistanceM(0.0)), ("f2", Stand::DistanceM(0.002))];
    assert_eq!(locked(&up_to(&text, "hand")), stands);
    for (first, second) in [("f2", "f1"), ("f1", "j1"), ("nowhere", "j1")] {
        let joints = fingers(("prismatic", &follows(first)), ("prismatic", &follows(second)));
        let fault = refused(&with_hand(&joints), "hand");
        assert_eq!(fault, UrdfFault::MimicsNothing { joint: "f1".into(), of: first.into() });
    }
}

/// A second arm on the base never moves; one that the arm carries is part of the body that carries it.
#[test]
fn a_second_arm_belongs_to_what_carries_it() {
    let second = |parent: &str, kind: &str| {
        with(&[
            link("c", BODY),
            joint("j3", kind, parent, "c", LIMIT),
            link("d", FINGER),
            joint("j4", kind, "c", "d", LIMIT),
        ])
    };
    assert_eq!(up_to(&second("base", "revolute"), "b").arm, read(&robot(&two_joints())).arm);
    for carrier in ["a", "b"] {
        let found = up_to(&second(carrier, "revolute"), "b");
        assert_eq!(found.arm, read(&second(carrier, "fixed")).arm);
    }
    // The arm ends at the named link, even if joints of its own follow.
    let shorter = up_to(&robot(&two_joints()), "a");
    assert_eq!((shorter.arm.dof(), shorter.arm.joints[0].link.mass_kg()), (1, 4.0));
    assert_eq!(locked(&shorter), [("j2", Stand::AngleRad(0.0))]);
    let names: Vec<String> =
        up_to(&second("a", "revolute"), "d").arm.joints.into_iter().map(|j| j.name).collect();
    assert_eq!(names, ["j1", "j3", "j4"]);
}

#[test]
fn without_a_last_link_all_that_is_in_the_way_is_told_at_once() {
    let mut joints =
        fingers(("prismatic", SLIDE), ("revolute", &format!(r#"{LIMIT}<mimic joint="f1"/>"#)));
    joints.extend([link("rim", BODY), joint("wheel", "continuous", "base", "rim", "")]);
    let text = with_hand(&joints);
    let name = || "toy.urdf#hand".to_owned();
    let expected = UrdfFault::NotOneChain {
        obstacles: vec![
            Obstacle::JointType { joint: "f1".into(), kind: "prismatic" },
            Obstacle::Mimic { joint: "f2".into(), of: "f1".into() },
            Obstacle::Branch { body: "base".into(), joints: vec!["j1".into(), "wheel".into()] },
        ],
        proposal: Some(name()),
    };
    let found = fault(&text);
    assert_eq!(found, expected);
    let message = found.to_string();
    for part in ["\"f1\" is prismatic", "\"f2\" mimics \"f1\"", "\"j1\", \"wheel\"", &name()] {
        assert!(message.contains(part), "{message}");
    }
    // The proposed link ends an arm.
    assert_eq!(up_to(&text, "hand").arm.dof(), 2);
}

/// The joint that drives a gripper's fingers is not part of the arm.
#[test]
fn a_gripper_is_not_proposed_as_the_end_of_the_arm() {
    let follows = format!(r#"{LIMIT}<mimic joint="f1"/>"#);
    let text = with_hand(&fingers(("revolute", LIMIT), ("revolute", &follows)));
    let UrdfFault::NotOneChain { proposal, .. } = fault(&text) else { panic!() };
    assert_eq!(proposal.as_deref(), Some("toy.urdf#hand"));
    // A rail ahead of the arm is in the way of every arm.
    let rail = [link("rail", ""), joint("slide", "prismatic", "rail", "base", SLIDE)];
    let found = fault(&with(&rail));
    let UrdfFault::NotOneChain { proposal: None, .. } = &found else { panic!("{found:?}") };
    assert!(found.to_string().contains("make what is in its way fixed"), "{found}");
}

#[test]
fn a_last_link_that_ends_no_arm_is_refused() {
    let fault = refused(&gripper(), "tip");
    let prismatic = Obstacle::JointType { joint: "f1".into(), kind: "prismatic" };
    assert_eq!(fault, UrdfFault::OnTheWay { last: "tip".into(), obstacles: vec![prismatic] });
    let words = fault.to_string();
    assert!(words.contains("on the way to link \"tip\", joint \"f1\" is prismatic;"), "{words}");
    for text in [gripper(), robot(&two_joints())] {
        let words = refused(&text, "base").to_string();
        assert!(words.contains("\"base\" stands still"), "{words}");
        let words = refused(&text, "flange").to_string();
        let proposed = "no link \"flange\"; name the last link of the arm: a, b";
        assert!(words.contains(proposed), "{words}");
    }
    let many: Vec<String> = (0..10)
        .flat_map(|k| {
            let name = format!("frame{k}");
            [link(&name, ""), joint(&format!("to_{name}"), "fixed", "b", &name, "")]
        })
        .collect();
    let words = refused(&with(&many), "flange").to_string();
    assert!(words.contains(": frame0, frame1, ") && !words.contains(" b, "), "{words}");
    assert!(words.contains("frame7 and 2 more, or one that moves on the way"), "{words}");
}

/// Sliding fingers, massless wheels and links that stand still do not end an arm.
#[test]
fn every_link_that_is_proposed_ends_an_arm() {
    let wheel = [link("rim", ""), joint("wheel", "continuous", "base", "rim", "")];
    let text =
        with_hand(&[fingers(("prismatic", SLIDE), ("revolute", LIMIT)), wheel.into()].concat());
    for asked in ["flange", "base"] {
        let (UrdfFault::NoSuchLink { choice, .. } | UrdfFault::NothingMovesUpTo { choice, .. }) =
            refused(&text, asked)
        else {
            panic!("{asked}")
        };
        assert_eq!(choice, ["a", "b", "hand", "right"]);
        for last in choice {
            up_to(&text, &last);
        }
    }
    let rail = [link("rail", ""), joint("slide", "prismatic", "rail", "base", SLIDE)];
    let words = refused(&with(&rail), "flange").to_string();
    assert!(words.contains("no link of the file ends an arm"), "{words}");
}

/// The bodies consist of their links, and the links are where the file has them.
#[test]
fn links_add_up_to_the_bodies_that_hold_them() {
    let mut parts = two_joints();
    parts[3] = joint("j1", "revolute", "base", "a", &format!(r#"{LIMIT}<axis xyz="0 1 0"/>"#));
    let gripper = gripper();
    let hand = gripper.split_once("<link name=\"hand\">").unwrap().1;
    let text = robot(&parts).replace("</robot>", &format!("<link name=\"hand\">{hand}"));
    let UrdfArm { arm, links, .. } = up_to(&text, "hand");
    let names: Vec<(&str, usize)> = links.iter().map(|l| (l.name.as_str(), l.body)).collect();
    let expected =
        [("base", 0), ("a", 1), ("b", 2), ("hand", 2), ("left", 2), ("right", 2), ("tip", 2)];
    assert_eq!(names, expected);
    for (number, joint) in (1..).zip(&arm.joints) {
        let own = || links.iter().filter(|link| link.body == number);
        assert_eq!(own().filter(|link| link.is_first).count(), 1);
        let sum = own().fold(LinkInertia::zero(), |sum, link| match &link.inertia {
            Some(inertia) => sum.plus(&inertia.transformed(&link.placement)),
            None => sum,
        });
        assert_eq!(sum, joint.link);
    }
    // At q = 0 the frames of the links are those of the file: none of its joints has a rotated origin.
    let frames = arm.frames(&[0.0, 0.0]);
    let heights = [0.5, 1.0, 1.5, 2.0, 2.0, 2.5];
    for (link, height) in links[1..].iter().zip(heights) {
        let pose = frames[link.body - 1].compose(&link.placement);
        assert_abs_diff_eq!(pose.translation_m, Vector3::new(0.0, 0.0, height), epsilon = 1e-15);
        assert_abs_diff_eq!(pose.rotation * Vector3::x(), Vector3::x(), epsilon = 1e-15);
    }
}

/// A gripper with twelve fingers on an arm that stands on ten boxes: one line for each subject.
#[test]
fn what_is_told_of_many_joints_and_links_is_short() {
    let fingers = (0..12).flat_map(|k| {
        let (finger, knuckle) = (format!("finger{k}"), format!("knuckle{k}"));
        [link(&finger, FINGER), joint(&knuckle, "prismatic", "hand", &finger, SLIDE)]
    });
    let boxes = (0..10).flat_map(|k| {
        let name = format!("box{k}");
        [link(&name, BODY), joint(&format!("bolt{k}"), "fixed", "base", &name, "")]
    });
    let parts: Vec<String> = fingers.chain(boxes).collect();
    let UrdfArm { notices, .. } = up_to(&with_hand(&[fixed_fingers(), parts].concat()), "hand");
    let said: Vec<String> = notices.iter().map(ToString::to_string).collect();
    for words in [
        "joints knuckle0 (0 m), knuckle1 (0 m), ",
        "knuckle7 (0 m) and 4 more are not on the way to link \"hand\"",
        "links box0 (2 kg), box1 (2 kg), ",
        "box7 (2 kg) and 2 more stand still",
        "links hand (2 kg), left (0.1 kg), right (0.1 kg), finger0 (0.1 kg), ",
    ] {
        let lines = said.iter().filter(|line| line.contains(words)).count();
        assert_eq!(lines, 1, "{words}: {said:#?}");
    }
    // Gravity, drives, clearance, friction and its epsilon, and acceleration, in addition to these.
    assert_eq!(said.len(), 9, "{said:#?}");
}

/// In many files the base has moments that no body can have; it never moves.
#[test]
fn moments_of_the_base_do_not_matter() {
    let mut parts = two_joints();
    parts[0] = link("base", &BODY.replace(r#"izz="0.025""#, r#"izz="0.035""#));
    let UrdfArm { arm, links, .. } = read(&robot(&parts));
    assert_eq!(arm, read(&robot(&two_joints())).arm);
    assert_eq!((links[0].name.as_str(), links[0].inertia, links[0].is_first), ("base", None, true));
}

proptest! {
    /// A damaged file is an arm or an error, never a panic.
    #[test]
    fn no_damage_makes_it_panic(at in 0.0..1.0f64, length in 0usize..40, junk in "[ -~]{0,12}") {
        let text = gripper();
        let start = (at * text.len() as f64) as usize;
        let end = (start + length).min(text.len());
        let damaged = format!("{}{junk}{}", &text[..start], &text[end..]);
        let _ = read_urdf_up_to(&damaged, "toy.urdf", "hand");
        let _ = crate::robot::read_urdf(&damaged, "toy.urdf");
    }
}
