//! `armid` and `montecarlo` as a user runs them on simulated logs: what they write, and what they tell about a log, its
//! processing and its estimate.

use serde_json::Value;

use crate::cli::{Folder, default_scenario};

/// Joint 1 of this arm turns too fast for a sample per second. It does not rest: a higher rate is all it takes.
#[test]
fn a_rate_too_low_for_the_motion_is_not_called_rest() {
    let folder = Folder::empty();
    folder.write("s.toml", default_scenario(7));
    folder.armid("simulate --scenario s.toml --out run.csv").says(0, &["samples"]);
    let lost =
        ["Declined", "At 1.00 Hz (--rate) less than half of the motion of joint 1", "or none"];
    let told = folder.armid("identify run.csv --robot ur5 --rate 1").says(3, &lost);
    assert!(!told.contains("not move") && !told.contains("Record a motion"), "{told}");
    // Fewer samples than any experiment has, whether a period is looked for or not.
    for options in ["--rate 0.5", "--rate 0.5 --period 0"] {
        let words = format!("identify run.csv --robot ur5 {options}");
        folder.armid(&words).says(1, &["run.csv: in samples at 0.5 Hz (--rate) the motion"]);
    }
    // The options may also be the reason where all joints seem to move: of what stays open, and of what is not explained.
    let of_rate = |hz: &str| format!("--rate lowered the rate from 125 Hz to {hz} Hz");
    let first = format!("{}: leave that out first", of_rate("2.00"));
    folder.armid("identify run.csv --robot ur5 --rate 2").says(3, &["Declined", &first]);
    let alone = format!("{}, which can be the whole cause: leave that out", of_rate("4.00"));
    folder.armid("identify run.csv --robot ur5 --rate 4").says(0, &["not to be trusted", &alone]);
    for (cutoff, code, named) in [("0.15", 3, "0.150"), ("0.5", 0, "0.500")] {
        let lowered = format!("the cut-off of the low-pass from 10.0 Hz to {named} Hz: leave that");
        let words = format!("identify run.csv --robot ur5 --period 0 --cutoff {cutoff}");
        folder.armid(&words).says(code, &[&lowered]);
    }
}

/// Logs of several days often have the same name, in folders of their own.
#[test]
fn validation_logs_of_one_name_are_told_by_their_folders() {
    let folder = Folder::empty();
    folder.write("s.toml", default_scenario(2));
    for trial in 0..3 {
        let words = format!("simulate --scenario s.toml --trial {trial} --out {trial}.csv");
        folder.armid(&words).says(0, &["samples"]);
    }
    folder.write("a/run.csv", folder.read("1.csv"));
    folder.write("b/run.csv", folder.read("2.csv"));
    let words = "identify 0.csv --robot ur5 --report r.html --validate a/run.csv b/run.csv";
    folder.armid(words).says(0, &["a/run: prediction", "b/run: prediction"]);
    assert!(!folder.read("r.html").contains("Validation on run"));
}

/// Value and σ of each base parameter that `armid identify` finds in `log`, a file with options behind it.
fn identified(folder: &Folder, log: &str, said: &[&str]) -> Vec<[f64; 2]> {
    folder.armid(&format!("identify {log} --robot ur5 --json r.json")).says(0, said);
    let parameters = folder.result("r.json")["base_parameters"].clone();
    let value = |p: &Value| ["value", "sigma"].map(|key| p[key].as_f64().unwrap());
    parameters.as_array().unwrap().iter().map(value).collect()
}

