//! What `armid` and `montecarlo` refuse or decline: exit codes, messages that name the fault, and no half-written
//! files.

use serde_json::Value;

use crate::cli::{Folder, default_scenario};

/// A log in the default layout: joint `j` moves as `amplitude[j]` rad × a sum of two sines.
fn log(amplitude: [f64; 6], samples: usize) -> String {
    let names = |what: &str| (0..6).map(|j| format!("{what}_{j}")).collect::<Vec<_>>().join(",");
    let (q, qd, torque) = (names("actual_q"), names("actual_qd"), names("actual_torque"));
    let mut text = format!("timestamp,{q},{qd},{torque}\n");
    for k in 0..samples {
        let t = k as f64 * 0.008;
        let wave = |j: usize| {
            let (w, v) = (0.9 + 0.23 * j as f64, 2.1 + 0.31 * j as f64);
            let q = amplitude[j] * ((w * t).sin() + 0.5 * (v * t).sin());
            let qd = amplitude[j] * (w * (w * t).cos() + 0.5 * v * (v * t).cos());
            (q, qd)
        };
        let values: Vec<String> = [t]
            .into_iter()
            .chain((0..6).map(|j| wave(j).0))
            .chain((0..6).map(|j| wave(j).1))
            .chain((0..6).map(|j| 3.0 * wave(j).1 + 0.1 * ((k * (j + 3)) as f64).sin()))
            .map(|v| v.to_string())
            .collect();
        text.push_str(&values.join(","));
        text.push('\n');
    }
    text
}

#[test]
fn bad_input_ends_in_a_message_that_names_it() {
    let folder = Folder::empty();
    let measured = log([0.5; 6], 1000);
    folder.write("log.csv", &measured);
    let refused = |words: &str, code: i32, expected: &[&str]| {
        folder.armid(words).says(code, expected);
    };
    refused("base --robot ur9", 1, &["ur9", "ur10e"]);
    refused("base --robot ur10e --reduced paper", 1, &["UR5", "ur10e"]);
    refused("identify no.csv --robot ur5", 1, &["no.csv"]);
    refused("identify log.csv --robot ur5 --validate log.csv", 1, &["training log"]);
    refused("identify log.csv --robot ur5 --period 3", 1, &["does not repeat every 3 s"]);
    let slow = ["log.csv: a single run", "10 Hz (--cutoff)", "18.0 Hz"];
    refused("identify log.csv --robot ur5 --rate 18 --period 0", 1, &slow);
    let narrow = ["log.csv: the low-pass at 0.05 Hz (--cutoff) leaves 0.", "at least 6 are needed"];
    refused("identify log.csv --robot ur5 --cutoff 0.05 --period 0", 1, &narrow);
    let unwritable = "identify log.csv --robot ur5 --json /no/such/folder/x.json";
    refused(unwritable, 1, &["/no/such/folder"]);
    refused("identify log.csv", 2, &["--robot"]);
    for command in ["identify", "diagnose"] {
        let words = format!("{command} log.csv --robot ur5 --report");
        refused(&format!("{words} log.csv"), 1, &["reads this file"]);
        let twice = format!("{words} x --json ./x");
        refused(&twice, 1, &["two outputs would go to this file"]);
    }
    folder.montecarlo("--trials 2 --out log.csv").says(1, &["this is a file"]);
    assert_eq!(folder.read("log.csv"), measured);
}

#[test]
fn a_motion_that_does_not_excite_the_arm_is_a_negative_result_not_an_error() {
    let folder = Folder::empty();
    folder.write("log.csv", log([0.8, 0.0, 0.0, 0.0, 0.0, 0.0], 4000));
    let words = "identify log.csv --robot ur5 --json result.json";
    folder.armid(words).says(3, &["Declined", "rc6"]);
    let result = folder.result("result.json");
    assert_eq!(result["schema"], "armid.identify/1");
    assert_eq!(result["verdict"], "not_identified");
    assert!(result["not_identified"].as_array().unwrap().iter().any(|name| name == "rv4"));
    // A diagnosis needs the model and declines as well.
    let words = "diagnose log.csv --robot ur5 --json result.json";
    folder.armid(words).says(3, &["declined", "armid excite"]);
    assert_eq!(folder.result("result.json")["verdict"], "declined");
    // So do both where nothing moves at all.
    folder.write("rest.csv", log([0.0; 6], 4000));
    let words = "identify rest.csv --robot ur5 --json rest.json --report rest.html";
    folder.armid(words).says(3, &["Declined: no joint moves"]);
    let result = folder.result("rest.json");
    assert_eq!(result["verdict"], "not_identified");
    assert_eq!(result["processing"], Value::Null);
    assert_eq!(result["not_identified"].as_array().unwrap().len(), 52);
    assert!(folder.read("rest.html").contains("no joint moves"));
    let words = ["declined, no joint moves. Record a motion", "armid excite"];
    folder.armid("diagnose rest.csv --robot ur5").says(3, &words);
}

