//! Robots given as URDF or MJCF: an arm that is a part of the model, the drive file beside the model, and what is left
//! of both in an exported model.

use armid::dynamics::{Model, ParameterLayout};
use armid::robot::export::{drive_file, mjcf, urdf};
use armid::robot::{Arm, Frames, Kinematics};
use serde_json::{Value, json};

use crate::cli::{Folder, default_scenario};

fn ur5() -> (Arm, String) {
    let arm = Arm::built_in("ur5").unwrap();
    let text = urdf(&arm, &Frames::default()).unwrap();
    (arm, text)
}

/// Adds a hand of 0.5 kg to the last link, with two fingers of 0.1 kg; the second finger mimics the first.
fn with_hand(text: &str) -> String {
    let link = |name: &str, mass_kg: f64| {
        format!(
            "<link name=\"{name}\"><inertial><origin xyz=\"0 0 0.05\"/><mass value=\"{mass_kg}\"/>\
             <inertia ixx=\"1e-3\" ixy=\"0\" ixz=\"0\" iyy=\"1e-3\" iyz=\"0\" izz=\"1e-3\"/></inertial></link>"
        )
    };
    let joint = |name: &str, kind: &str, parent: &str, child: &str, more: &str| {
        format!(
            "<joint name=\"{name}\" type=\"{kind}\"><parent link=\"{parent}\"/><child link=\"{child}\"/>\
             <axis xyz=\"0 1 0\"/><limit lower=\"0\" upper=\"0.04\" velocity=\"0.2\"/>{more}</joint>"
        )
    };
    let hand = [
        link("hand", 0.5),
        joint("mount", "fixed", "wrist_3_link", "hand", ""),
        link("thumb", 0.1),
        joint("slide", "prismatic", "hand", "thumb", ""),
        link("finger", 0.1),
        joint("follower", "prismatic", "hand", "finger", "<mimic joint=\"slide\"/>"),
        "</robot>".to_owned(),
    ];
    text.replace("</robot>", &hand.concat())
}

/// A folder `cell` with this robot and the drive file of its arm.
fn cell() -> (Folder, Arm) {
    let folder = Folder::empty();
    let (arm, text) = ur5();
    folder.write("cell/robot.urdf", with_hand(&text));
    folder.write("cell/robot.drives.toml", drive_file(&arm, &[0.0; 6]));
    (folder, arm)
}

#[test]
fn an_arm_with_a_gripper_is_named_by_its_last_link() {
    let (folder, _) = cell();
    let whole = folder.armid("base --robot cell/robot.urdf");
    let told = ["\"slide\" is prismatic", "\"follower\" is prismatic", "cell/robot.urdf#hand"];
    whole.complains(1, &told);
    let arm = folder.armid("base --robot cell/robot.urdf#hand --json base.json");
    arm.says(0, &["52 base parameters"]);
    arm.complains(0, &["joints slide (0 m), follower (0 m) are not on the way to link \"hand\""]);
    let inputs = &folder.result("base.json")["program"]["inputs"];
    assert_eq!(inputs[0]["path"], "cell/robot.urdf");
    assert_eq!(inputs[1]["path"], "cell/robot.drives.toml");
    folder.armid("base --robot cell/robot.urdf#flange").complains(1, &["no link \"flange\""]);
    folder.armid("base --robot cell/robot.urdf#finger").complains(1, &["on the way to link"]);
    folder.write("arm.toml", Arm::built_in("ur5").unwrap().to_toml());
    folder.armid("base --robot arm.toml#hand").complains(1, &["arm.toml", "#hand", "leave it out"]);
    folder.armid("base --robot ur5#hand").complains(1, &["ur5#hand"]);
}

/// Commands that are about something else than the file of the arm say in one line what was assumed about it.
#[test]
fn usual_assumptions_are_told_in_a_line() {
    let folder = Folder::empty();
    let (arm, text) = ur5();
    folder.write("arm.urdf", text);
    folder.write("result.json", result_of(&arm, "arm.urdf"));
    let export = folder.armid("export result.json --mjcf out.xml");
    export.complains(
        0,
        &[
            "note: arm.urdf: assumed or interpreted: gravity 9.81 m/s2 along -z of \"base_link\"; ",
            "; rotor inertia 0, gear ratio 1, torque constant 1 Nm/A; ",
            "; acceleration limit 10 rad/s2 (in full: armid base --robot arm.urdf)",
        ],
    );
    assert_eq!(export.stderr.matches("note: arm.urdf").count(), 1, "{}", export.stderr);
    let full = folder.armid("base --robot arm.urdf");
    full.complains(
        0,
        &["note: arm.urdf: no acceleration limit, taken as 10 rad/s2: shoulder_pan,"],
    );
    assert!(!full.stderr.contains("in full"), "{}", full.stderr);
}

