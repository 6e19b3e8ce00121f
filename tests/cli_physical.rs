//! From a log to an arm that simulators accept, and back into the plant, as a user does it: `identify --physical`,
//! `export`, `simulate --arm`.

use std::sync::OnceLock;

use armid::robot::{Arm, read_urdf};
use serde_json::Value;

use crate::cli::{Folder, default_scenario};
use crate::other_arms::Designed;

/// Standard deviation of the default scenario's torque noise, Nm.
const NOISE_NM: [f64; 6] = [1.0, 1.0, 0.7, 0.15, 0.15, 0.15];

fn parameter(result: &Value, list: &str, name: &str) -> f64 {
    let found = result[list].as_array().unwrap().iter().find(|p| p["name"] == name);
    found.unwrap_or_else(|| panic!("no {name}"))["value"].as_f64().unwrap()
}

/// A folder with the default scenario for 4 periods, its log and the result of its identification.
fn identified() -> &'static Folder {
    static FOLDER: OnceLock<Folder> = OnceLock::new();
    FOLDER.get_or_init(|| {
        let folder = Folder::empty();
        let scenario = default_scenario(4);
        folder.write("noisy.toml", &scenario);
        let (quiet, _) = scenario.split_once("[sensors]").unwrap();
        folder.write("quiet.toml", quiet);
        let words = "simulate --scenario noisy.toml --out log.csv --truth truth.json";
        folder.armid(words).says(0, &[]);
        let words = "identify log.csv --robot ur5 --physical --json result.json --report r.html";
        let said = ["Physical consistency: ", "duality gap", "KKT residual"];
        let text = folder.armid(words).says(0, &said);
        assert!(!text.contains("the model is wrong"), "{text}");
        folder
    })
}

#[test]
fn a_clean_log_gives_an_arm_with_a_certificate() {
    let folder = identified();
    let result = folder.result("result.json");
    assert_eq!(result["standard_parameters"].as_array().unwrap().len(), 84);
    for body in 1..=6 {
        assert!(parameter(&result, "standard_parameters", &format!("m{body}")) > 0.0);
        for drive in ["Ia", "rv", "rc"] {
            let name = format!("{drive}{body}");
            assert!(parameter(&result, "standard_parameters", &name) >= 0.0, "{name}");
        }
    }
    let physical = &result["physical"];
    assert_eq!(physical["model_is_wrong"], false);
    let number = |key: &str| physical[key].as_f64().unwrap();
    // The accuracy that the solver guarantees: 1e-8 of 1 + objective.
    assert!(number("duality_gap") <= 1e-8 * (1.0 + number("objective")), "{physical}");
    assert!(number("p_value") > 0.01, "{physical}");
    let page = folder.read("r.html");
    assert!(page.contains("Standard parameters that an arm can have"));
}

/// A simulation without noise, of a light arm with viscous friction only. The rounding errors that remain in the torque
/// must not count as evidence against zero Coulomb friction and rotor inertia, which lie on the boundary of physical
/// arms.
#[test]
fn a_log_without_noise_gives_an_arm() {
    let folder = Folder::empty();
    folder.write(
        "light.xml",
        r#"<mujoco model="light">
  <default><joint type="hinge" axis="0 1 0" range="-120 120" damping="0.01"/></default>
  <worldbody>
    <body name="upper" pos="0 0 0.5">
      <joint name="shoulder"/>
      <inertial pos="0 0 0.06" mass="0.03" diaginertia="4e-5 4e-5 1e-6"/>
      <body name="lower" pos="0 0 0.12">
        <joint name="elbow"/>
        <inertial pos="0 0 0.05" mass="0.02" diaginertia="2e-5 2e-5 1e-6"/>
      </body>
    </body>
  </worldbody>
</mujoco>"#,
    );
    let motion = serde_json::json!({
        "schema": "armid.trajectory/1",
        "program": { "version": "0.1.0", "command": "by hand", "seed": 1, "inputs": [] },
        "period_s": 4.0,
        "q0_rad": [0.2, -0.3],
        "a_rad_s": [[0.5, -0.9, 1.2], [-0.7, 1.0, 0.8]],
        "b_rad_s": [[0.9, 0.3, -0.6], [0.4, -1.1, 0.7]],
    });
    folder.write("motion.json", motion.to_string());
    folder.write(
        "quiet.toml",
        "name = \"light\"\nrobot = \"light.xml\"\nseed = 1\ntrials = 1\n[motion]\ntrajectory = \"motion.json\"\nperiods = 2\n",
    );
    folder.armid("simulate --scenario quiet.toml --out log.csv --truth truth.json").says(0, &[]);
    let words = "identify log.csv --robot light.xml --physical --json result.json";
    let text = folder.armid(words).says(0, &["within noise an arm can have"]);
    assert!(!text.contains("the model is wrong"), "{text}");
    let (result, truth) = (folder.result("result.json"), folder.result("truth.json"));
    assert!(result["physical"]["p_value"].as_f64().unwrap() > 0.01, "{}", result["physical"]);
    // The noise is taken as 1e-4 of the torque, and σ follows from that; the remaining torque is about a hundred times
    // smaller.
    for p in result["standard_parameters"].as_array().unwrap() {
        let Some(sigma) = p["sigma"].as_f64() else { continue };
        let name = p["name"].as_str().unwrap();
        let error = p["value"].as_f64().unwrap() - parameter(&truth, "standard_parameters", name);
        assert!(error.abs() <= 3.0 * sigma, "{name}: {error} ± {sigma}");
    }
    for name in ["rc1", "rc2"] {
        assert_eq!(parameter(&result, "standard_parameters", name), 0.0, "{name}");
    }
}

