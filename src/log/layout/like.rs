//! Layouts that inherit from another one through `like` and override parts of it.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use toml::{Table, Value};

use super::fault::LayoutFault;
use super::{Layout, built_in, is_file};
use crate::input::read_text;
use crate::log::error::LogError;

/// Keys that a layout must have, either itself or by inheritance.
const NEEDED: [&str; 2] = ["name", "header"];
/// Tables that are overridden key by key; any other key is overridden as a whole.
const BY_KEY: [&str; 2] = ["units", "columns"];

/// The text of a layout and its name in messages; `name` is a built-in layout, or a file in `folder`.
pub(super) fn text_of(name: &str, folder: &Path) -> Result<(String, String), LogError> {
    if let Some(text) = built_in(name) {
        return Ok((text.to_owned(), name.to_owned()));
    }
    if !is_file(name) {
        return Err(LogError::UnknownLayout { name: name.to_owned() });
    }
    let file = folder.join(name).display().to_string();
    match read_text(&file) {
        Ok(text) => Ok((text, file)),
        Err(e) => Err(LogError::Layout { file, fault: LayoutFault::Read(e) }),
    }
}

/// Parses `text`, read from `source`, and lays it over the layouts that it inherits from.
pub(super) fn overlaid(text: &str, source: &str) -> Result<Layout, LogError> {
    let (table, layout) = overlaid_within(text, source, &mut Vec::new())?;
    match NEEDED.into_iter().find(|key| !table.contains_key(*key)) {
        Some(key) => {
            let fault = LayoutFault::MissingKey { key };
            Err(LogError::Layout { file: source.to_owned(), fault })
        }
        None => Ok(layout),
    }
}

/// As [`overlaid`], without the check for required keys; `above` holds the files that inherit from this one.
fn overlaid_within(
    text: &str,
    source: &str,
    above: &mut Vec<PathBuf>,
) -> Result<(Table, Layout), LogError> {
    let fault = |fault| LogError::Layout { file: source.to_owned(), fault };
    let toml = |e: toml::de::Error| fault(LayoutFault::Toml(e.to_string()));
    // Each file is parsed as text before it is merged, because only then can an error name the line.
    let own: Layout = toml::from_str(text).map_err(toml)?;
    let table = text.parse::<Table>().map_err(toml)?;
    let Some(like) = own.like.clone() else {
        let stated = table.clone();
        return Ok((table, Layout { source: source.to_owned(), stated, ..own }));
    };
    let in_like = |error| fault(LayoutFault::Like { like: like.clone(), fault: Box::new(error) });
    let folder = Path::new(source).parent().unwrap_or(Path::new(""));
    let (below, name) = match text_of(&like, folder) {
        Err(LogError::Layout { file, fault: LayoutFault::Read(e) })
            if e.kind() == ErrorKind::NotFound =>
        {
            let looked_for = std::path::absolute(&file).unwrap_or_else(|_| file.into());
            return Err(fault(LayoutFault::NoLike { like: like.clone(), looked_for }));
        }
        found => found.map_err(in_like)?,
    };
    above.push(real_path(source));
    if above.contains(&real_path(&name)) {
        return Err(fault(LayoutFault::LikeItself { like: like.clone() }));
    }
    let (mut merged, below) = overlaid_within(&below, &name, above).map_err(in_like)?;
    let stated = table.clone();
    for (key, value) in table {
        match (merged.get_mut(&key), value) {
            (Some(Value::Table(there)), Value::Table(own)) if BY_KEY.contains(&&*key) => {
                there.extend(own);
            }
            (_, value) => {
                merged.insert(key, value);
            }
        }
    }
    let layout: Layout = merged.clone().try_into().map_err(toml)?;
    let below = Some(Box::new(below));
    Ok((merged, Layout { source: source.to_owned(), below, stated, ..layout }))
}

/// The canonical path of a file, by which it is recognised under any of its names.
fn real_path(name: &str) -> PathBuf {
    Path::new(name).canonicalize().unwrap_or_else(|_| name.into())
}

/// A check of a layout.
type Check<'a> = &'a dyn Fn(&Layout) -> Result<(), LayoutFault>;

impl Layout {
    /// The files that make up the layout, its own first; none for a built-in layout.
    pub fn files(&self) -> Vec<PathBuf> {
        let own = is_file(&self.source).then(|| PathBuf::from(&self.source));
        let below = self.below.iter().flat_map(|below| below.files());
        own.into_iter().chain(below).collect()
    }

    /// Whether `key` is stated in a layout that inherits `other`. A key within a table is written behind that of the
    /// table.
    pub(super) fn overrides(&self, key: &[&str], other: &[&str]) -> bool {
        self.depth_of(key).zip(self.depth_of(other)).is_some_and(|(key, other)| key < other)
    }

