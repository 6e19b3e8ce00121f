//! Collision shapes of whole files: which are watched, and what is reported about the others.

use std::path::Path;

use approx::assert_abs_diff_eq;
use nalgebra::Vector3;

use super::ShapeNotice;
use crate::robot::{
    Arm, Capsule, Clearance, LoadedArm, MjcfArm, UrdfArm, UrdfNotice, read_mjcf, read_urdf,
};

const BODY: &str = r#"<inertial><mass value="2"/>
    <inertia ixx="0.02" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/></inertial>"#;
const NAMES: [&str; 5] = ["base", "one", "two", "three", "four"];

/// A binary STL.
pub(super) fn binary_stl(header: &str, triangles: &[[Vector3<f64>; 3]]) -> Vec<u8> {
    let mut bytes = header.as_bytes().to_vec();
    bytes.resize(80, 0);
    bytes.extend((triangles.len() as u32).to_le_bytes());
    for corners in triangles {
        bytes.extend([0_u8; 12]);
        let numbers = corners.iter().flat_map(|corner| corner.iter());
        numbers.for_each(|number| bytes.extend((*number as f32).to_le_bytes()));
        bytes.extend([0_u8; 2]);
    }
    bytes
}

/// A bar of 60 × 80 × 200 mm along z, from the origin upwards, in mm.
fn bar() -> Vec<u8> {
    let corner = |k: usize| {
        Vector3::new([-30.0, 30.0][k & 1], [-40.0, 40.0][(k >> 1) & 1], [0.0, 200.0][k >> 2])
    };
    binary_stl("bar", &[[0, 1, 2], [3, 4, 5], [6, 7, 0]].map(|corners| corners.map(corner)))
}