/// The robot file that serves as prior is wrong by 10 to 20 % for every link. σ is stated only for what the data
/// decide, and must hold there: a file wrong by 100 % would move these estimates by less than σ, this one by at most a
/// fifth of that. Noise exceeds 5.8 σ of Student's t with 20 degrees of freedom once in 1e5, in about 45 parameters.
/// The mass of the first body, which turns about a vertical axis, has no effect on any torque; those of the others
/// appear only in combinations.
#[test]
fn sigma_is_stated_for_what_the_data_decide() {
    let folder = identified();
    let mut wrong = Arm::built_in("ur5").unwrap();
    for (joint, factor) in wrong.joints.iter_mut().zip([1.2, 0.8, 1.1, 0.85, 1.15, 0.9]) {
        joint.link.parameters.iter_mut().for_each(|p| *p *= factor);
    }
    folder.write("wrong.toml", wrong.to_toml());
    let words = "identify log.csv --robot wrong.toml --physical --json wrong.json --report w.html";
    let text = folder.armid(words).says(0, &["come without σ"]);
    assert!(!text.contains("the model is wrong"), "{text}");
    let truth = folder.result("truth.json");
    let result = folder.result("wrong.json");
    let (mut by_data, mut by_prior) = (Vec::new(), Vec::new());
    for p in result["standard_parameters"].as_array().unwrap() {
        let name = p["name"].as_str().unwrap();
        let value = p["value"].as_f64().unwrap();
        let Some(sigma) = p["sigma"].as_f64() else {
            match p["decided_by"].as_str() {
                Some("prior") => by_prior.push(name),
                other => assert_eq!((other, &name[..3]), (Some("not_fitted"), "off"), "{name}"),
            }
            continue;
        };
        assert_eq!(p["decided_by"], "data", "{name}");
        by_data.push(name);
        let error = value - parameter(&truth, "standard_parameters", name);
        assert!(error.abs() <= 6.0 * sigma, "{name}: {error} ± {sigma}");
    }
    for name in ["Ia3", "rc1", "rv6", "my2", "F2"] {
        assert!(by_data.contains(&name), "{name}: {by_prior:?}");
    }
    for name in ["m1", "A1", "Ia1", "m2", "m3", "m4", "m6", "mz3"] {
        assert!(by_prior.contains(&name), "{name}: {by_data:?}");
    }
    let page = folder.read("w.html");
    assert_eq!(page.matches(" (prior)</td>").count(), by_prior.len());
    let words = "export wrong.json --robot wrong.toml --mjcf w.xml";
    let decided = format!("of {} standard parameters (m1,", by_prior.len());
    folder.armid(words).says(0, &[&decided]);
}

