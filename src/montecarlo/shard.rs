//! A stretch of trials: run in parallel, saved, resumed, merged.

use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::trials::{Content, Difference, Gathered, Trials, run_one};
use crate::output::{OutputError, write_atomically};

/// What must be equal for two shards to belong together.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, bound = "")]
pub struct Header<C: Content> {
    /// Always [`Content::SCHEMA`].
    pub schema: String,
    /// Version of the program.
    pub version: String,
    /// Name of the scenario.
    pub scenario: String,
    /// SHA-256 of the scenario's text, its robot and its motions.
    pub scenario_sha256: String,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Trials of the whole run.
    pub trials: u64,
    /// What the kind of experiment adds.
    pub content: C,
}

/// A shard's file: its header, its range of trials, how far it has come, and the sums so far.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, bound = "")]
pub struct Shard<C: Content> {
    /// What it is part of.
    pub header: Header<C>,
    /// First trial and the one behind the last.
    pub range: [u64; 2],
    /// First trial that has not been run.
    pub next: u64,
    /// Time spent on trials, s, summed over resumptions.
    pub seconds: f64,
    /// What the trials from `range[0]` to `next` add up to.
    pub tally: C::Gathered,
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

/// Longest time whose work a kill can lose.
const SAVE_EVERY: Duration = Duration::from_secs(5);

impl<C: Content> Shard<C> {
    /// No trials run yet.
    pub fn new<T: Trials<Content = C>>(experiment: &T, trials: u64, range: Range<u64>) -> Self {
        let scenario = experiment.scenario();
        let content = experiment.content();
        Self {
            tally: content.nothing(),
            header: Header {
                schema: C::SCHEMA.to_owned(),
                version: env!("CARGO_PKG_VERSION").to_owned(),
                scenario: scenario.name.clone(),
                scenario_sha256: scenario.sha256.clone(),
                seed: scenario.seed,
                trials,
                content,
            },
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
        if shard.header.schema != C::SCHEMA {
            let (found, expected) = (&shard.header.schema, C::SCHEMA);
            return Err(format(format!("schema {found}, expected {expected}")));
        }
        let [start, end] = shard.range;
        let run = shard.next.checked_sub(start);
        if shard.next > end || run != Some(shard.tally.trials()) {
            let trials = shard.tally.trials();
            return Err(format(format!("{trials} trials do not fit {start}…{}", shard.next)));
        }
        if !shard.tally.fits(&shard.header.content.nothing()) {
            return Err(format(
                "its sums are not those of the parameters in its header".to_owned(),
            ));
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
    pub fn run<T: Trials<Content = C>>(
        &mut self,
        experiment: &T,
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
            let end = (self.next + T::BATCH_PER_THREAD * threads as u64).min(self.range[1]);
            let trials = self.next..end;
            // Thread t runs every threads-th trial of the batch; sums do not depend on the order.
            let parts: Vec<C::Gathered> = pool.install(|| {
                workers
                    .par_iter_mut()
                    .enumerate()
                    .map(|(t, worker)| {
                        let mut tally = experiment.content().nothing();
                        for trial in trials.clone().skip(t).step_by(threads) {
                            run_one::<T>(worker, trial, &mut tally);
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
pub struct Merged<C: Content> {
    /// Common header.
    pub header: Header<C>,
    /// All trials.
    pub tally: C::Gathered,
    /// Sum of the time spent on trials, s.
    pub seconds: f64,
    /// Trials that no shard has run.
    pub missing: Vec<Range<u64>>,
}

/// Merges shards (with the files they come from); any order gives the same bits.
pub fn merge<C: Content>(mut shards: Vec<(PathBuf, Shard<C>)>) -> Result<Merged<C>, ShardError> {
    shards.sort_by_key(|(_, shard)| shard.range);
    let Some((_, first)) = shards.first() else {
        return Err(ShardError::Empty { folder: PathBuf::new() });
    };
    let header = first.header.clone();
    let mut merged = Merged {
        tally: header.content.nothing(),
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

/// The names of all shard files in the given folders.
pub fn shard_files(folders: &[PathBuf]) -> Result<Vec<PathBuf>, ShardError> {
    let mut all = Vec::new();
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
        all.append(&mut files);
    }
    Ok(all)
}

/// The shards in `files`, each with its file.
pub fn load_all<C: Content>(files: &[PathBuf]) -> Result<Vec<(PathBuf, Shard<C>)>, ShardError> {
    files.iter().map(|file| Ok((file.clone(), Shard::load(file)?))).collect()
}

/// Format of the shard in `file`: which kind of experiment it is part of.
pub fn schema_of(file: &Path) -> Result<String, ShardError> {
    #[derive(Deserialize)]
    struct AnyShard {
        header: AnyHeader,
    }
    #[derive(Deserialize)]
    struct AnyHeader {
        schema: String,
    }
    let text = std::fs::read_to_string(file)
        .map_err(|source| ShardError::Read { file: file.to_owned(), source })?;
    let shard: AnyShard = serde_json::from_str(&text)
        .map_err(|e| ShardError::Format { file: file.to_owned(), message: e.to_string() })?;
    Ok(shard.header.schema)
}

/// Refuses a header that differs, naming the first part that does.
pub fn same_run<C: Content>(
    file: &Path,
    found: &Header<C>,
    expected: &Header<C>,
) -> Result<(), ShardError> {
    let parts: [(&'static str, String, String); 5] = [
        ("program version", found.version.clone(), expected.version.clone()),
        ("scenario", found.scenario.clone(), expected.scenario.clone()),
        (
            "scenario text, robot or motion",
            found.scenario_sha256.clone(),
            expected.scenario_sha256.clone(),
        ),
        ("seed", found.seed.to_string(), expected.seed.to_string()),
        ("number of trials", found.trials.to_string(), expected.trials.to_string()),
    ];
    let outer = parts
        .into_iter()
        .find(|(_, found, expected)| found != expected)
        .map(|(what, found, expected)| Difference { what, found, expected });
    match outer.or_else(|| found.content.difference(&expected.content)) {
        Some(Difference { what, found, expected }) => {
            Err(ShardError::Mismatch { file: file.to_owned(), what, found, expected })
        }
        None => Ok(()),
    }
}
