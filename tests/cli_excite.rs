//! `armid excite` from outside: exit codes, messages, and outputs that are complete or absent.

use armid::excitation::{ClearanceModel, FourierSeries, Reference};
use armid::robot::export::urdf;
use armid::robot::{Arm, Capsule, Frames};

use crate::cli::{Folder, Said};

fn excite(folder: &Folder, words: &str) -> Said {
    folder.armid(&format!("excite {words}"))
}

#[test]
fn a_small_design_writes_every_output() {
    let folder = Folder::empty();
    let words = "--robot ur5 --order 3 --starts 2 --finalists 1 --rate 10 --out t.json --csv t.csv \
                 --urscript t.script --speed 0.5 --report t.html --box 0.4,-0.5,0,0.9,0.5,0.3 --velocity-share 0.5";
    let slowed = "those of full speed: at a speed of 0.5 the motion takes 16";
    excite(&folder, words).says(0, &[slowed]);
    let series = FourierSeries::load(folder.path("t.json").to_str().unwrap());
    let series = series.unwrap();
    assert_eq!(series.order(), 3);
    let limits: Vec<f64> =
        Arm::built_in("ur5").unwrap().joints.iter().map(|j| j.limits.velocity_rad_s).collect();
    for k in 0..1000 {
        let (mut q, mut qd, mut qdd) = ([0.0; 6], [0.0; 6], [0.0; 6]);
        series.sample(1e-3 * f64::from(k) * series.period_s, &mut q, &mut qd, &mut qdd);
        assert!(qd.iter().zip(&limits).all(|(qd, limit)| qd.abs() <= 0.5 * limit), "{qd:?}");
    }
    let json = folder.result("t.json");
    assert_eq!(json["design"]["cut_short"], false);
    assert_eq!(json["program"]["seed"], 1);
    let margins = json["design"]["margins"].as_array().unwrap();
    assert!(margins.len() > 24 && margins.iter().all(|m| m["free"].as_f64().unwrap() >= 0.0));
    let page = folder.read("t.html");
    let design = &json["design"];
    let [all, known] = ["parameters", "parameters_known"].map(|key| design[key].as_u64().unwrap());
    let precision = format!("{known} of {all} parameters will be known better than their own size");
    assert!(known > 0 && known <= all && page.contains(&precision), "{precision}");
    assert!(design["known_sigma_90"].as_f64().unwrap() < 1.0, "{design}");
    assert!(page.contains("forearm and wrist 3") && page.contains("The swept arm"));
    assert!(page.contains(slowed));
    // What is played has half the speed of the design, a little more between the instants at which that was checked.
    for row in folder.read("t.csv").lines().skip(1) {
        let row: Vec<f64> = row.split(',').map(|word| word.parse().unwrap()).collect();
        let mut velocities = row[7..13].iter().zip(&limits);
        assert!(velocities.all(|(qd, limit)| qd.abs() <= 0.26 * limit), "{row:?}");
    }
    // The set points follow each other as controllers expect it, however slowly the data are recorded.
    let script = folder.read("t.script");
    assert!(script.contains("speed = 0.5\n") && script.contains("cycle = 0.008\n"), "{script}");
}

/// Exit code 3, a reason, and no file: a failed design must not look like a successful one.
#[test]
fn an_infeasible_task_writes_nothing() {
    let folder = Folder::empty();
    let words = "--robot ur5 --order 2 --starts 2 --clearance 0.9 --out t.json --csv t.csv";
    excite(&folder, words).complains(3, &["nothing was written"]);
    assert!(folder.is_empty());
}

#[test]
fn bad_input_is_named_before_the_work() {
    let folder = Folder::empty();
    let fails = |words: &str, expected: &str| excite(&folder, words).complains(1, &[expected]);
    fails("--robot ur6 --out t.json", "ur6");
    fails("--robot ur5 --out no/such/folder/t.json", "no/such/folder");
    fails("--robot ur5 --out t.json --offsets 0,0", "6 joints");
    fails("--robot ur5 --out t.json --offsets 0,x,0,0,0,0", "\"x\"");
    fails("--robot ur5 --out t.json --noise-nm 1,1", "6 joints");
    fails("--robot ur5 --out t.json --noise-nm 1e-300", "must be in 1e-9 … 1e9 Nm");
    fails("--robot ur5 --out t.json --period nan", "NaN");
    fails("--robot ur5 --out t.json --data 1e300", "= 1.00000e300 must be at most 86400 s");
    fails("--robot ur5 --out t.json --seconds 0", "seconds");
    fails("--robot ur5 --out t.json --urscript t.script --speed 2", "speed");
    fails("--robot ur5 --out t.json --csv t.csv --speed 0", "speed");
    excite(&folder, "--robot ur5 --out t.json --speed 0.5").complains(2, &["--csv", "--urscript"]);
    fails("--robot ur5 --out t.json --velocity-share 0", "velocity-share");
    fails("--robot ur5 --out t.json --clearance=-1", "-1");
    fails("--robot ur5 --out t.json --prior no.json", "no.json");
    fails("--robot ur5 --out t.json --box 0,1,2", "six numbers");
    fails("--robot ur5 --out t.json --period-range 1,2,3", "LOW,HIGH");
    assert!(folder.is_empty());
}

/// A box around the shoulder: the command gives a negative answer at once, with the reason.
#[test]
fn what_no_motion_keeps_clear_of_is_a_negative_result() {
    let folder = Folder::empty();
    let words = "--robot ur5 --box -0.3,-0.3,0,0.3,0.3,0.3 --out t.json";
    excite(&folder, words).complains(3, &["clearance of upper arm and box 1"]);
    assert!(!folder.path("t.json").exists());
}

