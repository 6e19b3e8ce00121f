//! Each fault and each interpretation on an MJCF of a few lines.

mod files;
mod inertia;
mod parts;
mod told;

use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};

use approx::assert_abs_diff_eq;
use nalgebra::{Matrix3, Rotation3, Vector3};
use proptest::prelude::*;

use super::pose::from_z;
use super::{MjcfArm, MjcfFault, MjcfNotice, read_mjcf};
use crate::robot::export::mjcf;
use crate::robot::{Arm, FixedFrame, Frames, Placement, RobotError, UrdfNotice, read_urdf};

const BODY: &str = r#"<inertial pos="0.1 0 0" mass="2" diaginertia="0.01 0.02 0.025"/>"#;
const RADIAN: &str = r#"<compiler angle="radian"/>"#;

/// A model with `sections` ahead of the world, and `world` in it.
fn model(sections: &str, world: &str) -> String {
    format!(r#"<mujoco model="toy">{sections}<worldbody>{world}</worldbody></mujoco>"#)
}

/// A model with one body, its attributes, and the elements `inside` it.
fn one(sections: &str, body: &str, inside: &str) -> String {
    model(sections, &format!(r#"<body name="a" {body}>{inside}</body>"#))
}

fn read(text: &str) -> MjcfArm {
    read_mjcf(text, "toy.xml").unwrap()
}

fn fault(text: &str) -> MjcfFault {
    match read_mjcf(text, "toy.xml") {
        Err(RobotError::Mjcf { file, fault }) => {
            assert_eq!(file, "toy.xml");
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

/// Pose of the frame of the only joint.
fn placement(text: &str) -> Placement {
    read(text).arm.joints[0].placement
}

fn assert_same_rotation(actual: &Matrix3<f64>, expected: &Matrix3<f64>) {
    assert!((actual - expected).amax() < 1e-14, "{actual} {expected}");
}

fn about(axis: Vector3<f64>, angle_rad: f64) -> Matrix3<f64> {
    Rotation3::new(axis * angle_rad).into_inner()
}

#[test]
fn a_plain_chain_is_the_arm_of_the_same_urdf() {
    let text = model(
        RADIAN,
        r#"<body name="base"><inertial pos="0 0 0" mass="4" diaginertia="1 1 1"/>
             <body name="a" pos="0 0 0.5">
               <inertial pos="0.1 0 0" mass="2" diaginertia="0.01 0.02 0.025"/>
               <joint name="j1" range="-1 2" damping="1.5" frictionloss="0.25" actuatorfrcrange="-50 50"/>
               <body name="b" pos="0.3 0 0" quat="1 1 0 0">
                 <inertial pos="0 0.1 0.2" mass="1" fullinertia="0.02 0.02 0.02 0.001 0.002 0.003"/>
                 <joint name="j2" axis="0 -2 0" range="-2 1" damping="1" frictionloss="0.5"
                        actuatorfrcrange="-20 20"/>
                 <body name="tool" pos="0 0 0.1"/>
               </body>
             </body>
           </body>"#,
    );
    let same = r#"<robot name="toy"><link name="world"/>
        <link name="base"><inertial><mass value="4"/>
          <inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial></link>
        <joint name="stand" type="fixed"><parent link="world"/><child link="base"/></joint>
        <link name="a"><inertial><origin xyz="0.1 0 0"/><mass value="2"/>
          <inertia ixx="0.01" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.025"/></inertial></link>
        <joint name="j1" type="revolute"><origin xyz="0 0 0.5"/><parent link="base"/><child link="a"/>
          <axis xyz="0 0 1"/><limit lower="-1" upper="2" effort="50" velocity="0"/>
          <dynamics damping="1.5" friction="0.25"/></joint>
        <link name="b"><inertial><origin xyz="0 0.1 0.2"/><mass value="1"/>
          <inertia ixx="0.02" ixy="0.001" ixz="0.002" iyy="0.02" iyz="0.003" izz="0.02"/></inertial></link>
        <joint name="j2" type="revolute"><origin xyz="0.3 0 0" rpy="1.5707963267948966 0 0"/>
          <parent link="a"/><child link="b"/><axis xyz="0 -1 0"/>
          <limit lower="-2" upper="1" effort="20" velocity="0"/>
          <dynamics damping="1" friction="0.5"/></joint>
        <link name="tool"/>
        <joint name="mount" type="fixed"><origin xyz="0 0 0.1"/><parent link="b"/><child link="tool"/></joint>
        </robot>"#;
    let MjcfArm { arm, frames, notices, .. } = read(&text);
    let expected = read_urdf(same, "toy.urdf").unwrap();
    // A URDF has no gravity of its own.
    assert_eq!(arm, Arm { gravity_assumed: false, ..expected.arm });
    assert_eq!(frames, expected.frames);
    let joints = arm.joints.iter().map(|joint| joint.name.clone()).collect();
    let no_speed = UrdfNotice::AssumedVelocity { joints, velocity_rad_s: PI };
    assert!(notices.contains(&no_speed));
    let standing = notices.iter().filter(|n| matches!(n, UrdfNotice::StandingMass { .. }));
    assert_eq!(standing.count(), 1);
}

/// Conversions of the quaternion to angles and back, and of moments to the centre of mass and back, cost a few units of
/// round-off each.
#[test]
fn an_arm_written_as_mjcf_reads_back_as_the_same_arm() {
    let frame = |name: &str, body, xyz, rpy| FixedFrame {
        name: name.into(),
        body,
        placement: Placement::from_xyz_rpy(xyz, rpy),
    };
    let frames = Frames {
        root: "world".into(),
        fixed: vec![
            frame("base", 0, [0.1, 0.0, -0.3], [0.0, 0.0, 0.3]),
            frame("tool & <tip>", 6, [0.0, 0.01, 0.1], [0.4, -1.2, 2.0]),
        ],
    };
    for name in crate::robot::built_in_names() {
        let arm = Arm::built_in(name).unwrap();
        let back = read(&mjcf(&arm, &frames).unwrap());
        assert_eq!(back.arm.name, name);
        assert_eq!(back.arm.gravity_m_s2, arm.gravity_m_s2);
        assert_eq!(back.arm.dof(), arm.dof());
        for (a, b) in arm.joints.iter().zip(&back.arm.joints) {
            assert_eq!(a.name, b.name);
            assert_eq!(a.limits.position_rad, b.limits.position_rad);
            assert_eq!(a.limits.torque_nm, b.limits.torque_nm);
            assert_eq!(a.drive.rotor_inertia_kg_m2, b.drive.rotor_inertia_kg_m2);
            assert_eq!(a.drive.viscous_nm_s_rad, b.drive.viscous_nm_s_rad);
            assert_eq!(a.drive.coulomb_nm, b.drive.coulomb_nm);
            assert_eq!(a.placement.translation_m, b.placement.translation_m);
            assert!((a.placement.rotation - b.placement.rotation).amax() < 1e-14, "{name}");
            for (x, y) in a.link.parameters.iter().zip(&b.link.parameters) {
                assert!((x - y).abs() < 1e-14, "{name} {}: {x} {y}", a.name);
            }
        }
        assert_eq!(back.frames.root, frames.root);
        assert_eq!(back.frames.fixed.len(), frames.fixed.len());
        for (a, b) in frames.fixed.iter().zip(&back.frames.fixed) {
            assert_eq!((&a.name, a.body), (&b.name, b.body));
            assert!((a.placement.rotation - b.placement.rotation).amax() < 1e-14);
            assert!((a.placement.translation_m - b.placement.translation_m).amax() < 1e-15);
        }
    }
}

#[test]
fn orientations_are_what_mujoco_calls_so() {
    let of = |sections: &str, attribute: &str| {
        placement(&one(sections, attribute, &format!("{BODY}<joint/>"))).rotation
    };
    let (x, y, z) = (Vector3::x(), Vector3::y(), Vector3::z());
    let degree = PI / 180.0;
    assert_eq!(of("", r#"euler="90 0 0""#), about(x, FRAC_PI_2).map(f64::round));
    assert_eq!(of("", r#"quat="0 0 2 2""#), about(y + z, PI / 2.0_f64.sqrt()).map(f64::round));
    let intrinsic = about(x, 10.0 * degree) * about(y, 20.0 * degree) * about(z, 30.0 * degree);
    assert_same_rotation(&of("", r#"euler="10 20 30""#), &intrinsic);
    let extrinsic = about(z, 30.0 * degree) * about(y, 20.0 * degree) * about(x, 10.0 * degree);
    let sequence = r#"<compiler eulerseq="XYZ"/>"#;
    assert_same_rotation(&of(sequence, r#"euler="10 20 30""#), &extrinsic);
    let mixed = about(y, 0.2) * about(z, 0.1) * about(x, 0.3);
    let sequence = r#"<compiler eulerseq="zYx" angle="radian"/>"#;
    assert_same_rotation(&of(sequence, r#"euler="0.1 0.2 0.3""#), &mixed);
    let axis = Vector3::new(1.0, 2.0, -2.0);
    let turned = about(axis / 3.0, 0.5);
    assert_same_rotation(&of(RADIAN, r#"axisangle="1 2 -2 0.5""#), &turned);
    let axes = of("", r#"xyaxes="0 2 0 -1 1 0""#);
    assert_eq!(axes, about(z, FRAC_PI_2).map(f64::round));
    let zaxis = of("", r#"zaxis="1 2 -2""#);
    assert_abs_diff_eq!(zaxis * z, axis / 3.0, epsilon = 1e-14);
    assert_same_rotation(&of("", r#"zaxis="0 0 -3""#), &about(x, PI).map(f64::round));
    let twice = one("", r#"quat="1 0 0 0" euler="0 0 0""#, BODY);
    says(&twice, &["line 1: body \"a\"", "both quat and euler"]);
    says(&one("", r#"quat="0 0 0 0""#, BODY), &["quat is zero"]);
}

proptest! {
    #[test]
    fn the_smallest_rotation_from_z_is_one(
        x in -1.0..1.0, y in -1.0..1.0, z in -1.0..1.0,
    ) {
        let to = Vector3::new(x, y, z);
        prop_assume!(to.norm() > 0.1);
        let to = to.normalize();
        let rotation = from_z(to);
        prop_assert!((rotation * Vector3::z() - to).amax() < 1e-14);
        prop_assert!((rotation.transpose() * rotation - Matrix3::identity()).amax() < 1e-14);
    }
}

/// The body turns about an axis beside its origin, so that its own frame moves on a circle.
#[test]
fn a_joint_beside_the_origin_of_its_body_has_its_frame_there() {
    let text = one(
        RADIAN,
        r#"pos="1 0 0""#,
        &format!(r#"{BODY}<joint pos="0 0.2 0"/><site name="origin"/>"#),
    );
    let MjcfArm { arm, frames, .. } = read(&text);
    assert_eq!(arm.joints[0].placement.translation_m, Vector3::new(1.0, 0.2, 0.0));
    assert_eq!(arm.joints[0].link.com_m(), Some(Vector3::new(0.1, -0.2, 0.0)));
    let origin = &frames.fixed[0];
    assert_eq!((origin.name.as_str(), origin.body), ("origin", 1));
    let turned = arm.frames(&[FRAC_PI_2])[0].compose(&origin.placement);
    assert_abs_diff_eq!(turned.translation_m, Vector3::new(1.2, 0.2, 0.0), epsilon = 1e-15);
}

/// The pose of the file is that with each joint at its `ref`.
#[test]
fn a_joint_has_its_reference_position_in_the_pose_of_the_file() {
    let joint = r#"<joint axis="0 0 2" ref="45" range="-90 60"/>"#;
    let MjcfArm { arm, .. } = read(&one("", "", &format!("{BODY}{joint}")));
    let limits = arm.joints[0].limits.position_rad;
    assert_abs_diff_eq!(limits[0], -FRAC_PI_2, epsilon = 1e-15);
    assert_abs_diff_eq!(limits[1], PI / 3.0, epsilon = 1e-15);
    let pose = arm.frames(&[FRAC_PI_4])[0];
    assert_same_rotation(&pose.rotation, &Matrix3::identity());
}

#[test]
fn limits_are_those_that_mujoco_keeps() {
    let of = |sections: &str, joint: &str| {
        let MjcfArm { arm, notices, .. } =
            read(&one(sections, "", &format!("{BODY}<joint name=\"j\" {joint}/>")));
        let unlimited = UrdfNotice::Continuous { joints: vec!["j".into()] };
        (arm.joints[0].limits.position_rad, notices.contains(&unlimited))
    };
    let all = [-2.0 * PI, 2.0 * PI];
    assert_eq!(of(RADIAN, r#"range="-1 2""#), ([-1.0, 2.0], false));
    assert_eq!(of(RADIAN, r#"range="-1 2" limited="false""#), (all, true));
    assert_eq!(of(RADIAN, ""), (all, true));
    let by_hand = r#"<compiler angle="radian" autolimits="false"/>"#;
    assert_eq!(of(by_hand, r#"range="-1 2" limited="false""#), (all, true));
    assert_eq!(of(by_hand, r#"range="-1 2" limited="true""#), ([-1.0, 2.0], false));
    let open = one(by_hand, "", &format!(r#"{BODY}<joint name="j" range="-1 2"/>"#));
    says(&open, &["joint \"j\" has range but not limited", "autolimits"]);
    let backwards = one("", "", &format!(r#"{BODY}<joint name="j" range="2 -1"/>"#));
    says(&backwards, &["joint \"j\"", "range=\"2 -1\"", "the smaller one"]);
}

#[test]
fn the_torque_limit_is_the_least_of_the_joints_and_its_actuators() {
    let of = |joint: &str, actuators: &str| {
        let sections = format!("<actuator>{actuators}</actuator>");
        let joint = format!("{BODY}<joint name=\"j\" {joint}/>");
        read(&one(&sections, "", &joint)).arm.joints[0].limits.torque_nm
    };
    let motor = r#"<motor joint="j" gear="-10" forcerange="-3 5" ctrlrange="-1 1"/>"#;
    assert_eq!(of(r#"actuatorfrcrange="-8 9""#, motor), 8.0);
    assert_eq!(of("", motor), 10.0);
    assert_eq!(of(r#"actuatorfrcrange="-80 80""#, motor), 10.0);
    let general = r#"<general joint="j" ctrlrange="-1 1" gainprm="3" gear="20"/>"#;
    assert_eq!(of("", general), 60.0);
    assert_eq!(of("", r#"<motor joint="j" ctrlrange="-1 1" gear="20"/>"#), 20.0);
    assert_eq!(of("", r#"<position joint="j" ctrlrange="-1 1"/>"#), f64::INFINITY);
    assert_eq!(of("", r#"<motor joint="j" ctrlrange="-1e9 1e9"/>"#), f64::INFINITY);
    let two = r#"<position joint="j" forcerange="-4 4"/><velocity joint="j" forcerange="0 6"/>"#;
    assert_eq!(of("", two), 10.0);
}

/// Inertia and damping on the motor side act at the joint times the square of the gear ratio: MuJoCo 4.0 moves this
/// joint as if it had 1.02 kg m² and 10.5 Nm s/rad.
#[test]
fn rotors_and_dampers_of_actuators_count() {
    let sections =
        r#"<actuator><motor joint="j" gear="100" armature="1e-4" damping="0.001"/></actuator>"#;
    let joint = r#"<joint name="j" armature="0.02" damping="0.5"/>"#;
    let drive = read(&one(sections, "", &format!("{BODY}{joint}"))).arm.joints[0].drive;
    assert_abs_diff_eq!(drive.rotor_inertia_kg_m2, 1.02, epsilon = 1e-12);
    assert_abs_diff_eq!(drive.viscous_nm_s_rad, 10.5, epsilon = 1e-12);
}

#[test]
fn what_is_no_part_of_a_serial_arm_is_told() {
    let told = |sections: &str, joint: &str| {
        let text = one(sections, "", &format!("{BODY}<joint name=\"j\" {joint}/>"));
        let notices = read(&text).notices.into_iter().map(|notice| notice.to_string());
        notices.collect::<Vec<_>>().join("\n")
    };
    assert!(told("", r#"springdamper="0.1 1""#).contains("time constant (springdamper)"));
    let weld =
        r#"<equality><weld body1="a" body2="b"/><connect body1="a" active="false"/></equality>"#;
    assert!(told(weld, "").contains("1 <connect> or <weld>"), "{}", told(weld, ""));
}

#[test]
fn rotors_friction_and_gravity_are_read() {
    let sections = r#"<option gravity="9.81 0 0"/>"#;
    let joint = r#"<joint name="j" armature="0.3" damping="1.5" frictionloss="0.25"/>"#;
    let MjcfArm { arm, notices, .. } = read(&one(sections, "", &format!("{BODY}{joint}")));
    let drive = arm.joints[0].drive;
    let friction = (drive.viscous_nm_s_rad, drive.coulomb_nm);
    assert_eq!((drive.rotor_inertia_kg_m2, friction), (0.3, (1.5, 0.25)));
    assert_eq!(arm.gravity_m_s2, Vector3::new(9.81, 0.0, 0.0));
    assert!(!notices.iter().any(|notice| matches!(notice, UrdfNotice::Gravity { .. })));
    let j = || vec!["j".to_owned()];
    let drives =
        UrdfNotice::Drives { rotor_inertia: vec![], gear_ratio: j(), torque_constant: j() };
    assert!(notices.contains(&drives));
    let weightless = UrdfNotice::Mjcf(MjcfNotice::Weightless);
    assert!(!notices.contains(&weightless));
    let off = r#"<option><flag gravity="disable"/></option>"#;
    let MjcfArm { arm, notices, .. } = read(&one(off, "", &format!("{BODY}{joint}")));
    assert_eq!(arm.gravity_m_s2, Vector3::zeros());
    assert!(notices.contains(&weightless));
}

/// An element's own attributes override those of its class, which override those of the class around it; `childclass`
/// applies where there is no `class`.
#[test]
fn classes_inherit_and_are_overridden() {
    let sections = r#"<default>
            <joint damping="1" frictionloss="1" armature="1"/>
            <default class="outer"><joint frictionloss="2" armature="2"/>
                <default class="inner"><joint armature="3"/></default></default>
        </default>
        <default><joint axis="1 0 0"/></default>"#;
    let of = |body: &str, joint: &str| {
        let MjcfArm { arm, .. } =
            read(&one(sections, body, &format!("{BODY}<joint name=\"j\" {joint}/>")));
        let drive = arm.joints[0].drive;
        (drive.viscous_nm_s_rad, drive.coulomb_nm, drive.rotor_inertia_kg_m2)
    };
    assert_eq!(of("", ""), (1.0, 1.0, 1.0));
    assert_eq!(of("", r#"class="outer""#), (1.0, 2.0, 2.0));
    assert_eq!(of("", r#"class="inner""#), (1.0, 2.0, 3.0));
    assert_eq!(of(r#"childclass="inner""#, ""), (1.0, 2.0, 3.0));
    assert_eq!(of(r#"childclass="inner""#, r#"class="main" damping="4""#), (4.0, 1.0, 1.0));
    let unknown = one(sections, "", &format!(r#"{BODY}<joint name="j" class="innr"/>"#));
    says(&unknown, &["joint \"j\"", "no <default class=\"innr\">"]);
    says(&one("<default><default/></default>", "", BODY), &["<default>: class is missing"]);
}

#[test]
fn what_is_in_a_frame_moves_with_it() {
    let inside =
        format!(r#"<frame pos="0 0 1" euler="90 0 0"><joint name="j" pos="0 1 0"/>{BODY}</frame>"#);
    let MjcfArm { arm, .. } = read(&one("", "", &inside));
    let joint = &arm.joints[0];
    // (0, 1, 0) in the frame is (0, 0, 2) in the body; the frame's z axis, which is that of the joint, is −y in the
    // body.
    let origin = joint.placement.translation_m;
    assert_abs_diff_eq!(origin, Vector3::new(0.0, 0.0, 2.0), epsilon = 1e-15);
    let axis = joint.placement.rotation * Vector3::z();
    assert_abs_diff_eq!(axis, -Vector3::y(), epsilon = 1e-15);
    let com = joint.placement.rotation * joint.link.com_m().unwrap();
    assert_abs_diff_eq!(com, Vector3::new(0.1, 0.0, -1.0), epsilon = 1e-15);
}
