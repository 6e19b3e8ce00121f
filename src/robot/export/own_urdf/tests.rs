//! The URDF of a cell: an arm of two joints, with a tool bolted to its hand and a finger on it.

use super::*;
use crate::robot::LoadedArm;

const BASE: &str = r#"<inertial><mass value="9"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>"#;
const BOOM: &str = r#"<inertial>
      <origin xyz="0.25 0.02 0.04" rpy="0 0.2 0"/>
      <mass value="4"/>
      <inertia ixx="0.02" ixy="-0.003" ixz="0.004" iyy="0.12" iyz="0.002" izz="0.11"/>
    </inertial>"#;
const SHOULDER: &str = r#"<dynamics damping="4" friction="5"/>"#;
const HAND: &str = r#"<inertial>
      <!-- from CAD -->
      <origin xyz="0.04 0.1 0.03" rpy="0 0 0.5"/>
      <mass value="1.5"/>
      <inertia ixx="0.012" ixy="0.001" ixz="0" iyy="0.006" iyz="-0.001" izz="0.011"/>
    </inertial>"#;
const HAND_SHAPE: &str =
    r#"<visual><geometry><mesh filename="meshes/hand.stl"/></geometry></visual>"#;
const WRIST: &str = r#"<dynamics damping='1' spring_reference="0.2" friction='1.5'/>"#;
const TOOL: &str = r#"<inertial>
      <origin xyz="0 0.05 0.02" rpy="0 0 0"/>
      <mass value="0.8"/>
      <inertia ixx="0.002" ixy="0" ixz="0.0003" iyy="0.0015" iyz="0" izz="0.0018"/>
    </inertial>"#;
const FINGER: &str = r#"<inertial><origin xyz="0 0 0.03"/><mass value="0.1"/><inertia ixx="4e-5" ixy="0" ixz="0" iyy="4e-5" iyz="0" izz="1e-5"/></inertial>"#;

fn cell() -> String {
    format!(
        r#"<?xml version="1.0" encoding="utf-8"?>
<!-- The cell's own file: mind the ° in it. -->
<robot name="cell">
  <material name="grey"><color rgba="0.5 0.5 0.5 1"/></material>
  <link name="base">{BASE}</link>
  <link name="boom">
    <visual>
      <geometry><mesh filename="package://cell/boom.stl" scale="0.001 0.001 0.001"/></geometry>
    </visual>

    {BOOM}
    <collision><geometry><cylinder radius="0.05" length="0.4"/></geometry></collision>
  </link>
  <joint name="shoulder" type="revolute">
    <origin xyz="0 0 0.3" rpy="0.5 0 0"/>
    <parent link="base"/>
    <child link="boom"/>
    <axis xyz="0.6 0 0.8"/>
    <limit lower="-2.6" upper="2.6" effort="150" velocity="2.5"/> <!-- as on its plate -->
    {SHOULDER}
  </joint>
  <link name="hand">
    {HAND}
    {HAND_SHAPE}
  </link>
  <joint name="wrist" type="revolute">
    <origin xyz="0.45 0 0.06" rpy="-0.8 0.9 0.2"/>
    <parent link="boom"/>
    <child link="hand"/>
    <axis xyz="0 -0.6 0.8"/>
    {WRIST}
    <limit lower="-2.8" upper="2.8" effort="40" velocity="3"/>
  </joint>
  <link name="tool">
    {TOOL}
  </link>
  <joint name="bolts" type="fixed">
    <origin xyz="0.05 0.18 0.04" rpy="0.4 -0.3 0.6"/>
    <parent link="hand"/>
    <child link="tool"/>
  </joint>
  <link name="finger">{FINGER}</link>
  <joint name="grip" type="fixed">
    <origin xyz="0 0.02 0.05" rpy="0 0.3 0"/>
    <parent link="tool"/>
    <child link="finger"/>
  </joint>
  <gazebo reference="boom"><selfCollide>true</selfCollide></gazebo>
  <transmission name="drive"><joint name="wrist"><dynamics damping="9"/></joint></transmission>
</robot>
"#
    )
}

fn loaded(text: &str) -> LoadedArm {
    loaded_up_to(text, "")
}

/// The arm that ends with the link behind the `#` of `link`, if there is one.
fn loaded_up_to(text: &str, link: &str) -> LoadedArm {
    let file = tempfile::Builder::new().suffix(".urdf").tempfile().unwrap();
    std::fs::write(file.path(), text).unwrap();
    LoadedArm::load(&format!("{}{link}", file.path().display())).unwrap()
}

/// The arm with bodies `factor` times as heavy, and more friction.
fn identified(LoadedArm { arm, .. }: &LoadedArm, factor: f64) -> Arm {
    let mut arm = arm.clone();
    for joint in &mut arm.joints {
        joint.link.parameters.iter_mut().for_each(|p| *p *= factor);
        joint.drive.viscous_nm_s_rad += 0.5;
        joint.drive.coulomb_nm += 0.25;
    }
    arm
}

