//! Merging the shards of one run.

use std::collections::BTreeSet;
use std::ops::Range;
use std::path::{Path, PathBuf};

use super::shard::{Header, Shard, ShardError};
use super::trials::{Content, Difference, Gathered};

/// The merged shards of one run.
#[derive(Debug, Clone, PartialEq)]
pub struct Merged<C: Content> {
    /// Header that the shards have in common.
    pub header: Header<C>,
    /// The results of all trials.
    pub tally: C::Gathered,
    /// Sum of the time spent on trials, s.
    pub seconds: f64,
    /// Ranges of trials that no shard has run.
    pub missing: Vec<Range<u64>>,
    /// SHA-256 of every build of the program that has run some of the trials.
    pub programs: BTreeSet<String>,
}

impl<C: Content> Merged<C> {
    /// Leaves only those of the missing trials that are in `range`.
    pub fn look_only_at(&mut self, [first, end]: [u64; 2]) {
        let inside = self.missing.iter().map(|gap| gap.start.max(first)..gap.end.min(end));
        self.missing = inside.filter(|gap| !gap.is_empty()).collect();
    }
}

/// Merges shards, each given with its file. The result is the same to the last bit for any order.
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
        programs: shards.iter().map(|(_, shard)| shard.header.program.clone()).collect(),
    };
    let mut reached = 0;
    for (file, shard) in &shards {
        same_run(file, &shard.header, &header)?;
        let [start, end] = shard.range;
        if start < reached {
            let last = reached.min(end).max(1) - 1;
            return Err(ShardError::Overlap { file: file.clone(), start, end: last });
        }
        if reached < start {
            merged.missing.push(reached..start);
        }
        // Trials that this shard was meant to run but did not may be in another shard.
        reached = shard.next;
        merged.tally.merge(&shard.tally);
        merged.seconds += shard.seconds;
    }
    if reached < header.trials {
        merged.missing.push(reached..header.trials);
    }
    Ok(merged)
}

/// Refuses a header `found` that differs from `expected`; the error names the first part that differs.
pub fn same_run<C: Content>(
    file: &Path,
    found: &Header<C>,
    expected: &Header<C>,
) -> Result<(), ShardError> {
    let text = [
        ("program version", &found.version, &expected.version),
        ("scenario", &found.scenario, &expected.scenario),
        ("scenario text, robot or motion", &found.scenario_sha256, &expected.scenario_sha256),
    ];
    let numbers =
        [("seed", found.seed, expected.seed), ("number of trials", found.trials, expected.trials)];
    let text =
        text.into_iter().find_map(|(what, own, others)| Difference::between(what, own, others));
    let difference = text
        .or_else(|| {
            let mut numbers = numbers.into_iter();
            numbers.find_map(|(what, own, others)| Difference::between(what, own, others))
        })
        .or_else(|| found.content.difference(&expected.content));
    match difference {
        Some(Difference { what, found, expected }) => {
            Err(ShardError::Mismatch { file: file.to_owned(), what, found, expected })
        }
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::montecarlo::blind::{BlindContent, Records};
    use crate::montecarlo::trials::Failure;

    fn shard(range: [u64; 2], seed: u64, program: &str) -> (PathBuf, Shard<BlindContent>) {
        let content = BlindContent { known: Vec::new() };
        let header = Header {
            schema: BlindContent::SCHEMA.to_owned(),
            version: "1".to_owned(),
            program: program.to_owned(),
            scenario: "test".to_owned(),
            scenario_sha256: String::new(),
            seed,
            trials: 10,
            content,
        };
        let failures =
            (range[0]..range[1]).map(|trial| Failure { trial, reason: String::new() }).collect();
        let tally = Records { records: Vec::new(), failures };
        let shard = Shard { header, range, next: range[1], seconds: 1.0, tally };
        (PathBuf::from(format!("{}.json", range[0])), shard)
    }

    /// The first half of a run was stopped after three of its five trials. The trials of the second half are not its
    /// own.
    #[test]
    fn a_shard_that_was_stopped_misses_its_own_trials() {
        let (file, mut half) = shard([0, 5], 1, "a");
        half.next = 3;
        let mut merged = merge(vec![(file, half)]).unwrap();
        assert_eq!(merged.missing[0], 3..10);
        merged.look_only_at([0, 5]);
        assert_eq!((merged.missing.len(), merged.missing[0].clone()), (1, 3..5));
        let mut whole = merge(vec![shard([5, 8], 1, "a")]).unwrap();
        whole.look_only_at([5, 8]);
        assert!(whole.missing.is_empty());
    }

    #[test]
    fn builds_of_the_program_are_counted_and_other_runs_refused() {
        let merged = merge(vec![shard([4, 10], 1, "b"), shard([0, 4], 1, "a")]).unwrap();
        assert_eq!(merged.tally.trials(), 10);
        assert!(merged.missing.is_empty());
        assert_eq!(merged.programs.into_iter().collect::<Vec<_>>(), ["a", "b"]);
        let error = merge(vec![shard([0, 4], 1, "a"), shard([4, 10], 2, "a")]).unwrap_err();
        assert_eq!(
            error.to_string(),
            "4.json: its seed is 2, but the others have 1: not the same run"
        );
        let twice = merge(vec![shard([0, 5], 1, "a"), shard([4, 10], 1, "a")]).unwrap_err();
        assert!(matches!(twice, ShardError::Overlap { start: 4, end: 4, .. }), "{twice}");
        // The first shard was meant to run ten trials and ran four; the second one has the other six.
        let (file, mut half) = shard([0, 4], 1, "a");
        half.range = [0, 10];
        assert!(merge(vec![(file, half), shard([4, 10], 1, "a")]).unwrap().missing.is_empty());
    }
}
