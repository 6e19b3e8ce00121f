//! A stretch of trials: run in parallel, saved, resumed, merged.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::experiment::Experiment;
use super::tally::{Failure, Tally};
use crate::output::{OutputError, write_atomically};

/// Format of shard files.
pub const SHARD_SCHEMA: &str = "armid.shard/1";

/// What must be equal for two shards to belong together.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Header {
    /// Always [`SHARD_SCHEMA`].
    pub schema: String,
    /// Version of the program.
    pub version: String,
    /// Name of the scenario.
    pub scenario: String,
    /// SHA-256 of the scenario's text.
    pub scenario_sha256: String,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Trials of the whole run.
    pub trials: u64,
    /// Estimator and covariance, as they appear in the results.
    pub estimator: String,
    /// See `estimator`.
    pub covariance: String,
    /// The parameters with their truth and scale.
    pub parameters: Vec<ParameterHeader>,
}

/// One parameter of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParameterHeader {
    /// Name of the kept column.
    pub name: String,
    /// The whole combination.
    pub formula: String,
    /// SI unit.
    pub unit: String,
    /// True value.
    pub truth: f64,
    /// Unit of the tally's sums.
    pub scale: f64,
}

/// A shard's file: its header, its range of trials, how far it has come, and the sums so far.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Shard {
    /// What it is part of.
    pub header: Header,
    /// First trial and the one behind the last.
    pub range: [u64; 2],
    /// First trial that has not been run.
    pub next: u64,
    /// Time spent on trials, s, summed over resumptions.
    pub seconds: f64,
    /// Sums over the trials from `range[0]` to `next`.
    pub tally: Tally,
}

/// Shards that cannot be saved, read, resumed or merged.
#[derive(Debug, Error)]
pub enum ShardError {
    /// Could not be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// Could not be read.
    #[error("{file}: {source}")]
    Read {
        /// The file or folder.
        file: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// Not a shard file of this version.
    #[error("{file}: not a shard file this program can read: {message}")]
    Format {
        /// The file.
        file: PathBuf,
        /// The parser's message.
        message: String,
    },
    /// Shards of different runs.
    #[error("{file}: its {what} is {found}, but the others have {expected}: not the same run")]
    Mismatch {
        /// The file.
        file: PathBuf,
        /// Which part of the header differs.
        what: &'static str,
        /// Its value.
        found: String,
        /// The value of the first file.
        expected: String,
    },
    /// Trials counted twice.
    #[error("{file}: trials {start}…{end} are in another shard too")]
    Overlap {
        /// The file.
        file: PathBuf,
        /// First trial of the shard.
        start: u64,
        /// Last trial of the shard.
        end: u64,
    },
    /// A folder without shards.
    #[error("{folder}: no shard files (shard-*.json)")]
    Empty {
        /// The folder.
        folder: PathBuf,
    },
    /// Threads could not be started.
    #[error("could not start {threads} threads: {message}")]
    Threads {
        /// Threads asked for.
        threads: usize,
        /// Why not.
        message: String,
    },
}

/// Trials of shard `index` of `count` (0-based): contiguous, sizes differing by at most one.
pub fn shard_range(trials: u64, index: u64, count: u64) -> Range<u64> {
    let bound = |i: u64| (u128::from(trials) * u128::from(i) / u128::from(count)) as u64;
    bound(index)..bound(index + 1)
}

/// File of the shard that holds `range`.
pub fn shard_path(folder: &Path, range: &Range<u64>) -> PathBuf {
    folder.join(format!("shard-{:012}-{:012}.json", range.start, range.end))
}

/// Trials between two looks at the clock, per thread.
const BATCH_PER_THREAD: u64 = 16;
/// Longest time whose work a kill can lose.
const SAVE_EVERY: Duration = Duration::from_secs(5);

impl Shard {
    /// No trials run yet.
    pub fn new(experiment: &Experiment, trials: u64, range: Range<u64>) -> Self {
        let scenario = &experiment.simulation.scenario;
        let set = &scenario.set;
        let parameters = (0..set.rank())
            .map(|k| ParameterHeader {
                name: set.name(k).to_owned(),
                formula: set.formula(k),
                unit: set.unit(k).to_owned(),
                truth: experiment.truth[k],
                scale: experiment.scale[k],
            })
            .collect();
        Self {
            header: Header {
                schema: SHARD_SCHEMA.to_owned(),
                version: env!("CARGO_PKG_VERSION").to_owned(),
                scenario: scenario.name.clone(),
                scenario_sha256: scenario.sha256.clone(),
                seed: scenario.seed,
                trials,
                estimator: experiment.estimator.to_string(),
                covariance: experiment.covariance.to_string(),
                parameters,
            },
            tally: Tally::new(set.rank()),
            next: range.start,
            range: [range.start, range.end],
            seconds: 0.0,
        }
    }

