//! Output files: checked before the work starts, and afterwards either complete or not there at all.

use std::ffi::{OsStr, OsString};
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use thiserror::Error;

/// An output file that cannot be written, and what to do about it.
#[derive(Debug, Error)]
pub enum OutputError {
    /// The path names a folder.
    #[error("{}: this is a folder; name a file to write", path.display())]
    IsFolder {
        /// The output asked for.
        path: PathBuf,
    },
    /// The folder to write into does not exist.
    #[error("{}: the folder {} does not exist; create it first", path.display(), folder.display())]
    NoFolder {
        /// The output asked for.
        path: PathBuf,
        /// The folder that is missing.
        folder: PathBuf,
    },
    /// The file or its folder does not accept writing.
    #[error("{}: cannot be written: {source}", path.display())]
    NotWritable {
        /// The output asked for.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
    /// An output would overwrite a file that the command reads.
    #[error("{}: the command reads this file; name another one to write", path.display())]
    IsInput {
        /// The output asked for.
        path: PathBuf,
    },
    /// Two outputs would go to the same file.
    #[error("{}: two outputs would go to this file; name two", path.display())]
    Twice {
        /// The output asked for.
        path: PathBuf,
    },
    /// No space is left.
    #[error("{}: the disk is full; nothing was written, free some space and run again", path.display())]
    DiskFull {
        /// The output asked for.
        path: PathBuf,
    },
}

impl OutputError {
    fn new(path: &Path, source: io::Error) -> Self {
        let path = path.to_owned();
        match source.kind() {
            ErrorKind::StorageFull | ErrorKind::QuotaExceeded => Self::DiskFull { path },
            _ => Self::NotWritable { path, source },
        }
    }
}

/// Checks that `path` can be written now: its folder exists and accepts a new file, and the path is neither a folder
/// nor read-only. Called before long work, so that its result is not lost at the end.
pub fn check_writable(path: &Path) -> Result<(), OutputError> {
    let fault = |e| OutputError::new(path, e);
    match Target::find(path)? {
        Target::StandardOutput | Target::StandardError => {}
        Target::Device => {
            open_device(path).map_err(fault)?;
        }
        Target::File { path: file, .. } => {
            Partial::create(&file).map_err(fault)?;
        }
    }
    Ok(())
}

/// Checks that all `outputs` can be written ([`check_writable`]) and that none of them would replace another output or
/// one of the `inputs`.
pub fn check_outputs(
    outputs: impl IntoIterator<Item = impl AsRef<Path>>,
    inputs: impl IntoIterator<Item = impl AsRef<Path>>,
) -> Result<(), OutputError> {
    let inputs: Vec<PathBuf> =
        inputs.into_iter().filter_map(|input| file_behind(input.as_ref())).collect();
    let mut taken: Vec<(PathBuf, bool)> = Vec::new();
    for output in outputs {
        let path = output.as_ref();
        check_writable(path)?;
        let Some(file) = file_behind(path) else { continue };
        if inputs.contains(&file) {
            return Err(OutputError::IsInput { path: path.to_owned() });
        }
        // Several outputs may be added to an open file, but what replaces it would be all that is left.
        let is_replaced = place(path).is_some();
        if taken.iter().any(|(other, replaced)| *other == file && (is_replaced || *replaced)) {
            return Err(OutputError::Twice { path: path.to_owned() });
        }
        taken.push((file, is_replaced));
    }
    Ok(())
}

/// The regular file that is read or written under the name `path`, which may be that of an open file.
fn file_behind(path: &Path) -> Option<PathBuf> {
    place(path).or_else(|| fs::canonicalize(path).ok().filter(|file| file.is_file()))
}

/// The file that `path` names, with all links resolved, whether it exists or not; `None` for paths that no file can
/// replace: a device, a folder, a file that cannot be written.
fn place(path: &Path) -> Option<PathBuf> {
    let Target::File { path, .. } = Target::find(path).ok()? else { return None };
    let folder = fs::canonicalize(folder_of(&path)).ok()?;
    Some(folder.join(path.file_name()?))
}

/// Writes `path` as a whole: into a temporary file beside it, which is forced to disk and then renamed. On any error,
/// including one of the writer itself, an earlier file of that name stays as it was and the temporary file is removed.
/// A device, or an open file of this program (such as `/dev/stdout`), is written directly.
pub fn write_atomically(
    path: &Path,
    write: impl FnOnce(&mut dyn Write) -> io::Result<()>,
) -> Result<(), OutputError> {
    let fault = |e| OutputError::new(path, e);
    match Target::find(path)? {
        Target::StandardOutput => fill(io::stdout(), write).map_err(fault),
        Target::StandardError => fill(io::stderr(), write).map_err(fault),
        Target::Device => open_device(path).and_then(|file| fill(file, write)).map_err(fault),
        Target::File { path: file, permissions } => {
            let partial = Partial::create(&file).map_err(fault)?;
            fill(&partial.file, write).map_err(fault)?;
            if let Some(permissions) = permissions {
                fs::set_permissions(&partial.path, permissions).map_err(fault)?;
            }
            partial.file.sync_all().map_err(fault)?;
            partial.rename_to(&file).map_err(fault)
        }
    }
}

/// [`write_atomically`] for a text that is complete.
pub fn write_text(path: &Path, text: &str) -> Result<(), OutputError> {
    write_atomically(path, |out| out.write_all(text.as_bytes()))
}

fn fill(file: impl Write, write: impl FnOnce(&mut dyn Write) -> io::Result<()>) -> io::Result<()> {
    let mut buffer = BufWriter::with_capacity(1 << 16, file);
    write(&mut buffer)?;
    buffer.flush()
}

/// Opens a device for appending: behind `/dev/fd/3` there may be a file that already has contents.
fn open_device(path: &Path) -> io::Result<File> {
    OpenOptions::new().append(true).open(path)
}

/// Longest chain of links that is followed, as in Linux.
const LINKS: usize = 40;

/// The kind of object that a path leads to.
enum Target {
    /// A regular file that exists or can be created; links are followed, so that a link stays a link.
    File { path: PathBuf, permissions: Option<fs::Permissions> },
    /// A terminal, pipe, device or open file, which cannot be replaced by renaming.
    Device,
    /// The standard output. Opened once more by its name, a file behind it would be written from its start.
    StandardOutput,
    /// The standard error, for which the same holds.
    StandardError,
}

impl Target {
    fn find(path: &Path) -> Result<Self, OutputError> {
        let fault = |e| OutputError::new(path, e);
        // Links are followed one by one: the name of an open file is a link too, but to the file behind it, and the
        // last link may lead to a file that does not exist yet. In a circle of links the last one remains, and is
        // refused.
        let mut end = path.to_owned();
        for _ in 0..LINKS {
            if let Some(open) = Self::of_open_file(&end) {
                return Ok(open);
            }
            let Ok(next) = fs::read_link(&end) else { break };
            end = folder_of(&end).join(next);
        }
        match fs::metadata(&end) {
            Ok(data) if data.is_dir() => Err(OutputError::IsFolder { path: path.to_owned() }),
            Ok(data) if !data.is_file() => Ok(Self::Device),
            Ok(data) if data.permissions().readonly() => {
                Err(fault(io::Error::new(ErrorKind::PermissionDenied, "the file is read-only")))
            }
            Ok(data) => Ok(Self::File {
                path: fs::canonicalize(&end).map_err(fault)?,
                permissions: Some(data.permissions()),
            }),
            Err(e) if e.kind() == ErrorKind::NotFound => {
                let folder = folder_of(&end).to_owned();
                match fs::metadata(&folder) {
                    Ok(data) if data.is_dir() && end.file_name().is_some() => {
                        Ok(Self::File { path: end, permissions: None })
                    }
                    _ => Err(OutputError::NoFolder { path: path.to_owned(), folder }),
                }
            }
            Err(e) => Err(fault(e)),
        }
    }

