//! `armid study paper`: repeats section IV of the paper on the simulated arm.

use std::path::PathBuf;

use clap::Args;

use super::count::at_least;
use super::outputs::Outputs;
use super::robot::inputs;
use super::{CommandResult, Progress};
use crate::excitation::FourierSeries;
use crate::montecarlo::Scenario;
use crate::montecarlo::study::{paper_study, paper_study_runs};
use crate::report::json::Program;
use crate::report::paper_study::{markdown, page};

#[derive(Debug, Args)]
pub(super) struct PaperArgs {
    /// Scenario of the identification trajectory.
    #[arg(default_value = "sims/paper.toml")]
    scenario: PathBuf,
    /// Second trajectory, for validation: a built-in name or a .json file.
    #[arg(long, default_value = "trajectories/ur5_paper_validation.json")]
    validation: String,
    /// Repetitions with fresh noise instead of the scenario's own.
    #[arg(long, allow_negative_numbers = true, value_parser = at_least(2_u64))]
    trials: Option<u64>,
    #[command(flatten)]
    output: Outputs,
}

pub(super) fn run(args: &PaperArgs) -> CommandResult {
    let scenario = Scenario::load(Some(&args.scenario))?;
    let mut files = scenario.sources(&args.scenario);
    files.extend(Some(PathBuf::from(&args.validation)).filter(|path| path.extension().is_some()));
    args.output.check(&files)?;
    let inputs = inputs(&files)?;
    let validation = FourierSeries::load(&args.validation)?;
    let trials = args.trials.unwrap_or(scenario.trials).max(2);
    let progress = Progress::new("runs of the arm", paper_study_runs());
    let result = paper_study(&scenario, validation, trials, &|n| progress.reached(n))?;
    progress.finish();
    let program = Program::started(Some(scenario.seed), inputs);
    args.output.write("armid.study-paper/1", &result, program, markdown, page)
}