/// Four links, each 0.4 m above the one before in the pose of the file. The first turns about the vertical.
fn urdf(shapes: [&str; 5]) -> String {
    let links = NAMES.iter().zip(shapes).map(|(name, shape)| {
        let body = if *name == "base" { "" } else { BODY };
        format!(r#"<link name="{name}">{body}{shape}</link>"#)
    });
    let joints = (1..5).map(|k| {
        let (parent, child, axis) =
            (NAMES[k - 1], NAMES[k], if k == 1 { "0 0 1" } else { "0 1 0" });
        format!(
            r#"<joint name="j{k}" type="revolute"><origin xyz="0 0 0.4"/><parent link="{parent}"/>
               <child link="{child}"/><axis xyz="{axis}"/>
               <limit lower="-2" upper="2" effort="50" velocity="3"/></joint>"#
        )
    });
    let parts: Vec<String> = links.chain(joints).collect();
    format!(r#"<robot name="tower">{}</robot>"#, parts.concat())
}

fn collision(z_m: f64, geometry: &str) -> String {
    format!(r#"<collision><origin xyz="0 0 {z_m}"/><geometry>{geometry}</geometry></collision>"#)
}

fn read(shapes: [&str; 5], source: &Path) -> UrdfArm {
    read_urdf(&urdf(shapes), source.to_str().unwrap()).unwrap()
}

fn told(notices: &[UrdfNotice]) -> Vec<&ShapeNotice> {
    let of_shapes = notices.iter().filter_map(|notice| match notice {
        UrdfNotice::Shapes(notice) => Some(notice),
        _ => None,
    });
    of_shapes.collect()
}

/// Ends of a capsule in the base frame at q = 0, the lower one first.
fn ends(arm: &Arm, capsule: &Capsule) -> [Vector3<f64>; 2] {
    let mut ends = [capsule.from_m, capsule.to_m];
    if capsule.body > 0 {
        let frame = arm.frames(&[0.0; 4])[capsule.body - 1];
        ends = ends.map(|end| frame.rotation * end + frame.translation_m);
    }
    ends.sort_by(|a, b| a.z.total_cmp(&b.z));
    ends
}

fn owned(names: &[&str]) -> Vec<String> {
    names.iter().map(|name| (*name).to_owned()).collect()
}

/// Asserts that each link of the tower has its capsule: not narrower than the shape, hardly wider, and not longer than
/// with whole hemispheres at the ends.
fn assert_is_tower(arm: &Arm) {
    // Radius, height of the middle and half length of each shape, m.
    let expected = [
        ("base", 0.1, 0.0, 0.0),
        ("one", 0.05, 0.6, 0.1),
        ("two", 0.04, 1.0, 0.15),
        ("three", 0.05, 1.4, 0.15),
        ("four", 0.05, 1.7, 0.1),
    ];
    assert_eq!(arm.clearance.capsules.len(), 5);
    for (body, (capsule, expected)) in arm.clearance.capsules.iter().zip(expected).enumerate() {
        let (name, radius_m, middle_m, half_m) = expected;
        assert_eq!((capsule.name.as_str(), capsule.body), (name, body));
        let wide = capsule.radius_m / radius_m;
        assert!((0.9999..1.06).contains(&wide), "{capsule:?}");
        let [low, high] = ends(arm, capsule);
        let middle = Vector3::new(0.0, 0.0, middle_m);
        assert_abs_diff_eq!((low + high) * 0.5, middle, epsilon = 1e-4);
        let reach_m = (high - low).norm() / 2.0 + capsule.radius_m;
        assert!((half_m..half_m + radius_m + 1e-3).contains(&reach_m), "{capsule:?}");
    }
    let mut pairs = arm.clearance.pairs.clone();
    pairs.sort_unstable();
    assert_eq!(pairs, [[0, 2], [0, 3], [0, 4], [1, 3], [1, 4], [2, 4]]);
}

#[test]
fn shapes_of_a_urdf_become_capsules() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = folder.path().join("tower/meshes/four.STL");
    std::fs::create_dir_all(mesh.parent().unwrap()).unwrap();
    std::fs::write(&mesh, bar()).unwrap();
    let shapes = [
        collision(0.0, r#"<sphere radius="0.1"/>"#),
        collision(0.2, r#"<cylinder radius="0.05" length="0.2"/>"#),
        collision(0.2, r#"<capsule radius="0.04" length="0.3"/>"#),
        collision(0.2, r#"<box size="0.06 0.08 0.3"/>"#),
        collision(
            0.0,
            r#"<mesh filename="package://tower/meshes/four.STL" scale="0.001 0.001 0.001"/>"#,
        ),
    ];
    let source = folder.path().join("tower/urdf/arm.urdf");
    std::fs::create_dir_all(source.parent().unwrap()).unwrap();
    let UrdfArm { arm, notices, meshes, .. } = read(shapes.each_ref().map(String::as_str), &source);
    assert_is_tower(&arm);
    assert_eq!(meshes, [mesh]);
    let links = owned(&NAMES);
    let capsules = ShapeNotice::Capsules { count: 5, boxes: 0, links, bare: Vec::new() };
    assert_eq!(told(&notices), [&capsules]);
    let words = "5 capsules from the collision shapes of base, one, two, three, four";
    assert_eq!(capsules.to_string(), words);
}

/// The same tower as an MJCF, with purely visual geometry, a ground plane, and a mesh whose scale comes from its class.
#[test]
fn geoms_of_an_mjcf_become_capsules() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::create_dir_all(folder.path().join("assets")).unwrap();
    std::fs::write(folder.path().join("assets/bar.stl"), bar()).unwrap();
    let geoms = [
        r#"<geom type="plane" size="5 5 1"/><geom size="0.1"/>"#,
        r#"<geom class="seen" size="0.4"/><geom type="cylinder" size="0.05" fromto="0 0 0.1 0 0 0.3"/>"#,
        r#"<frame pos="0 0 0.1"><geom type="capsule" size="0.04 0.15" pos="0 0 0.1"/></frame>"#,
        r#"<geom type="box" size="0.03 0.04 0.15" pos="0 0 0.2" contype="0"/>"#,
        r#"<geom type="mesh" mesh="bar"/>"#,
    ];
    let inertial = r#"<inertial pos="0 0 0" mass="2" diaginertia="0.02 0.02 0.02"/>"#;
    let mut bodies = String::new();
    for k in (1..5).rev() {
        let axis = if k == 1 { "0 0 1" } else { "0 1 0" };
        bodies = format!(
            r#"<body name="{}" pos="0 0 0.4"><joint axis="{axis}" range="-2 2"/>{inertial}{}{bodies}</body>"#,
            NAMES[k], geoms[k]
        );
    }
    let text = format!(
        r#"<mujoco model="tower"><compiler angle="radian" meshdir="assets"/>
        <default><mesh scale="0.001 0.001 0.001"/>
          <default class="seen"><geom contype="0" conaffinity="0"/></default></default>
        <asset><mesh file="bar.stl"/></asset>
        <worldbody><body name="base">{}{bodies}</body></worldbody></mujoco>"#,
        geoms[0]
    );
    let source = folder.path().join("arm.xml");
    let source = source.to_str().unwrap();
    let MjcfArm { arm, notices, meshes, .. } = read_mjcf(&text, source).unwrap();
    assert_is_tower(&arm);
    assert_eq!(meshes, [folder.path().join("assets/bar.stl")]);
    assert_eq!(told(&notices).len(), 1, "{notices:?}");
    let other = text.replace(r#"mesh="bar""#, r#"mesh="rod""#);
    let MjcfArm { arm, notices, .. } = read_mjcf(&other, source).unwrap();
    assert_eq!(arm.clearance.capsules.len(), 4);
    let said = told(&notices)[1].to_string();
    assert!(said.contains("four (line ") && said.contains("no <mesh> \"rod\""), "{said}");
}

/// Each shape with its reason, in one line per kind of reason.
#[test]
fn what_is_not_read_is_told_and_not_watched() {
    let folder = tempfile::tempdir().unwrap();
    let bytes = bar();
    std::fs::write(folder.path().join("cut.stl"), &bytes[..bytes.len() - 7]).unwrap();
    let mut damaged = bytes;
    damaged[100..104].copy_from_slice(&f32::NAN.to_le_bytes());
    std::fs::write(folder.path().join("nan.stl"), &damaged).unwrap();
    let shapes = [
        collision(0.0, r#"<mesh filename="cut.stl"/>"#)
            + &collision(0.0, r#"<mesh filename="nan.stl"/>"#),
        collision(0.0, r#"<mesh filename="one.DAE"/>"#),
        collision(0.0, r#"<sphere radius="-1"/>"#),
        collision(0.0, r#"<mesh filename="package://nowhere/three.stl"/>"#),
        collision(f64::NAN, r#"<sphere radius="0.1"/>"#),
    ];
    let source = folder.path().join("arm.urdf");
    let UrdfArm { arm, notices, meshes, .. } = read(shapes.each_ref().map(String::as_str), &source);
    assert_eq!(arm.clearance, Clearance::default());
    assert!(meshes.is_empty());
    let [nothing, missing, unread] = told(&notices)[..] else { panic!("{notices:?}") };
    assert_eq!(*nothing, ShapeNotice::Nothing);
    let files = owned(&["package://nowhere/three.stl"]);
    assert_eq!(*missing, ShapeNotice::MissingMeshes { files, links: owned(&["three"]) });
    let unread = unread.to_string();
    for words in [
        "base (cut.stl: it announces 3 triangles and has room for 2; is it cut off?)",
        "base (nan.stl: point 1 has a coordinate that is not finite)",
        "one (one.DAE: of meshes only .stl and .obj are read)",
        "two (its size -1 m is not positive)",
        "four (its pose has a number that is not finite)",
    ] {
        assert!(unread.contains(words), "{words}: {unread}");
    }
    assert!(!unread.contains('\n'));
}

/// A mesh drawn in millimetres and read in metres.
#[test]
fn a_mesh_without_its_scale_is_told() {
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("bar.stl"), bar()).unwrap();
    let mesh = collision(0.0, r#"<mesh filename="file://bar.stl"/>"#);
    let sphere = collision(0.0, r#"<sphere radius="0.1"/>"#);
    let source = folder.path().join("arm.urdf");
    let UrdfArm { arm, notices, .. } = read([&sphere, "", &mesh, "", ""], &source);
    assert_eq!(arm.clearance.capsules.len(), 1);
    let [capsules, unread] = told(&notices)[..] else { panic!("{notices:?}") };
    let words = "1 capsule from the collision shapes of base; without shapes and not watched: one, three, four";
    assert_eq!(capsules.to_string(), words);
    let unread = unread.to_string();
    assert!(unread.contains("two (it reaches 206.2 m from its link"), "{unread}");
}

/// The centres are always 0.8 m apart, and the radii are 0.45 m.
#[test]
fn links_that_no_motion_parts_are_not_kept_apart() {
    let wide = collision(0.0, r#"<sphere radius="0.45"/>"#);
    let thin = collision(0.2, r#"<sphere radius="0.05"/>"#);
    let shapes = [&wide, &thin, &wide, &thin, &thin].map(String::as_str);
    let UrdfArm { arm, notices, .. } = read(shapes, Path::new("arm.urdf"));
    assert!(!arm.clearance.pairs.contains(&[0, 2]), "{:?}", arm.clearance.pairs);
    assert!(arm.clearance.pairs.contains(&[0, 4]), "{:?}", arm.clearance.pairs);
    let pairs = told(&notices)[1].to_string();
    assert!(pairs.contains("wherever the arm is: base and two"), "{pairs}");
}

/// A table under the arm stays a box, and so does a box that the arm can leave; the block around the arm joins the
/// base.
#[test]
fn boxes_of_the_base_stay_boxes() {
    let sphere = collision(0.0, r#"<sphere radius="0.2"/>"#);
    let of_base = |boxes: &str| {
        let read = read([boxes, &sphere, &sphere, "", ""], Path::new("arm.urdf"));
        let clearance = read.arm.clearance;
        let names: Vec<String> =
            clearance.capsules.iter().map(|capsule| capsule.name.clone()).collect();
        (clearance.boxes.len(), names)
    };
    let table = collision(-0.3, r#"<box size="100 100 0.1"/>"#);
    let post = collision(0.0, r#"<box size="0.3 0.3 0.3"/>"#);
    assert_eq!(of_base(&(table.clone() + &post)), (2, owned(&["one", "two"])));
    let block = collision(0.0, r#"<box size="0.3 0.3 0.5"/>"#);
    assert_eq!(of_base(&(table + &block)), (1, owned(&["base", "one", "two"])));
    let tilted = post.replace("/><geometry>", r#" rpy="0.3 0 0"/><geometry>"#);
    assert_ne!(tilted, post);
    assert_eq!(of_base(&tilted), (0, owned(&["base", "one", "two"])));
}

/// Two shapes that are far apart get two capsules; repeated names are numbered.
#[test]
fn a_link_may_have_several_capsules() {
    let ears = [0.0, 1.0].map(|z_m| collision(z_m, r#"<sphere radius="0.1"/>"#)).concat();
    let UrdfArm { arm, .. } = read(["", "", &ears, "", ""], Path::new("arm.urdf"));
    let names: Vec<&str> = arm.clearance.capsules.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["two", "two 2"]);
}

/// The keys of the drive file add to the shapes or replace them.
#[test]
fn a_drive_file_says_more_or_less() {
    let folder = tempfile::tempdir().unwrap();
    let source = folder.path().join("arm.urdf");
    let sphere = collision(0.0, r#"<sphere radius="0.1"/>"#);
    std::fs::write(&source, urdf([&sphere; 5].map(String::as_str))).unwrap();
    let loaded = |drives: &str| {
        std::fs::write(source.with_extension("drives.toml"), drives).unwrap();
        LoadedArm::load(source.to_str().unwrap()).unwrap()
    };
    let usual = loaded("floor_z_m = -0.1\nunwatched_pairs = [[\"four\", \"base\"]]\n");
    assert_eq!(usual.arm.clearance.floor_z_m, Some(-0.1));
    assert_eq!((usual.arm.clearance.capsules.len(), usual.arm.clearance.pairs.len()), (5, 5));
    assert_eq!(told(&usual.notices).len(), 1);
    let none = loaded("clearance = \"none\"\n");
    assert!(none.arm.clearance.capsules.is_empty() && told(&none.notices).is_empty());
}
