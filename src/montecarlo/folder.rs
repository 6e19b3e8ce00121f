//! The shard files of a folder.

use std::ops::Range;
use std::path::{Path, PathBuf};

use serde::Deserialize;

use super::shard::{Shard, ShardError, shard_range};
use super::trials::Content;

/// Path of the shard file in `folder` that holds the trials `range`.
pub fn shard_path(folder: &Path, range: &Range<u64>) -> PathBuf {
    folder.join(format!("shard-{:012}-{:012}.json", range.start, range.end))
}

/// The range of trials of the shard in `file`, read from the file name.
fn range_of(file: &Path) -> Option<Range<u64>> {
    let name = file.file_name()?.to_str()?;
    let (start, end) = name.strip_prefix("shard-")?.strip_suffix(".json")?.split_once('-')?;
    Some(start.parse().ok()?..end.parse().ok()?)
}

/// The paths of all shard files in the given folders.
pub fn shard_files(folders: &[PathBuf]) -> Result<Vec<PathBuf>, ShardError> {
    let mut all = Vec::new();
    for folder in folders {
        let mut files = files_of(folder)?;
        if files.is_empty() {
            return Err(ShardError::Empty { folder: folder.clone() });
        }
        all.append(&mut files);
    }
    Ok(all)
}

/// The shard files of `folder`, in arbitrary order.
fn files_of(folder: &Path) -> Result<Vec<PathBuf>, ShardError> {
    let read = |source| ShardError::Read { file: folder.to_owned(), source };
    let mut files: Vec<PathBuf> = std::fs::read_dir(folder)
        .map_err(read)?
        .map(|entry| entry.map(|e| e.path()))
        .collect::<Result<_, _>>()
        .map_err(read)?;
    files.retain(|file| {
        let name = file.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        name.starts_with("shard-") && name.ends_with(".json")
    });
    Ok(files)
}

/// Loads the shards in `files` and pairs each with its path.
pub fn load_all<C: Content>(files: &[PathBuf]) -> Result<Vec<(PathBuf, Shard<C>)>, ShardError> {
    files.iter().map(|file| Ok((file.clone(), Shard::load(file)?))).collect()
}

/// The part of the header that all kinds of shards share.
#[derive(Deserialize)]
pub(super) struct AnyHeader {
    pub schema: String,
    pub trials: u64,
}

impl AnyHeader {
    /// Reads the header of the shard whose file contains `text`.
    pub fn within(text: &str) -> serde_json::Result<Self> {
        #[derive(Deserialize)]
        struct AnyShard {
            header: AnyHeader,
        }
        Ok(serde_json::from_str::<AnyShard>(text)?.header)
    }

    fn load(file: &Path) -> Result<Self, ShardError> {
        let text = std::fs::read_to_string(file)
            .map_err(|source| ShardError::Read { file: file.to_owned(), source })?;
        Self::within(&text)
            .map_err(|e| ShardError::Format { file: file.to_owned(), message: e.to_string() })
    }
}

/// Schema of the shard in `file`, which tells the kind of experiment it belongs to.
pub fn schema_of(file: &Path) -> Result<String, ShardError> {
    Ok(AnyHeader::load(file)?.schema)
}

/// Refuses a `folder` that holds shards of another cut than `trials` trials in `count` parts: shards written next to
/// them could never be merged with them. Only one file is opened to check the length of its run, because every shard
/// passed the same check when it was added to the folder.
pub fn check_cut(folder: &Path, trials: u64, count: u64) -> Result<(), ShardError> {
    if !folder.exists() {
        return Ok(());
    }
    let files = files_of(folder)?.into_iter();
    let mut shards: Vec<(PathBuf, Range<u64>)> =
        files.filter_map(|file| range_of(&file).map(|range| (file, range))).collect();
    shards.sort_by(|(a, _), (b, _)| a.cmp(b));
    for (file, found) in &shards {
        if !is_of_the_cut(found, trials, count) {
            let (file, Range { start, end }) = (file.clone(), found.clone());
            return Err(ShardError::OtherCut { file, start, end, trials, shards: count });
        }
    }
    let Some((file, _)) = shards.first() else { return Ok(()) };
    match AnyHeader::load(file)?.trials {
        found if found == trials => Ok(()),
        found => Err(ShardError::OtherLength { file: file.clone(), found, expected: trials }),
    }
}

/// Whether `range` is one of the `count` parts into which `trials` trials are cut.
fn is_of_the_cut(range: &Range<u64>, trials: u64, count: u64) -> bool {
    if range.start >= trials {
        return false;
    }
    // The part that holds the first trial of `range` is the first part that ends after this trial.
    let behind = u128::from(range.start) + 1;
    let index = (behind * u128::from(count)).div_ceil(u128::from(trials)) as u64 - 1;
    shard_range(trials, index, count) == *range
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_parts_of_a_cut_are_known_and_no_others() {
        for (trials, count) in [(10, 3), (7, 7), (1000, 8), (1, 1), (3, 5), (1_000_000_007, 999)] {
            for index in (0..count).step_by((count as usize / 50).max(1)) {
                let range = shard_range(trials, index, count);
                // An empty part has no file, so it does not count as a part of the cut.
                assert_eq!(is_of_the_cut(&range, trials, count), !range.is_empty(), "{range:?}");
                let longer = range.start..range.end + 1;
                assert!(range.is_empty() || !is_of_the_cut(&longer, trials, count), "{longer:?}");
            }
        }
        assert!(!is_of_the_cut(&(10..20), 10, 1));
    }

    /// A folder belongs to one run: another length or another cut is detected before anything is written to the folder.
    #[test]
    fn a_folder_of_another_run_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let here = folder.path();
        check_cut(&here.join("missing"), 10, 2).unwrap();
        check_cut(here, 10, 2).unwrap();
        let file = shard_path(here, &(0..5));
        std::fs::write(&file, r#"{"header": {"schema": "x", "trials": 10}}"#).unwrap();
        std::fs::write(here.join("shard-0.log"), "no shard").unwrap();
        check_cut(here, 10, 2).unwrap();
        let cut = check_cut(here, 10, 1).unwrap_err();
        assert!(matches!(cut, ShardError::OtherCut { start: 0, end: 5, .. }), "{cut}");
        let length = check_cut(here, 15, 3).unwrap_err();
        let is_it = matches!(length, ShardError::OtherLength { found: 10, expected: 15, .. });
        assert!(is_it, "{length}");
        assert_eq!(shard_files(&[here.to_owned()]).unwrap(), [file]);
    }
}