#[test]
fn a_fixed_pose_inside_the_floor_is_a_negative_result() {
    let folder = Folder::empty();
    let words = "--robot ur5 --out t.json --offsets 0,1.5,0,0,0,0";
    excite(&folder, words)
        .complains(3, &["no pose the arm may take", "floor", "nothing was written"]);
    assert!(folder.is_empty());
}

/// Gaps in a URDF are reported, and a distance that cannot be watched is not promised.
#[test]
fn a_robot_without_shapes_has_no_clearance() {
    let folder = Folder::empty();
    let arm = Arm::built_in("ur5").unwrap();
    let urdf = urdf(&arm, &Frames::default()).unwrap();
    folder.write("arm.urdf", &urdf);
    let run = |words: &str, code: i32, expected: &str| {
        excite(&folder, words).complains(code, &[expected]);
    };
    let words = "--robot arm.urdf --order 2 --starts 1 --finalists 1 --out t.json";
    run(&format!("{words} --report t.html"), 0, "the robot has no capsules");
    let page = folder.read("t.html");
    assert!(page.contains("is not watched") && !page.contains("Clearance model"));
    run(&format!("{words} --box 0.4,-0.5,0,0.9,0.5,0.3"), 1, "--box");
    let unlimited = urdf.replacen("effort=\"150\"", "effort=\"0\"", 1);
    assert_ne!(unlimited, urdf);
    folder.write("arm.urdf", unlimited);
    run(words, 1, "--noise-nm");
}

/// A mesh with six points around each end of a capsule.
fn mesh(capsule: &Capsule) -> String {
    let mut mesh = String::new();
    for end in [capsule.from_m, capsule.to_m] {
        for (axis, side) in [(0, -1.0), (0, 1.0), (1, -1.0), (1, 1.0), (2, -1.0), (2, 1.0)] {
            let mut point = end;
            point[axis] += side * capsule.radius_m;
            mesh += &format!("v {} {} {}\n", point.x, point.y, point.z);
        }
    }
    mesh
}

/// Writes the UR5 as a URDF whose collision shapes are separate mesh files.
fn write_ur5_with_shapes(folder: &Folder) -> Arm {
    let arm = Arm::built_in("ur5").unwrap();
    let text = urdf(&arm, &Frames::default()).unwrap();
    let mut text =
        text.replacen("<link name=\"base_link\"/>", "<link name=\"base_link\"></link>", 1);
    for (number, capsule) in arm.clearance.capsules.iter().enumerate() {
        folder.write(&format!("meshes/{number}.obj"), mesh(capsule));
        let link = match capsule.body {
            0 => "<link name=\"base_link\">".to_owned(),
            body => format!("<link name=\"{}_link\">", arm.joints[body - 1].name),
        };
        assert!(text.contains(&link), "{link}: {text}");
        let file = format!("meshes/{number}.obj");
        let shape =
            format!("<collision><geometry><mesh filename=\"{file}\"/></geometry></collision>");
        text = text.replacen(&link, &format!("{link}{shape}"), 1);
    }
    folder.write("arm.urdf", text);
    arm
}

/// The smallest distance along one period, m.
fn least_distance_m(arm: &Arm, series: &FourierSeries) -> f64 {
    let model = ClearanceModel::new(arm);
    assert!(!model.is_empty());
    let (mut workspace, mut distances_m) = (model.workspace(), vec![0.0; model.len()]);
    let mut least_m = f64::INFINITY;
    for k in 0..2000 {
        let (mut q, mut qd, mut qdd) = ([0.0; 6], [0.0; 6], [0.0; 6]);
        series.sample(5e-4 * f64::from(k) * series.period_s, &mut q, &mut qd, &mut qdd);
        model.distances(&mut workspace, &q, &mut distances_m);
        least_m = distances_m.iter().copied().fold(least_m, f64::min);
    }
    least_m
}

/// The motion keeps clear of the arm itself and the floor, by the model from the collision shapes and by the original
/// capsules from which the shapes were made.
#[test]
fn an_arm_with_collision_shapes_is_kept_clear() {
    let folder = Folder::empty();
    let built_in = write_ur5_with_shapes(&folder);
    folder.write("arm.drives.toml", "floor_z_m = 0.0\n");
    let words = "--robot arm.urdf --order 2 --starts 2 --finalists 1 --out t.json";
    let said = excite(&folder, words);
    said.complains(
        0,
        &[
            "8 capsules from the collision shapes of base_link, shoulder_pan_link, ",
            "wherever the arm is: base_link and shoulder_lift_link 2, elbow_link and wrist_2_link",
        ],
    );
    let own = Arm::load(folder.path("arm.urdf").to_str().unwrap()).unwrap();
    let series = FourierSeries::load(folder.path("t.json").to_str().unwrap()).unwrap();
    let least_m = least_distance_m(&own, &series);
    assert!(least_m > 0.0199, "{least_m} m");
    let least_m = least_distance_m(&built_in, &series);
    assert!(least_m > 0.0, "{least_m} m");
    let inputs = folder.result("t.json")["program"]["inputs"].as_array().unwrap().len();
    assert_eq!(inputs, 2 + 8, "URDF, drive file, meshes");
    // For an arm folded onto itself, the message names the links and the remedy.
    let folded = excite(&folder, &format!("{words} --offsets 0,-1.57,3.1,0,0,0"));
    folded.complains(3, &["no pose the arm may take: clearance of ", "_link", "unwatched_pairs"]);
    folder.write("arm.drives.toml", "clearance = \"none\"\n");
    excite(&folder, words).complains(0, &["the robot has no capsules"]);
}