    /// What `path` leads to if it names an open file by its number, such as `/dev/fd/1` or `/proc/self/fd/1`, or
    /// anything else of the system in `/proc`. The rest of `/dev` is told by its kind: `/dev/shm` holds regular files.
    fn of_open_file(path: &Path) -> Option<Self> {
        let folder = fs::canonicalize(folder_of(path)).ok()?;
        let own = fs::canonicalize("/proc/self/fd").ok();
        let is_own = folder == Path::new("/dev/fd") || own.is_some_and(|own| folder == own);
        match path.file_name().and_then(OsStr::to_str) {
            Some("1") if is_own => Some(Self::StandardOutput),
            Some("2") if is_own => Some(Self::StandardError),
            _ => (is_own || folder.starts_with("/proc")).then_some(Self::Device),
        }
    }
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// A temporary file in the folder of its target; removed when dropped.
struct Partial {
    path: PathBuf,
    file: File,
}

impl Partial {
    fn create(target: &Path) -> io::Result<Self> {
        static NUMBER: AtomicU64 = AtomicU64::new(0);
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let mut name = OsString::from(".");
        name.push(target.file_name().unwrap_or_default());
        name.push(format!(".{}-{number}.part", std::process::id()));
        let path = folder_of(target).join(name);
        let file = OpenOptions::new().write(true).create_new(true).open(&path)?;
        Ok(Self { path, file })
    }