fn written(text: &str, arm: &Arm, links: &[UrdfLink]) -> OwnUrdf {
    own_urdf(text, "cell.urdf", arm, links).unwrap()
}

/// Conversions to other frames and to centres of mass and back cost a few roundings of the largest number.
fn assert_reads_back(text: &str, arm: &Arm) {
    let back = loaded(text).arm;
    assert_eq!(arm.dof(), back.dof());
    for (a, b) in arm.joints.iter().zip(&back.joints) {
        assert_eq!((&a.name, a.drive, a.placement), (&b.name, b.drive, b.placement));
        let size = a.link.parameters.iter().fold(0.0_f64, |size, p| size.max(p.abs()));
        for (x, y) in a.link.parameters.iter().zip(&b.link.parameters) {
            assert!((x - y).abs() < 1e-12 * size, "{}: {x} {y}", a.name);
        }
    }
}

/// The parts of `text` at the places where `original` has `parts`; everything else must be the same.
fn in_place_of<'a>(parts: &[String], mut original: &str, mut text: &'a str) -> Vec<&'a str> {
    let mut found = Vec::new();
    for (k, part) in parts.iter().enumerate() {
        let (before, behind) = original.split_once(part.as_str()).unwrap();
        text = text.strip_prefix(before).unwrap();
        let up_to = |next: &String| behind.split_once(next.as_str()).unwrap().0;
        let end = text.find(parts.get(k + 1).map_or(behind, up_to)).unwrap();
        found.push(&text[..end]);
        original = behind;
        text = &text[end..];
    }
    assert_eq!(text, original);
    found
}

