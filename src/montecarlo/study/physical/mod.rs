//! Study of physical consistency: what do the constraints repair, and what not?
//!
//! The arm of a scenario is replaced by an arm [as built](as_built), while the robot file remains the prior. Every
//! trial is identified with and without the constraints, and both estimates predict another motion.
//!
//! Input: scenarios. Output: scatter and model error of both kinds of estimates, and how often a model is called wrong.

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

/// Methods of estimation that are compared, in the order of [`METHODS`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// Least squares.
    Unconstrained = 0,
    /// With the constraints and the default prior, which governs only what the data determine less accurately than to
    /// 100 % of the robot file's value.
    Constrained = 1,
    /// With the constraints and a constant pull-back to the robot file, whose weight is chosen by cross-validation.
    PullBack = 2,
    /// With the constraints and the entropic prior, whose weight is chosen by cross-validation.
    Entropic = 3,
}

/// Names of the methods in results, in the order of [`Method`].
pub const METHODS: [&str; 4] =
    ["unconstrained", "constrained", "constrained, pull-back prior", "constrained, entropic prior"];

/// The motion that is predicted; no scenario uses it for identification.
pub const VALIDATED_ON: &str = "ur5_validation";
/// Default interval between trials with bootstrap and cross-validation, which take about a hundred solves each.
pub const THOROUGH_EVERY: u64 = 10;
/// Seed that determines the arm as built.
const AS_BUILT_SEED: u64 = 1;

/// Results of all cases.
#[derive(Debug, Clone, Serialize)]
pub struct PhysicalStudy {
    /// One entry per scenario.
    pub cases: Vec<CaseResult>,
}

/// Runs `trials` trials of `scenario` (the scenario's own number if `None`) on the arm as built, every
/// `thorough_every`-th of them with bootstrap and cross-validation.
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
    // Sum in the order of the trials, so that the result is the same for any number of threads.
    outcomes.sort_by_key(|(trial, _)| *trial);
    let seconds = begun.elapsed().as_secs_f64();
    Ok(CaseResult::of(&experiment, &validation, &outcomes, seconds))
}
