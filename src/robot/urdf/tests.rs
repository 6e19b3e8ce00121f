//! Each fault and each interpretation on a URDF of a few lines.

mod locked;
mod told;

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use approx::assert_abs_diff_eq;
use nalgebra::Vector3;
use proptest::prelude::*;

use super::{UrdfArm, UrdfFault, UrdfNotice, read_urdf};
use crate::robot::{RobotError, ShapeNotice};

const BODY: &str = r#"<inertial><origin xyz="0.1 0 0" rpy="0 0 0"/><mass value="2"/>
    <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.025"/></inertial>"#;
const LIMIT: &str = r#"<limit lower="-1" upper="2" effort="50" velocity="3"/>"#;

fn link(name: &str, inside: &str) -> String {
    format!(r#"<link name="{name}">{inside}</link>"#)
}

/// A joint with axis z at (0, 0, 0.5), unless `inside` says otherwise.
fn joint(name: &str, kind: &str, parent: &str, child: &str, inside: &str) -> String {
    let origin = if inside.contains("<origin") { "" } else { r#"<origin xyz="0 0 0.5"/>"# };
    let axis = if inside.contains("<axis") { "" } else { r#"<axis xyz="0 0 1"/>"# };
    format!(
        r#"<joint name="{name}" type="{kind}">{origin}<parent link="{parent}"/><child link="{child}"/>{axis}{inside}</joint>"#
    )
}

fn robot(parts: &[String]) -> String {
    format!(r#"<robot name="toy">{}</robot>"#, parts.concat())
}

/// base – j1 – a – j2 – b
fn two_joints() -> Vec<String> {
    vec![
        link("base", ""),
        link("a", BODY),
        link("b", BODY),
        joint("j1", "revolute", "base", "a", LIMIT),
        joint("j2", "revolute", "a", "b", LIMIT),
    ]
}

fn with(extra: &[String]) -> String {
    robot(&[two_joints(), extra.to_vec()].concat())
}

fn read(text: &str) -> UrdfArm {
    read_urdf(text, "toy.urdf").unwrap()
}

fn fault(text: &str) -> UrdfFault {
    match read_urdf(text, "toy.urdf") {
        Err(RobotError::UrdfArm { file, fault }) => {
            assert_eq!(file, "toy.urdf");
            fault
        }
        other => panic!("{other:?}"),
    }
}

/// Asserts that the text of the fault contains all of `parts`.
fn says(text: &str, parts: &[&str]) {
    let message = fault(text).to_string();
    for part in parts {
        assert!(message.contains(part), "\"{part}\" is not in: {message}");
    }
}

#[test]
fn a_plain_chain_is_read_as_written() {
    let UrdfArm { arm, frames, notices, .. } = read(&robot(&two_joints()));
    assert_eq!(arm.name, "toy");
    assert_eq!(arm.dof(), 2);
    assert!(frames.root == "base" && frames.fixed.is_empty());
    let joint = &arm.joints[0];
    assert_eq!(joint.name, "j1");
    assert_eq!(joint.placement.translation_m, Vector3::new(0.0, 0.0, 0.5));
    assert_eq!(joint.limits.position_rad, [-1.0, 2.0]);
    assert_eq!(joint.limits.velocity_rad_s, 3.0);
    assert_eq!(joint.limits.torque_nm, 50.0);
    assert_eq!(joint.drive.gain_nm_a(), 1.0);
    // Steiner: 2 kg at x = 0.1 m.
    let expected = [2.0, 0.2, 0.0, 0.0, 0.01, 0.04, 0.045, 0.0, 0.0, 0.0];
    for (actual, expected) in joint.link.parameters.iter().zip(expected) {
        assert_abs_diff_eq!(*actual, expected, epsilon = 1e-15);
    }
    assert!(notices.contains(&UrdfNotice::Gravity { root: "base".into() }));
    let all = || vec!["j1".to_owned(), "j2".to_owned()];
    let drives =
        UrdfNotice::Drives { rotor_inertia: all(), gear_ratio: all(), torque_constant: all() };
    assert!(notices.contains(&drives));
}

#[test]
fn damping_and_friction_are_viscous_and_coulomb() {
    let inside = format!(r#"{LIMIT}<dynamics damping="1.5" friction="0.25"/>"#);
    let mut parts = two_joints();
    parts[3] = joint("j1", "revolute", "base", "a", &inside);
    let UrdfArm { arm, notices, .. } = read(&robot(&parts));
    assert_eq!(arm.joints[0].drive.viscous_nm_s_rad, 1.5);
    assert_eq!(arm.joints[0].drive.coulomb_nm, 0.25);
    assert!(notices.contains(&UrdfNotice::NoFriction { joints: vec!["j2".into()] }));
}

#[test]
fn links_ahead_of_the_first_joint_are_folded_into_its_placement() {
    let UrdfArm { arm, frames, notices, .. } = read(&with(&[
        link("world", ""),
        joint(
            "fix",
            "fixed",
            "world",
            "base",
            r#"<origin xyz="1 0 0" rpy="0 0 1.5707963267949"/>"#,
        ),
    ]));
    let placement = arm.joints[0].placement;
    assert_eq!(placement.translation_m, Vector3::new(1.0, 0.0, 0.5));
    assert_eq!(placement.rotation * Vector3::x(), Vector3::y());
    assert_eq!(frames.root, "world");
    assert_eq!((frames.fixed[0].name.as_str(), frames.fixed[0].body), ("base", 0));
    assert!(notices.contains(&UrdfNotice::Gravity { root: "world".into() }));
}

#[test]
fn a_fixed_link_with_mass_is_merged_and_one_without_becomes_a_frame() {
    let UrdfArm { arm, frames, notices, .. } = read(&with(&[
        link("gripper", BODY),
        joint("mount", "fixed", "b", "gripper", r#"<origin xyz="0 0 1" rpy="0 0 3.14159265359"/>"#),
        link("tool0", ""),
        joint("tool", "fixed", "gripper", "tool0", ""),
    ]));
    let body = arm.joints[1].link;
    assert_eq!(body.mass_kg(), 4.0);
    // b has 2 kg at (0.1, 0, 0), the gripper 2 kg at (−0.1, 0, 1).
    assert_abs_diff_eq!(body.com_m().unwrap(), Vector3::new(0.0, 0.0, 0.5), epsilon = 1e-15);
    // B about the joint: 2 (0.02 + 2·0.1²) + 2 kg·1 m².
    assert_abs_diff_eq!(body.parameters[5], 2.08, epsilon = 1e-14);
    assert_eq!((frames.fixed[0].name.as_str(), frames.fixed[0].body), ("tool0", 2));
    assert_eq!(frames.fixed[0].placement.translation_m, Vector3::new(0.0, 0.0, 1.5));
    let merged = UrdfNotice::Merged { joint: "j2".into(), links: vec![("gripper".into(), 2.0)] };
    assert!(notices.contains(&merged));
    let words = "link gripper (2 kg) is fixed to the body of joint \"j2\" and counted in it";
    assert_eq!(merged.to_string(), words);
}

#[test]
fn two_fixed_tool_branches_are_fine() {
    let text = with(&[
        link("tool0", ""),
        joint("t0", "fixed", "b", "tool0", ""),
        link("camera", BODY),
        joint("t1", "fixed", "b", "camera", ""),
    ]);
    assert_eq!(read(&text).arm.joints[1].link.mass_kg(), 4.0);
}

#[test]
fn an_axis_off_z_turns_the_joint_frame_and_its_parameters() {
    let axes: [[f64; 3]; 5] =
        [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [0.6, 0.0, -0.8]];
    for axis in axes {
        let [x, y, z] = axis;
        let inside = format!(r#"{LIMIT}<axis xyz="{x} {y} {z}"/>"#);
        let mut parts = two_joints();
        parts[3] = joint("j1", "revolute", "base", "a", &inside);
        let UrdfArm { arm, notices, .. } = read(&robot(&parts));
        let rotation = arm.joints[0].placement.rotation;
        let exact = axis.iter().all(|v| v.fract() == 0.0);
        let tolerance = if exact { 0.0 } else { 4.0 * f64::EPSILON };
        assert_abs_diff_eq!(rotation * Vector3::z(), Vector3::from(axis), epsilon = tolerance);
        assert_abs_diff_eq!(rotation.determinant(), 1.0, epsilon = 4.0 * f64::EPSILON);
        // The centre of mass stays where the file has it: x = 0.1 m in the link's frame.
        let com = rotation * arm.joints[0].link.com_m().unwrap();
        assert_abs_diff_eq!(com, Vector3::new(0.1, 0.0, 0.0), epsilon = 1e-16);
        // At q = 0 the next joint is where the file has it, whatever the orientation of the joint frame.
        let origin = arm.frames(&[0.0, 0.0])[1].translation_m;
        assert_abs_diff_eq!(origin, Vector3::new(0.0, 0.0, 1.0), epsilon = 1e-15);
        assert!(notices.contains(&UrdfNotice::Reoriented { joints: vec![("j1".into(), axis)] }));
    }
}

#[test]
fn a_continuous_joint_has_two_turns_and_missing_limits_are_named() {
    let mut parts = two_joints();
    parts[3] = joint("j1", "continuous", "base", "a", "");
    let UrdfArm { arm, notices, .. } = read(&robot(&parts));
    assert_eq!(arm.joints[0].limits.position_rad, [-TAU, TAU]);
    assert!(arm.joints[0].assumed.position && !arm.joints[1].assumed.position);
    assert_eq!(arm.joints[0].limits.velocity_rad_s, PI);
    assert_eq!(arm.joints[0].limits.torque_nm, f64::INFINITY);
    let joint = || "j1".to_owned();
    for notice in [
        UrdfNotice::Continuous { joints: vec![joint()] },
        UrdfNotice::AssumedVelocity { joints: vec![joint()], velocity_rad_s: PI },
        UrdfNotice::NoTorqueLimit { joints: vec![joint()] },
    ] {
        assert!(notices.contains(&notice), "{notice}");
    }
}

/// From 1e9 Nm on, a torque limit stands for an unknown one.
#[test]
fn a_torque_limit_that_no_drive_has_is_unknown() {
    let mut parts = two_joints();
    let limit = LIMIT.replace("effort=\"50\"", "effort=\"1e9\"");
    parts[3] = joint("j1", "revolute", "base", "a", &limit);
    let UrdfArm { arm, notices, .. } = read(&robot(&parts));
    assert_eq!(arm.joints[0].limits.torque_nm, f64::INFINITY);
    assert!(notices.contains(&UrdfNotice::NoTorqueLimit { joints: vec!["j1".into()] }));
}

/// Many files leave the speed out, which the parser does not allow.
#[test]
fn a_speed_limit_may_be_missing() {
    let mut parts = two_joints();
    parts[4] = joint("j2", "revolute", "a", "b", r#"<limit lower="-1" upper="2" effort="50"/>"#);
    let UrdfArm { arm, notices, .. } = read(&robot(&parts));
    let limits: Vec<f64> = arm.joints.iter().map(|joint| joint.limits.velocity_rad_s).collect();
    assert_eq!(limits, [3.0, PI]);
    let joints = vec!["j2".to_owned()];
    assert!(notices.contains(&UrdfNotice::AssumedVelocity { joints, velocity_rad_s: PI }));
}

/// The controller stops the joint at its soft limits, before its end stops.
#[test]
fn soft_limits_narrow_the_range() {
    let of = |soft: &str| {
        let inside = format!("{LIMIT}<safety_controller k_velocity=\"1\" {soft}/>");
        let mut parts = two_joints();
        parts[4] = joint("j2", "revolute", "a", "b", &inside);
        robot(&parts)
    };
    for (soft, range, is_told) in [
        (r#"soft_lower_limit="-0.5" soft_upper_limit="3""#, [-0.5, 2.0], true),
        (r#"soft_lower_limit="-2" soft_upper_limit="3""#, [-1.0, 2.0], false),
        ("", [-1.0, 2.0], false),
    ] {
        let UrdfArm { arm, notices, .. } = read(&of(soft));
        assert_eq!(arm.joints[1].limits.position_rad, range, "{soft}");
        let told = UrdfNotice::SoftLimits { joints: vec![("j2".into(), range)] };
        assert_eq!(notices.contains(&told), is_told, "{soft}");
    }
    // They are all that a joint without end stops has.
    let endless = of(r#"soft_lower_limit="-0.5" soft_upper_limit="3""#)
        .replace("name=\"j2\" type=\"revolute\"", "name=\"j2\" type=\"continuous\"");
    let arm = read(&endless).arm;
    assert_eq!(arm.joints[1].limits.position_rad, [-0.5, 3.0]);
    assert!(!arm.joints[1].assumed.position);
    let apart = of(r#"soft_lower_limit="3" soft_upper_limit="4""#);
    says(&apart, &["\"j2\"", "3 to 4 rad (<safety_controller>)", "range -1 to 2 rad"]);
}

#[test]
fn a_right_angle_printed_short_is_a_right_angle_and_is_said() {
    for written in ["1.5708", "1.570796327", "1.57079632679"] {
        let inside = format!(r#"{LIMIT}<origin xyz="0 0 0" rpy="{written} 0 0"/>"#);
        let mut parts = two_joints();
        parts[4] = joint("j2", "revolute", "a", "b", &inside);
        let UrdfArm { arm, notices, .. } = read(&robot(&parts));
        assert_eq!(arm.joints[1].placement.rotation * Vector3::y(), Vector3::z());
        let places = vec!["joint \"j2\"".to_owned()];
        let off_rad = written.parse::<f64>().unwrap() - FRAC_PI_2;
        let notice = UrdfNotice::RightAngles { places, off_rad };
        // The other two deviate by at most 2e-10 rad, which is not worth reporting.
        assert_eq!(notices.contains(&notice), written == "1.5708", "{notices:?}");
    }
    for (written, turns) in [("3.1416", 2.0), ("-3.1416", -2.0), ("4.7124", 3.0), ("6.2832", 4.0)] {
        let inside = format!(r#"{LIMIT}<origin xyz="0 0 0" rpy="{written} 0 0"/>"#);
        let mut parts = two_joints();
        parts[4] = joint("j2", "revolute", "a", "b", &inside);
        let off_rad = (written.parse::<f64>().unwrap() - turns * FRAC_PI_2).abs();
        let places = vec!["joint \"j2\"".to_owned()];
        let notice = UrdfNotice::RightAngles { places, off_rad };
        assert!(read(&robot(&parts)).notices.contains(&notice), "{written}");
    }
    // A calibrated angle is left alone.
    let inside = format!(r#"{LIMIT}<origin xyz="0 0 0" rpy="1.5709 0 0"/>"#);
    let mut parts = two_joints();
    parts[4] = joint("j2", "revolute", "a", "b", &inside);
    assert!(read(&robot(&parts)).arm.joints[1].placement.rotation[(1, 1)].abs() > 1e-5);
}

/// Visual geometry does not matter.
#[test]
fn meshes_of_collision_shapes_that_are_not_there_are_named() {
    let mesh =
        r#"<visual><geometry><mesh filename="package://nowhere/a.stl"/></geometry></visual>"#;
    let mut parts = two_joints();
    parts[1] = link("a", &format!("{BODY}{mesh}"));
    let seen = read(&robot(&parts));
    assert_eq!((seen.arm, seen.notices), {
        let UrdfArm { arm, notices, .. } = read(&robot(&two_joints()));
        (arm, notices)
    });
    parts[1] = link("a", &format!("{BODY}{mesh}{}", mesh.replace("visual", "collision")));
    let UrdfArm { arm, notices, .. } = read(&robot(&parts));
    assert_eq!(arm, read(&robot(&two_joints())).arm);
    let files = vec!["package://nowhere/a.stl".to_owned()];
    let notice = ShapeNotice::MissingMeshes { files, links: vec!["a".to_owned()] };
    let message = notice.to_string();
    assert!(notices.contains(&UrdfNotice::Shapes(notice)), "{notices:?}");
    let words = "collision shapes whose mesh files are not there (package://nowhere/a.stl) are not watched: a";
    assert_eq!(message, words);
}

#[test]
fn a_byte_order_mark_and_windows_line_ends_do_not_matter() {
    let text = format!("\u{feff}{}", robot(&two_joints()).replace('>', ">\r\n"));
    assert_eq!(read(&text).arm, read(&robot(&two_joints())).arm);
}

#[test]
fn a_moving_link_without_inertial_is_refused() {
    let mut parts = two_joints();
    parts[2] = link("b", "");
    says(&robot(&parts), &["\"b\"", "\"j2\"", "no mass", "<inertial>"]);
}

#[test]
fn a_moving_link_of_mass_zero_is_refused() {
    let mut parts = two_joints();
    let empty = r#"<inertial><mass value="0"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial>"#;
    parts[2] = link("b", empty);
    says(&robot(&parts), &["\"b\"", "mass 0"]);
    parts[2] = link("b", &BODY.replace(r#"mass value="2""#, r#"mass value="0""#));
    says(&robot(&parts), &["\"b\"", "mass 0", "give its mass"]);
    parts[2] = link("b", &BODY.replace(r#"mass value="2""#, r#"mass value="-2""#));
    says(&robot(&parts), &["\"b\"", "mass = -2", "negative"]);
}

#[test]
fn an_axis_that_is_no_unit_vector_is_refused() {
    for (axis, length) in [("0 0 2", 2.0), ("0 0 0", 0.0), ("1 1 0", 2f64.sqrt())] {
        let mut parts = two_joints();
        let inside = format!(r#"{LIMIT}<axis xyz="{axis}"/>"#);
        parts[4] = joint("j2", "revolute", "a", "b", &inside);
        says(&robot(&parts), &["\"j2\"", &format!("length {length};"), "must be a unit vector"]);
    }
}

#[test]
fn an_axis_printed_to_three_digits_is_normalised_and_said() {
    let mut parts = two_joints();
    let inside = format!(r#"{LIMIT}<axis xyz="0.577 0.577 0.577"/>"#);
    parts[4] = joint("j2", "revolute", "a", "b", &inside);
    let UrdfArm { arm, notices, .. } = read(&robot(&parts));
    let z = arm.joints[1].placement.rotation * Vector3::z();
    assert_abs_diff_eq!(z, Vector3::repeat(1.0 / 3f64.sqrt()), epsilon = 4.0 * f64::EPSILON);
    assert!(
        notices
            .iter()
            .any(|n| matches!(n, UrdfNotice::AxisNormalised { joints } if joints[0].0 == "j2"))
    );
}

#[test]
fn joints_that_do_not_rotate_are_refused() {
    for kind in ["prismatic", "floating", "planar"] {
        let text = with(&[link("c", BODY), joint("j3", kind, "b", "c", LIMIT)]);
        says(&text, &["toy.urdf#b", &format!("joint \"j3\" is {kind}")]);
    }
}

#[test]
fn a_mimic_joint_is_refused() {
    let inside = format!(r#"{LIMIT}<mimic joint="j1"/>"#);
    let text = with(&[link("c", BODY), joint("j3", "revolute", "b", "c", &inside)]);
    says(&text, &["\"j3\"", "mimics \"j1\"", "toy.urdf#b"]);
}

#[test]
fn a_branch_that_moves_is_refused() {
    let text = with(&[link("c", BODY), joint("j3", "revolute", "a", "c", LIMIT)]);
    says(&text, &["branches behind \"a\"", "\"j2\", \"j3\"", "toy.urdf#b"]);
}

#[test]
fn a_closed_chain_is_refused() {
    let text = with(&[joint("back", "revolute", "b", "a", LIMIT)]);
    says(&text, &["closed", "link \"a\"", "\"j1\"", "\"back\""]);
    let text = with(&[joint("back", "fixed", "b", "base", "")]);
    says(&text, &["closed"]);
    let text = with(&[link("c", BODY), joint("self", "fixed", "c", "c", "")]);
    says(&text, &["closed", "\"c\"", "\"self\""]);
}

#[test]
fn links_that_hang_on_nothing_are_refused() {
    let expected = UrdfFault::Disconnected { first: "base".into(), second: "c".into() };
    assert_eq!(fault(&with(&[link("c", BODY)])), expected);
}

#[test]
fn names_that_are_missing_or_double_are_refused() {
    says(&with(&[joint("j3", "fixed", "b", "c", "")]), &["\"j3\"", "child", "\"c\""]);
    says(&with(&[joint("j3", "fixed", "x", "b", "")]), &["\"j3\"", "parent", "\"x\""]);
    says(&with(&[link("a", BODY)]), &["link", "\"a\"", "twice"]);
    let text = with(&[link("c", BODY), joint("j2", "fixed", "b", "c", "")]);
    says(&text, &["joint", "\"j2\"", "twice"]);
}

#[test]
fn a_robot_without_a_name_is_called_after_its_file() {
    let text = robot(&two_joints());
    for nameless in ["<robot>", "<robot name=\"\">"] {
        let text = text.replace("<robot name=\"toy\">", nameless);
        for source in ["my.arm.urdf", "./my.arm.urdf", "/cell/my.arm.urdf"] {
            assert_eq!(read_urdf(&text, source).unwrap().arm.name, "my.arm", "{source}");
        }
    }
}

#[test]
fn names_with_control_characters_are_refused() {
    let text = robot(&two_joints());
    for (from, to, words) in [
        ("\"toy\"", "\"t&#9;oy\"", "the name of the robot \"t\\toy\" has a control character"),
        ("\"a\"", "\"a&#10;a\"", "the name of the link \"a\\na\" has"),
        ("\"j2\"", "\"j&#10;2\"", "the name of the joint \"j\\n2\" has"),
    ] {
        says(&text.replace(from, to), &[words]);
    }
}

#[test]
fn an_arm_without_moving_joints_is_refused() {
    let text = robot(&[link("base", ""), link("a", BODY), joint("f", "fixed", "base", "a", "")]);
    assert_eq!(fault(&text), UrdfFault::NothingMoves);
    assert_eq!(fault("<robot name='x'/>"), UrdfFault::NoLinks);
}

#[test]
fn an_impossible_inertia_is_refused_with_its_principal_moments() {
    let mut parts = two_joints();
    parts[2] = link("b", &BODY.replace(r#"izz="0.025""#, r#"izz="0.035""#));
    says(&robot(&parts), &["\"b\"", "triangle", "1.000000e-2", "3.500000e-2"]);
    parts[2] = link("b", &BODY.replace(r#"izz="0.025""#, r#"izz="0.03""#));
    says(&robot(&parts), &["\"b\"", "infinitely thin plate", "make the largest a little smaller"]);
    parts[2] = link("b", &BODY.replace(r#"ixy="0""#, r#"ixy="0.02""#));
    says(&robot(&parts), &["\"b\"", "not positive definite"]);
    let point = BODY.replace("0.01", "0").replace("0.025", "0").replace("0.02", "0");
    parts[2] = link("b", &point);
    says(&robot(&parts), &["\"b\"", "not positive definite"]);
}

#[test]
fn a_revolute_joint_without_range_is_refused() {
    let mut parts = two_joints();
    parts[3] = joint("j1", "revolute", "base", "a", "");
    says(&robot(&parts), &["\"j1\"", "lower = 0", "upper = 0", "<limit"]);
    let backwards = LIMIT.replace(r#"lower="-1""#, r#"lower="5""#);
    parts[3] = joint("j1", "revolute", "base", "a", &backwards);
    says(&robot(&parts), &["\"j1\"", "lower = 5", "upper = 2"]);
}

#[test]
fn numbers_that_are_none_are_refused_where_they_stand() {
    let plain = robot(&two_joints());
    for (from, to, parts) in [
        (r#"ixx="0.01""#, r#"ixx="nan""#, ["\"a\"", "ixx"]),
        (r#"mass value="2""#, r#"mass value="inf""#, ["\"a\"", "mass"]),
        (r#"xyz="0 0 0.5""#, r#"xyz="0 0 1e999""#, ["\"j1\"", "xyz"]),
        (r#"effort="50""#, r#"effort="-50""#, ["\"j1\"", "effort"]),
    ] {
        says(&plain.replacen(from, to, 1), &parts);
    }
}

#[test]
fn what_is_no_urdf_is_an_error_that_names_the_file() {
    for text in ["", "nonsense", "<robot", r#"<robot name="x"><link/></robot>"#] {
        match read_urdf(text, "toy.urdf") {
            Err(error @ RobotError::Urdf { .. }) => {
                assert!(error.to_string().starts_with("toy.urdf: "), "{error}");
            }
            other => panic!("{text}: {other:?}"),
        }
    }
    // An unexpanded macro in place of a number.
    let text = robot(&two_joints()).replacen("0.01", "${ixx}", 1);
    assert!(matches!(read_urdf(&text, "toy.urdf"), Err(RobotError::Urdf { .. })));
}

proptest! {
    /// A damaged file is an arm or an error, never a panic.
    #[test]
    fn no_damage_makes_it_panic(at in 0.0..1.0f64, length in 0usize..40, junk in "[ -~]{0,12}") {
        let text = with(&[link("tool0", ""), joint("t", "fixed", "b", "tool0", "")]);
        let start = (at * text.len() as f64) as usize;
        let end = (start + length).min(text.len());
        let damaged = format!("{}{junk}{}", &text[..start], &text[end..]);
        let _ = read_urdf(&damaged, "toy.urdf");
    }
}
