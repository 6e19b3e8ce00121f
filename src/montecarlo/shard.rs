//! Shards: contiguous ranges of trials that are run in parallel, saved, resumed and merged.

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

/// Header of a shard: everything that must be equal for two shards to belong to the same run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, bound = "")]
pub struct Header<C: Content> {
    /// Always [`Content::SCHEMA`].
    pub schema: String,
    /// Version of the program.
    pub version: String,
    /// SHA-256 of the program; empty if unknown. This is the only part in which shards of one run may differ.
    pub program: String,
    /// Name of the scenario.
    pub scenario: String,
    /// SHA-256 of the scenario's text, its robot and its motions.
    pub scenario_sha256: String,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Number of trials of the whole run.
    pub trials: u64,
    /// The part that is specific to the kind of experiment.
    pub content: C,
}

/// Contents of a shard file: the header, the range of trials, the progress, and the sums so far.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, bound = "")]
pub struct Shard<C: Content> {
    /// The run that the shard is part of.
    pub header: Header<C>,
    /// First trial, and one past the last.
    pub range: [u64; 2],
    /// First trial that has not been run.
    pub next: u64,
    /// Time spent on trials, s, summed over resumptions.
    pub seconds: f64,
    /// Sum over the trials from `range[0]` up to, but not including, `next`.
    pub tally: C::Gathered,
}

/// Error in running, saving, reading, resuming or merging shards.
#[derive(Debug, Error)]
pub enum ShardError {
    /// A file could not be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// A file or folder could not be read.
    #[error("{file}: {source}")]
    Read {
        /// The file or folder.
        file: PathBuf,
        /// Why reading failed.
        source: std::io::Error,
    },
    /// The file is not a shard file of this version.
    #[error("{file}: not a shard file this program can read: {message}")]
    Format {
        /// The file.
        file: PathBuf,
        /// The parser's message.
        message: String,
    },
    /// The shards belong to different runs.
    #[error("{file}: its {what} is {found}, but the others have {expected}: not the same run")]
    Mismatch {
        /// The file.
        file: PathBuf,
        /// Which part of the header differs.
        what: String,
        /// Its value in this file.
        found: String,
        /// Its value in the first file.
        expected: String,
    },
    /// The shard was begun by another build of the program.
    #[error(
        "{file}: its first {trials} trials were run by another build of this program (SHA-256 {found}, now {expected}): go on \
         with that one, or begin again in another --out"
    )]
    OtherProgram {
        /// The file.
        file: PathBuf,
        /// Number of trials that have been run.
        trials: u64,
        /// The build that ran them.
        found: String,
        /// The build that is running.
        expected: String,
    },
    /// The shard belongs to a run that is cut differently.
    #[error(
        "{file}: trials {start} up to {end} are none of the {shards} shards of {trials} trials: this folder is another run's, or \
         --trials or --shard were others; give those, or another --out"
    )]
    OtherCut {
        /// The file.
        file: PathBuf,
        /// First trial of the shard.
        start: u64,
        /// One past the last trial of the shard.
        end: u64,
        /// Number of trials of the run that was asked for.
        trials: u64,
        /// Number of shards of the run that was asked for.
        shards: u64,
    },
    /// The shard belongs to a run of another length.
    #[error(
        "{file}: it is a shard of {found} trials, not of {expected}: give --trials {found} to go on, or another --out"
    )]
    OtherLength {
        /// The file.
        file: PathBuf,
        /// Number of trials of the shard's run.
        found: u64,
        /// Number of trials that was asked for.
        expected: u64,
    },
    /// Two shards contain the same trials.
    #[error("{file}: trials {start}…{end} are in another shard too")]
    Overlap {
        /// The file.
        file: PathBuf,
        /// First trial of the shard.
        start: u64,
        /// Last trial of the shard.
        end: u64,
    },
    /// The folder contains no shards.
    #[error("{folder}: no shard files (shard-*.json)")]
    Empty {
        /// The folder.
        folder: PathBuf,
    },
    /// The threads could not be started.
    #[error("could not start {threads} threads: {message}")]
    Threads {
        /// Number of threads asked for.
        threads: usize,
        /// Why not.
        message: String,
    },
}

/// Trials of shard `index` (0-based) of `count`. The ranges are contiguous and differ in size by at most one.
pub fn shard_range(trials: u64, index: u64, count: u64) -> Range<u64> {
    let bound = |i: u64| (u128::from(trials) * u128::from(i) / u128::from(count)) as u64;
    bound(index)..bound(index + 1)
}

/// Interval between saves: a killed run loses at most the work of this time and the trials in progress.
const SAVE_EVERY: Duration = Duration::from_secs(5);

impl<C: Content> Shard<C> {
    /// A shard of which no trial has been run yet.
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

    /// Writes the shard file atomically.
    pub fn save(&self, file: &Path) -> Result<(), ShardError> {
        Ok(write_atomically(file, |out| serde_json::to_writer(out, self).map_err(Into::into))?)
    }

    /// Refuses to continue the shard in `file` unless it was begun by the program with the SHA-256 `program`.
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

    /// Whether all trials of the shard have been run.
    pub fn is_complete(&self) -> bool {
        self.next == self.range[1]
    }

    /// Runs the missing trials on `threads` threads, until all are done or `stop` is set.
    ///
    /// `progress` is called with the number of trials of this shard that have been run. `file` is written every few
    /// seconds and at the end, so that a killed run loses little and a resumed run repeats nothing that was saved.
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
        // Threads take trials in ascending order and finish every trial they have taken, so that the trials that have
        // been run leave no gap.
        let next = &AtomicU64::new(self.next);
        let nothing = &experiment.content().nothing();
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
                        let mut outcome = nothing.clone();
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

    /// Adds the outcomes in the order of the trial numbers until all senders are gone, and saves every few seconds.
    fn collect(
        &mut self,
        outcomes: Receiver<(u64, C::Gathered)>,
        file: Option<&Path>,
        progress: &(dyn Fn(u64) + Sync),
    ) -> Result<(), ShardError> {
        let (begun, before) = (Instant::now(), self.seconds);
        let mut saved = begun;
        // Outcomes that arrived before those of trials with lower numbers.
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

    /// Trials that all fail, with their number as the reason; each calls `seen` before it ends.
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

    /// The flag is checked before every trial: trials already begun are finished, no others are started, and no trial
    /// with a lower number is left out.
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
        // Each of the three threads runs at most one trial whose number is 105 or higher.
        assert!((106..=108).contains(&shard.next), "{}", shard.next);
        assert_eq!(trials_of(&shard), (100..shard.next).collect::<Vec<_>>());
        assert_eq!(*reached.lock().unwrap(), shard.next - 100);
        stop.store(false, Ordering::Relaxed);
        let experiment = counting(|_| ());
        shard.run(&experiment, 2, None, &stop, &progress).unwrap();
        assert!(shard.is_complete());
        assert_eq!(trials_of(&shard), (100..200).collect::<Vec<_>>());
    }

    /// A file of an older program is reported as having another format, not as lacking some field.
    #[test]
    fn the_format_is_looked_at_first() {
        let file = tempfile::NamedTempFile::new().unwrap();
        let old = r#"{"header": {"schema": "armid.blind-shard/2", "trials": 3}}"#;
        std::fs::write(file.path(), old).unwrap();
        let error = Shard::<BlindContent>::load(file.path()).unwrap_err().to_string();
        assert!(error.contains("schema armid.blind-shard/2, expected"), "{error}");
    }

    /// A shard that one build began must not be continued by another, because the file could not say which build ran
    /// which trials.
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
