//! The `montecarlo` program: runs trials, and `montecarlo merge` combines shards.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Instant;

use clap::{Args, Parser, Subcommand};

use super::count::at_least;
use super::outputs::Outputs;
use super::robot::inputs;
use super::{CommandResult, Outcome, Progress, interrupt_flag, simulating, threads_or_all};
use crate::montecarlo::blind::{Benchmark, BlindContent, SCORES_SCHEMA, Scores};
use crate::montecarlo::calibration::Verdict;
use crate::montecarlo::folder::{check_cut, load_all, schema_of, shard_files, shard_path};
use crate::montecarlo::shard::{Merged, Shard, merge, same_run, shard_range};
use crate::montecarlo::trials::{Content, Trials};
use crate::montecarlo::{Estimation, Experiment, Job, SUMMARY_SCHEMA, Summary};
use crate::output::{OutputError, check_writable};
use crate::report::blind;
use crate::report::json::{Input, Program, sha256_of_file};
use crate::report::montecarlo::{
    check_table, efficiency_sentence, markdown, page, parameter_table,
};

/// Simulate an arm with a known truth, identify it from noisy logs thousands of times, and check
/// that the predicted uncertainty is true.
#[derive(Debug, Parser)]
#[command(name = "montecarlo", version, args_conflicts_with_subcommands = true)]
pub struct Command {
    #[command(subcommand)]
    merge: Option<MergeCommand>,
    #[command(flatten)]
    run: RunArgs,
}

#[derive(Debug, Subcommand)]
enum MergeCommand {
    /// Put the shards of one run together; refuses shards of different runs, lists missing trials.
    Merge {
        /// Folders with shard files.
        #[arg(required = true)]
        folders: Vec<PathBuf>,
        #[command(flatten)]
        output: Outputs,
    },
}

#[derive(Debug, Args)]
struct RunArgs {
    /// Scenario file; sims/default.toml (built in) where left out.
    #[arg(long)]
    scenario: Option<PathBuf>,
    /// Number of trials instead of the scenario's.
    #[arg(long, allow_negative_numbers = true, value_parser = at_least(1_u64))]
    trials: Option<u64>,
    /// Run this one trial alone (from 0) and print its estimates.
    #[arg(long, conflicts_with_all = [
        "trials", "threads", "shard", "out", "resume", "json", "report", "markdown",
    ], allow_negative_numbers = true, value_parser = at_least(0_u64))]
    trial: Option<u64>,
    /// Seed instead of the scenario's.
    #[arg(long, allow_negative_numbers = true, value_parser = at_least(0_u64))]
    seed: Option<u64>,
    /// Threads; all cores where left out. Results do not depend on it.
    #[arg(long, allow_negative_numbers = true, value_parser = clap::value_parser!(u16).range(1..))]
    threads: Option<u16>,
    /// Run only part I of N (I from 0) of the trials; needs --out.
    #[arg(long, value_name = "I/N", requires = "out")]
    shard: Option<ShardOf>,
    /// Folder for the shard file, written every few seconds.
    #[arg(long)]
    out: Option<PathBuf>,
    /// Go on with the shard file in --out, if this build of the program began it.
    #[arg(long, requires = "out")]
    resume: bool,
    #[command(flatten)]
    output: Outputs,
}

/// Part `I/N` of a run, with I < N.
#[derive(Debug, Clone, Copy)]
struct ShardOf {
    index: u64,
    count: u64,
}

impl FromStr for ShardOf {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let parts =
            text.split_once('/').and_then(|(i, n)| Some((i.parse().ok()?, n.parse().ok()?)));
        match parts {
            Some((index, count)) if index < count => Ok(Self { index, count }),
            Some((index, count)) => {
                Err(format!("shard {index} of {count} does not exist: they count from 0"))
            }
            None => Err("expected I/N, such as 0/8".into()),
        }
    }
}

/// Runs the command.
pub fn run(command: Command) -> CommandResult {
    match command.merge {
        Some(MergeCommand::Merge { folders, output }) => run_merge(&folders, &output),
        None => run_trials(&command.run),
    }
}

fn run_merge(folders: &[PathBuf], output: &Outputs) -> CommandResult {
    let files = shard_files(folders)?;
    output.check(&files)?;
    let inputs = inputs(&files)?;
    let schema = files.first().map(|file| schema_of(file)).transpose()?;
    if schema.as_deref() == Some(BlindContent::SCHEMA) {
        let merged = merge(load_all::<BlindContent>(&files)?)?;
        note_builds(&merged);
        let outcome = conclude_blind(&merged, inputs, output)?;
        return Ok(unless_interrupted(outcome, &merged));
    }
    let merged = merge(load_all::<Estimation>(&files)?)?;
    note_builds(&merged);
    let outcome = conclude(&merged, merged.seconds, inputs, output)?;
    Ok(unless_interrupted(outcome, &merged))
}

/// Prints a note if shards were run by different builds of one version: for other processors, or with a changed
/// algorithm.
fn note_builds<C: Content>(merged: &Merged<C>) {
    if merged.programs.len() > 1 {
        eprintln!(
            "note: {} builds of this program ran these shards (header.program in the files): right if they are of one source, for \
             other processors",
            merged.programs.len()
        );
    }
}

