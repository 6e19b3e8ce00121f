//! `armid` and `montecarlo` as a user runs them: exit codes, messages, and nothing written half.

use std::path::Path;
use std::process::{Command, Output};

fn armid(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_armid")).args(arguments).output().unwrap()
}

fn montecarlo(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_montecarlo")).args(arguments).output().unwrap()
}

/// Asserts the exit code and that the message on stderr (or, for verdicts, stdout) says `words`.
fn assert_says(output: &Output, code: i32, words: &[&str]) {
    let text = format!(
        "{}{}",
        String::from_utf8_lossy(&output.stdout),
        String::from_utf8_lossy(&output.stderr)
    );
    assert_eq!(output.status.code(), Some(code), "{text}");
    for word in words {
        assert!(text.contains(word), "\"{word}\" is not in: {text}");
    }
}

/// A log in the default layout: joint `j` moves as `amplitude[j]` rad × a sum of sines.
fn write_log(file: &Path, amplitude: [f64; 6], samples: usize) {
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
    std::fs::write(file, text).unwrap();
}

#[test]
fn bad_input_ends_in_a_message_that_names_it() {
    let folder = tempfile::tempdir().unwrap();
    let log = folder.path().join("log.csv");
    write_log(&log, [0.5; 6], 1000);
    let log = log.to_str().unwrap();
    assert_says(&armid(&["base", "--robot", "ur9"]), 1, &["ur9", "ur10e"]);
    assert_says(&armid(&["base", "--robot", "ur10e", "--reduced", "paper"]), 1, &["UR5", "ur10e"]);
    assert_says(&armid(&["identify", "no.csv", "--robot", "ur5"]), 1, &["no.csv"]);
    let twice = armid(&["identify", log, "--robot", "ur5", "--validate", log]);
    assert_says(&twice, 1, &["training log"]);
    let period = armid(&["identify", log, "--robot", "ur5", "--period", "3"]);
    assert_says(&period, 1, &["does not repeat every 3 s"]);
    let unwritable =
        armid(&["identify", log, "--robot", "ur5", "--json", "/no/such/folder/x.json"]);
    assert_says(&unwritable, 1, &["/no/such/folder"]);
    assert_says(&armid(&["identify", log]), 2, &["--robot"]);
    let measured = std::fs::read(log).unwrap();
    for command in ["identify", "diagnose"] {
        let over = armid(&[command, log, "--robot", "ur5", "--report", log]);
        assert_says(&over, 1, &["reads this file"]);
        let twice = armid(&[command, log, "--robot", "ur5", "--report", "x", "--json", "./x"]);
        assert_says(&twice, 1, &["two outputs would go to this file"]);
    }
    assert_says(&montecarlo(&["--trials", "2", "--out", log]), 1, &["this is a file"]);
    assert_eq!(std::fs::read(log).unwrap(), measured);
}

#[test]
fn a_motion_that_does_not_excite_the_arm_is_a_negative_result_not_an_error() {
    let folder = tempfile::tempdir().unwrap();
    let (log, json) = (folder.path().join("log.csv"), folder.path().join("result.json"));
    write_log(&log, [0.8, 0.0, 0.0, 0.0, 0.0, 0.0], 4000);
    let arguments =
        ["identify", log.to_str().unwrap(), "--robot", "ur5", "--json", json.to_str().unwrap()];
    assert_says(&armid(&arguments), 3, &["Declined", "rc6"]);
    let result: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(&json).unwrap()).unwrap();
    assert_eq!(result["schema"], "armid.identify/1");
    assert_eq!(result["verdict"], "not_identified");
    assert!(result["not_identified"].as_array().unwrap().iter().any(|name| name == "rv4"));
    // The same of a diagnosis, which needs the model.
    let arguments = ["diagnose", arguments[1], "--robot", "ur5", "--json", arguments[5]];
    assert_says(&armid(&arguments), 3, &["declined", "armid excite"]);
    let result: serde_json::Value =
        serde_json::from_str(&std::fs::read_to_string(&json).unwrap()).unwrap();
    assert_eq!(result["verdict"], "declined");
}

