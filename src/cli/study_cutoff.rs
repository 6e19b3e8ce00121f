//! `armid study cutoff`: bias and scatter over the cutoff, e_N over the length of the record, and the paper's σ.

use std::path::PathBuf;

use clap::Args;

use super::count::at_least;
use super::outputs::Outputs;
use super::robot::inputs;
use super::{CommandResult, Progress};
use crate::montecarlo::Scenario;
use crate::montecarlo::study::{cutoff_study, cutoff_study_trials};
use crate::report::cutoff_study::{markdown, page};
use crate::report::json::Program;

#[derive(Debug, Args)]
pub(super) struct CutoffArgs {
    /// Scenario.
    #[arg(default_value = "sims/cutoff.toml")]
    scenario: PathBuf,
    /// Trials per point instead of the scenario's own.
    #[arg(long, allow_negative_numbers = true, value_parser = at_least(2_u64))]
    trials: Option<u64>,
    #[command(flatten)]
    output: Outputs,
}

pub(super) fn run(args: &CutoffArgs) -> CommandResult {
    let scenario = Scenario::load(Some(&args.scenario))?;
    let files = scenario.sources(&args.scenario);
    args.output.check(&files)?;
    let inputs = inputs(&files)?;
    let trials = args.trials.unwrap_or(scenario.trials).max(2);
    let progress = Progress::new("trials", cutoff_study_trials(trials));
    let result = cutoff_study(&scenario, trials, &|n| progress.reached(n))?;
    progress.finish();
    let program = Program::started(Some(scenario.seed), inputs);
    args.output.write("armid.study-cutoff/1", &result, program, markdown, page)
}