fn run_trials(args: &RunArgs) -> CommandResult {
    let mut job = Job::load(args.scenario.as_deref())?;
    let scenario = job.scenario_mut();
    args.output.check(&[args.scenario.as_slice(), &scenario.files].concat())?;
    if let Some(file) = args.out.as_ref().filter(|folder| folder.is_file()) {
        return Err(
            format!("{}: this is a file; name a folder for the shard", file.display()).into()
        );
    }
    let trials = args.trials.unwrap_or(scenario.trials);
    let ShardOf { index, count } = args.shard.unwrap_or(ShardOf { index: 0, count: 1 });
    if let Some(folder) = &args.out {
        check_cut(folder, trials, count)?;
    }
    let range = shard_range(trials, index, count);
    if range.is_empty() {
        eprintln!("shard {index} of {count} has none of the {trials} trials: nothing is written");
        return Ok(Outcome::Done);
    }
    // Checked before the simulation, which may take minutes.
    let file = args.out.as_ref().map(|folder| shard_file(args, folder, &range)).transpose()?;
    let inputs = inputs(args.scenario.iter().chain(&scenario.files))?;
    scenario.seed = args.seed.unwrap_or(scenario.seed);
    eprintln!("{}: {}", scenario.name, scenario.description);
    eprintln!("{}", simulating(scenario));
    match job {
        Job::Estimates(scenario) => {
            let experiment = Experiment::prepare(*scenario)?;
            if let Some(trial) = args.trial {
                return replay(&experiment, trial);
            }
            let (merged, wall_s) = run_all(&experiment, args, trials, range, file.as_deref())?;
            let outcome = conclude(&merged, wall_s, inputs, &args.output)?;
            Ok(unless_interrupted(outcome, &merged))
        }
        Job::Blind(plan) => {
            let benchmark = Benchmark::prepare(*plan)?;
            if let Some(trial) = args.trial {
                return replay_blind(&benchmark, trial);
            }
            let (merged, _) = run_all(&benchmark, args, trials, range, file.as_deref())?;
            let outcome = conclude_blind(&merged, inputs, &args.output)?;
            Ok(unless_interrupted(outcome, &merged))
        }
    }
}