    fn rename_to(self, target: &Path) -> io::Result<()> {
        fs::rename(&self.path, target)?;
        // The rename itself reaches the disk only with the folder. Not every file system can sync a folder, and the
        // file is complete either way, so a refusal is not an error.
        if let Ok(folder) = File::open(folder_of(target)) {
            let _ = folder.sync_all();
        }
        Ok(())
    }
}

impl Drop for Partial {
    fn drop(&mut self) {
        // After a rename this finds no file to remove.
        let _ = fs::remove_file(&self.path);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<OsString> {
        fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name()).collect()
    }

    #[test]
    fn a_written_file_is_whole_and_alone() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.json");
        check_writable(&path).unwrap();
        assert!(names(folder.path()).is_empty(), "the check leaves nothing behind");
        for text in ["first", "second"] {
            write_atomically(&path, |w| w.write_all(text.as_bytes())).unwrap();
            assert_eq!(fs::read_to_string(&path).unwrap(), text);
        }
        assert_eq!(names(folder.path()), ["a.json"]);
    }

    #[test]
    fn a_failure_half_way_leaves_the_earlier_file_untouched() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.json");
        fs::write(&path, "earlier").unwrap();
        let error = write_atomically(&path, |w| {
            w.write_all(b"half")?;
            Err(ErrorKind::StorageFull.into())
        })
        .unwrap_err();
        assert!(error.to_string().contains("disk is full"), "{error}");
        assert_eq!(fs::read_to_string(&path).unwrap(), "earlier");
        assert_eq!(names(folder.path()), ["a.json"]);
    }

    #[test]
    fn unwritable_places_are_named_before_the_work() {
        let folder = tempfile::tempdir().unwrap();
        let error = check_writable(folder.path()).unwrap_err();
        assert!(matches!(error, OutputError::IsFolder { .. }), "{error}");
        let error = check_writable(&folder.path().join("missing/a.json")).unwrap_err();
        assert!(error.to_string().contains("missing does not exist"), "{error}");
        let locked = folder.path().join("locked.json");
        fs::write(&locked, "kept").unwrap();
        let mut permissions = fs::metadata(&locked).unwrap().permissions();
        permissions.set_readonly(true);
        fs::set_permissions(&locked, permissions).unwrap();
        let error = check_writable(&locked).unwrap_err();
        assert!(error.to_string().contains("read-only"), "{error}");
    }

