//! Logs that are read differently from how they were recorded: permuted columns, wrong signs or zeros, or an arm that
//! hangs. Each mistake is named, alone and in combination; a log that is read correctly is not called misread, whatever
//! effect its arm hides.

use std::f64::consts::FRAC_PI_2;

use armid::identify::Channels::{All, Motion, Torque};
use armid::identify::{Change, Channels, Identifier, Misreading, Options, Repetition};
use armid::plant::Measured;
use armid::robot::{Arm, JointSignals};
use nalgebra::Vector3;

use crate::cli::{Folder, default_scenario};
use crate::simulated::{Along, NOISE, Run, scenario};

/// A UR5 along some periods of a motion, with hidden `effects`.
fn run(along: Along, effects: &str) -> Run {
    Run::new(scenario(("misread", 5), along, NOISE, effects))
}

/// The misreading of `log` found for `arm`.
fn misreading(run: &Run, arm: &Arm, log: &Measured, options: &Options) -> Option<Misreading> {
    misreading_of_currents(run, arm, log, options, None)
}

fn misreading_of_currents(
    run: &Run,
    arm: &Arm,
    log: &Measured,
    options: &Options,
    gain: Option<&[f64]>,
) -> Option<Misreading> {
    let mut identifier = Identifier::new(&run.model, &run.set, options.clone());
    let regression = identifier.regression(&log.measurement("misread")).unwrap();
    Misreading::of(arm, &regression, options, gain)
}

/// `log` as recorded by a system that deviates from the description of the arm such that reading it correctly requires
/// `change`.
fn recorded(log: &Measured, change: &Change) -> Measured {
    let mut log = log.clone();
    match change {
        Change::Ordered { what, order } => {
            channels(&mut log, *what).into_iter().for_each(|signals| stand_in(signals, order));
        }
        Change::Reversed { what, joint } => {
            channels(&mut log, *what).into_iter().for_each(|signals| signals.reverse(*joint));
        }
        Change::AllTorquesReversed => (0..6).for_each(|j| log.torque_nm.reverse(j)),
        Change::ZeroTurned { joint, add_rad } => {
            log.q_rad.joint_mut(*joint).iter_mut().for_each(|q| *q -= add_rad);
        }
        Change::Mounted { .. } => unreachable!("no channel says how the arm is mounted"),
    }
    log
}

fn channels(log: &mut Measured, what: Channels) -> Vec<&mut JointSignals> {
    let Measured { q_rad, qd_rad_s, torque_nm, .. } = log;
    match what {
        All => vec![q_rad, qd_rad_s, torque_nm],
        Motion => vec![q_rad, qd_rad_s],
        Torque => vec![torque_nm],
    }
}

/// The columns of two joints of a UR5 exchanged.
fn exchanged(what: Channels, joints: [usize; 2]) -> Change {
    Change::exchanged(what, joints, 6)
}

fn reversed(what: Channels, joint: usize) -> Change {
    Change::Reversed { what, joint }
}

/// Moves the signals of each joint to the place that `order` gives it.
fn stand_in(signals: &mut JointSignals, order: &[usize]) {
    let of_the_arm = signals.clone();
    for (j, place) in order.iter().enumerate() {
        signals.joint_mut(*place).copy_from_slice(of_the_arm.joint(j));
    }
}

fn is_named(found: Option<Misreading>, hidden: &[Change]) {
    let found = found.unwrap_or_else(|| panic!("{hidden:?} is not found"));
    assert_eq!(found.changes.len(), hidden.len(), "{hidden:?}: {found:?}");
    assert!(hidden.iter().all(|change| found.changes.contains(change)), "{hidden:?}: {found:?}");
    let sentence = found.sentence();
    assert!(hidden.iter().all(|change| sentence.contains(&change.to_string())), "{sentence}");
}

/// Asserts that exchanged columns of two joints in the log of `run` are named.
pub fn assert_exchange_is_named(run: &Run, joints: [usize; 2]) {
    let hidden = Change::exchanged(All, joints, run.arm.dof());
    let log = recorded(&run.log, &hidden);
    is_named(misreading(run, &run.arm, &log, &run.options), &[hidden]);
}