/// Torques of which the sign was exchanged fit as well as others: drives push then, and the arm falls upward.
#[test]
fn what_no_arm_has_is_a_negative_result() {
    let folder = tempfile::tempdir().unwrap();
    let (log, json) = (folder.path().join("log.csv"), folder.path().join("result.json"));
    let [file, result] = [&log, &json].map(|path| path.to_str().unwrap());
    let simulated = armid(&[
        "simulate",
        "--scenario",
        concat!(env!("CARGO_MANIFEST_DIR"), "/sims/default.toml"),
        "--out",
        file,
    ]);
    assert_says(&simulated, 0, &[]);
    let text = std::fs::read_to_string(&log).unwrap();
    let turned = |line: &str| {
        let turn = |(column, field): (usize, &str)| match field.strip_prefix('-') {
            _ if column < 13 || field.starts_with(char::is_alphabetic) => field.to_owned(),
            Some(positive) => positive.to_owned(),
            None => format!("-{field}"),
        };
        line.split(',').enumerate().map(turn).collect::<Vec<_>>().join(",")
    };
    std::fs::write(&log, text.lines().map(turned).collect::<Vec<_>>().join("\n")).unwrap();
    for command in ["identify", "diagnose"] {
        let output = armid(&[command, file, "--robot", "ur5", "--json", result]);
        let told = [
            "What was identified is physically impossible",
            "friction is negative",
            "the other sign",
        ];
        assert_says(&output, 3, &told);
        let result: serde_json::Value =
            serde_json::from_str(&std::fs::read_to_string(&json).unwrap()).unwrap();
        assert_eq!(result["verdict"], "contradicted");
    }
}

/// What was not recorded is no motion that excites too little.
#[test]
fn a_torque_that_never_changes_is_told_by_its_joint() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("log.csv");
    write_log(&file, [0.5; 6], 1000);
    let text = std::fs::read_to_string(&file).unwrap();
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
    // Behind the time six angles and six velocities.
    for (dead, joint) in [(13..19, "joint 1"), (15..16, "joint 3")] {
        std::fs::write(&file, without(dead)).unwrap();
        for task in ["identify", "diagnose"] {
            let output = armid(&[task, file.to_str().unwrap(), "--robot", "ur5"]);
            assert_says(&output, 1, &["log.csv", joint, "0 Nm in every row"]);
        }
    }
}

#[test]
fn usage_errors_of_the_main_job_exit_with_2() {
    assert_says(&montecarlo(&["--trials", "0"]), 2, &["--trials"]);
    assert_says(&montecarlo(&["--threads", "0"]), 2, &["--threads"]);
    assert_says(&montecarlo(&["--shard", "3/3", "--out", "x"]), 2, &["count from 0"]);
    assert_says(&montecarlo(&["--shard", "0/3"]), 2, &["--out"]);
    assert_says(&montecarlo(&["--scenario", "no.toml"]), 1, &["no.toml"]);
    assert_says(&montecarlo(&["merge", "no-folder"]), 1, &["no-folder"]);
}

/// A run of a few trials that have no place to say more than their number.
#[test]
fn the_main_job_writes_what_it_is_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (toml, markdown) = (path("s.toml"), path("mc.md"));
    let scenario = include_str!("../sims/default.toml").replace("periods = 8", "periods = 4");
    std::fs::write(&toml, scenario).unwrap();
    let words = ["--scenario", &toml, "--trials", "3", "--markdown", &markdown];
    assert_says(&montecarlo(&words), 0, &["3 trials with an estimate are too few"]);
    let text = std::fs::read_to_string(&markdown).unwrap();
    assert!(text.contains("## Parameters") && text.contains("| rv1"), "{text}");
    // One trial alone has no summary to write.
    let alone = montecarlo(&["--scenario", &toml, "--trial", "1", "--json", &path("t.json")]);
    assert_says(&alone, 2, &["--json"]);
}

#[test]
fn unknown_keys_of_a_scenario_are_errors_that_name_them() {
    let folder = tempfile::tempdir().unwrap();
    let scenario = folder.path().join("x.toml");
    let default = include_str!("../sims/default.toml");
    std::fs::write(&scenario, default.replace("trials =", "trails =")).unwrap();
    let output = montecarlo(&["--scenario", scenario.to_str().unwrap()]);
    assert_says(&output, 1, &["x.toml", "trails"]);
    // So are things that the plant does not have.
    let effect = "\n[[effect]]\nkind = \"load_friction\"\njoint = 7\nmu = 0.05\n";
    std::fs::write(&scenario, default.to_owned() + effect).unwrap();
    let output = montecarlo(&["--scenario", scenario.to_str().unwrap()]);
    assert_says(&output, 1, &["x.toml: effect 1", "joint = 7"]);
}