    /// How many steps of `like` lead to the nearest layout that states `key`; `None` if none does.
    fn depth_of(&self, key: &[&str]) -> Option<usize> {
        let (first, rest) = key.split_first()?;
        let mut own = self.stated.get(*first);
        for key in rest {
            own = own.and_then(|table| table.get(*key));
        }
        match own {
            Some(_) => Some(0),
            None => Some(1 + self.below.as_ref()?.depth_of(key)?),
        }
    }

    /// Runs `check`; a fault is attributed to the deepest layout of the chain that already has it.
    pub(super) fn checked_by(&self, check: Check) -> Result<(), LogError> {
        check(self).map_err(|fault| self.told(fault, check))
    }

    fn told(&self, fault: LayoutFault, check: Check) -> LogError {
        let message = fault.to_string();
        let is_same = |other: LayoutFault| other.to_string() == message;
        let fault = match (&self.below, &self.like) {
            (Some(below), Some(like)) if check(below).is_err_and(is_same) => {
                LayoutFault::Like { like: like.clone(), fault: Box::new(below.told(fault, check)) }
            }
            _ => fault,
        };
        LogError::Layout { file: self.source.clone(), fault }
    }
}

#[cfg(test)]
mod tests {
    use std::path::MAIN_SEPARATOR;

    use super::*;
    use crate::log::layout::block::Block;
    use crate::log::read_log_from;

    #[test]
    fn what_it_does_not_say_is_as_in_the_other() {
        let text = "name = \"turned\"\nlike = \"armid\"\n[joints]\ntorque_reversed = [2]\n[columns]\ntorque = \"tau_{0}\"\n";
        let layout = Layout::from_toml(text, "turned.toml").unwrap();
        let armid = Layout::default();
        assert_eq!(layout.name, "turned");
        assert_eq!(layout.columns(Block::Torque).unwrap().name(1).unwrap(), "tau_1");
        assert_eq!(layout.columns(Block::Q), armid.columns(Block::Q));
        assert!(layout.counting(6).torque()[1].is_reversed);
    }

    /// A folder of layouts.
    struct Folder(tempfile::TempDir);

    impl Folder {
        fn with(files: &[(&str, &str)]) -> Self {
            let folder = Self(tempfile::tempdir().unwrap());
            for (name, text) in files {
                std::fs::write(folder.0.path().join(name), text).unwrap();
            }
            folder
        }

        fn load(&self, name: &str) -> Result<Layout, LogError> {
            Layout::load(self.0.path().join(name).to_str().unwrap())
        }

        /// The message of the error, without the path of the folder.
        fn told(&self, error: &LogError) -> String {
            let path = format!("{}{MAIN_SEPARATOR}", self.0.path().display());
            error.to_string().replace(&path, "")
        }
    }

    #[test]
    fn files_are_looked_for_beside_the_layout() {
        let a = "name = \"a\"\nlike = \"armid\"\n[joints]\nmotion_reversed = [1, 2]\n";
        let b = "like = \"a.toml\"\n[joints]\nmotion_reversed = [3]\n";
        let folder = Folder::with(&[("a.toml", a), ("b.toml", b)]);
        let layout = folder.load("b.toml").unwrap();
        let reversed: Vec<bool> =
            layout.counting(3).motion().iter().map(|place| place.is_reversed).collect();
        assert_eq!(reversed, [false, false, true]);
        assert_eq!((&*layout.name, layout.files().len()), ("a", 2), "{:?}", layout.files());
    }

    /// Of currents and torques those count that are stated nearest to the layout, and torques where neither is nearer.
    #[test]
    fn the_nearest_effort_counts() {
        let all = "name = \"all\"\nheader = false\n[columns]\ntime = 1\nq = { first = 2, last = 3 }\n\
            current = { first = 4, last = 5 }\ntorque = { first = 6, last = 7 }\n\
            [[width]]\nfields = 7\nblocks = [\"time\", \"q\", \"current\", \"torque\"]\n";
        let folder = Folder::with(&[
            ("all.toml", all),
            (
                "current.toml",
                "like = \"all.toml\"\ncolumns = { current = { first = 4, last = 5 } }\n",
            ),
            ("same.toml", "like = \"current.toml\"\n"),
            (
                "torque.toml",
                "like = \"same.toml\"\ncolumns = { torque = { first = 6, last = 7 } }\n",
            ),
        ]);
        let file = "0.0,1,1,40,50,60,70\n0.1,1,1,40,50,60,70\n0.2,1,1,40,50,60,70\n";
        for (name, effort) in
            [("all.toml", 60.0), ("current.toml", 40.0), ("same.toml", 40.0), ("torque.toml", 60.0)]
        {
            let layout = folder.load(name).unwrap();
            let log = read_log_from(file.as_bytes(), "x.csv", &layout, 2).unwrap();
            assert_eq!(log.effort.signals().joint(0)[0], effort, "{name}");
        }
    }