/// The zero of joint 1 is not among the changes: for an upright arm it is arbitrary, nothing reveals it, and nothing is
/// said about it.
#[test]
fn each_way_to_misread_a_log_is_named() {
    let run = run(("ur5_identification", 4), "");
    let single = Options { repetition: Repetition::Never, ..run.options.clone() };
    for hidden in [
        exchanged(All, [0, 2]),
        exchanged(All, [3, 4]),
        exchanged(Torque, [1, 2]),
        exchanged(Torque, [4, 5]),
        exchanged(Motion, [0, 2]),
        reversed(Torque, 1),
        reversed(Torque, 5),
        Change::AllTorquesReversed,
        reversed(All, 2),
        reversed(Motion, 3),
        Change::ZeroTurned { joint: 1, add_rad: -FRAC_PI_2 },
        Change::ZeroTurned { joint: 2, add_rad: 2.0 * FRAC_PI_2 },
        Change::Ordered { what: All, order: vec![1, 2, 3, 4, 5, 0] },
        Change::Ordered { what: Torque, order: vec![5, 0, 1, 2, 3, 4] },
    ] {
        let log = recorded(&run.log, &hidden);
        let hidden = [hidden];
        is_named(misreading(&run, &run.arm, &log, &run.options), &hidden);
        is_named(misreading(&run, &run.arm, &log, &single), &hidden);
    }
}

/// A current in another joint's column is converted with the gain of that joint and gives a wrong torque.
#[test]
fn currents_have_the_gain_of_the_joint_that_they_are_read_for() {
    let run = run(("ur5_identification", 4), "");
    let gain = [12.0, 9.0, 6.0, 4.0, 3.0, 2.0];
    let scale = |log: &mut Measured, by: &dyn Fn(usize) -> f64| {
        for j in 0..6 {
            log.torque_nm.joint_mut(j).iter_mut().for_each(|value| *value *= by(j));
        }
    };
    let mut in_ampere = run.log.clone();
    scale(&mut in_ampere, &|j| 1.0 / gain[j]);
    for hidden in [exchanged(All, [0, 2]), exchanged(Torque, [1, 3])] {
        let mut log = recorded(&in_ampere, &hidden);
        scale(&mut log, &|j| gain[j]);
        let found = misreading_of_currents(&run, &run.arm, &log, &run.options, Some(&gain));
        let left = found.as_ref().map(|found| found.otherwise.left.clone()).unwrap_or_default();
        assert!(left.iter().all(|share| *share < 0.03), "{left:?}");
        is_named(found, &[hidden]);
    }
}

/// ROS sorts joints by name, and drives may be wired differently: several mistakes occur at once.
#[test]
fn several_ways_at_once_are_named() {
    let run = run(("ur5_validation", 4), "");
    let zero = |joint| Change::ZeroTurned { joint, add_rad: -FRAC_PI_2 };
    for hidden in [
        vec![exchanged(All, [0, 2]), reversed(Torque, 1)],
        vec![zero(1), zero(3)],
        vec![reversed(Torque, 0), reversed(Torque, 3)],
        vec![exchanged(All, [0, 2]), zero(1), zero(3)],
    ] {
        let log = hidden.iter().fold(run.log.clone(), |log, change| recorded(&log, change));
        is_named(misreading(&run, &run.arm, &log, &run.options), &hidden);
    }
}

/// The model fits equally well with one torque reversed as with all others reversed: without friction, only gravity
/// tells which is the case.
#[test]
fn where_there_is_no_friction_gravity_tells_the_sign_of_torques() {
    let run = run(("ur5_identification", 4), "");
    let mut log = run.log.clone();
    for j in 0..6 {
        let qd_rad_s = log.qd_rad_s.joint(j).to_vec();
        let torque_nm = log.torque_nm.joint_mut(j).iter_mut();
        torque_nm.zip(qd_rad_s).for_each(|(nm, qd)| *nm -= run.model.friction(j, qd));
    }
    let single = reversed(Torque, 3);
    for hidden in [vec![single.clone()], vec![Change::AllTorquesReversed, single]] {
        let log = hidden.iter().fold(log.clone(), |log, change| recorded(&log, change));
        is_named(misreading(&run, &run.arm, &log, &run.options), &hidden);
    }
}

#[test]
fn an_arm_that_is_not_mounted_as_described_is_named() {
    let run = run(("ur5_identification", 4), "");
    let wall = Arm { gravity_m_s2: Vector3::new(0.0, 9.81, 0.0), ..run.arm.clone() };
    let found = misreading(&run, &wall, &run.log, &run.options);
    is_named(found, &[Change::Mounted { gravity_m_s2: [0.0, 0.0, -9.81] }]);
}

/// Three encoders that count backwards have the same effect as three reversed torques on an arm that hangs.
#[test]
fn an_arm_is_not_told_to_hang_where_encoders_do_as_well() {
    let run = run(("ur5_identification", 4), "");
    for joints in [[1, 2, 3], [1, 2, 4]] {
        let hidden = joints.map(|joint| reversed(Motion, joint));
        let log = hidden.iter().fold(run.log.clone(), |log, change| recorded(&log, change));
        is_named(misreading(&run, &run.arm, &log, &run.options), &hidden);
    }
}