    #[test]
    fn no_output_takes_the_place_of_an_input_or_of_another_output() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("log.csv"), "measured").unwrap();
        let same = at("../").join(folder.path().file_name().unwrap()).join("log.csv");
        assert!(matches!(
            check_outputs([&same], [at("log.csv")]),
            Err(OutputError::IsInput { .. })
        ));
        let twice = check_outputs([at("a.json"), at("./a.json")], [at("log.csv")]);
        assert!(matches!(twice, Err(OutputError::Twice { .. })));
        check_outputs([at("a.json"), at("a.html")], [at("log.csv"), at("missing.csv")]).unwrap();
        assert_eq!(names(folder.path()), ["log.csv"]);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_full_device_is_reported_and_not_replaced() {
        let full = Path::new("/dev/full");
        let error = write_atomically(full, |w| w.write_all(b"x")).unwrap_err();
        assert!(matches!(error, OutputError::DiskFull { .. }), "{error}");
        assert!(!fs::metadata(full).unwrap().is_file());
    }

    #[cfg(unix)]
    #[test]
    fn a_link_stays_a_link() {
        let folder = tempfile::tempdir().unwrap();
        let (file, link) = (folder.path().join("file"), folder.path().join("link"));
        fs::write(&file, "earlier").unwrap();
        std::os::unix::fs::symlink(&file, &link).unwrap();
        write_atomically(&link, |w| w.write_all(b"new")).unwrap();
        assert_eq!(fs::read_to_string(&file).unwrap(), "new");
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
    }

    /// Targets of links are relative to the folder of the link.
    #[cfg(unix)]
    #[test]
    fn a_link_to_a_file_that_is_not_there_yet_is_followed() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let link = |target: &str, name: &str| {
            std::os::unix::fs::symlink(target, at(name)).unwrap();
        };
        fs::create_dir(at("links")).unwrap();
        link("links/second", "first");
        link("../file", "links/second");
        let twice = check_outputs([at("first"), at("file")], [at("missing.csv")]);
        assert!(matches!(twice, Err(OutputError::Twice { .. })));
        write_text(&at("first"), "new").unwrap();
        assert_eq!(fs::read_to_string(at("file")).unwrap(), "new");
        assert!(["first", "links/second"].map(at).iter().all(|link| link.is_symlink()));

        link("nowhere/file", "lost");
        let error = check_writable(&at("lost")).unwrap_err();
        assert!(error.to_string().contains("nowhere does not exist"), "{error}");
        link("round", "about");
        link("about", "round");
        let error = check_writable(&at("about")).unwrap_err();
        assert!(matches!(error, OutputError::NotWritable { .. }), "{error}");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn the_standard_streams_are_known_by_all_their_names() {
        let folder = tempfile::tempdir().unwrap();
        let link = folder.path().join("link");
        std::os::unix::fs::symlink("/dev/stdout", &link).unwrap();
        let output = ["/dev/stdout", "/dev/../dev/stdout", "/dev/fd/1", "/proc/self/fd/1"];
        for path in output.map(Path::new).into_iter().chain([&*link]) {
            assert!(matches!(Target::find(path), Ok(Target::StandardOutput)), "{path:?}");
        }
        for path in ["/dev/stderr", "/dev/fd/2", "/proc/self/fd/2"].map(Path::new) {
            assert!(matches!(Target::find(path), Ok(Target::StandardError)), "{path:?}");
        }
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn an_open_file_is_added_to() {
        use std::os::fd::AsRawFd;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("all.txt");
        let mut file = File::create(&path).unwrap();
        file.write_all(b"earlier, ").unwrap();
        let open = PathBuf::from(format!("/dev/fd/{}", file.as_raw_fd()));
        check_outputs([&open], [&folder.path().join("log.csv")]).unwrap();
        write_text(&open, "new").unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "earlier, new");
        // A file that is read through its number is not to be replaced, nor one that is read to be added to.
        for (output, input) in [(&path, &open), (&open, &path), (&open, &open)] {
            let lost = check_outputs([output], [input]);
            assert!(matches!(lost, Err(OutputError::IsInput { .. })), "{output:?}");
        }
        let nothing: [&Path; 0] = [];
        check_outputs([&open, &open], nothing).unwrap();
        for outputs in [[&path, &open], [&open, &path]] {
            let lost = check_outputs(outputs, nothing);
            assert!(matches!(lost, Err(OutputError::Twice { .. })), "{outputs:?}");
        }
    }
}