    #[test]
    fn a_layout_that_it_cannot_be_like_is_named() {
        for (like, parts) in [
            ("\"ur10\"", vec!["like = \"ur10\": unknown layout", "ur10e_innopolis"]),
            ("\"no.toml\"", vec!["like = \"no.toml\": there is no no.toml", "beside"]),
            ("1", vec!["line 2", "expected a string"]),
            ("\"d.toml\"", vec!["like = \"d.toml\" leads back"]),
        ] {
            let text = format!("name = \"d\"\nlike = {like}\n");
            let folder = Folder::with(&[("d.toml", &*text)]);
            let message = folder.told(&folder.load("d.toml").unwrap_err());
            assert!(message.starts_with("layout d.toml: "), "{like}: {message}");
            assert!(parts.iter().all(|part| message.contains(*part)), "{like}: {message}");
        }
    }

    /// A chain of layouts ends at one without `like`; a circular chain does not end.
    #[test]
    fn a_circle_is_no_long_row() {
        let like = |k: usize| format!("name = \"{k}\"\nlike = \"{}.toml\"\n", k + 1);
        let files: Vec<(String, String)> =
            (0..20).map(|k| (format!("{k}.toml"), like(k))).collect();
        let mut files: Vec<(&str, &str)> =
            files.iter().map(|(name, text)| (&**name, &**text)).collect();
        files.push(("20.toml", "like = \"armid\"\n"));
        assert_eq!(Folder::with(&files).load("0.toml").unwrap().name, "0");
        files.truncate(2);
        files.push(("2.toml", "like = \"1.toml\"\n"));
        let folder = Folder::with(&files);
        let message = folder.told(&folder.load("0.toml").unwrap_err());
        let chain = "layout 0.toml: like = \"1.toml\": layout 1.toml: like = \"2.toml\": layout 2.toml: like = \"1.toml\" leads back";
        assert!(message.starts_with(chain), "{message}");
    }

    #[test]
    fn a_mistake_is_told_in_the_file_that_makes_it() {
        let chain = "layout b.toml: like = \"a.toml\": layout a.toml: ";
        for (mistake, parts) in [
            ("headr = true", ["line 3", "`headr`", "`like`"]),
            ("units = { q = \"grad\" }", ["line 3", "`grad`", "`deg`"]),
            ("drive_gain_nm_a = [1, -2]", ["drive_gain_nm_a", "joint 2", "-2"]),
            ("joints = { motion_reversed = [2, 2] }", ["motion_reversed", "joint 2", "twice"]),
            ("joints = { order = [1, 2] }", ["order", "2 number", "6 joints"]),
            ("joints = { zero = [0] }", ["zero", "1 number", "6 joints"]),
            ("joints = { motion_reversed = [7] }", ["motion_reversed", "joint 7", "6 joints"]),
        ] {
            let a = format!("name = \"a\"\nlike = \"armid\"\n{mistake}\n");
            let b = "name = \"b\"\nlike = \"a.toml\"\n";
            let folder = Folder::with(&[("a.toml", &*a), ("b.toml", b)]);
            for (file, begin) in [("a.toml", "layout a.toml: "), ("b.toml", chain)] {
                let used = folder.load(file).and_then(|layout| layout.check_for(6));
                let message = folder.told(&used.unwrap_err());
                assert!(message.starts_with(begin), "{mistake}: {message}");
                assert!(parts.iter().all(|part| message.contains(*part)), "{mistake}: {message}");
            }
        }
        let a = "name = \"a\"\nlike = \"armid\"\njoints = { zero = [0, 90] }\nunits = { q = \"deg\" }\n";
        let b = "name = \"b\"\nlike = \"a.toml\"\nunits = { q = \"rad\" }\n";
        let folder = Folder::with(&[("a.toml", a), ("b.toml", b)]);
        folder.load("a.toml").unwrap();
        let message = folder.told(&folder.load("b.toml").unwrap_err());
        assert!(message.starts_with("layout b.toml: zero under [joints] is 90"), "{message}");
    }

    #[test]
    fn keys_that_a_layout_needs_are_missed_by_name() {
        for (text, key) in [("header = true", "name"), ("name = \"a\"", "header")] {
            let message = Layout::from_toml(text, "a.toml").unwrap_err().to_string();
            assert!(message.starts_with(&format!("layout a.toml: {key} is missing")), "{message}");
        }
    }
}