/// The simulated arm has no limits; a motion for another one is said to be none for it.
#[test]
fn a_motion_that_is_too_fast_for_its_arm_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let (toml, log) = (path("s.toml"), path("log.csv"));
    let words = ["simulate", "--scenario", &toml, "--out", &log];
    for (robot, said) in [("ur10e", true), ("ur5", false)] {
        let scenario = include_str!("../sims/default.toml")
            .replace("periods = 8", "periods = 1\nrun_in_s = 3.0")
            .replace("robot = \"ur5\"", &format!("robot = \"{robot}\""));
        std::fs::write(&toml, scenario).unwrap();
        let output = armid(&words);
        assert_says(&output, 0, &["samples"]);
        let note = String::from_utf8_lossy(&output.stderr);
        assert_eq!(note.contains("passes the limit of ur10e"), said, "{note}");
    }
}

#[test]
fn a_simulated_log_goes_through_identify_and_the_base_set_is_printed() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let scenario = include_str!("../sims/default.toml").replace("periods = 8", "periods = 4");
    std::fs::write(path("s.toml"), scenario).unwrap();
    let (toml, log, truth, json) =
        (path("s.toml"), path("log.csv"), path("t.json"), path("r.json"));
    let simulate = armid(&["simulate", "--scenario", &toml, "--out", &log, "--truth", &truth]);
    assert_says(&simulate, 0, &["samples"]);
    let report = path("r.html");
    let arguments = ["identify", &log, "--robot", "ur5", "--json", &json, "--report", &report];
    assert_says(&armid(&arguments), 0, &["Identified 52 base parameters"]);
    let read = |file: &str| -> serde_json::Value {
        serde_json::from_str(&std::fs::read_to_string(file).unwrap()).unwrap()
    };
    let (result, truth) = (read(&json), read(&truth));
    // Viscous friction of joint 1 is a base parameter by itself: no combination to compute.
    let of = |list: &serde_json::Value, name: &str| {
        list.as_array().unwrap().iter().find(|p| p["name"] == name).unwrap().clone()
    };
    let estimate = of(&result["base_parameters"], "rv1");
    let true_value = of(&truth["standard_parameters"], "rv1")["value"].as_f64().unwrap();
    let z =
        (estimate["value"].as_f64().unwrap() - true_value) / estimate["sigma"].as_f64().unwrap();
    // Fixed seed; a correct σ exceeds 8 of Student's t with few degrees of freedom once in 1e3.
    assert!(z.abs() < 8.0, "z = {z}");
    assert_eq!(result["processing"]["periods"], 4);
    assert!(std::fs::read_to_string(&report).unwrap().contains("Identified parameters"));

    assert_says(&armid(&["identify", &log, &log, "--robot", "ur5"]), 1, &["are the same log"]);
    // Nor does it become another one by other line ends, or by its second half.
    let text = std::fs::read_to_string(&log).unwrap();
    let rows: Vec<&str> = text.lines().collect();
    let half = [&rows[..1], &rows[rows.len() / 2..]].concat().join("\r\n");
    let copy = path("copy.csv");
    std::fs::write(&copy, half + "\r\n").unwrap();
    assert_says(&armid(&["identify", &log, &copy, "--robot", "ur5"]), 1, &["are the same log"]);
    let validated = armid(&["identify", &log, "--validate", &copy, "--robot", "ur5"]);
    assert_says(&validated, 1, &["or a part of it"]);
    assert_says(
        &armid(&["base", "--robot", "ur5", "--reduced", "paper"]),
        0,
        &["33 base parameters"],
    );
}