/// An arm on a pedestal of 45°, as on a humanoid torso.
#[test]
fn an_arm_that_leans_is_named() {
    let tilt =
        "[[effect]]\nkind = \"base_tilt\"\ntilt_x_rad = 0.7853981633974483\ntilt_y_rad = 0.0";
    let run = run(("ur5_identification", 4), tilt);
    let sentence = misreading(&run, &run.arm, &run.log, &run.options).unwrap().sentence();
    assert!(sentence.contains("with gravity_m_s2 = [0.00, -6.94, -6.94] the model"), "{sentence}");
}

/// Physical effects of any size are not a mistake in reading the log: the largest effects of the scenarios, and larger
/// ones.
#[test]
fn a_log_that_is_read_as_it_was_recorded_is_not_called_misread() {
    for effect in [
        "kind = \"payload\"\nmass_kg = 5.0\ncom_x_m = 0.1\ncom_y_m = 0.0\ncom_z_m = 0.1",
        "kind = \"torque_gain\"\njoint = 2\nerror_fraction = -0.5",
        "kind = \"stribeck\"\njoint = 4\nextra_nm = 6.0\nvs_rad_s = 0.1",
        "kind = \"spring\"\njoint = 3\nstiffness_nm_rad = 30.0\nrest_rad = 1.0",
        "kind = \"base_tilt\"\ntilt_x_rad = 0.5\ntilt_y_rad = 0.3",
        "kind = \"encoder_offset\"\njoint = 2\noffset_rad = 0.3",
        "kind = \"elasticity\"\njoint = 2\nstiffness_nm_rad = 3000.0",
    ] {
        let run = run(("ur5_identification", 4), &format!("[[effect]]\n{effect}"));
        let found = misreading(&run, &run.arm, &run.log, &run.options);
        assert_eq!(found, None, "{effect}");
    }
}

/// Reversing the torque of joint 1 would correct the sign of its friction and nothing else: its whole column is wrong.
#[test]
fn a_reading_that_fits_no_better_is_not_named() {
    let run = run(("ur5_identification", 4), "");
    let mut log = run.log.clone();
    let noise = |k: usize| 25.0 * ((k * k % 997) as f64).sin();
    let qd_rad_s = log.qd_rad_s.joint(0).to_vec();
    let rows = log.torque_nm.joint_mut(0).iter_mut().zip(&qd_rad_s).enumerate();
    rows.for_each(|(k, (torque, qd))| *torque = noise(k % 1250) - 8.0 * (qd / 0.02).tanh());
    let found = misreading(&run, &run.arm, &log, &run.options);
    assert_eq!(found, None);
}

/// A torque unrelated to the motion fits no arm, however it is read.
#[test]
fn torque_that_is_none_is_not_called_misread() {
    let run = run(("ur5_identification", 4), "");
    let mut log = run.log.clone();
    for j in 0..6 {
        let rows = log.torque_nm.joint_mut(j).iter_mut().enumerate();
        rows.for_each(|(k, torque)| *torque = ((k * (2 * j + 3)) as f64).sin());
    }
    assert_eq!(misreading(&run, &run.arm, &log, &run.options), None);
}