#[test]
fn the_weight_of_the_prior_is_cross_validated_and_shown() {
    let folder = identified();
    for prior in ["pull_back", "entropic"] {
        let words = format!(
            "identify log.csv --robot ur5 --physical --prior {prior} --prior-weight auto --json \
             {prior}.json"
        );
        folder.armid(&words).says(0, &["chosen by cross-validation"]);
        let physical = &folder.result(&format!("{prior}.json"))["physical"];
        assert_eq!(physical["prior_metric"], prior);
        let tried = physical["cross_validation"].as_array().unwrap();
        let error = |t: &Value| t["prediction_error"].as_f64().unwrap();
        let best = tried.iter().min_by(|a, b| error(a).total_cmp(&error(b))).unwrap();
        assert_eq!(best["weight"], physical["prior_weight"], "{physical}");
    }
    let words = "identify log.csv --robot ur5 --period 0 --physical --prior-weight auto";
    folder.armid(words).says(1, &["repeats at least 3 times", "give the weight as a number"]);
    let words = "identify log.csv log.csv --robot ur5 --physical --prior-weight auto";
    folder.armid(words).says(1, &["--prior-weight auto", "of several logs give it as a number"]);
    let words = "identify log.csv --robot ur5 --physical --prior-weight 0";
    folder.armid(words).says(2, &["positive number or auto"]);
    folder.armid("identify log.csv --robot ur5 --prior entropic").says(2, &["--physical"]);
}

/// Torque that is logged late makes rotor inertias negative, as in the paper, and gives friction that drives the
/// joints, which no arm has.
#[test]
fn a_wrong_model_is_called_wrong_and_sent_to_diagnose() {
    let folder = Folder::empty();
    let late = default_scenario(4) + "\n[[effect]]\nkind = \"time_skew\"\ndelay_s = 0.16\n";
    folder.write("late.toml", late);
    folder.armid("simulate --scenario late.toml --out late.csv").says(0, &[]);
    let words = "identify late.csv --robot ur5 --physical --json late.json --report late.html";
    let wrong = "the model is wrong, not only noisy";
    let told =
        [wrong, "Run armid diagnose", "Ia6 ≥ 0", "What was identified is physically impossible"];
    folder.armid(words).says(3, &told);
    let result = folder.result("late.json");
    assert!(parameter(&result, "base_parameters", "Ia6") < 0.0);
    assert!(parameter(&result, "standard_parameters", "Ia6") >= 0.0);
    assert_eq!(result["physical"]["model_is_wrong"], true);
    let page = folder.read("late.html");
    assert!(page.contains(wrong));
}

#[test]
fn both_formats_are_exported_and_the_urdf_comes_back_with_its_drives() {
    let folder = identified();
    let words = "export result.json --urdf a.urdf --mjcf a.xml";
    folder.armid(words).says(0, &["a.urdf", "a.drives.toml", "a.xml"]);
    let result = folder.result("result.json");
    let mjcf = folder.read("a.xml");
    let armature = parameter(&result, "standard_parameters", "Ia3");
    assert!(mjcf.contains(&format!("armature=\"{armature}\"")), "{mjcf}");
    let back = Arm::load(folder.path("a.urdf").to_str().unwrap()).unwrap();
    for (j, joint) in back.joints.iter().enumerate() {
        let value =
            |kind: &str| parameter(&result, "standard_parameters", &format!("{kind}{}", j + 1));
        assert_eq!(joint.drive.rotor_inertia_kg_m2, value("Ia"));
        assert_eq!(joint.drive.coulomb_nm, value("rc"));
        // Converted to the centre of mass and back: a few rounding errors.
        assert!((joint.link.mass_kg() / value("m") - 1.0).abs() < 1e-14);
        assert!((joint.link.parameters[4] - value("A")).abs() < 1e-13);
    }
    let text = folder.armid("base --robot a.urdf").says(0, &["52 base parameters"]);
    assert!(text.contains("a.drives.toml"), "{text}");
}

