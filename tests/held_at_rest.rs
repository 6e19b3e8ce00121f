//! Joints that stick between their moves: `identify` leaves their pauses out and gets the weight of the arm right, and
//! `diagnose` names every one of them, also beside an error of the model that is as large.

use std::ops::RangeInclusive;

use armid::diagnose::{Diagnosis, Kind};
use armid::dynamics::Model;
use armid::identify::{Identification, Identifier, Options, Repetition};
use armid::montecarlo::Simulation;

use crate::cli::Folder;
use crate::simulated::{NOISE, Run, assert_holds, scenario, simulation};

const MOVES: &str = "trajectories/ur5_moves_trapezoidal.json";
/// Bristles of joints 2 and 3 that turn round within a twentieth of a milliradian.
const STICK: &str = "[[effect]]\nkind = \"presliding\"\njoint = 2\nstiffness_per_rad = 20000.0\n\
                     [[effect]]\nkind = \"presliding\"\njoint = 3\nstiffness_per_rad = 20000.0\n";
const SPRING: &str =
    "[[effect]]\nkind = \"spring\"\njoint = 2\nstiffness_nm_rad = 40.0\nrest_rad = -0.5\n";
/// Drives that feed half of friction forward, so that joints come to rest with more of it to hold.
const DRIVES: &str = "[plant]\nfriction_feedforward = 0.5\n";

fn logs(effects: &str) -> Simulation {
    simulation(scenario(("held", 5), (MOVES, 6), NOISE, &format!("{effects}{DRIVES}")))
}

fn identified(simulation: &Simulation, repetition: Repetition) -> Identification {
    let scenario = &simulation.scenario;
    let model = Model::new(&scenario.arm);
    let log = simulation.log(0).unwrap();
    let options = Options { repetition, ..scenario.processing.clone() };
    let mut identifier = Identifier::new(&model, &scenario.set, options);
    identifier.identify(&log.measurement("held")).unwrap()
}

fn diagnosed(simulation: &Simulation) -> Diagnosis {
    let run = Run::of(simulation, 0);
    run.diagnoser().diagnose(&run.log.measurement("held"), &[], None).unwrap().diagnosis
}

/// Of the log as it is read by `repetition`, joints 2 and 3 are told to stick in this many pauses each, and the first
/// moments of links 2 and 3 and of what they carry are within 5 σ of the truth.
fn assert_weighed(repetition: Repetition, pauses: RangeInclusive<usize>) {
    let simulation = logs(STICK);
    let found = identified(&simulation, repetition);
    let joints: Vec<usize> = found.held_at_rest.iter().map(|held| held.joint).collect();
    assert_eq!(joints, [1, 2]);
    for held in &found.held_at_rest {
        let count = held.pauses.len();
        assert!(pauses.contains(&count), "joint {} pauses {count} times", held.joint + 1);
    }
    let set = &simulation.scenario.set;
    let truth = set.values(&Model::new(&simulation.scenario.arm).standard_parameters());
    let sigma = found.sigma();
    for name in ["mx2", "mx3"] {
        let k = (0..set.rank()).find(|k| set.name(*k) == name).expect("a base parameter");
        let off = (found.fit.theta[k] - truth[k]) / sigma[k];
        println!("{name}: {} for {}, {off:.1} σ", found.fit.theta[k], truth[k]);
        assert!(off.abs() < 5.0, "{name} is {off:.1} σ off");
    }
}

/// A pause behind each of six moves. With friction at rest taken for zero, the moments were 100 and 250 σ off, a quarter of
/// their size.
#[test]
fn pauses_in_which_joints_stick_are_no_weight() {
    assert_weighed(Repetition::Found, 6..=6);
}

/// The same log as a single run. Most of the pause behind the 36th move is cut off with the end of the log; what is left of it may
/// be long enough to count. With friction at rest taken for zero, the first moment of link 2 was 22 σ off.
#[test]
fn pauses_of_a_single_run_are_no_weight() {
    assert_weighed(Repetition::Never, 35..=36);
}

