//! A real UR10e diagnosed from its public logs: improvement on runs that were never used, a body on the flange whose
//! mass the authors of the logs weighed, and contacts.
//!
//! Reads the folder named by ARMID_DATA (the public set `dataset_ur10e` of github.com/shamilmamedov/dynamic_calibration
//! below `ur10e/`); if it is not set, the tests print that and pass.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};

use armid::base::{BaseSet, Parameterisation};
use armid::diagnose::{Diagnoser, Diagnosis, Finding, Validation, candidates};
use armid::dynamics::Model;
use armid::identify::{Measurement, Options};
use armid::log::{Layout, Log, read_log, read_log_from};
use armid::robot::{Arm, JointSignals};

use crate::damage::{Sound, few_families};
use crate::real_logs;

type Families = Vec<Box<dyn candidates::Candidate>>;

struct Bench {
    arm: Arm,
    set: BaseSet,
    model: Model,
}

struct Recorded {
    log: Log,
    torque_nm: JointSignals,
    manufacturer_nm: Option<JointSignals>,
}

impl Bench {
    fn new() -> Self {
        let arm = Arm::built_in("ur10e").unwrap();
        let full = Parameterisation::full(arm.dof(), arm.torque_offsets);
        let set = BaseSet::find(&arm, full).unwrap();
        let model = Model::new(&arm);
        Self { arm, set, model }
    }

    fn read(&self, folder: &Path, file: &str) -> Recorded {
        let layout = Layout::load("ur10e_innopolis").unwrap();
        let log = read_log(&folder.join("ur10e").join(file), &layout, 6).unwrap();
        let torque_nm = log.torque_nm(&self.arm).unwrap();
        let manufacturer_nm = log.target_torque_nm(&self.arm).unwrap();
        Recorded { log, torque_nm, manufacturer_nm }
    }

    fn diagnoser(&self) -> Diagnoser<'_> {
        self.diagnoser_with(candidates::all())
    }

    fn diagnoser_with(&self, families: Families) -> Diagnoser<'_> {
        let options = Options::default();
        Diagnoser::with_families(&self.arm, &self.model, &self.set, options, families)
    }
}

impl Recorded {
    fn measurement(&self) -> Measurement<'_> {
        Measurement {
            source: &self.log.source,
            time_s: &self.log.time_s,
            q_rad: &self.log.q_rad,
            qd_rad_s: &self.log.qd_rad_s,
            torque_nm: &self.torque_nm,
        }
    }
}

const TRAINING: &str = "ur-20_02_19_14harm50sec.csv";

fn names(finding: &Finding, kind: &str, joint: usize) -> bool {
    finding.diagnosis.causes.iter().any(|c| c.kind.name() == kind && c.joint == Some(joint))
}

#[test]
fn the_extended_model_predicts_other_days_better_and_the_body_weighs_what_it_weighs() {
    let Some(folder) = real_logs::folder() else { return };
    let bench = Bench::new();
    let training = bench.read(&folder, TRAINING);
    let held_out = [
        "ur-20_02_10-30sec_12harm.csv",
        "ur-20_02_12-50sec_12harm.csv",
        "ur-20_01_17-ptp_10_points.csv",
    ]
    .map(|file| bench.read(&folder, file));
    let validations: Vec<Validation> = held_out
        .iter()
        .map(|log| Validation {
            measurement: log.measurement(),
            manufacturer_nm: log.manufacturer_nm.as_ref(),
        })
        .collect();
    let mut diagnoser = bench.diagnoser();
    let finding = diagnoser.diagnose(&training.measurement(), &validations, None).unwrap();
    for sentence in &finding.diagnosis.sentences {
        println!("{sentence}");
    }
    assert!(names(&finding, "load_friction", 2) && names(&finding, "load_friction", 3));
    assert!((4..=6).all(|j| names(&finding, "presliding", j)));
    assert!(names(&finding, "nonlinear_viscous", 1));
    assert!((1..=6).all(|j| !names(&finding, "asymmetric_friction", j)), "a known trap");
    assert!(!finding.diagnosis.causes.iter().any(|c| c.kind.name() == "time_skew"), "its stand-in");
    // A cause that another one explains better would have been exchanged for it.
    for cause in &finding.diagnosis.causes {
        assert!(cause.confidence > 0.5, "{} {:?}: {}", cause.kind, cause.joint, cause.confidence);
    }
    let ripple = finding.diagnosis.causes.iter().filter(|c| c.kind.name() == "ripple");
    for ripple in ripple {
        // A strain-wave gear of ratio 101 turns its motor 101 times per turn: orders are multiples of that.
        let multiple = ripple.parameters["order_per_turn"].value / 101.0;
        assert!((multiple - multiple.round()).abs() < 0.02, "{:?}", ripple.parameters);
    }

    let logs = &finding.diagnosis.held_out;
    let gain = |j: usize| {
        logs.iter().map(|l| 1.0 - l.after_rms_nm[j] / l.before_rms_nm[j]).sum::<f64>() / 3.0
    };
    let gains: Vec<f64> = (0..6).map(gain).collect();
    println!("error removed per joint, mean of three runs: {gains:.3?}");
    assert!(gains.iter().all(|g| *g >= 0.2), "every joint: {gains:.3?}");
    assert!(gains.iter().sum::<f64>() / 6.0 >= 0.35, "mean of the joints: {gains:.3?}");
    for log in &logs[..2] {
        let manufacturer = log.manufacturer_rms_nm.as_ref().unwrap();
        let pairs = log.after_rms_nm.iter().zip(manufacturer);
        assert!(pairs.into_iter().all(|(a, m)| a < m), "{log:?}");
    }

    let loaded = bench.read(&folder, "ur-20_02_19_14harm50secLoad.csv");
    let mut against = |log: &Recorded| {
        let (reference, other) = (training.measurement(), log.measurement());
        diagnoser.payload(&finding, &reference, &other, Some(2.805)).unwrap()
    };
    let body = against(&loaded);
    println!("{:?}", body.sentences());
    assert!(body.is_named);
    // The controller's gains are trusted to 2 %, and so is the mass.
    assert!((body.mass_kg.value / 2.805 - 1.0).abs() < 0.02, "{:?}", body.mass_kg);
    let bare = against(&held_out[1]);
    assert!(!bare.is_named, "{bare:?}");
    assert!(bare.mass_kg.value.abs() < 0.05, "{:?}", bare.mass_kg);
}

