//! `armid study cutoff`: bias and scatter against the cutoff, e_N against the record, the paper's σ.

use std::path::PathBuf;

use clap::Args;

use super::{CommandResult, Outcome, Progress};
use crate::montecarlo::Scenario;
use crate::montecarlo::study::{cutoff_study, cutoff_study_trials};
use crate::output::{check_writable, write_atomically};
use crate::report::cutoff_study::{markdown, page};
use crate::report::json::{Document, Input, Program};

#[derive(Debug, Args)]
pub(super) struct CutoffArgs {
    /// Scenario.
    #[arg(default_value = "sims/cutoff.toml")]
    scenario: PathBuf,
    /// Trials per point instead of the scenario's own.
    #[arg(long, value_parser = clap::value_parser!(u64).range(2..))]
    trials: Option<u64>,
    /// Write the tables as Markdown.
    #[arg(long)]
    markdown: Option<PathBuf>,
    /// Write a page with plots.
    #[arg(long)]
    report: Option<PathBuf>,
    /// Write the numbers as JSON.
    #[arg(long)]
    json: Option<PathBuf>,
}

pub(super) fn run(args: &CutoffArgs) -> CommandResult {
    for path in [&args.markdown, &args.report, &args.json].into_iter().flatten() {
        check_writable(path)?;
    }
    let inputs = vec![Input::of(&args.scenario)?];
    let scenario = Scenario::load(Some(&args.scenario))?;
    let trials = args.trials.unwrap_or(scenario.trials).max(2);
    let progress = Progress::new("trials", cutoff_study_trials(trials));
    let result = cutoff_study(&scenario, trials, &|n| progress.reached(n))?;
    progress.finish();
    let program = Program::new(std::env::args(), Some(scenario.seed), inputs);
    let text = markdown(&result, &program.command);
    println!("{text}");
    if let Some(path) = &args.markdown {
        write_atomically(path, |out| out.write_all(text.as_bytes()))?;
    }
    if let Some(path) = &args.json {
        Document { schema: "armid.study-cutoff/1", program: &program, body: &result }
            .write(path)?;
    }
    if let Some(path) = &args.report {
        page(&result, program)?.write(path)?;
    }
    Ok(Outcome::Done)
}