/// The file of the shard with the trials `range`, in `folder`, which is created. Refuses a file that exists already
/// without --resume, that cannot be written, or that is another output as well.
fn shard_file(
    args: &RunArgs,
    folder: &Path,
    range: &Range<u64>,
) -> Result<PathBuf, Box<dyn std::error::Error>> {
    let file = shard_path(folder, range);
    if file.exists() && !args.resume {
        let file = file.display();
        return Err(format!("{file} exists: give --resume to go on, or another --out").into());
    }
    std::fs::create_dir_all(folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    check_writable(&file)?;
    args.output.check(std::slice::from_ref(&file)).map_err(|e| match e {
        OutputError::IsInput { path } => OutputError::Twice { path },
        e => e,
    })?;
    Ok(file)
}

/// Exit with an interruption if trials are missing: the result for a part is not the final answer, and whoever started
/// the run has to continue it.
fn unless_interrupted<C: Content>(outcome: Outcome, merged: &Merged<C>) -> Outcome {
    if merged.missing.is_empty() { outcome } else { Outcome::Interrupted }
}

/// A value with the wall time that it took, s.
type Timed<T> = Result<(T, f64), Box<dyn std::error::Error>>;

/// Runs the trials in `range` out of `trials`, and saves them as the shard `file` if there is one.
fn run_all<T: Trials>(
    experiment: &T,
    args: &RunArgs,
    trials: u64,
    range: Range<u64>,
    file: Option<&Path>,
) -> Timed<Merged<T::Content>> {
    let (shard, wall_s) = run_shard(experiment, args, trials, range, file)?;
    if !shard.is_complete() {
        eprintln!("interrupted after {} trials", shard.next - shard.range[0]);
    }
    let range = shard.range;
    let mut merged = merge(vec![(PathBuf::new(), shard)])?;
    // A single shard is judged by its own trials; the trials of other shards are not missing.
    merged.look_only_at(range);
    Ok((merged, wall_s))
}

fn run_shard<T: Trials>(
    experiment: &T,
    args: &RunArgs,
    trials: u64,
    range: Range<u64>,
    file: Option<&Path>,
) -> Timed<Shard<T::Content>> {
    let (threads, stop) = (threads_or_all(args.threads), interrupt_flag());
    let mut shard = Shard::new(experiment, trials, range);
    if let Some(file) = file {
        shard.header.program = sha256_of_file(&std::env::current_exe()?)?;
        if file.exists() {
            let saved = Shard::load(file)?;
            same_run(file, &saved.header, &shard.header)?;
            saved.check_program(file, &shard.header.program)?;
            shard = saved;
            eprintln!("going on after {} trials", shard.next - shard.range[0]);
        } else if args.resume {
            eprintln!("{}: nothing to resume, begins with its first trial", file.display());
        }
    }
    let progress = Progress::new("trials", shard.range[1] - shard.range[0]);
    let begun = Instant::now();
    let before = shard.seconds;
    shard.run(experiment, threads, file, stop, &|n| progress.reached(n))?;
    progress.finish();
    Ok((shard, before + begun.elapsed().as_secs_f64()))
}

/// Runs one trial alone and prints its estimates beside the truth.
fn replay(experiment: &Experiment, trial: u64) -> CommandResult {
    let set = &experiment.simulation.scenario.set;
    let identification = experiment.worker().identify(trial)?;
    let sigma = identification.sigma();
    say!("trial {trial}, {} with {}", identification.estimator, experiment.covariance);
    say!("{:<6} {:>24} {:>24} {:>24} {:>8}", "", "truth", "estimate", "sigma", "z");
    for (k, sigma) in sigma.iter().enumerate() {
        let (truth, estimate) = (experiment.truth[k], identification.fit.theta[k]);
        let z = (estimate - truth) / sigma;
        say!("{:<6} {truth:>24} {estimate:>24} {sigma:>24} {z:>8.3}", set.name(k));
    }
    Ok(Outcome::Done)
}

/// Prints and writes the summary, and turns its verdict into the outcome.
fn conclude(
    merged: &Merged<Estimation>,
    wall_s: f64,
    inputs: Vec<Input>,
    output: &Outputs,
) -> CommandResult {
    let summary = Summary::of(merged, wall_s);
    say!("{}", parameter_table(&summary).to_text());
    say!("{}", check_table(&summary).to_text());
    say!(
        "{} trials ({} failed) in {wall_s:.1} s: {:.1} trials/s",
        summary.trials,
        summary.failed,
        summary.trials_per_second
    );
    for failure in summary.failures.iter().take(5) {
        say!("  trial {} failed: {}", failure.trial, failure.reason);
    }
    for [start, end] in &summary.missing {
        say!("  trials {start}…{} have not been run", end - 1);
    }
    if let Some(efficiency) = &summary.efficiency {
        say!("{}", efficiency_sentence(efficiency));
    }
    say!("\n{}: {}", summary.verdict.to_string().to_uppercase(), summary.sentence());
    let program = Program::started(Some(merged.header.seed), inputs);
    let page = |summary: &Summary, program| page(summary, merged, program);
    output.save(SUMMARY_SCHEMA, &summary, program, markdown, page)?;
    output.name_report();
    Ok(if summary.verdict == Verdict::Fail { Outcome::Negative } else { Outcome::Done })
}

/// Runs one case of the blind benchmark alone and prints case, truth and answer.
fn replay_blind(benchmark: &Benchmark, trial: u64) -> CommandResult {
    let begun = Instant::now();
    let record = benchmark.trial(trial)?;
    for line in blind::replay_lines(&record) {
        say!("{line}");
    }
    say!("{:.1} s", begun.elapsed().as_secs_f64());
    Ok(Outcome::Done)
}

/// Prints and writes the scores of a blind benchmark, and turns the verdict into the outcome.
fn conclude_blind(
    merged: &Merged<BlindContent>,
    inputs: Vec<Input>,
    output: &Outputs,
) -> CommandResult {
    let scores = Scores::of(merged);
    let seed = merged.header.seed;
    let program = Program::started(Some(seed), inputs);
    let markdown = |scores: &Scores, command: &str| blind::markdown(scores, command, seed);
    output.write(SCORES_SCHEMA, &scores, program, markdown, blind::page)?;
    output.name_report();
    Ok(if scores.verdict == Verdict::Fail { Outcome::Negative } else { Outcome::Done })
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::error::ErrorKind;

    #[test]
    fn one_trial_alone_takes_nothing_that_is_about_many() {
        for other in ["--trials", "--threads"] {
            let error =
                Command::try_parse_from(["montecarlo", "--trial", "9", other, "3"]).unwrap_err();
            assert_eq!(error.kind(), ErrorKind::ArgumentConflict, "{other}");
        }
    }

    /// A shard that cannot belong to the run in its folder is refused before anything is prepared or written.
    #[test]
    fn a_shard_that_does_not_belong_in_its_folder_is_not_begun() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().to_str().unwrap();
        let shard = |part: &str, trials: &str| {
            let words = ["montecarlo", "--shard", part, "--trials", trials, "--out", out];
            run(Command::try_parse_from(words).unwrap())
        };
        let names = || std::fs::read_dir(out).unwrap().count();
        // Two trials in five parts leave three parts empty.
        assert_eq!(shard("0/5", "2").unwrap(), Outcome::Done);
        assert_eq!(names(), 0);
        let other = r#"{"header": {"schema": "armid.shard/5", "trials": 1000}}"#;
        std::fs::write(shard_path(folder.path(), &(0..500)), other).unwrap();
        let cut = shard("1/4", "1000").unwrap_err().to_string();
        assert!(cut.contains("none of the 4 shards of 1000 trials"), "{cut}");
        let length = shard("1/3", "1500").unwrap_err().to_string();
        assert!(length.contains("a shard of 1000 trials, not of 1500"), "{length}");
        assert_eq!(names(), 1);
    }
}