/// Velocities that come late, and a clock that stands still while the arm moves on, are corrected and told. Along a
/// single run, whose accelerations are the derivatives of the velocities, 3 ms shift inertias by more than 20 σ.
#[test]
fn what_the_record_does_to_a_log_is_corrected() {
    let folder = Folder::empty();
    let scenario = default_scenario(4);
    for (name, effect) in [
        ("run", ""),
        ("late", "[[effect]]\nkind = \"velocity_lag\"\ndelay_s = 0.003\n"),
        (
            "stale",
            "[[effect]]\nkind = \"velocity_lag\"\ndelay_s = 0.003\n[[effect]]\nkind = \"dropped_samples\"\nfraction = 0.01\nrepeat = true\n",
        ),
        ("slow", "[[effect]]\nkind = \"clock_fault\"\nevery_rows = 400\nlost_s = 0.02\n"),
    ] {
        folder.write(&format!("{name}.toml"), format!("{scenario}\n{effect}"));
        let words = format!("simulate --scenario {name}.toml --out {name}.csv");
        folder.armid(&words).says(0, &["samples"]);
    }
    let run = identified(&folder, "run.csv --period 0", &[]);
    for name in ["late", "stale"] {
        let said = [&*format!("{name}.csv: The velocities of all joints come 3.0")];
        let late = identified(&folder, &format!("{name}.csv --period 0"), &said);
        for ([value, sigma], [again, _]) in run.iter().zip(late) {
            // The logs differ by the noise of their velocities, which is a part of σ, and by that of one row in a
            // hundred.
            assert!((again - value).abs() < *sigma, "{name}: {value} and {again} ± {sigma}");
        }
    }
    let said = ["slow.csv: The record has time that passed", "This is corrected"];
    identified(&folder, "slow.csv", &said);
}

/// A single wild reading is replaced and told; it neither moves the estimate nor widens its intervals.
#[test]
fn a_wild_torque_reading_does_no_harm() {
    let folder = Folder::empty();
    folder.write("s.toml", default_scenario(4));
    folder.armid("simulate --scenario s.toml --out run.csv").says(0, &["samples"]);
    let mut rows: Vec<String> = folder.read("run.csv").lines().map(str::to_owned).collect();
    let column = rows[0].split(',').position(|name| name == "actual_torque_1").unwrap();
    let mut wild: Vec<&str> = rows[2000].split(',').collect();
    wild[column] = "20000.0";
    rows[2000] = wild.join(",");
    folder.write("wild.csv", rows.join("\n") + "\n");
    let clean = identified(&folder, "run.csv", &[]);
    let said = ["1 single value of the torque of joint 2", "Identified 52"];
    let mended = identified(&folder, "wild.csv", &said);
    for ([value, sigma], [again, sigma_again]) in clean.into_iter().zip(mended) {
        // The median of its neighbours is off from the reading by about σ of the noise. One of 5000 rows moves a
        // parameter by σ/√5000 = 0.014 of its own σ, and one with fifty times the usual weight by 0.1.
        assert!((again - value).abs() < 0.1 * sigma, "{value} and {again} ± {sigma}");
        assert!((sigma_again / sigma - 1.0).abs() < 0.02, "{sigma} and {sigma_again}");
    }
}

/// A run with too few trials for a verdict; it reports their number.
#[test]
fn the_main_job_writes_what_it_is_asked_for() {
    let folder = Folder::empty();
    folder.write("s.toml", default_scenario(4));
    let words = "--scenario s.toml --trials 3 --markdown mc.md --json mc.json";
    folder.montecarlo(words).says(0, &["3 trials with an estimate are too few"]);
    let text = folder.read("mc.md");
    assert!(text.contains("## Parameters") && text.contains("| rv1"), "{text}");
    assert_eq!(folder.result("mc.json")["trials"], 3);
    // A single trial has no summary to write.
    let alone = folder.montecarlo("--scenario s.toml --trial 1 --json t.json");
    alone.says(2, &["--json"]);
}

/// One period of `robot` with a run-in of one second: a longer run-in would move joint 3 of a UR5 past its limit.
fn one_period(robot: &str) -> String {
    let scenario = default_scenario(1).replace("\n[sensors]", "run_in_s = 1.0\n\n[sensors]");
    scenario.replace("robot = \"ur5\"", &format!("robot = \"{robot}\""))
}

