//! `armid excite` from the outside: exit codes, messages, and outputs that are whole or not there.

use armid::excitation::Reference;
use armid::robot::Arm;

use crate::cli::{Folder, Said};

fn excite(folder: &Folder, words: &str) -> Said {
    folder.armid(&format!("excite {words}"))
}

#[test]
fn a_small_design_writes_every_output() {
    let folder = Folder::empty();
    let words = "--robot ur5 --order 3 --starts 2 --finalists 1 --out t.json --csv t.csv \
                 --urscript t.script --report t.html --box 0.4,-0.5,0,0.9,0.5,0.3 --velocity-share 0.5";
    excite(&folder, words).says(0, &[]);
    let series = armid::excitation::FourierSeries::load(folder.path("t.json").to_str().unwrap());
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
    assert!(page.contains("forearm and wrist 3") && page.contains("The swept arm"));
    assert!(folder.path("t.csv").exists() && folder.path("t.script").exists());
}

/// Exit code 3, a reason, and no file: a run without a design must not look like one with.
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
    fails("--robot ur5 --out t.json --offsets 0,0.5,0,0,0,0", "floor");
    fails("--robot ur5 --out t.json --noise-nm 1,1", "6 joints");
    fails("--robot ur5 --out t.json --period nan", "NaN");
    fails("--robot ur5 --out t.json --seconds 0", "seconds");
    fails("--robot ur5 --out t.json --urscript t.script --speed 2", "speed");
    fails("--robot ur5 --out t.json --velocity-share 0", "velocity-share");
    fails("--robot ur5 --out t.json --clearance=-1", "-1");
    fails("--robot ur5 --out t.json --prior no.json", "no.json");
    fails("--robot ur5 --out t.json --box 0,1,2", "six numbers");
    fails("--robot ur5 --out t.json --period-range 1,2,3", "LOW,HIGH");
    assert!(folder.is_empty());
}

/// A box around the shoulder: the answer is no, at once, and says why.
#[test]
fn what_no_motion_keeps_clear_of_is_a_negative_result() {
    let folder = Folder::empty();
    let words = "--robot ur5 --box -0.3,-0.3,0,0.3,0.3,0.3 --out t.json";
    excite(&folder, words).complains(3, &["clearance of upper arm and box 1"]);
    assert!(!folder.path("t.json").exists());
}

/// What a URDF leaves open is said, and what cannot be watched is not promised.
#[test]
fn a_robot_without_shapes_has_no_clearance() {
    let folder = Folder::empty();
    let arm = armid::robot::Arm::built_in("ur5").unwrap();
    let urdf = armid::robot::export::urdf(&arm, &armid::robot::Frames::default()).unwrap();
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