/// The tip of the argument parser, to write `-- -3`, is none: the range of the option is what helps.
#[test]
fn a_negative_number_is_refused_by_its_range() {
    let folder = Folder::empty();
    folder.write("log.csv", log([0.5; 6], 1000));
    let refused = |words: &str, code: i32, expected: &str| {
        let said = folder.armid(words).says(code, &[expected]);
        assert!(!said.contains("unexpected argument"), "{said}");
    };
    let positive = "must be a positive number";
    for command in ["identify", "diagnose"] {
        for option in ["--cutoff", "--rate", "--period"] {
            let expected = format!("{option} -3: {positive}");
            refused(&format!("{command} log.csv --robot ur5 {option} -3"), 1, &expected);
        }
    }
    let weight = "identify log.csv --robot ur5 --physical --prior-weight -1";
    refused(weight, 2, "expected a positive number or auto");
    refused("diagnose log.csv --robot ur5 --known-payload -1", 2, positive);
    for (option, code, expected) in [
        ("--order -3", 2, "must be a whole number of at least 1"),
        ("--period -1", 1, "the period = -1 must be positive"),
        ("--period-range -1,2", 1, "the shortest period = -1 must be positive"),
        ("--clearance -1", 1, "the clearance = -1 must be finite and not negative"),
        ("--velocity-share -1", 1, "--velocity-share -1: must be in (0, 1]"),
        ("--torque-share -1", 1, "the share of the torque = -1 must be in (0, 1]"),
        ("--noise-nm -1", 1, "the torque noise of joint 1 = -1 must be positive"),
        ("--data -1", 1, "the length of the data = -1 must be positive"),
        ("--rate -1", 1, "the sampling rate = -1 must be positive"),
        ("--starts -1", 2, "must be a whole number of at least 1"),
        ("--finalists -1", 2, "must be a whole number of at least 1"),
        ("--seed -1", 2, "must be a whole number of at least 0"),
        ("--seconds -1", 1, "--seconds -1: must be positive"),
        ("--threads -1", 2, "-1 is not in 1..=65535"),
        ("--csv t.csv --speed -1", 1, "a speed of -1 cannot be played"),
    ] {
        refused(&format!("excite --robot ur5 --out t.json {option}"), code, expected);
    }
    refused("simulate --out log.csv --trial -1", 2, "must be a whole number of at least 0");
    for study in ["noise s.toml", "paper", "cutoff", "physical s.toml"] {
        let words = format!("study {study} --trials -1");
        refused(&words, 2, "must be a whole number of at least 2");
    }
    refused("study noise s.toml --slow-every -1", 2, "must be a whole number of at least 1");
    for (option, least) in [("--trials", 1), ("--trial", 0), ("--seed", 0)] {
        let expected = format!("must be a whole number of at least {least}");
        folder.montecarlo(&format!("{option} -1")).says(2, &[&expected]);
    }
    folder.montecarlo("--threads -1").says(2, &["-1 is not in 1..=65535"]);
}

/// Of several logs, the one that is too short has to be known.
#[test]
fn a_log_too_short_for_its_sigma_is_named() {
    let folder = Folder::empty();
    folder.write("short.csv", log([0.5; 6], 300));
    for command in ["identify", "diagnose"] {
        let words = format!("{command} short.csv --robot ur5");
        folder.armid(&words).says(1, &["error: short.csv: 2.", "s of motion without a gap"]);
    }
}

/// An identification is not lost because a log it is validated on is of no use.
#[test]
fn a_bad_validation_log_does_not_discard_the_estimate() {
    let folder = Folder::empty();
    folder.write("s.toml", default_scenario(2));
    folder.armid("simulate --scenario s.toml --out run.csv").says(0, &["samples"]);
    folder.write("rest.csv", log([0.0; 6], 4000));
    let words = "identify run.csv --robot ur5 --validate rest.csv --json r.json";
    folder.armid(words).says(1, &["Identified 52", "rest.csv"]);
    assert_eq!(folder.result("r.json")["verdict"], "identified");
}

