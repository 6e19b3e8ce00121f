//! `armid study`: what is true in general, found by simulation.

use std::path::PathBuf;

use clap::{Args, Subcommand};

use super::study_cutoff::{self, CutoffArgs};
use super::study_output::StudyOutput;
use super::study_paper::{self, PaperArgs};
use super::study_physical::{self, PhysicalArgs};
use super::study_real_arm::{self, RealArmArgs};
use super::{CommandResult, Progress, threads_or_all};
use crate::montecarlo::Scenario;
use crate::montecarlo::study::{NoiseStudy, study};
use crate::report::json::{Input, Program};
use crate::report::noise_study::{markdown, page};

/// Studies over many scenarios.
#[derive(Debug, Args)]
pub struct StudyArgs {
    #[command(subcommand)]
    topic: Topic,
}

#[derive(Debug, Subcommand)]
enum Topic {
    /// Which σ is true under which noise: every estimator and covariance on the same logs.
    Noise(NoiseArgs),
    /// The paper's section IV on the simulated arm, and where negative rotor inertias come from.
    Paper(PaperArgs),
    /// What physical consistency repairs, and what not: scatter, model error and σ.
    Physical(PhysicalArgs),
    /// Where the low-pass should sit: bias and scatter against its cutoff, by formula and measured.
    Cutoff(CutoffArgs),
    /// What a real UR10e's rigid model gets wrong, from its public logs.
    RealArm(RealArmArgs),
}

#[derive(Debug, Args)]
struct NoiseArgs {
    /// Scenario files.
    #[arg(required = true)]
    scenarios: Vec<PathBuf>,
    /// At most this many trials per scenario; each scenario's own number where left out.
    #[arg(long, value_parser = clap::value_parser!(u64).range(2..))]
    trials: Option<u64>,
    /// Run the costly methods (bootstrap, HAC, instruments, …) on every so many trials only.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u64).range(1..))]
    slow_every: u64,
    /// Threads; all cores where left out.
    #[arg(long, value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
    #[command(flatten)]
    output: StudyOutput,
}

/// Runs the command.
pub fn run(args: &StudyArgs) -> CommandResult {
    match &args.topic {
        Topic::Noise(args) => noise(args),
        Topic::Paper(args) => study_paper::run(args),
        Topic::Physical(args) => study_physical::run(args),
        Topic::Cutoff(args) => study_cutoff::run(args),
        Topic::RealArm(args) => study_real_arm::run(args),
    }
}

const SCHEMA: &str = "armid.study-noise/1";

fn noise(args: &NoiseArgs) -> CommandResult {
    args.output.check()?;
    let threads = threads_or_all(args.threads);
    let mut results = NoiseStudy { slow_every: args.slow_every, scenarios: Vec::new() };
    let mut inputs = Vec::new();
    let program = |inputs: &[Input]| Program::new(std::env::args(), None, inputs.to_vec());
    for path in &args.scenarios {
        inputs.push(Input::of(path)?);
        let scenario = Scenario::load(Some(path))?;
        eprintln!("{}: {}", scenario.name, scenario.description);
        let progress = Progress::new(
            "trials",
            args.trials.map_or(scenario.trials, |most| most.min(scenario.trials)),
        );
        let done = |n| progress.reached(n);
        results.scenarios.push(study(scenario, args.trials, args.slow_every, threads, &done)?);
        progress.finish();
        args.output.save(SCHEMA, &results, program(&inputs), markdown, page)?;
    }
    args.output.write(SCHEMA, &results, program(&inputs), markdown, page)
}
