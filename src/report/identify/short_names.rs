//! Short names of several files.

use std::path::{Component, Path, PathBuf};

/// Names of the `files` that differ: each is that of the file without its extension, behind as many of its folders as
/// it takes to tell it from the others. A file that no folder tells from another keeps its whole path.
pub(super) fn short_names(files: &[&Path]) -> Vec<String> {
    let deepest = files.iter().map(|file| file.components().count()).max().unwrap_or(0);
    let short = |(k, file): (usize, &&Path)| {
        let is_unique = |folders: &usize| {
            let mut others = files.iter().enumerate().filter(|(other, _)| *other != k);
            others.all(|(_, other)| name(other, *folders) != name(file, *folders))
        };
        match (0..deepest).find(is_unique) {
            Some(folders) => name(file, folders),
            None => file.display().to_string(),
        }
    };
    files.iter().enumerate().map(short).collect()
}

/// The name of `file` without its extension, behind the last of its `folders`.
fn name(file: &Path, folders: usize) -> String {
    let bare = file.with_extension("");
    let parts: Vec<Component> = bare.components().collect();
    let kept = &parts[parts.len().saturating_sub(folders + 1)..];
    kept.iter().collect::<PathBuf>().display().to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_names_are_told_apart_by_the_fewest_folders() {
        let names = |files: &[&str]| {
            short_names(&files.iter().map(|file| Path::new(*file)).collect::<Vec<_>>())
        };
        assert_eq!(names(&["/x/a/run.csv", "b/walk.1.csv"]), ["run", "walk.1"]);
        assert_eq!(names(&["a/run.csv", "b/run.csv"]), ["a/run", "b/run"]);
        assert_eq!(names(&["x/a/run.csv", "y/a/run.csv", "z.csv"]), ["x/a/run", "y/a/run", "z"]);
        assert_eq!(names(&["run.csv", "b/run.csv"]), ["run", "b/run"]);
        assert_eq!(names(&["a/run.csv", "a/run.tsv"]), ["a/run.csv", "a/run.tsv"]);
        assert!(names(&[]).is_empty());
    }
}
