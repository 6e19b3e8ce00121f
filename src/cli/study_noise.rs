//! `armid study noise`: all methods on the same logs for every scenario, in one run or in several.

use std::path::{Path, PathBuf};

use clap::Args;
use serde::Deserialize;
use thiserror::Error;

use super::count::at_least;
use super::outputs::Outputs;
use super::robot::inputs;
use super::{CommandResult, Progress, threads_or_all};
use crate::montecarlo::Scenario;
use crate::montecarlo::study::{NoiseStudy, study};
use crate::report::json::{Input, Program};
use crate::report::noise_study::{markdown, page};
use crate::report::saved::{SavedError, load};

#[derive(Debug, Args)]
pub(super) struct NoiseArgs {
    /// Scenario files.
    #[arg(required_unless_present = "from")]
    scenarios: Vec<PathBuf>,
    /// Results of earlier runs (their --json), to stand in front of those of SCENARIOS.
    #[arg(long, value_name = "JSON", num_args = 1..)]
    from: Vec<PathBuf>,
    /// At most this many trials per scenario; each scenario's own number where left out.
    #[arg(long, allow_negative_numbers = true, value_parser = at_least(2_u64))]
    trials: Option<u64>,
    /// Run the costly methods (bootstrap, HAC, instruments, …) on every so many trials only.
    #[arg(long, default_value_t = 5, allow_negative_numbers = true, value_parser = at_least(1_u64))]
    slow_every: u64,
    /// Threads; all cores where left out.
    #[arg(long, allow_negative_numbers = true, value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
    #[command(flatten)]
    output: Outputs,
}

/// Results that cannot be combined.
#[derive(Debug, Error)]
enum NoiseStudyError {
    /// The file cannot be read, or is not a result of this study.
    #[error("{0} (wanted: a result of armid study noise --json)")]
    Saved(#[from] SavedError),
    /// A scenario occurs twice.
    #[error("{file}: scenario {scenario} is already there")]
    Twice {
        /// The file with the second occurrence.
        file: String,
        /// Name of the scenario.
        scenario: String,
    },
}

const SCHEMA: &str = "armid.study-noise/2";

/// A result file.
#[derive(Deserialize)]
struct Saved {
    program: Program,
    #[serde(flatten)]
    study: NoiseStudy,
}

/// The results so far, and their origin.
struct Collected {
    study: NoiseStudy,
    inputs: Vec<Input>,
    /// Commands of the earlier runs, in order.
    commands: Vec<String>,
}

impl Collected {
    /// Reads the results in `files`.
    fn load(files: &[PathBuf]) -> Result<Self, Box<dyn std::error::Error>> {
        let study = NoiseStudy { scenarios: Vec::new() };
        let mut all = Self { study, inputs: Vec::new(), commands: Vec::new() };
        for file in files {
            let Saved { study, program } = load(file, SCHEMA).map_err(NoiseStudyError::Saved)?;
            for scenario in study.scenarios {
                all.check_new(file, &scenario.name)?;
                all.study.scenarios.push(scenario);
            }
            all.inputs.extend(program.inputs);
            all.inputs.push(Input::of(file)?);
            all.commands.push(program.command);
        }
        Ok(all)
    }

    /// Refuses the scenario `name` of `file` if it is already collected.
    fn check_new(&self, file: &Path, name: &str) -> Result<(), NoiseStudyError> {
        if self.study.scenarios.iter().any(|known| known.name == name) {
            let (file, scenario) = (file.display().to_string(), name.to_owned());
            return Err(NoiseStudyError::Twice { file, scenario });
        }
        Ok(())
    }

    /// This program, with its command after those of the earlier runs.
    fn program(&self) -> Program {
        let own = Program::started(None, self.inputs.clone());
        let commands: Vec<&str> =
            self.commands.iter().chain([&own.command]).map(|c| &**c).collect();
        Program { command: commands.join(" && "), ..own }
    }
}

pub(super) fn run(args: &NoiseArgs) -> CommandResult {
    args.output.check(&args.from)?;
    let threads = threads_or_all(args.threads);
    let mut all = Collected::load(&args.from)?;
    // Errors in any input are reported before the first scenario runs.
    let mut scenarios = Vec::new();
    for path in &args.scenarios {
        let scenario = Scenario::load(Some(path))?;
        all.check_new(path, &scenario.name)?;
        let files = scenario.sources(path);
        args.output.check(&files)?;
        scenarios.push((inputs(&files)?, scenario));
    }
    for (inputs, scenario) in scenarios {
        eprintln!("{}: {}", scenario.name, scenario.description);
        let trials = args.trials.map_or(scenario.trials, |most| most.min(scenario.trials));
        let progress = Progress::new("trials", trials);
        let done = |n| progress.reached(n);
        let result = study(scenario, args.trials, args.slow_every, threads, &done)?;
        progress.finish();
        all.inputs.extend(inputs);
        all.study.scenarios.push(result);
        args.output.save(SCHEMA, &all.study, all.program(), markdown, page)?;
    }
    args.output.write(SCHEMA, &all.study, all.program(), markdown, page)
}