#[test]
fn the_hits_are_found_and_the_free_run_has_none() {
    let Some(folder) = real_logs::folder() else { return };
    let bench = Bench::new();
    let contacts = |file: &str| {
        let log = bench.read(&folder, file);
        let finding = bench.diagnoser().diagnose(&log.measurement(), &[], None).unwrap();
        let Diagnosis { causes, sentences, .. } = finding.diagnosis;
        // The motion hardly excites gravity; that must not raise a doubt about the robot.
        assert!(!sentences.iter().any(|s| s.starts_with("Is this log of")), "{sentences:?}");
        causes.into_iter().filter(|c| c.kind.name() == "contact").collect::<Vec<_>>()
    };
    let hits = contacts("collision_2link.csv");
    for hit in &hits {
        println!("{} {:?}", hit.in_words, hit.parameters["start_s"]);
    }
    assert!(hits.len() >= 8, "{} hits", hits.len());
    assert!(hits.iter().all(|c| c.in_words.contains("joint 1") || c.in_words.contains("joint 2")));
    assert!(contacts("collision_free.csv").is_empty());
}

/// Every file of the folder, and damaged pieces of one, end in a result or in a message. (`damaged_logs.rs` pins the
/// outcome of each damage to a simulated log.)
#[test]
fn no_file_and_no_damage_panics() {
    let Some(folder) = real_logs::folder() else { return };
    let mut files: Vec<PathBuf> = Vec::new();
    let mut folders = vec![folder];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() { folders.push(path) } else { files.push(path) }
        }
    }
    files.sort();
    let bench = Bench::new();
    let small = Arm::built_in("ur5").unwrap();
    let layouts = ["ur10e_innopolis", "armid"].map(|name| Layout::load(name).unwrap());
    let run = |bytes: &[u8], name: &str, layout: &Layout, arm: &Arm, families: Families| {
        let outcome = catch_unwind(AssertUnwindSafe(|| -> Result<(), String> {
            let log = read_log_from(bytes, name, layout, 6).map_err(|e| e.to_string())?;
            let torque_nm = log.torque_nm(arm).map_err(|e| e.to_string())?;
            let m = Measurement {
                source: name,
                time_s: &log.time_s,
                q_rad: &log.q_rad,
                qd_rad_s: &log.qd_rad_s,
                torque_nm: &torque_nm,
            };
            let mut diagnoser = bench.diagnoser_with(families);
            let finding = diagnoser.diagnose(&m, &[], None).map_err(|e| e.to_string())?;
            let numbers = finding.diagnosis.after.rms_nm.iter();
            assert!(numbers.chain(&finding.diagnosis.before.rms_nm).all(|rms| rms.is_finite()));
            Ok(())
        }));
        match outcome {
            Ok(Ok(())) => {}
            Ok(Err(message)) => assert!(message.len() > 10, "{name}: {message}"),
            Err(_) => panic!("{name} with {} panicked", layout.name),
        }
    };
    for path in &files {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let bytes = std::fs::read(path).unwrap();
        // A piece from the middle, where the arm moves: whole files take seconds each.
        let start = bytes.len() / 3;
        let piece = &bytes[start..(start + 150_000).min(bytes.len())];
        for layout in &layouts {
            run(piece, &name, layout, &bench.arm, candidates::all());
        }
    }
    let text =
        std::fs::read_to_string(files.iter().find(|f| f.ends_with(TRAINING)).unwrap()).unwrap();
    let rows: Vec<&str> = text.lines().skip(1000).take(700).collect();
    let sound = Sound { header: "", rows, joints: 6 };
    for (name, text) in sound.damaged() {
        run(text.as_bytes(), name, &layouts[0], &bench.arm, few_families());
    }
    let plain = sound.text();
    run(plain.as_bytes(), "wrong layout", &layouts[1], &bench.arm, few_families());
    run(plain.as_bytes(), "wrong robot", &layouts[0], &small, few_families());
}