    /// Reads a shard file.
    pub fn load(file: &Path) -> Result<Self, ShardError> {
        let text = std::fs::read_to_string(file)
            .map_err(|source| ShardError::Read { file: file.to_owned(), source })?;
        let format = |message: String| ShardError::Format { file: file.to_owned(), message };
        let shard: Self = serde_json::from_str(&text).map_err(|e| format(e.to_string()))?;
        if shard.header.schema != SHARD_SCHEMA {
            return Err(format(format!("schema {}, expected {SHARD_SCHEMA}", shard.header.schema)));
        }
        let [start, end] = shard.range;
        let run = shard.next.checked_sub(start);
        if shard.next > end || run != Some(shard.tally.trials()) {
            let trials = shard.tally.trials();
            return Err(format(format!("{trials} trials do not fit {start}…{}", shard.next)));
        }
        Ok(shard)
    }

    /// Writes the shard file as a whole.
    pub fn save(&self, file: &Path) -> Result<(), ShardError> {
        Ok(write_atomically(file, |out| serde_json::to_writer(out, self).map_err(Into::into))?)
    }

    /// Whether all its trials have been run.
    pub fn is_complete(&self) -> bool {
        self.next == self.range[1]
    }

    /// Runs the trials that are missing on `threads` threads, until done or `stop` is set.
    ///
    /// `progress` is told the number of trials run in this shard; `file` is written every few
    /// seconds and at the end, so that a killed run loses little and repeats nothing.
    pub fn run(
        &mut self,
        experiment: &Experiment,
        threads: usize,
        file: Option<&Path>,
        stop: &AtomicBool,
        progress: &(dyn Fn(u64) + Sync),
    ) -> Result<(), ShardError> {
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads)
            .build()
            .map_err(|e| ShardError::Threads { threads, message: e.to_string() })?;
        let mut workers: Vec<_> = (0..threads).map(|_| experiment.worker()).collect();
        let mut saved = Instant::now();
        while !self.is_complete() && !stop.load(Ordering::Relaxed) {
            let begun = Instant::now();
            let end = (self.next + BATCH_PER_THREAD * threads as u64).min(self.range[1]);
            let trials = self.next..end;
            // Thread t runs every threads-th trial of the batch; sums do not depend on the order.
            let parts: Vec<Tally> = pool.install(|| {
                workers
                    .par_iter_mut()
                    .enumerate()
                    .map(|(t, worker)| {
                        let mut tally = Tally::new(experiment.truth.len());
                        for trial in trials.clone().skip(t).step_by(threads) {
                            match worker.trial(trial) {
                                Ok(outcomes) => tally.add(&outcomes),
                                Err(error) => {
                                    let reason = error.to_string();
                                    tally.add_failure(Failure { trial, reason });
                                }
                            }
                        }
                        tally
                    })
                    .collect()
            });
            parts.iter().for_each(|part| self.tally.merge(part));
            self.next = end;
            self.seconds += begun.elapsed().as_secs_f64();
            progress(self.next - self.range[0]);
            if let Some(file) = file.filter(|_| saved.elapsed() > SAVE_EVERY) {
                self.save(file)?;
                saved = Instant::now();
            }
        }
        file.map_or(Ok(()), |file| self.save(file))
    }
}

