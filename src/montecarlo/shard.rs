//! A stretch of trials: run in parallel, saved, resumed, merged.

use std::collections::BTreeMap;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::folder::AnyHeader;
pub use super::merged::{Merged, merge, same_run};
use super::trials::{Content, Gathered, Trials, run_one};
use crate::output::{OutputError, write_atomically};

/// What must be equal for two shards to belong together.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, bound = "")]
pub struct Header<C: Content> {
    /// Always [`Content::SCHEMA`].
    pub schema: String,
    /// Version of the program.
    pub version: String,
    /// SHA-256 of the program; empty where it is not known. The one part in which shards of one run may differ.
    pub program: String,
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
        what: String,
        /// Its value.
        found: String,
        /// The value of the first file.
        expected: String,
    },
    /// A shard that another build of the program has begun.
    #[error(
        "{file}: its first {trials} trials were run by another build of this program (SHA-256 {found}, now {expected}): go on \
         with that one, or begin again in another --out"
    )]
    OtherProgram {
        /// The file.
        file: PathBuf,
        /// Trials that have been run.
        trials: u64,
        /// The build that ran them.
        found: String,
        /// This one.
        expected: String,
    },
    /// Shards of a run that is cut otherwise.
    #[error(
        "{file}: trials {start} up to {end} are none of the {shards} shards of {trials} trials: this folder is another run's, or \
         --trials or --shard were others; give those, or another --out"
    )]
    OtherCut {
        /// The file.
        file: PathBuf,
        /// First trial of the shard.
        start: u64,
        /// The one behind its last.
        end: u64,
        /// Trials of the run that was asked for.
        trials: u64,
        /// Its shards.
        shards: u64,
    },
    /// Shards of a run of another length.
    #[error(
        "{file}: it is a shard of {found} trials, not of {expected}: give --trials {found} to go on, or another --out"
    )]
    OtherLength {
        /// The file.
        file: PathBuf,
        /// Trials of its run.
        found: u64,
        /// Trials that were asked for.
        expected: u64,
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

/// Longest time whose work a kill can lose, the trials under way aside.
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
                program: String::new(),
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
        let AnyHeader { schema: found, .. } =
            AnyHeader::within(&text).map_err(|e| format(e.to_string()))?;
        if found != C::SCHEMA {
            return Err(format(format!("schema {found}, expected {}", C::SCHEMA)));
        }
        let shard: Self = serde_json::from_str(&text).map_err(|e| format(e.to_string()))?;
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

    /// Refuses to go on with the shard of `file` where another program than the one with the SHA-256 `program` has begun it.
    pub fn check_program(&self, file: &Path, program: &str) -> Result<(), ShardError> {
        let found = &self.header.program;
        if found == program {
            return Ok(());
        }
        Err(ShardError::OtherProgram {
            file: file.to_owned(),
            trials: self.next - self.range[0],
            found: found.clone(),
            expected: program.to_owned(),
        })
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
        let workers: Vec<_> = (0..threads).map(|_| experiment.worker()).collect();
        let end = self.range[1];
        // Threads take trials in their order, and finish what they took: what was run leaves no gap.
        let next = &AtomicU64::new(self.next);
        let (sender, outcomes) = channel();
        pool.in_place_scope(|scope| {
            for mut worker in workers {
                let sender = sender.clone();
                scope.spawn(move |_| {
                    while !stop.load(Ordering::Relaxed) {
                        let trial = next.fetch_add(1, Ordering::Relaxed);
                        if trial >= end {
                            break;
                        }
                        let mut outcome = experiment.content().nothing();
                        run_one::<T>(&mut worker, trial, &mut outcome);
                        if sender.send((trial, outcome)).is_err() {
                            break;
                        }
                    }
                });
            }
            drop(sender);
            self.collect(outcomes, file, progress)
        })?;
        file.map_or(Ok(()), |file| self.save(file))
    }

    /// Adds the outcomes of trials in the order of their numbers, until no more can come, and saves now and then.
    fn collect(
        &mut self,
        outcomes: Receiver<(u64, C::Gathered)>,
        file: Option<&Path>,
        progress: &(dyn Fn(u64) + Sync),
    ) -> Result<(), ShardError> {
        let (begun, before) = (Instant::now(), self.seconds);
        let mut saved = begun;
        // What came before the trials in front of it.
        let mut early = BTreeMap::new();
        for (trial, outcome) in outcomes {
            early.insert(trial, outcome);
            while let Some(outcome) = early.remove(&self.next) {
                self.tally.merge(&outcome);
                self.next += 1;
            }
            self.seconds = before + begun.elapsed().as_secs_f64();
            progress(self.next - self.range[0]);
            if let Some(file) = file.filter(|_| saved.elapsed() > SAVE_EVERY) {
                self.save(file)?;
                saved = Instant::now();
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::montecarlo::blind::{BlindContent, Record};
    use crate::montecarlo::trials::Failure;
    use crate::montecarlo::{Job, Scenario};
    use std::sync::Mutex;

    /// Trials that say their number and give nothing; each tells `seen` before it ends.
    struct Counting<F> {
        scenario: Scenario,
        seen: F,
    }

    impl<F: Fn(u64) + Sync> Trials for Counting<F> {
        type Content = BlindContent;
        type Worker<'a>
            = &'a F
        where
            Self: 'a;
        type Error = String;

        fn scenario(&self) -> &Scenario {
            &self.scenario
        }

        fn content(&self) -> BlindContent {
            BlindContent { known: Vec::new() }
        }

        fn worker(&self) -> &F {
            &self.seen
        }

        fn trial(seen: &mut &F, trial: u64) -> Result<Record, String> {
            (*seen)(trial);
            Err(trial.to_string())
        }
    }

    fn counting<F: Fn(u64) + Sync>(seen: F) -> Counting<F> {
        let Ok(Job::Estimates(scenario)) = Job::load(None) else { panic!("the default scenario") };
        Counting { scenario: *scenario, seen }
    }

    fn trials_of(shard: &Shard<BlindContent>) -> Vec<u64> {
        shard.tally.failures.iter().map(|Failure { trial, .. }| *trial).collect()
    }

    /// The flag is looked at before every trial: what was begun is finished, nothing else, and no trial in front is left out.
    #[test]
    fn an_interrupted_shard_has_no_gap_and_goes_on() {
        let stop = AtomicBool::new(false);
        let experiment = counting(|trial| {
            if trial >= 105 {
                stop.store(true, Ordering::Relaxed);
            }
        });
        let mut shard = Shard::new(&experiment, 1000, 100..200);
        let reached = Mutex::new(0);
        let progress = |n: u64| *reached.lock().unwrap() = n;
        shard.run(&experiment, 3, None, &stop, &progress).unwrap();
        // Each of three threads takes at most one trial from the 105th on.
        assert!((106..=108).contains(&shard.next), "{}", shard.next);
        assert_eq!(trials_of(&shard), (100..shard.next).collect::<Vec<_>>());
        assert_eq!(*reached.lock().unwrap(), shard.next - 100);
        stop.store(false, Ordering::Relaxed);
        let experiment = counting(|_| ());
        shard.run(&experiment, 2, None, &stop, &progress).unwrap();
        assert!(shard.is_complete());
        assert_eq!(trials_of(&shard), (100..200).collect::<Vec<_>>());
    }

    /// Files of older programs are said to be of another format, not to lack this or that.
    #[test]
    fn the_format_is_looked_at_first() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let old = r#"{"header": {"schema": "armid.blind-shard/2", "trials": 3}}"#;
        std::fs::write(file.path(), old).unwrap();
        let error = Shard::<BlindContent>::load(file.path()).unwrap_err().to_string();
        assert!(error.contains("schema armid.blind-shard/2, expected"), "{error}");
    }

    /// What one build began another must not go on with: the file could not say who ran what.
    #[test]
    fn a_shard_stays_with_its_program() {
        let of = |program: &str| {
            let mut shard = Shard::new(&counting(|_| ()), 1000, 0..10);
            shard.header.program = program.to_owned();
            shard
        };
        of("a").check_program(Path::new("s.json"), "a").unwrap();
        let error = of("a").check_program(Path::new("s.json"), "b").unwrap_err();
        assert!(matches!(error, ShardError::OtherProgram { .. }), "{error}");
    }
}
