//! Diagnoses of logs of 6 periods in which effects of the plant are hidden.

use armid::diagnose::Diagnosis;
use armid::diagnose::candidates::{self, Candidate};
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};

use crate::simulated::{NOISE, Run, scenario};

/// Diagnoses a log with white noise and the effects in `toml`.
pub fn diagnose(seed: u64, toml: &str) -> Diagnosis {
    diagnose_along("ur5_identification", seed, toml)
}

/// The same along another motion.
pub fn diagnose_along(trajectory: &str, seed: u64, toml: &str) -> Diagnosis {
    diagnose_rows(trajectory, seed, toml, |samples, _| (0..samples).collect())
}

/// The same with a selection of `rows`, drawn from the number of all rows by a random generator.
pub fn diagnose_rows(
    trajectory: &str,
    seed: u64,
    toml: &str,
    rows: impl Fn(usize, &mut ChaCha8Rng) -> Vec<usize>,
) -> Diagnosis {
    diagnose_by(candidates::all(), (trajectory, seed, toml), rows)
}

/// The same with only these families in the dictionary.
pub fn diagnose_by(
    families: Vec<Box<dyn Candidate>>,
    (trajectory, seed, toml): (&str, u64, &str),
    rows: impl Fn(usize, &mut ChaCha8Rng) -> Vec<usize>,
) -> Diagnosis {
    let mut run = Run::new(scenario(("blind", seed), (trajectory, 6), NOISE, toml));
    let rows = rows(run.log.time_s.len(), &mut ChaCha8Rng::seed_from_u64(seed));
    let log = &mut run.log;
    log.time_s = rows.iter().map(|&row| log.time_s[row]).collect();
    for signals in [&mut log.q_rad, &mut log.qd_rad_s, &mut log.torque_nm] {
        *signals = signals.map_joints(|_, y| rows.iter().map(|&row| y[row]).collect());
    }
    let mut diagnoser = run.diagnoser_with(families);
    diagnoser.diagnose(&run.log.measurement("blind"), &[], None).unwrap().diagnosis
}

/// Diagnoses a log with one effect of `kind` with `parameters`, at a joint drawn from `joints`.
pub fn hide(seed: u64, kind: &str, joints: &[usize], parameters: &str) -> (usize, Diagnosis) {
    let joint = joints[ChaCha8Rng::seed_from_u64(seed).random_range(0..joints.len())];
    let toml = format!("[[effect]]\nkind = \"{kind}\"\njoint = {joint}\n{parameters}\n");
    (joint, diagnose(seed, &toml))
}

/// Whether the strongest cause is `kind` (or its class) at `joint`.
pub fn is_named(d: &Diagnosis, kind: &str, joint: Option<usize>) -> bool {
    println!("{kind} at {joint:?}: {:?} {:#?}", d.verdict, d.sentences);
    let strongest = d.causes.iter().max_by(|a, b| a.strength.total_cmp(&b.strength));
    strongest.is_some_and(|c| {
        c.joint == joint && (c.kind.name() == kind || c.class.iter().any(|k| k == kind))
    })
}