/// A drive file about a whole arm serves a part of it, too: what lies behind the last link is none of that part's.
#[test]
fn a_drive_file_of_a_longer_arm_fits_a_shorter_one() {
    let folder = Folder::empty();
    let (arm, text) = ur5();
    let drives = drive_file(&arm, &[0.0; 6]);
    folder.write("arm.urdf", text);
    folder.write("arm.drives.toml", &drives);
    folder.armid("base --robot arm.urdf#wrist_1_link").says(0, &["base parameters"]);
    let part = Arm::load(&format!("{}#wrist_1_link", folder.path("arm.urdf").display())).unwrap();
    assert_eq!(part.dof(), 4);
    let names = |arm: &Arm| -> Vec<[String; 2]> {
        let capsules = &arm.clearance.capsules;
        let kept = arm.clearance.pairs.iter().filter(|p| p.iter().all(|k| capsules[*k].body <= 4));
        kept.map(|pair| pair.map(|k| capsules[k].name.clone())).collect()
    };
    assert_eq!(names(&part), names(&arm));
    assert_eq!(part.clearance.pairs.len(), names(&part).len());
    let kept = arm.clearance.capsules.iter().filter(|capsule| capsule.body <= 4);
    assert!(part.clearance.capsules.iter().eq(kept), "{:?}", part.clearance.capsules);
    // Of a whole arm, such a body is a mistake.
    folder.write("arm.drives.toml", drives.replace("body = 6", "body = 7"));
    folder.armid("base --robot arm.urdf").complains(1, &["body = 7 must be 0 (the base)"]);
}

/// The properties in an exported model are read; the missing ones are reported, and a drive file beside it supplies
/// them.
#[test]
fn a_mujoco_model_is_a_robot() {
    let folder = Folder::empty();
    let (arm, _) = ur5();
    folder.write("arm.xml", mjcf(&arm, &Frames::default()).unwrap());
    let alone = folder.armid("base --robot arm.xml");
    alone.says(0, &["58 base parameters"]);
    alone.complains(
        0,
        &[
            "no speed limit, taken as 3.1416 rad/s",
            "no gear ratio and no torque constant given, taken as 1 and 1 Nm/A",
        ],
    );
    folder.write("arm.drives.toml", drive_file(&arm, &[0.0; 6]));
    folder.armid("base --robot arm.xml#wrist_3_link --json base.json").says(0, &["52 base"]);
    let inputs = &folder.result("base.json")["program"]["inputs"];
    assert_eq!(inputs[0]["path"], "arm.xml");
    assert_eq!(inputs[1]["path"], "arm.drives.toml");
    folder.armid("base --robot arm.xml#hand").complains(1, &["no body or site \"hand\""]);
}

/// The last body of the simulated arm is that of a UR5 with everything attached to it.
#[test]
fn a_scenario_names_an_arm_by_its_last_link() {
    let (folder, arm) = cell();
    let scenario = default_scenario(1);
    let robot = "robot = \"robot.urdf#hand\"";
    folder.write("cell/scenario.toml", scenario.replace("robot = \"ur5\"", robot));
    let words = "simulate --scenario cell/scenario.toml --out log.csv --truth truth.json";
    folder.armid(words).says(0, &["log.csv"]);
    let truth = folder.result("truth.json");
    let parameters = truth["standard_parameters"].as_array().unwrap();
    let mass = parameters.iter().find(|parameter| parameter["name"] == "m6").unwrap();
    let expected_kg = arm.joints[5].link.mass_kg() + 0.5 + 2.0 * 0.1;
    assert!((mass["value"].as_f64().unwrap() - expected_kg).abs() < 1e-12, "{mass}");
}

/// A drive file of one or two lines settles what they state and nothing else.
#[test]
fn a_drive_file_says_as_much_as_its_author_knows() {
    let folder = Folder::empty();
    folder.write("arm.urdf", ur5().1);
    let notes = |drives: &str| {
        folder.write("arm.drives.toml", drives);
        folder.armid("base --robot arm.urdf").says(0, &["arm.drives.toml"])
    };
    let elbow = "[[joint]]\nname = \"elbow\"\n";
    let text = notes(&format!("{elbow}gear_ratio = 101.0\ntorque_constant_nm_a = 0.12\n"));
    assert!(text.contains("gravity is taken as 9.81"), "{text}");
    let open = "no gear ratio and no torque constant given, taken as 1 and 1 Nm/A: shoulder_pan, shoulder_lift, wrist_1,";
    assert!(text.contains(open), "{text}");
    let text = notes(&format!("gravity_m_s2 = [9.81, 0.0, 0.0]\n{elbow}acceleration_rad_s2 = 5.0"));
    assert!(!text.contains("gravity is taken"), "{text}");
    assert!(text.contains("the file has no drives"), "{text}");
    // A single line reports everything that is open; for a complete file it contains only the name of the file.
    let told_of = |drives: &str| {
        let text = notes(drives);
        let told = text.lines().filter(|line| line.contains("drives.toml")).map(str::to_owned);
        let told: Vec<String> = told.collect();
        assert_eq!(told.len(), 1, "{text}");
        (told[0].clone(), text)
    };
    let (told, _) = told_of("");
    for words in [
        "arm.drives.toml leaves open: gravity is taken as 9.81 m/s2",
        "; the file has no drives: rotor inertia 0, gear ratio 1, torque constant 1 Nm/A",
        "; no acceleration limit, taken as 10 rad/s2",
    ] {
        assert!(told.contains(words), "{told}");
    }
    let (told, text) = told_of(&drive_file(&ur5().0, &[0.0; 6]));
    assert!(told.ends_with("drives and gravity are those of arm.drives.toml"), "{told}");
    assert!(!text.contains("taken as"), "{text}");
    folder.write("arm.drives.toml", elbow.replace("elbow", "knee"));
    folder.armid("base --robot arm.urdf").complains(1, &["\"knee\"", "shoulder_pan, "]);
}