#[test]
fn every_joint_that_sticks_is_named() {
    let d = diagnosed(&logs(STICK));
    let mut named: Vec<_> = d.causes.iter().map(|c| (c.kind, c.joint, c.form)).collect();
    named.sort_by_key(|(_, joint, _)| *joint);
    let held = |joint: usize| (Kind::Presliding, Some(joint), Some("held at rest"));
    assert_eq!(named, [held(2), held(3)], "{:#?}", d.sentences);
    assert!(d.unexplained.is_none(), "{:#?}", d.sentences);
    for cause in &d.causes {
        assert_holds(cause, "coulomb_nm", if cause.joint == Some(2) { 8.0 } else { 6.0 });
    }
}

/// The same log as a single run, of which no row at rest is tested: the joints are told, but not as a cause.
#[test]
fn a_single_run_tells_which_joints_stick_and_names_nothing() {
    let mut run = Run::of(&logs(STICK), 0);
    run.options.repetition = Repetition::Never;
    let d = run.diagnoser().diagnose(&run.log.measurement("held"), &[], None).unwrap().diagnosis;
    assert!(d.causes.is_empty() && d.unexplained.is_none(), "{:#?}", d.sentences);
    let told = "friction is held in pauses: joint 2 (";
    assert!(d.warnings.iter().any(|warning| warning.contains(told)), "{:#?}", d.warnings);
}

/// A spring that pulls as hard as friction holds: in the pauses alone, neither is told from the other.
#[test]
fn a_spring_beside_friction_at_rest_is_named_with_its_size() {
    let d = diagnosed(&logs(&format!("{STICK}{SPRING}")));
    let mut named: Vec<_> = d.causes.iter().map(|c| (c.joint, c.kind.to_string())).collect();
    named.sort();
    let expected = [(2, "presliding"), (2, "spring"), (3, "presliding")];
    let expected = expected.map(|(joint, kind)| (Some(joint), kind.to_owned()));
    assert_eq!(named, expected, "{:#?}", d.sentences);
    let spring = d.causes.iter().find(|c| c.kind == Kind::Spring).expect("a spring");
    assert_holds(spring, "stiffness_nm_rad", 40.0);
    assert_holds(spring, "rest_rad", -0.5);
}

/// The spring alone holds nothing.
#[test]
fn a_spring_is_no_friction_at_rest() {
    let simulation = logs(SPRING);
    for repetition in [Repetition::Found, Repetition::Never] {
        assert!(identified(&simulation, repetition).held_at_rest.is_empty());
    }
    let d = diagnosed(&simulation);
    let [cause] = &d.causes[..] else { panic!("{:#?}", d.sentences) };
    assert_eq!((cause.kind, cause.joint), (Kind::Spring, Some(2)));
}

#[test]
fn a_user_is_told_which_joints_stick() {
    let folder = Folder::empty();
    let moves = std::fs::canonicalize(MOVES).unwrap();
    let told = "friction is held in pauses: joint 2 (";
    for (name, effects) in [("clean", ""), ("stick", STICK)] {
        let scenario = format!(
            "name = \"{name}\"\nrobot = \"ur5\"\nseed = 3\ntrials = 1\n[motion]\ntrajectory = {moves:?}\n\
             periods = 6\n[sensors]\n{NOISE}{effects}{DRIVES}"
        );
        folder.write(&format!("{name}.toml"), scenario);
        folder.armid(&format!("simulate --scenario {name}.toml --out {name}.csv")).says(0, &[]);
        let words =
            format!("identify {name}.csv --robot ur5 --json {name}.json --report {name}.html");
        let said = folder.armid(&words).says(0, &["Identified 52"]);
        let sticks = name == "stick";
        assert_eq!(said.contains(told), sticks, "{said}");
        assert_eq!(folder.read(&format!("{name}.html")).contains(told), sticks);
        let result = folder.result(&format!("{name}.json"));
        let held = result["held_at_rest"].as_array().unwrap();
        let joints: Vec<u64> = held.iter().map(|held| held["joint"].as_u64().unwrap()).collect();
        assert_eq!(joints, if sticks { vec![2, 3] } else { vec![] });
        for held in held {
            let [nm, share] = ["held_nm", "share"].map(|key| held[key].as_f64().unwrap());
            assert!(nm > 1.0 && (0.3..0.6).contains(&share) && held["pauses"] == 6, "{held}");
        }
    }
}
