//! What does physical consistency repair, and what not?
//!
//! The arm of a scenario is replaced by one [as built](as_built), the robot file stays the prior.
//! Every trial is identified with and without constraints, and both predict another motion.
//!
//! Enters: scenarios. Leaves: scatter and model error of both kinds of estimates, and how often a wrong model is called one.

mod as_built;
mod statistics;
mod trial;
mod validation;

use std::time::Instant;

use rayon::prelude::*;
use serde::Serialize;

pub use as_built::as_built;
pub use statistics::{CaseResult, Coverage, Prediction};
pub use trial::SIGMAS;
pub use validation::CaseError;

use crate::identify::physical::{PhysicalOptions, Solver, Structure};
use crate::montecarlo::experiment::Experiment;
use crate::montecarlo::scenario::Scenario;
use trial::Bench;
use validation::Validation;

/// Ways to estimate that are compared, in the order of [`METHODS`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// Least squares.
    Unconstrained = 0,
    /// With the constraints and the default prior, which decides what the data know to less than 100 % of the robot file.
    Constrained = 1,
    /// With the constant pull-back to the robot file, its weight by cross-validation.
    PullBack = 2,
    /// With the entropic pull, its weight by cross-validation.
    Entropic = 3,
}

/// In words.
pub const METHODS: [&str; 4] =
    ["unconstrained", "constrained", "constrained, pull-back prior", "constrained, entropic prior"];

/// The motion that is predicted; no scenario identifies from it.
pub const VALIDATED_ON: &str = "ur5_validation";
/// Bootstrap and cross-validation take a hundred solves: only in every such trial.
pub const THOROUGH_EVERY: u64 = 10;
/// Which arm was built.
const AS_BUILT_SEED: u64 = 1;

/// All cases.
#[derive(Debug, Clone, Serialize)]
pub struct PhysicalStudy {
    /// One entry per scenario.
    pub cases: Vec<CaseResult>,
}

/// Runs `trials` of `scenario` (its own number where `None`) on the arm as built, every
/// `thorough_every`th of them with bootstrap and cross-validation.
pub fn physical_case(
    mut scenario: Scenario,
    trials: Option<u64>,
    thorough_every: u64,
    threads: usize,
    progress: &(dyn Fn(u64) + Sync),
) -> Result<CaseResult, CaseError> {
    let nominal = scenario.arm.clone();
    scenario.arm = as_built(&nominal, AS_BUILT_SEED);
    let margin = PhysicalOptions::default().margin;
    let structure = Structure::new(&scenario.arm, &scenario.set, &nominal, margin)?;
    let solver = Solver::new(structure);
    let validation = Validation::run(&scenario, VALIDATED_ON)?;
    let experiment = Experiment::prepare(scenario)?;
    let trials = trials.unwrap_or(experiment.simulation.scenario.trials);
    let begun = Instant::now();
    let done = std::sync::atomic::AtomicU64::new(0);
    let run = |bench: &mut Bench, trial: u64| {
        let outcome = bench.trial(trial, trial.is_multiple_of(thorough_every));
        progress(done.fetch_add(1, std::sync::atomic::Ordering::Relaxed) + 1);
        outcome
    };
    let bench = || Bench::new(&experiment, &solver, &validation);
    let share = |t: usize| {
        let mut bench = bench();
        let own = (t as u64..trials).step_by(threads);
        own.map(|trial| (trial, run(&mut bench, trial))).collect::<Vec<_>>()
    };
    let mut outcomes: Vec<_> = (0..threads).into_par_iter().flat_map_iter(share).collect();
    // Summed in the order of the trials: the same result for any number of threads.
    outcomes.sort_by_key(|(trial, _)| *trial);
    let seconds = begun.elapsed().as_secs_f64();
    Ok(CaseResult::of(&experiment, &validation, &outcomes, seconds))
}