/// A log beside a copy of it tells nothing of a load.
#[test]
fn a_load_is_not_looked_for_in_one_log_twice() {
    let folder = Folder::empty();
    folder.write("log.csv", log([0.5; 6], 1000));
    folder.write("copy.csv", folder.read("log.csv"));
    folder.armid("diagnose log.csv copy.csv --robot ur5").says(1, &["are the same log"]);
}

/// Torques with reversed sign fit as well as correct ones, but friction then drives the joints and the arm falls
/// upwards.
#[test]
fn what_no_arm_has_is_a_negative_result() {
    let folder = Folder::empty();
    folder.armid("simulate --out log.csv").says(0, &[]);
    let turned = |line: &str| {
        let turn = |(column, field): (usize, &str)| match field.strip_prefix('-') {
            _ if column < 13 || field.starts_with(char::is_alphabetic) => field.to_owned(),
            Some(positive) => positive.to_owned(),
            None => format!("-{field}"),
        };
        line.split(',').enumerate().map(turn).collect::<Vec<_>>().join(",")
    };
    let text = folder.read("log.csv");
    folder.write("log.csv", text.lines().map(turned).collect::<Vec<_>>().join("\n"));
    for (command, verdict) in [("identify", "contradicted"), ("diagnose", "declined")] {
        let words = format!("{command} log.csv --robot ur5 --json result.json");
        let told =
            ["with the torques of all joints reversed", "friction pushes joint 1, 2, 3, 4, 5, 6"];
        folder.armid(&words).says(3, &told);
        assert_eq!(folder.result("result.json")["verdict"], verdict);
    }
    // The arm stands, but its description says that it hangs.
    folder.armid("simulate --out log.csv").says(0, &[]);
    let robot = include_str!("../robots/ur5.toml").replace("-9.81]", "9.81]");
    folder.write("hanging.toml", robot);
    for (command, verdict) in [("identify", "contradicted"), ("diagnose", "declined")] {
        let words = format!("{command} log.csv --robot hanging.toml --json result.json");
        folder.armid(&words).says(3, &["gravity_m_s2 = [0.00, 0.00, -9.81]"]);
        assert_eq!(folder.result("result.json")["verdict"], verdict);
    }
}

/// A torque that was not recorded must not be reported as insufficient excitation.
#[test]
fn a_torque_that_never_changes_is_told_by_its_joint() {
    let folder = Folder::empty();
    let text = log([0.5; 6], 1000);
    let without = |dead: std::ops::Range<usize>| {
        let of_row = |(row, line): (usize, &str)| {
            let torque = |(column, field): (usize, &str)| match row > 0 && dead.contains(&column) {
                true => "0".to_owned(),
                false => field.to_owned(),
            };
            line.split(',').enumerate().map(torque).collect::<Vec<_>>().join(",")
        };
        text.lines().enumerate().map(of_row).collect::<Vec<_>>().join("\n")
    };
    // The torque columns follow the time, six angles and six velocities.
    for (dead, joint) in [(13..19, "joint 1"), (15..16, "joint 3")] {
        folder.write("log.csv", without(dead));
        for task in ["identify", "diagnose"] {
            let output = folder.armid(&format!("{task} log.csv --robot ur5"));
            output.says(1, &["log.csv", joint, "0 Nm in every row"]);
        }
    }
}

#[test]
fn usage_errors_of_the_main_job_exit_with_2() {
    let folder = Folder::empty();
    let refused = |words: &str, code: i32, expected: &str| {
        folder.montecarlo(words).says(code, &[expected]);
    };
    refused("--trials 0", 2, "--trials");
    refused("--threads 0", 2, "--threads");
    refused("--shard 3/3 --out x", 2, "count from 0");
    refused("--shard 0/3", 2, "--out");
    refused("--scenario no.toml", 1, "no.toml");
    refused("merge no-folder", 1, "no-folder");
}

#[test]
fn unknown_keys_of_a_scenario_are_errors_that_name_them() {
    let folder = Folder::empty();
    let default = default_scenario(8);
    folder.write("x.toml", default.replace("trials =", "trails ="));
    folder.montecarlo("--scenario x.toml").says(1, &["x.toml", "trails"]);
    // Effects that the plant does not have are errors too.
    let effect = "\n[[effect]]\nkind = \"load_friction\"\njoint = 7\nmu = 0.05\n";
    folder.write("x.toml", default + effect);
    folder.montecarlo("--scenario x.toml").says(1, &["x.toml: effect 1", "joint = 7"]);
}