/// URDF in, URDF out: the same links, joints, limits and frames after another identification. As in ROS, the arm stands
/// in a world, so that "base_link" is not the root.
#[test]
fn a_robot_that_came_as_urdf_leaves_as_urdf() {
    let folder = identified();
    folder.armid("export result.json --urdf in.urdf").says(0, &[]);
    let with_tool = folder.read("in.urdf").replace(
        "</robot>",
        "<link name=\"world\"/><joint name=\"stand\" type=\"fixed\"><parent link=\"world\"/><child link=\"base_link\"/>\
         </joint><link name=\"tool0\"/><joint name=\"tool\" type=\"fixed\"><origin xyz=\"0 0 0.1\" rpy=\"0 0.5 0\"/>\
         <parent link=\"wrist_3_link\"/><child link=\"tool0\"/></joint></robot>",
    );
    folder.write("in.urdf", with_tool);
    let words = "identify log.csv --robot in.urdf --physical --json in.json";
    folder.armid(words).says(0, &["note: in.urdf"]);
    folder.armid("export in.json --robot in.urdf --urdf out.urdf").says(0, &["out.urdf"]);
    let read = |name: &str| read_urdf(&folder.read(name), name).unwrap();
    let (before, after) = (read("in.urdf"), read("out.urdf"));
    assert_eq!(before.arm.name, after.arm.name);
    assert_eq!((&*before.frames.root, before.frames.fixed.len()), ("world", 2));
    assert_eq!(before.frames.root, after.frames.root);
    for (a, b) in before.frames.fixed.iter().zip(&after.frames.fixed) {
        assert_eq!((&a.name, a.body), (&b.name, b.body));
        assert!((a.placement.rotation - b.placement.rotation).norm() < 1e-14);
        assert!((a.placement.translation_m - b.placement.translation_m).norm() < 1e-15);
    }
    for (a, b) in before.arm.joints.iter().zip(&after.arm.joints) {
        assert_eq!((&a.name, a.limits), (&b.name, b.limits));
        assert!((a.placement.rotation - b.placement.rotation).norm() < 1e-14);
        assert_eq!(a.placement.translation_m, b.placement.translation_m);
    }
    let other = folder.armid("export in.json --urdf x.urdf --robot ur10e");
    other.says(1, &["in.json", "\"ur5\"", "\"ur10e\""]);
    // An arm of the same name whose wrist is a centimetre longer.
    let arm = Arm::built_in("ur5").unwrap();
    let longer = arm.to_toml().replacen("xyz_m = [-0.39225,", "xyz_m = [-0.40225,", 1);
    assert_ne!(longer, arm.to_toml());
    folder.write("longer.toml", longer);
    let words = "export result.json --robot longer.toml --urdf x.urdf";
    folder.armid(words).says(1, &["another \"ur5\"", "joint 4", "1.00e-2 m"]);
    let words = "diagnose log.csv --robot longer.toml --sim result.json";
    folder.armid(words).says(1, &["result.json", "another \"ur5\""]);
    let words = "diagnose log.csv --robot ur10e --sim quiet.toml";
    folder.armid(words).says(1, &["quiet.toml", "another arm than \"ur10e\""]);
    assert!(!folder.path("x.urdf").exists());
}

/// The words of a URDF without the parts that identification changes.
fn not_identified(urdf: &str) -> Vec<String> {
    let cut = |text: &str, from: &str, to: &str| {
        let mut parts = text.split(from);
        let first = parts.next().unwrap().to_owned();
        parts.fold(first, |kept, part| kept + part.split_once(to).unwrap().1)
    };
    let rest = cut(&cut(urdf, "<inertial>", "</inertial>"), "<dynamics ", "/>");
    rest.split_whitespace().map(str::to_owned).collect()
}

