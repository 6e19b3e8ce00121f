//! Included files and files beside the MJCF, and their faults.

use super::{BODY, model, one, says};
use crate::robot::export::urdf;
use crate::robot::{Arm, Frames, LoadedArm};

#[test]
fn files_are_included_once() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, text).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let load = |path: &str| LoadedArm::load(path).map_err(|e| e.to_string());
    let body = format!("<body name=\"b\">\n<joint name=\"k\"/>{BODY}</body>");
    let hand = format!("<mujocoinclude>\n{body}</mujocoinclude>");
    write("parts/hand.xml", &hand);
    let arm = |file: &str| {
        let include = format!("<include file=\"{file}\"/>");
        one("", "", &format!(r#"<joint name="j"/>{BODY}{include}"#))
    };
    let main = write("arm.xml", &arm("parts/hand.xml"));
    let loaded = load(&main).unwrap();
    let names: Vec<&str> = loaded.arm.joints.iter().map(|joint| joint.name.as_str()).collect();
    assert_eq!(names, ["j", "k"]);
    assert_eq!(loaded.files.len(), 2);
    assert!(loaded.files[1].ends_with("parts/hand.xml"));
    write("parts/hand.xml", &hand.replace("name=\"k\"", "name=\"k\" damping=\"x\""));
    let bad = load(&main).unwrap_err();
    let place = "parts/hand.xml line 3: joint \"k\": damping: \"x\" is no number";
    assert!(bad.contains(place), "{bad}");
    let itself = load(&write("arm.xml", &arm("arm.xml"))).unwrap_err();
    assert!(itself.contains("is there already"), "{itself}");
    let missing = load(&write("arm.xml", &arm("nowhere.xml"))).unwrap_err();
    assert!(missing.contains("line 1: <include>") && missing.contains("nowhere.xml"), "{missing}");
}

#[test]
fn bad_input_is_told_with_its_place() {
    let joint =
        |attributes: &str| one("", "", &format!("{BODY}\n<joint name=\"j\" {attributes}/>"));
    says(&joint(r#"damping="-1""#), &["line 2: joint \"j\"", "damping = -1", "negative"]);
    says(&joint(r#"armature="nan""#), &["armature = NaN"]);
    says(&joint(r#"pos="0 1e293 0""#), &["pos = 1e293 is not a number to calculate with"]);
    says(&joint(r#"axis="0 1""#), &["axis has 2 numbers instead of 3"]);
    says(&joint(r#"axis="0 0 0""#), &["axis is zero"]);
    says(&joint(r#"axis="0,1,0""#), &["\"0,1,0\" is no number"]);
    says(&joint(r#"type="screw""#), &["type=\"screw\"", "hinge"]);
    says(&joint(r#"limited="yes""#), &["limited=\"yes\"", "true"]);
    let body = |inertial: &str| one("", "", &format!("<joint/><inertial {inertial}/>"));
    says(&body(r#"pos="0 0 0" mass="-1" diaginertia="1 1 1""#), &["<inertial>", "mass = -1"]);
    says(&body(r#"mass="1" diaginertia="1 1 1""#), &["pos is missing"]);
    says(&body(r#"pos="0 0 0" mass="1""#), &["diaginertia is missing"]);
    says(&body(r#"pos="0 0 0" mass="1" diaginertia="1 1 3""#), &["body \"a\"", "triangle"]);
    says(
        &body(r#"pos="0 0 0" mass="1" diaginertia="1 1 1" fullinertia="1 1 1 0 0 0""#),
        &["both diaginertia and fullinertia"],
    );
    says(&one(r#"<compiler coordinate="global"/>"#, "", BODY), &["coordinates", "mj_saveLastXML"]);
    says(&one(r#"<compiler eulerseq="xyw"/>"#, "", BODY), &["eulerseq=\"xyw\""]);
    says(&one("", "", "<replicate count=\"2\"/>"), &["<replicate>: copies are not read"]);
    says(&one("", "", BODY), &["no hinge is in it"]);
    let jointed = |sections: &str| one(sections, "", &format!("<joint name=\"j\"/>{BODY}"));
    for (sections, place) in [
        ("\n<actuator><motor name=\"m\" joint=\"k\"/></actuator>", "line 2: motor \"m\": "),
        ("<equality>\n<joint joint1=\"k\"/></equality>", "line 2: <joint>: "),
        ("<equality><joint joint1=\"j\" joint2=\"k\"/></equality>", "line 1: <joint>: "),
    ] {
        let unknown = format!("{place}there is no joint \"k\" in <worldbody>");
        says(&jointed(sections), &[&unknown]);
    }
    let twice = one("", "", &format!("<joint/>{BODY}<body name=\"a\"/>"));
    says(&twice, &["body \"a\" is there twice"]);
    let broken = one("", "", &format!("<joint/>{BODY}")).replace("name=\"a\"", "name=\"a&#10;b\"");
    says(&broken, &["the name of the body \"a\\nb\" has a control character"]);
    says("<mujoco><worldbody>", &["not readable as XML"]);
    says("", &["not readable as XML"]);
    says("<sdf/>", &["line 1: <sdf>", "<mujoco>"]);
    let deep = "<body>".repeat(5000) + &"</body>".repeat(5000);
    says(&model("", &deep), &["nested too deeply"]);
}

/// The content decides, not the extension.
#[test]
fn an_xml_that_is_a_urdf_is_read_as_one() {
    let folder = tempfile::tempdir().unwrap();
    let arm = Arm::built_in("ur5").unwrap();
    let path = folder.path().join("arm.xml");
    std::fs::write(&path, urdf(&arm, &Frames::default()).unwrap()).unwrap();
    let loaded = LoadedArm::load(path.to_str().unwrap()).unwrap();
    assert_eq!(loaded.arm.dof(), 6);
    assert!(!loaded.urdf_links.is_empty());
}

/// The drive file beside the MJCF takes precedence.
#[test]
fn a_drive_file_comes_before_the_mjcf() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("arm.xml");
    let joint = r#"<joint name="j" armature="0.3" damping="1.5"/>"#;
    std::fs::write(&path, one("", "", &format!("{BODY}{joint}"))).unwrap();
    let drives = "[[joint]]\nname = \"j\"\nrotor_inertia_kg_m2 = 0.4\n";
    std::fs::write(path.with_extension("drives.toml"), drives).unwrap();
    let loaded = LoadedArm::load(path.to_str().unwrap()).unwrap();
    assert_eq!(loaded.arm.joints[0].drive.rotor_inertia_kg_m2, 0.4);
    assert_eq!(loaded.arm.joints[0].drive.viscous_nm_s_rad, 1.5);
    assert_eq!(loaded.files.len(), 2);
    let names: Vec<&str> = loaded.urdf_links.iter().map(|link| link.name.as_str()).collect();
    assert_eq!(names, ["world", "a"]);
}