/// Nothing stops the simulated arm at a limit of position, speed or acceleration, so a motion designed for another arm
/// is reported as exceeding the limits.
#[test]
fn a_motion_that_is_too_fast_for_its_arm_is_told() {
    let folder = Folder::empty();
    for (robot, said) in [("ur10e", true), ("ur5", false)] {
        folder.write("s.toml", one_period(robot));
        let output = folder.armid("simulate --scenario s.toml --out log.csv");
        output.says(0, &["samples"]);
        let note = output.stderr;
        assert_eq!(note.contains("passes the limit of"), said, "{note}");
        assert_eq!(note.contains("passes the limit of ur10e"), said, "{note}");
        assert_eq!(note.contains("nothing stops the simulated arm there"), said, "{note}");
    }
}

/// How a log is read and processed: each option shows in the result, and each wrong value is named in an error.
#[test]
fn what_is_chosen_of_the_processing_is_what_is_done() {
    let folder = Folder::empty();
    folder.write("s.toml", one_period("ur5"));
    folder.armid("simulate --scenario s.toml --out log.csv").says(0, &["samples"]);
    // The torques are read as currents of drives with 2 Nm/A.
    let layout = "name = \"mine\"\nheader = true\ndrive_gain_nm_a = [2, 2, 2, 2, 2, 2]\n\
                  [columns]\ntime = \"timestamp\"\nq = \"actual_q_{0}\"\n\
                  qd = \"actual_qd_{0}\"\ncurrent = \"actual_torque_{0}\"\n";
    folder.write("mine.toml", layout);
    folder.write("other.toml", layout.replace("actual_q_", "angle_"));
    let identified = |options: &str| {
        let words = format!("identify log.csv --robot ur5 --json r.json {options}");
        folder.armid(&words).says(0, &["Identified 52"]);
        folder.result("r.json")
    };
    let done = |result: &Value, cutoff_hz: f64, rate_hz: f64, estimator: &str| {
        let processing = &result["processing"];
        assert_eq!(processing["cutoff_hz"], cutoff_hz, "{processing}");
        assert_eq!(processing["rate_hz"], rate_hz, "{processing}");
        assert_eq!(processing["resampled"], rate_hz != 125.0, "{processing}");
        assert_eq!(result["estimator"], estimator);
    };
    done(&identified(""), 10.0, 125.0, "wls");
    let narrower = folder.armid("identify log.csv --robot ur5 --cutoff 2.5");
    narrower.says(0, &["low-passed at 2.50 Hz"]);
    let options = "--cutoff 5 --rate 100 --estimator ols";
    let chosen = identified(options);
    done(&chosen, 5.0, 100.0, "ols");
    let doubled = identified(&format!("{options} --layout mine.toml"));
    assert_eq!(doubled["program"]["inputs"][0]["path"], "mine.toml");
    let values = |result: &Value| -> Vec<f64> {
        let list = result["base_parameters"].as_array().unwrap();
        list.iter().map(|p| p["value"].as_f64().unwrap()).collect()
    };
    for (one, two) in values(&chosen).into_iter().zip(values(&doubled)) {
        assert!((two / one - 2.0).abs() < 1e-9, "{one} and {two}");
    }

    for (options, code, expected) in [
        ("--layout no.toml", 1, "no.toml"),
        ("--layout none", 1, "unknown layout \"none\""),
        ("--layout other.toml", 1, "no column \"angle_0\", which the layout \"mine\" needs"),
        ("--cutoff 0", 1, "--cutoff 0"),
        ("--cutoff 50 --rate 100", 1, "at 50 Hz (--cutoff), which has to be below half of"),
        ("--rate inf", 1, "--rate inf"),
        ("--rate 1e9", 1, "a rate of 1000000000 Hz is more than can be made"),
        ("--estimator best", 2, "'best' for '--estimator"),
    ] {
        let words = format!("identify log.csv --robot ur5 {options}");
        folder.armid(&words).complains(code, &[expected]);
    }
}