/// Another day's log of the same arm: one page, σ from the scatter between the periods of each; and what cannot stand alone.
#[test]
fn several_logs_become_one_estimate_if_each_can_stand_alone() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name).to_str().unwrap().to_owned();
    let scenario = include_str!("../sims/default.toml").replace("periods = 8", "periods = 4");
    std::fs::write(path("s.toml"), &scenario).unwrap();
    let payload = "\n[[effect]]\nkind = \"payload\"\nmass_kg = 0.5\ncom_x_m = 0.0\ncom_y_m = 0.0\ncom_z_m = 0.05\n";
    std::fs::write(path("loaded.toml"), scenario + payload).unwrap();
    let [one, two, loaded] = [("s", "0"), ("s", "1"), ("loaded", "2")].map(|(name, trial)| {
        let (toml, log) = (path(&format!("{name}.toml")), path(&format!("{trial}.csv")));
        let words = ["simulate", "--scenario", &toml, "--out", &log, "--trial", trial];
        assert_says(&armid(&words), 0, &["samples"]);
        log
    });
    let result = |words: &[&str], said: &[&str]| -> serde_json::Value {
        let json = path("r.json");
        let words = [&["identify", "--robot", "ur5", "--json", &json][..], words].concat();
        assert_says(&armid(&words), 0, said);
        serde_json::from_str(&std::fs::read_to_string(json).unwrap()).unwrap()
    };
    let alone = result(&[&one], &[]);
    let page = path("both.html");
    let said = [
        "2 logs with 8 periods in all",
        "the motion repeats",
        "The logs do not contradict each other",
    ];
    let both = result(&[&one, &two, "--report", &page], &said);
    assert!(std::fs::read_to_string(&page).unwrap().contains("Torque along the training log"));
    assert_eq!(both["samples"].as_u64(), Some(2 * alone["samples"].as_u64().unwrap()));
    // The same motion twice: σ falls by √2. Each is known to 1/√(2ν) = 16 %, ν of some 20 per log of 4 periods; that of both
    // shares its scatter, and the median over 52 parameters is off by a fifth at most.
    let sigma = |result: &serde_json::Value| -> Vec<f64> {
        let list = result["base_parameters"].as_array().unwrap();
        list.iter().map(|p| p["sigma"].as_f64().unwrap()).collect()
    };
    let pairs = sigma(&alone).into_iter().zip(sigma(&both));
    let mut ratios: Vec<f64> = pairs.map(|(alone, both)| alone / both).collect();
    ratios.sort_by(f64::total_cmp);
    assert!((ratios[26] / 2f64.sqrt() - 1.0).abs() < 0.2, "{}", ratios[26]);

    // The arm with half a kilogram on its flange is another.
    let said = ["the logs contradict each other", "identify each log alone"];
    let other = result(&[&one, &loaded], &said);
    assert_eq!(other["intervals"]["trusted"], false);
    assert!(other["intervals"]["agreement"]["p_value"].as_f64().unwrap() < 1e-3);

    // What cannot stand alone takes the others along, and it is said why: a log that does not repeat, and one whose periods are
    // the same to the last digit.
    let text = std::fs::read_to_string(&two).unwrap();
    let rows: Vec<&str> = text.lines().collect();
    let run = path("run.csv");
    std::fs::write(&run, rows[..2000].join("\n") + "\n").unwrap();
    let said =
        ["2 logs one below the other", "run.csv cannot stand alone: its motion does not repeat"];
    result(&[&one, &run], &said);
    // Behind the run-in of half a second.
    let tiled = (0..6 * 1250).map(|k| {
        let (_, values) = rows[100 + k % 1250].split_once(',').unwrap();
        format!("\n{:.6},{values}", 0.008 * k as f64)
    });
    let copies = path("copies.csv");
    std::fs::write(&copies, rows[0].to_owned() + &tiled.collect::<String>() + "\n").unwrap();
    result(&[&one, &copies], &["2 logs one below the other", "copies.csv cannot stand alone"]);
    // By itself it is identified all the same, by what its residual says of noise; nothing of it is without a number.
    let said = ["alike to the last digit, and show no noise", "Identified 52"];
    let of_copies = result(&[&copies], &said);
    assert!(sigma(&of_copies).iter().all(|sigma| *sigma > 0.0));
    assert_eq!(of_copies["intervals"]["trusted"], serde_json::Value::Null);
    let words = ["identify", &copies, "--robot", "ur5", "--covariance", "spectral"];
    assert_says(&armid(&words), 1, &["alike to the last digit"]);
    let said = ["2 logs one below the other", "asked for"];
    result(&[&one, &two, "--covariance", "blocks"], &said);
}
