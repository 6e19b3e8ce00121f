//! `armid study physical`: what physical consistency repairs, and what not.

use std::path::PathBuf;

use clap::Args;

use super::{CommandResult, Outcome, Progress};
use crate::montecarlo::Scenario;
use crate::montecarlo::study::physical::{PhysicalStudy, THOROUGH_EVERY, physical_case};
use crate::output::{check_writable, write_atomically};
use crate::report::json::{Document, Input, Program};
use crate::report::physical_study::{markdown, page};

/// Which scenarios, and where to write.
#[derive(Debug, Args)]
pub struct PhysicalArgs {
    /// Scenario files.
    #[arg(required = true)]
    scenarios: Vec<PathBuf>,
    /// Trials per scenario instead of each scenario's own.
    #[arg(long, value_parser = clap::value_parser!(u64).range(2..))]
    trials: Option<u64>,
    /// Threads; all cores where left out.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
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

/// Runs the study.
pub fn run(args: &PhysicalArgs) -> CommandResult {
    for path in [&args.markdown, &args.report, &args.json].into_iter().flatten() {
        check_writable(path)?;
    }
    let threads = match args.threads {
        Some(threads) => usize::from(threads),
        None => std::thread::available_parallelism().map_or(1, usize::from),
    };
    let mut study = PhysicalStudy { cases: Vec::new() };
    let mut inputs = Vec::new();
    for path in &args.scenarios {
        inputs.push(Input::of(path)?);
        let scenario = Scenario::load(Some(path))?;
        eprintln!("{}: {}", scenario.name, scenario.description);
        let progress = Progress::new("trials", args.trials.unwrap_or(scenario.trials));
        let reached = |n| progress.reached(n);
        let case = physical_case(scenario, args.trials, THOROUGH_EVERY, threads, &reached)?;
        study.cases.push(case);
        progress.finish();
    }
    let program = Program::new(std::env::args(), None, inputs);
    let text = markdown(&study, &program.command);
    println!("{text}");
    if let Some(path) = &args.markdown {
        write_atomically(path, |out| out.write_all(text.as_bytes()))?;
    }
    if let Some(path) = &args.json {
        Document { schema: "armid.study-physical/1", program: &program, body: &study }
            .write(path)?;
    }
    if let Some(path) = &args.report {
        page(&study, program)?.write(path)?;
    }
    Ok(Outcome::Done)
}