#[test]
fn a_simulated_log_goes_through_identify_and_the_base_set_is_printed() {
    let folder = Folder::empty();
    folder.write("s.toml", default_scenario(4));
    let words = "simulate --scenario s.toml --out log.csv --truth t.json";
    folder.armid(words).says(0, &["samples"]);
    let words = "identify log.csv --robot ur5 --json r.json --report r.html";
    folder.armid(words).says(0, &["Identified 52 base parameters"]);
    let (result, truth) = (folder.result("r.json"), folder.result("t.json"));
    // Viscous friction of joint 1 is a base parameter of its own: no combination has to be computed.
    let of = |list: &Value, name: &str| {
        list.as_array().unwrap().iter().find(|p| p["name"] == name).unwrap().clone()
    };
    let estimate = of(&result["base_parameters"], "rv1");
    let true_value = of(&truth["standard_parameters"], "rv1")["value"].as_f64().unwrap();
    let z =
        (estimate["value"].as_f64().unwrap() - true_value) / estimate["sigma"].as_f64().unwrap();
    // Fixed seed. With a correct σ, |z| exceeds 8 for Student's t with few degrees of freedom once in 1e3.
    assert!(z.abs() < 8.0, "z = {z}");
    assert_eq!(result["processing"]["periods"], 4);
    assert!(folder.read("r.html").contains("Identified parameters"));

    folder.armid("identify log.csv log.csv --robot ur5").says(1, &["are the same log"]);
    // Other line ends, or only its second half, do not make it another log.
    let text = folder.read("log.csv");
    let rows: Vec<&str> = text.lines().collect();
    let half = [&rows[..1], &rows[rows.len() / 2..]].concat().join("\r\n");
    folder.write("copy.csv", half + "\r\n");
    folder.armid("identify log.csv copy.csv --robot ur5").says(1, &["are the same log"]);
    let validated = folder.armid("identify log.csv --validate copy.csv --robot ur5");
    validated.says(1, &["or a part of it"]);
    let words = "base --robot ur5 --reduced paper --json base.json";
    folder.armid(words).says(0, &["33 base parameters"]);
    assert_eq!(folder.result("base.json")["rank"], 33);
}