/// The exported URDF is the user's own file with the identified numbers; everything else in it is unchanged. Its joints
/// are tilted, and a tool is bolted to the last link.
#[test]
fn a_urdf_is_given_back_with_its_identified_numbers() {
    let folder = Folder::empty();
    let hand = "<link name=\"hand\">";
    let shape = "<visual><geometry><mesh filename=\"meshes/hand.stl\"/></geometry></visual> <!-- scanned -->";
    let own = include_str!("other_arms/three_joints.urdf")
        .replace(hand, &format!("{hand}\n    {shape}"))
        .replace(
            "</robot>",
            "  <gazebo reference=\"hand\"><selfCollide>true</selfCollide></gazebo>\n</robot>",
        );
    folder.write("own.urdf", &own);
    let designed = Designed::new("three_joints", 5.0, &[0.5, 0.4, 0.1]);
    folder.write("designed.json", designed.trajectory());
    let scenario = "name = \"three\"\nrobot = \"own.urdf\"\nseed = 1\ntrials = 1\n[motion]\ntrajectory = \"designed.json\"\n\
                    periods = 8\n[sensors]\ntorque_sd_nm = [0.5, 0.4, 0.1]\nq_sd_rad = 2e-5\nqd_sd_rad_s = 1e-3\n";
    folder.write("three.toml", scenario);
    folder.armid("simulate --scenario three.toml --out log.csv").says(0, &[]);
    let words = "identify log.csv --robot own.urdf --physical --json result.json";
    folder.armid(words).says(0, &["note: own.urdf"]);
    let refused = folder.armid("export result.json --robot own.urdf --urdf own.urdf");
    refused.says(1, &["own.urdf", "the command reads this file"]);
    assert_eq!(folder.read("own.urdf"), own);
    let told = "out.urdf: own.urdf with the inertia of 3 links and the friction of 3 joints; everything else as it was";
    let words = "export result.json --robot own.urdf --urdf out.urdf";
    let text = folder.armid(words).says(0, &[told, "out.drives.toml"]);
    assert!(!text.contains("meshes such as"), "{text}");
    let written = folder.read("out.urdf");
    assert_ne!(written, own);
    assert_eq!(not_identified(&written), not_identified(&own));
    let result = folder.result("result.json");
    let back = Arm::load(folder.path("out.urdf").to_str().unwrap()).unwrap();
    assert_eq!(back.dof(), 3);
    for (j, joint) in back.joints.iter().enumerate() {
        let value =
            |kind: &str| parameter(&result, "standard_parameters", &format!("{kind}{}", j + 1));
        let body = ["m", "mx", "my", "mz", "A", "B", "C", "D", "E", "F"].map(value);
        // Converted through frames and centres of mass and back: some rounding errors of the largest value.
        let size = body.iter().fold(0.0_f64, |size, p| size.max(p.abs()));
        for (found, expected) in joint.link.parameters.iter().zip(body) {
            assert!((found - expected).abs() < 1e-12 * size, "{}: {found} {expected}", joint.name);
        }
        assert_eq!(joint.drive.rotor_inertia_kg_m2, value("Ia"));
        assert_eq!(joint.drive.viscous_nm_s_rad, value("rv"));
        assert_eq!(joint.drive.coulomb_nm, value("rc"));
    }
    // The robot file is found by its name in the result, from the working folder or beside the result, or through the
    // scenario.
    let words = "export result.json --urdf again.urdf";
    folder.armid(words).says(0, &["again.urdf: own.urdf with the inertia of 3 links"]);
    assert_eq!(folder.read("again.urdf"), written);
    let words = "simulate --scenario three.toml --arm result.json --out again.csv";
    folder.armid(words).says(0, &["again.csv"]);
    let named = "\"robot_source\": \"own.urdf\"";
    let moved = folder.read("result.json").replace(named, &named.replace("own", "moved"));
    folder.write("moved.json", &moved);
    let words = "export moved.json --urdf lost.urdf";
    folder.armid(words).says(1, &["moved.json", "moved.urdf", "say where it is with --robot"]);
    let words = "simulate --scenario three.toml --arm moved.json --out again.csv";
    folder.armid(words).says(0, &["again.csv"]);
    folder.write("cell/result.json", &moved);
    folder.write("cell/moved.urdf", &own);
    let words = "export cell/result.json --urdf again.urdf";
    folder.armid(words).says(0, &["again.urdf: cell/moved.urdf with the inertia of 3 links"]);
    folder.write("elsewhere/nothing", "");
    let words = "export result.json --robot own.urdf --urdf elsewhere/out.urdf";
    folder.armid(words).says(0, &["meshes such as meshes/hand.stl", "beside own.urdf"]);
}

