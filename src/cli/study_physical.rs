//! `armid study physical`: what physical consistency repairs, and what it does not.

use std::path::PathBuf;

use clap::Args;

use super::count::at_least;
use super::outputs::Outputs;
use super::robot::inputs;
use super::{CommandResult, Progress, threads_or_all};
use crate::montecarlo::Scenario;
use crate::montecarlo::study::physical::{PhysicalStudy, THOROUGH_EVERY, physical_case};
use crate::report::json::Program;
use crate::report::physical_study::{markdown, page};

const SCHEMA: &str = "armid.study-physical/1";

/// Which scenarios, and where to write.
#[derive(Debug, Args)]
pub struct PhysicalArgs {
    /// Scenario files.
    #[arg(required = true)]
    scenarios: Vec<PathBuf>,
    /// Trials per scenario instead of each scenario's own.
    #[arg(long, allow_negative_numbers = true, value_parser = at_least(2_u64))]
    trials: Option<u64>,
    /// Threads; all cores where left out.
    #[arg(long, allow_negative_numbers = true, value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
    #[command(flatten)]
    output: Outputs,
}

/// Runs the study.
pub fn run(args: &PhysicalArgs) -> CommandResult {
    let threads = threads_or_all(args.threads);
    let mut study = PhysicalStudy { cases: Vec::new() };
    // Errors in any input are reported before the first scenario runs.
    let (mut scenarios, mut files) = (Vec::new(), Vec::new());
    for path in &args.scenarios {
        let scenario = Scenario::load(Some(path))?;
        files.extend(scenario.sources(path));
        scenarios.push(scenario);
    }
    args.output.check(&files)?;
    let inputs = inputs(&files)?;
    for scenario in scenarios {
        eprintln!("{}: {}", scenario.name, scenario.description);
        let progress = Progress::new("trials", args.trials.unwrap_or(scenario.trials));
        let reached = |n| progress.reached(n);
        let case = physical_case(scenario, args.trials, THOROUGH_EVERY, threads, &reached)?;
        study.cases.push(case);
        progress.finish();
        let program = Program::started(None, inputs.clone());
        args.output.save(SCHEMA, &study, program, markdown, page)?;
    }
    args.output.write(SCHEMA, &study, Program::started(None, inputs), markdown, page)
}