/// From a user's view: both commands say what is wrong, and the layout they print corrects it.
#[test]
fn a_layout_puts_a_misread_log_right() {
    let folder = Folder::empty();
    folder.write("mine.toml", default_scenario(4));
    folder.armid("simulate --scenario mine.toml --out log.csv").says(0, &[]);
    let of = |columns: &str, joints: &str| {
        format!(
            "name = \"mine\"\nheader = true\n{joints}\n[columns]\ntime = \"timestamp\"\n{columns}"
        )
    };
    let order = |what: &str, order: [usize; 6]| {
        format!("[{}]", order.map(|j| format!("\"actual_{what}_{j}\"")).join(", "))
    };
    let columns = |o: [usize; 6]| {
        let [q, qd, torque] = ["q", "qd", "torque"].map(|what| order(what, o));
        format!("q = {q}\nqd = {qd}\ntorque = {torque}\n")
    };
    let as_it_is = columns([0, 1, 2, 3, 4, 5]);
    folder.write("right.toml", of(&as_it_is, ""));
    folder.write("sorted.toml", of(&columns([2, 1, 0, 3, 4, 5]), ""));
    let turned = "joints = { motion_reversed = [3], torque_reversed = [3], zero = [0, 1.5707963267948966, 0, 0, 0, 0] }";
    folder.write("turned.toml", of(&as_it_is, turned));
    folder.armid("identify log.csv --robot ur5 --layout right.toml").says(0, &["Identified 52"]);
    let identify = "identify log.csv --robot ur5 --json result.json --report page.html --layout";
    let exchanged = ["columns of joints 1 and 3 exchanged", "--layout"];
    folder.armid(&format!("{identify} sorted.toml")).says(3, &exchanged);
    let result = folder.result("result.json");
    assert_eq!(result["verdict"], "contradicted");
    assert_eq!(result["misreading"]["changes"][0]["kind"], "joints_exchanged");
    assert_eq!(result["misreading"]["changes"][0]["joints"], serde_json::json!([1, 3]));
    assert!(folder.read("page.html").contains(exchanged[0]));
    let reads_it = |result: &serde_json::Value| {
        let lines = result["misreading"]["layout"].as_str().unwrap();
        folder.write("mended.toml", lines);
        folder
            .armid("identify log.csv --robot ur5 --layout mended.toml")
            .says(0, &["Identified 52"]);
        lines.to_owned()
    };
    let lines = reads_it(&result);
    assert!(lines.contains("order = [3, 2, 1, 4, 5, 6]"), "{lines}");
    let diagnose = "diagnose log.csv --robot ur5 --json why.json --layout";
    folder.armid(&format!("{diagnose} sorted.toml")).says(3, &["declined", exchanged[0]]);
    let why = folder.result("why.json");
    assert_eq!((&why["verdict"], &why["causes"]), (&"declined".into(), &serde_json::json!([])));
    assert_eq!(why["misreading"]["changes"], result["misreading"]["changes"]);
    let said = [
        "angle, velocity and torque of joint 3 reversed",
        "-90° added to the angle of joint 2",
        "[joints]",
    ];
    folder.armid(&format!("{identify} turned.toml")).says(3, &said);
    reads_it(&folder.result("result.json"));
}

/// One layout reads both logs, but the second was recorded differently; the message says which log it is.
#[test]
fn of_two_logs_the_one_that_is_misread_is_named() {
    let folder = Folder::empty();
    folder.write("mine.toml", default_scenario(4));
    folder.armid("simulate --scenario mine.toml --out first.csv").says(0, &[]);
    folder.armid("simulate --scenario mine.toml --trial 1 --out other.csv").says(0, &[]);
    let mut other = folder.read("other.csv").replacen("actual_torque_1,", "second,", 1);
    other = other.replacen("actual_torque_2,", "actual_torque_1,", 1);
    folder.write("other.csv", other.replacen("second,", "actual_torque_2,", 1));
    let said = "other.csv: The log is not read as it was recorded: with the torques of joints 2 and 3 exchanged";
    let words = "identify first.csv other.csv --robot ur5 --json both.json";
    folder.armid(words).says(3, &[said]);
    assert_eq!(folder.result("both.json")["misreading"]["log"], "other.csv");
    // Validation and held-out logs are examined as well.
    folder.armid("identify first.csv --validate other.csv --robot ur5").says(0, &[said]);
    folder.armid("diagnose first.csv --held-out other.csv --robot ur5").says(0, &[said]);
    let declined = "other.csv: declined. The log is not read as it was recorded";
    folder.armid("diagnose first.csv other.csv --robot ur5").complains(3, &[declined]);
}

/// Torques from another time: no way of reading them fits, and the parameters contradict the arm whether the log ends
/// with a line end or without, which leaves one row less and another realisation of the noise.
#[test]
fn a_log_that_is_of_no_arm_is_questioned() {
    let folder = Folder::empty();
    folder.write("mine.toml", default_scenario(4));
    folder.armid("simulate --scenario mine.toml --out log.csv").says(0, &[]);
    let text = folder.read("log.csv");
    let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
    let (header, rows) = rows.split_first().unwrap();
    let torque = header.iter().position(|name| *name == "actual_torque_0").unwrap();
    let later = |k: usize| &rows[(k + 300) % rows.len()][torque..torque + 6];
    let shifted = rows
        .iter()
        .enumerate()
        .map(|(k, row)| [&row[..torque], later(k), &row[torque + 6..]].concat().join(","));
    let lines: Vec<String> = [header.join(",")].into_iter().chain(shifted).collect();
    folder.write("log.csv", lines.join("\n"));
    let question = "Is this log of ur5, and read as it was recorded?";
    let words = "identify log.csv --robot ur5 --json result.json";
    folder.armid(words).says(3, &[question]);
    assert_eq!(folder.result("result.json")["verdict"], "contradicted");
    folder.armid("diagnose log.csv --robot ur5").says(3, &[question]);
    folder.write("log.csv", lines.join("\n") + "\n");
    folder.armid("identify log.csv --robot ur5").says(3, &[question]);
}