/// Two logs of the same arm give one page, with σ from the scatter between the periods of each. Logs that cannot stand
/// alone are pooled.
#[test]
fn several_logs_become_one_estimate_if_each_can_stand_alone() {
    let folder = Folder::empty();
    let scenario = default_scenario(4);
    folder.write("s.toml", &scenario);
    let payload = "\n[[effect]]\nkind = \"payload\"\nmass_kg = 0.5\ncom_x_m = 0.0\ncom_y_m = 0.0\ncom_z_m = 0.05\n";
    folder.write("loaded.toml", scenario + payload);
    for words in
        ["s.toml --out 0.csv", "s.toml --out 1.csv --trial 1", "loaded.toml --out 2.csv --trial 2"]
    {
        folder.armid(&format!("simulate --scenario {words}")).says(0, &["samples"]);
    }
    let result = |words: &str, said: &[&str]| {
        folder.armid(&format!("identify --robot ur5 --json r.json {words}")).says(0, said);
        folder.result("r.json")
    };
    let alone = result("0.csv", &[]);
    let said = [
        "2 logs with 8 periods in all",
        "the motion repeats",
        "The logs do not contradict each other",
    ];
    let both = result("0.csv 1.csv --report both.html", &said);
    assert!(folder.read("both.html").contains("Torque along the training log"));
    assert_eq!(both["samples"].as_u64(), Some(2 * alone["samples"].as_u64().unwrap()));
    // The same motion twice: σ falls by √2. Each σ is known to 1/√(2ν) = 16 %, with ν of about 20 per log of 4 periods.
    // The σ of both logs shares part of that error, and the median over 52 parameters is off by at most a fifth.
    let sigma = |result: &Value| -> Vec<f64> {
        let list = result["base_parameters"].as_array().unwrap();
        list.iter().map(|p| p["sigma"].as_f64().unwrap()).collect()
    };
    let pairs = sigma(&alone).into_iter().zip(sigma(&both));
    let mut ratios: Vec<f64> = pairs.map(|(alone, both)| alone / both).collect();
    ratios.sort_by(f64::total_cmp);
    assert!((ratios[26] / 2f64.sqrt() - 1.0).abs() < 0.2, "{}", ratios[26]);

    // With half a kilogram on its flange, the arm is another arm.
    let said = ["the logs contradict each other", "identify each log alone"];
    let other = result("0.csv 2.csv", &said);
    assert_eq!(other["intervals"]["trusted"], false);
    assert!(other["intervals"]["agreement"]["p_value"].as_f64().unwrap() < 1e-3);

    // A log that cannot stand alone makes all logs count as single runs, and the reason is reported: a log that does
    // not repeat, and one whose periods are identical to the last digit.
    let text = folder.read("1.csv");
    let rows: Vec<&str> = text.lines().collect();
    folder.write("run.csv", rows[..2000].join("\n") + "\n");
    let said =
        ["2 logs one below the other", "run.csv cannot stand alone: its motion does not repeat"];
    let estimates = |result: &Value| -> Vec<f64> {
        let list = result["base_parameters"].as_array().unwrap();
        list.iter().map(|p| p["value"].as_f64().unwrap()).collect()
    };
    let one_way = result("0.csv run.csv --cutoff 5", &said);
    // All rows are filtered then, whichever log comes first.
    let other_way = result("run.csv 0.csv --cutoff 5", &["2 logs one below the other"]);
    for processing in [&one_way["processing"], &other_way["processing"]] {
        assert_eq!(processing["cutoff_hz"], 5.0);
        assert_eq!(processing["period_s"], Value::Null);
    }
    let both_ways = estimates(&one_way).into_iter().zip(estimates(&other_way));
    let off = both_ways.zip(sigma(&one_way)).map(|((a, b), sigma)| (a - b).abs() / sigma);
    assert!(off.fold(0.0, f64::max) < 1e-3);
    // The copied rows begin after the run-in of half a second.
    let tiled = (0..6 * 1250).map(|k| {
        let (_, values) = rows[100 + k % 1250].split_once(',').unwrap();
        format!("\n{:.6},{values}", 0.008 * k as f64)
    });
    folder.write("copies.csv", rows[0].to_owned() + &tiled.collect::<String>() + "\n");
    result("0.csv copies.csv", &["2 logs one below the other", "copies.csv cannot stand alone"]);
    // Alone, this log is still identified, with the noise estimated from its residual; no parameter lacks σ.
    let said = ["alike to the last digit, and show no noise", "Identified 52"];
    let of_copies = result("copies.csv", &said);
    // A copy tells nothing new: σ is that of three copies, whose blocks of time are the same. Only the weights of the
    // joints differ, by up to 0.7 %: the squares of their residuals are divided by the rows less up to 52 parameters.
    let three: Vec<String> =
        folder.read("copies.csv").lines().take(1 + 3 * 1250).map(str::to_owned).collect();
    folder.write("three.csv", three.join("\n") + "\n");
    let pairs = sigma(&of_copies).into_iter().zip(sigma(&result("three.csv", &said)));
    pairs.for_each(|(six, three)| assert!((six / three - 1.0).abs() < 0.007, "{six} and {three}"));
    assert!(sigma(&of_copies).iter().all(|sigma| *sigma > 0.0));
    assert_eq!(of_copies["intervals"]["trusted"], Value::Null);
    let words = "identify copies.csv --robot ur5 --covariance spectral";
    folder.armid(words).says(1, &["alike to the last digit"]);
    let said = ["2 logs one below the other", "asked for"];
    result("0.csv 1.csv --covariance blocks", &said);
}

/// A soft gear with the encoder on its link makes the drive unstable: the log is written, and a note says what it is.
#[test]
fn an_arm_that_does_not_follow_its_motion_is_told() {
    let folder = Folder::empty();
    let gear = "[[effect]]\nkind = \"elasticity\"\njoint = 3\nstiffness_nm_rad = 15000.0\nencoder = \"link\"\n";
    folder.write("s.toml", format!("{}\n{gear}", default_scenario(1)));
    let told = ["the arm does not follow its motion", "joint 3 by"];
    folder.armid("simulate --scenario s.toml --out log.csv").complains(0, &told);
    folder.write("firm.toml", default_scenario(1));
    let firm = folder.armid("simulate --scenario firm.toml --out log.csv");
    assert!(!firm.stderr.contains("does not follow"), "{}", firm.stderr);
}