/// Shards put together.
#[derive(Debug, Clone, PartialEq)]
pub struct Merged {
    /// Common header.
    pub header: Header,
    /// All trials.
    pub tally: Tally,
    /// Sum of the time spent on trials, s.
    pub seconds: f64,
    /// Trials that no shard has run.
    pub missing: Vec<Range<u64>>,
}

/// Merges shards (with the files they come from); any order gives the same bits.
pub fn merge(mut shards: Vec<(PathBuf, Shard)>) -> Result<Merged, ShardError> {
    shards.sort_by_key(|(_, shard)| shard.range);
    let Some((_, first)) = shards.first() else {
        return Err(ShardError::Empty { folder: PathBuf::new() });
    };
    let header = first.header.clone();
    let mut merged = Merged {
        tally: Tally::new(header.parameters.len()),
        header: header.clone(),
        seconds: 0.0,
        missing: Vec::new(),
    };
    let mut reached = 0;
    for (file, shard) in &shards {
        same_run(file, &shard.header, &header)?;
        let [start, end] = shard.range;
        if start < reached {
            return Err(ShardError::Overlap { file: file.clone(), start, end: end.max(1) - 1 });
        }
        let mut lack = |from: u64, to: u64| {
            if from < to {
                merged.missing.push(from..to);
            }
        };
        lack(reached, start);
        lack(shard.next, end);
        reached = end;
        merged.tally.merge(&shard.tally);
        merged.seconds += shard.seconds;
    }
    if reached < header.trials {
        merged.missing.push(reached..header.trials);
    }
    Ok(merged)
}

/// All shard files below the given folders.
pub fn load_folders(folders: &[PathBuf]) -> Result<Vec<(PathBuf, Shard)>, ShardError> {
    let mut shards = Vec::new();
    for folder in folders {
        let read = |source| ShardError::Read { file: folder.clone(), source };
        let mut files: Vec<PathBuf> = std::fs::read_dir(folder)
            .map_err(read)?
            .map(|entry| entry.map(|e| e.path()))
            .collect::<Result<_, _>>()
            .map_err(read)?;
        files.retain(|f| {
            let name = f.file_name().and_then(|n| n.to_str()).unwrap_or_default();
            name.starts_with("shard-") && name.ends_with(".json")
        });
        if files.is_empty() {
            return Err(ShardError::Empty { folder: folder.clone() });
        }
        for file in files {
            let shard = Shard::load(&file)?;
            shards.push((file, shard));
        }
    }
    Ok(shards)
}

/// Refuses a header that differs, naming the first part that does.
pub fn same_run(file: &Path, found: &Header, expected: &Header) -> Result<(), ShardError> {
    let parts: [(&'static str, String, String); 7] = [
        ("program version", found.version.clone(), expected.version.clone()),
        ("scenario", found.scenario.clone(), expected.scenario.clone()),
        ("scenario text", found.scenario_sha256.clone(), expected.scenario_sha256.clone()),
        ("seed", found.seed.to_string(), expected.seed.to_string()),
        ("number of trials", found.trials.to_string(), expected.trials.to_string()),
        (
            "estimator",
            format!("{} with {}", found.estimator, found.covariance),
            format!("{} with {}", expected.estimator, expected.covariance),
        ),
        (
            "parameters",
            format!("{} of them or their truth", found.parameters.len()),
            format!("{} others", expected.parameters.len()),
        ),
    ];
    let parameters_differ = found.parameters != expected.parameters;
    for (what, found, expected) in parts {
        let differs = if what == "parameters" { parameters_differ } else { found != expected };
        if differs {
            return Err(ShardError::Mismatch { file: file.to_owned(), what, found, expected });
        }
    }
    Ok(())
}