/// The result of an identification that found exactly `arm`, whose robot was given as `source`.
fn result_of(arm: &Arm, source: &str) -> String {
    let layout = ParameterLayout::new(arm.dof());
    let values = Model::new(arm).standard_parameters();
    let named = values
        .iter()
        .enumerate()
        .map(|(k, value)| json!({"name": layout.name(k), "value": value, "decided_by": "data"}));
    let result = json!({
        "schema": "armid.identify/1",
        "robot": arm.name,
        "robot_source": source,
        "kinematics": Kinematics::of(arm),
        "standard_parameters": named.collect::<Vec<Value>>(),
    });
    result.to_string()
}

/// A drive file of the same name that lies there already is about the arm as it was before, or about another.
#[test]
fn an_exported_mjcf_comes_back_with_its_own_drive_file() {
    let folder = Folder::empty();
    let (mut arm, urdf) = ur5();
    for joint in &mut arm.joints {
        joint.drive.coulomb_nm *= 2.0;
    }
    folder.write("result.json", result_of(&arm, "ur5"));
    let earlier = "[[joint]]\nname = \"elbow\"\ncoulomb_nm = 99.0\nrotor_inertia_kg_m2 = 99.0\n";
    folder.write("x.drives.toml", earlier);
    folder.armid("export result.json --mjcf x.xml").says(0, &["x.xml", "x.drives.toml"]);
    let back = Arm::load(folder.path("x.xml").to_str().unwrap()).unwrap();
    assert_eq!(back.friction_epsilon_rad_s, arm.friction_epsilon_rad_s);
    assert_eq!(back.clearance, arm.clearance);
    for (a, b) in arm.joints.iter().zip(&back.joints) {
        assert_eq!((a.drive, a.limits), (b.drive, b.limits));
    }
    let text = folder.armid("base --robot x.xml").says(0, &["52 base parameters"]);
    assert!(!text.contains("taken as"), "{text}");
    let words = "export result.json --urdf both.urdf --mjcf both.xml";
    let text = folder.armid(words).says(0, &[]);
    assert_eq!(text.matches("both.drives.toml").count(), 1, "{text}");
    let words = "export result.json --urdf one.urdf --mjcf other.xml";
    folder.armid(words).says(0, &["one.drives.toml", "other.drives.toml"]);
    // The robot's own drive file is not replaced.
    folder.write("own.urdf", urdf);
    folder.write("own.drives.toml", earlier);
    let words = "export result.json --robot own.urdf --mjcf own.xml";
    folder.armid(words).says(1, &["own.drives.toml", "the command reads this file"]);
    assert_eq!(folder.read("own.drives.toml"), earlier);
}

/// Simulations address bodies by name.
#[test]
fn an_arm_that_came_as_mjcf_keeps_the_names_of_its_bodies() {
    let folder = Folder::empty();
    let (arm, _) = ur5();
    let model = mjcf(&arm, &Frames::default()).unwrap();
    folder.write("arm.xml", model.replace("\"elbow_link\"", "\"forearm\""));
    folder.write("result.json", result_of(&arm, "arm.xml"));
    let words = "export result.json --mjcf out.xml --urdf out.urdf";
    folder.armid(words).says(0, &["out.xml", "out.urdf"]);
    assert!(folder.read("out.xml").contains("<body name=\"forearm\""));
    assert!(folder.read("out.urdf").contains("<link name=\"forearm\""));
}

/// Angles mean the same in every format, so that an exported arm is the one that was identified.
#[test]
fn an_arm_with_a_small_tilt_is_still_itself_when_it_is_exported() {
    let folder = Folder::empty();
    let own = include_str!("../robots/ur5.toml");
    let tilted = own.replacen("rpy_rad = [0.0,", "rpy_rad = [3e-5,", 1);
    folder.write("tilted.toml", &tilted);
    let arm = Arm::from_toml(&tilted, "tilted.toml").unwrap();
    folder.write("result.json", result_of(&arm, "tilted.toml"));
    let first = folder.armid("export result.json --urdf a.urdf --mjcf b.xml");
    first.complains(0, &["taken as these: joint \"shoulder_pan\""]);
    folder.armid("export result.json --robot a.urdf --urdf c.urdf").says(0, &["c.urdf"]);
    folder.armid("export result.json --robot b.xml --mjcf d.xml").says(0, &["d.xml"]);
    folder.write("few.toml", own.replace("1.5707963267948966", "1.57"));
    let words = ["1.57 (of a right angle write 1.5707963)", "axes are nearly parallel", "column "];
    folder.armid("base --robot few.toml").complains(0, &words);
}