/// The file as an editor on Windows saves it.
#[test]
fn what_is_not_identified_stays_byte_for_byte() {
    let windows = |text: &str| text.replace('\n', "\r\n");
    let text = format!("\u{feff}{}", windows(&cell()));
    let robot = loaded(&text);
    let arm = identified(&robot, 1.1);
    let own = written(&text, &arm, &robot.urdf_links);
    assert!(own.rescalings.is_empty(), "{:?}", own.rescalings);
    assert_eq!(own.relative_mesh.as_deref(), Some("meshes/hand.stl"));
    let parts = [BOOM, SHOULDER, HAND, WRIST].map(windows);
    let found = in_place_of(&parts, &text, &own.text);
    for inertial in [found[0], found[2]] {
        assert!(inertial.starts_with("<inertial>\r\n      <origin xyz=\""), "{inertial}");
        assert!(inertial.ends_with("\"/>\r\n    </inertial>"), "{inertial}");
        assert_eq!(inertial.split("\r\n").count(), 5, "{inertial}");
    }
    assert_eq!(found[1], r#"<dynamics damping="4.5" friction="5.25"/>"#);
    assert_eq!(found[3], r#"<dynamics damping='1.5' spring_reference="0.2" friction='1.75'/>"#);
    assert_reads_back(&own.text, &arm);
}

/// Tool and finger weigh 0.9 kg together. With 0.3 times the 2.4 kg of the file, the body weighs less; with half of it,
/// 0.3 kg are left for the hand, with moments of inertia that no body can have. The largest factor of the two links is
/// 1.35210969782 times that of the body (bisection with NumPy, on the smallest principal moment and the triangle
/// inequality), of which 99 % are taken.
#[test]
fn links_that_do_not_fit_into_their_body_are_scaled() {
    let text = cell();
    let robot = loaded(&text);
    for (factor, expected, said) in [
        (0.3, "-0.1800 kg would be left: ", "multiplied by 0.4016"),
        (0.5, "which no body has: ", "multiplied by 0.6693"),
    ] {
        let arm = identified(&robot, factor);
        let own = written(&text, &arm, &robot.urdf_links);
        let [rescaling] = &own.rescalings[..] else { panic!("{:?}", own.rescalings) };
        let is_mass = matches!(rescaling.why, Unfit::Mass { .. });
        assert_eq!(is_mass, factor == 0.3, "{rescaling:?}");
        // The factor is known to the digits that are given above.
        assert!((rescaling.factor - 0.99 * 1.35210969782 * factor).abs() < 1e-10, "{rescaling:?}");
        let message = rescaling.to_string();
        for words in [
            "\"wrist\"",
            "\"tool\" (0.8000 kg), \"finger\" (0.1000 kg)",
            expected,
            said,
            "\"hand\" has the rest",
        ] {
            assert!(message.contains(words), "{words}: {message}");
        }
        let back = loaded(&own.text).urdf_links;
        for name in ["tool", "finger"] {
            assert_scaled(
                &inertia_of(&robot.urdf_links, name),
                &inertia_of(&back, name),
                rescaling,
            );
        }
        assert_reads_back(&own.text, &arm);
    }
}

fn inertia_of(links: &[UrdfLink], name: &str) -> LinkInertia {
    links.iter().find(|link| link.name == name).unwrap().inertia.unwrap()
}

/// A link is written about its centre of mass and read back: a few roundings of numbers below 1.
fn assert_scaled(before: &LinkInertia, after: &LinkInertia, rescaling: &Rescaling) {
    for (x, y) in before.parameters.iter().zip(&after.parameters) {
        assert!((rescaling.factor * x - y).abs() < 1e-14, "{x} {y}");
    }
}

/// Simulators move the finger that was locked for the arm, and refuse a moving link without mass.
#[test]
fn a_finger_that_is_locked_for_the_arm_keeps_some_of_its_mass() {
    let jaw =
        "type=\"prismatic\">\n    <limit lower=\"0\" upper=\"0.04\" effort=\"9\" velocity=\"1\"/>";
    let text = cell().replace("name=\"grip\" type=\"fixed\">", &format!("name=\"grip\" {jaw}"));
    let robot = loaded_up_to(&text, "#tool");
    let arm = identified(&robot, 0.3);
    let own = written(&text, &arm, &robot.urdf_links);
    let [rescaling] = &own.rescalings[..] else { panic!("{:?}", own.rescalings) };
    let back = loaded_up_to(&own.text, "#tool").urdf_links;
    let (before, after) = (inertia_of(&robot.urdf_links, "finger"), inertia_of(&back, "finger"));
    assert!(after.mass_kg() > 0.0);
    assert_scaled(&before, &after, rescaling);
}

/// The drive file and the results name the arm, which is called after the file that it was read from.
#[test]
fn a_robot_without_a_name_gets_that_of_the_arm() {
    for nameless in ["<robot>", "<robot name=\"\">", "<robot name=''>"] {
        let text = cell().replace("<robot name=\"cell\">", nameless);
        let robot = loaded(&text);
        let mut arm = identified(&robot, 1.1);
        arm.name = "the cell's & mine".into();
        let own = written(&text, &arm, &robot.urdf_links);
        assert_eq!(loaded(&own.text).arm.name, arm.name, "{}", own.text);
    }
}

/// Many files have a mere named frame directly behind the joint, and the body on it.
#[test]
fn a_link_without_mass_stays_so_where_another_one_has_the_body() {
    let text = cell().replace(HAND, "");
    let robot = loaded(&text);
    let arm = identified(&robot, 1.1);
    let own = written(&text, &arm, &robot.urdf_links);
    assert!(own.rescalings.is_empty(), "{:?}", own.rescalings);
    let parts = [BOOM, SHOULDER, WRIST, TOOL].map(str::to_owned);
    in_place_of(&parts, &text, &own.text);
    assert_reads_back(&own.text, &arm);
}

#[test]
fn elements_that_are_missing_are_put_in() {
    let robot = loaded(&cell());
    let arm = identified(&robot, 1.1);
    let mut links = robot.urdf_links;
    links.iter_mut().filter(|link| link.body == 2).for_each(|link| link.inertia = None);
    let hand = format!("<link name=\"hand\">\n    {HAND}\n    {HAND_SHAPE}\n  </link>");
    let mut text = cell().replace(&hand, "<link name=\"hand\" />");
    for part in [SHOULDER, WRIST, TOOL, FINGER] {
        text = text.replace(part, "");
    }
    let own = written(&text, &arm, &links);
    for words in [
        "<link name=\"hand\">\n    <inertial>\n      <origin xyz=",
        "/>\n    </inertial>\n  </link>\n  <joint name=\"wrist\"",
        "<!-- as on its plate -->\n    <dynamics damping=\"4.5\" friction=\"5.25\"/>\n",
        "velocity=\"3\"/>\n    <dynamics damping=\"1.5\" friction=\"1.75\"/>\n  </joint>",
    ] {
        assert!(own.text.contains(words), "{words}: {}", own.text);
    }
    assert_reads_back(&own.text, &arm);
}

#[test]
fn a_text_that_is_not_that_of_the_arm_is_refused() {
    let text = cell();
    let LoadedArm { mut arm, urdf_links, .. } = loaded(&text);
    let message = |text: &str, arm: &Arm, links: &[UrdfLink]| {
        own_urdf(text, "cell.urdf", arm, links).unwrap_err().to_string()
    };
    let renamed = message(&text.replace("\"wrist\"", "\"wrist_1\""), &arm, &urdf_links);
    assert!(renamed.contains("cell.urdf: the joint \"wrist\" is not there"), "{renamed}");
    let renamed = message(&text.replace("\"boom\"", "\"beam\""), &arm, &urdf_links);
    assert!(renamed.contains("the link \"boom\""), "{renamed}");
    let none = message(&text, &arm, &[]);
    assert!(none.contains("\"shoulder\""), "{none}");
    let cut = message(&text[..text.len() / 2], &arm, &urdf_links);
    assert!(cut.contains("cell.urdf: cannot be rewritten"), "{cut}");
    arm.joints[1].drive.coulomb_nm = -1.0;
    let pushes = message(&text, &arm, &urdf_links);
    assert!(pushes.contains("\"wrist\"") && pushes.contains("--physical"), "{pushes}");
}