#[test]
fn results_that_hold_no_arm_are_refused_with_what_to_do() {
    let folder = identified();
    let refused = |words: &str, expected: &[&str]| {
        folder.armid(&format!("export {words} --urdf bad.urdf")).says(1, expected);
        assert!(!folder.path("bad.urdf").exists(), "{words}");
    };
    let good = folder.read("result.json");
    let edited = |name: &str, edit: &dyn Fn(&mut Value)| {
        let mut value: Value = serde_json::from_str(&good).unwrap();
        edit(&mut value);
        folder.write(name, value.to_string());
    };
    refused("nothing.json", &["nothing.json"]);
    folder.write("cut.json", &good[..good.len() / 2]);
    refused("cut.json", &["cut.json", "wanted: a result of armid identify --physical --json"]);
    refused("truth.json", &["truth.json", "armid.truth/1"]);
    edited("base.json", &|v| v["standard_parameters"] = Value::Null);
    refused("base.json", &["base.json", "run identify --physical"]);
    edited("null.json", &|v| v["standard_parameters"][3]["value"] = Value::Null);
    refused("null.json", &["null.json", "\"mz1\"", "not a finite number"]);
    edited("name.json", &|v| v["standard_parameters"][3]["name"] = "mw1".into());
    refused("name.json", &["name.json", "\"mw1\"", "not one of this arm"]);
    edited("twice.json", &|v| v["standard_parameters"][3]["name"] = "my1".into());
    refused("twice.json", &["twice.json", "\"my1\"", "twice"]);
    edited("short.json", &|v| {
        v["standard_parameters"].as_array_mut().unwrap().remove(3);
    });
    refused("short.json", &["short.json", "\"mz1\"", "missing"]);
    edited("rotor.json", &|v| v["standard_parameters"][65]["value"] = (-0.1).into());
    refused("rotor.json", &["wrist_3", "rotor inertia = -0.1", "--physical"]);
    edited("body.json", &|v| v["standard_parameters"][4]["value"] = 50.0.into());
    refused("body.json", &["shoulder_pan", "cannot exist", "--physical"]);
    edited("robot.json", &|v| {
        v["robot"] = "ur9".into();
        v["robot_source"] = Value::Null;
    });
    refused("robot.json", &["ur9", "built in are"]);
    refused("result.json --robot ur10e", &["\"ur5\"", "\"ur10e\""]);
    folder.armid("export result.json").says(2, &["--urdf"]);
    folder.armid("export result.json --mjcf no/folder/x.xml").says(1, &["no/folder"]);
}

/// Column `actual_torque_j` of a log, one list per joint.
fn torque_nm(log: &str) -> Vec<Vec<f64>> {
    let mut lines = log.lines();
    let header: Vec<&str> = lines.next().unwrap().split(',').collect();
    let column = |j: usize| header.iter().position(|h| *h == format!("actual_torque_{j}")).unwrap();
    let columns: Vec<usize> = (0..6).map(column).collect();
    let rows: Vec<Vec<&str>> = lines.map(|line| line.split(',').collect()).collect();
    columns.iter().map(|&c| rows.iter().map(|row| row[c].parse().unwrap()).collect()).collect()
}

/// The identified arm, in closed loop, reproduces the torque of the log.
///
/// Against the noise-free truth: the squared difference in units of the noise, summed over joints and samples, is ‖X
/// (θ̂ − θ)‖². For least squares this is χ² with 52 degrees of freedom, and it is smaller for an estimate projected
/// onto a convex set that holds the truth. Weights from the scatter of 4 periods lose some efficiency, and the run-in
/// is not in the data: a factor of 2. 97 is the quantile for 1e-4. Against the log: the rms of the noise, known to
/// 1/√(2·5250) = 1 % per joint; four of these for six joints (4e-4), and the difference above, which adds less than 1
/// %.
#[test]
fn the_identified_arm_moves_in_closed_loop_as_the_log_says() {
    let folder = identified();
    folder.armid("simulate --scenario quiet.toml --out true.csv").says(0, &[]);
    let words = "simulate --scenario quiet.toml --arm result.json --out again.csv";
    folder.armid(words).says(0, &["again.csv"]);
    let read = |name: &str| torque_nm(&folder.read(name));
    let (truth, again, log) = (read("true.csv"), read("again.csv"), read("log.csv"));
    let mut squares = 0.0;
    for j in 0..6 {
        let difference = |other: &[f64]| -> f64 {
            again[j].iter().zip(other).map(|(a, b)| ((a - b) / NOISE_NM[j]).powi(2)).sum()
        };
        squares += difference(&truth[j]);
        let rms = (difference(&log[j]) / log[j].len() as f64).sqrt();
        println!("joint {}: {rms:.4} of the noise against the log", j + 1);
        assert!((rms - 1.0).abs() < 0.05, "joint {}: {rms}", j + 1);
    }
    println!("squared difference to the truth: {squares:.1} units of noise");
    assert!(squares < 2.0 * 97.0, "{squares}");
}
