//! Loading of arms from any kind of file.

use std::path::{Path, PathBuf};

use super::{name, read_toml};
use crate::input::read_text;
use crate::robot::arm::Arm;
use crate::robot::error::RobotError;
use crate::robot::export::{DriveFile, Rest};
use crate::robot::mjcf::{self, MjcfArm, read_mjcf, read_mjcf_up_to};
use crate::robot::urdf::{Frames, UrdfArm, UrdfLink, UrdfNotice, read_urdf, read_urdf_up_to};

/// Extension that replaces `urdf` in `NAME.urdf` to name its drive file.
const DRIVES: &str = "drives.toml";

/// An arm and its origin.
#[derive(Debug, Clone, PartialEq)]
pub struct LoadedArm {
    /// The arm.
    pub arm: Arm,
    /// What had to be assumed or interpreted; a robot file leaves open only what its angles mean.
    pub notices: Vec<UrdfNotice>,
    /// Named frames on its bodies; only a URDF or an MJCF has any.
    pub frames: Frames,
    /// Links that its bodies consist of; only a URDF or an MJCF has any.
    pub urdf_links: Vec<UrdfLink>,
    /// Files that the arm was read from, the one that was named first: none for a built-in arm. For a URDF or an MJCF
    /// also the drive file and the meshes, for an MJCF the files that it includes.
    pub files: Vec<PathBuf>,
}

impl LoadedArm {
    /// Loads the arm that `name` names, as [`Arm::load`] does.
    pub fn load(name: &str) -> Result<Self, RobotError> {
        let (file, last_link) = name::split(name);
        let path = Path::new(file);
        let own = |arm| Self {
            arm,
            notices: Vec::new(),
            frames: Frames::default(),
            urdf_links: Vec::new(),
            files: vec![path.to_owned()],
        };
        let extension = path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase);
        match (extension.as_deref(), last_link) {
            (Some("urdf" | "xml" | "mjcf"), _) => {
                let text = text_of(path)?;
                let (mut loaded, meshes) = if is_urdf(path, &text) {
                    let UrdfArm { arm, frames, links, notices, meshes } = match last_link {
                        Some(last) => read_urdf_up_to(&text, file, last)?,
                        None => read_urdf(&text, file)?,
                    };
                    (Self { notices, frames, urdf_links: links, ..own(arm) }, meshes)
                } else {
                    let MjcfArm { arm, frames, links, notices, included, meshes } = match last_link
                    {
                        Some(last) => read_mjcf_up_to(&text, file, last)?,
                        None => read_mjcf(&text, file)?,
                    };
                    let mut loaded = Self { notices, frames, urdf_links: links, ..own(arm) };
                    loaded.files.extend(included);
                    (loaded, meshes)
                };
                let drives = path.with_extension(DRIVES);
                if drives.exists() {
                    loaded.take_drives(drives)?;
                }
                loaded.files.extend(meshes);
                Ok(loaded)
            }
            (Some("toml"), None) => {
                let (arm, notices) = read_toml(&text_of(path)?, file)?;
                Ok(Self { notices, ..own(arm) })
            }
            (Some("toml"), Some(link)) => Err(RobotError::Invalid {
                file: file.to_owned(),
                what: format!(
                    "\"#{link}\" is for a .urdf or an MJCF, a robot file is one arm: leave it out"
                ),
            }),
            _ => Ok(Self { files: Vec::new(), ..own(Arm::built_in(name)?) }),
        }
    }

    /// The drive file among the `files` of a loaded arm.
    pub fn drive_file(files: &[PathBuf]) -> Option<&PathBuf> {
        let ends_so = |file: &&PathBuf| file.to_string_lossy().ends_with(&format!(".{DRIVES}"));
        files.iter().skip(1).find(ends_so)
    }

    /// Applies the drive file beside the URDF or MJCF, and drops the notices that it settles.
    fn take_drives(&mut self, path: PathBuf) -> Result<(), RobotError> {
        let source = path.display().to_string();
        let drives = DriveFile::read(&text_of(&path)?, &source)?;
        let locked: Vec<&str> = self.notices.iter().flat_map(UrdfNotice::locked).collect();
        drives.apply(&mut self.arm, &locked, &source)?;
        let mut open = Vec::new();
        for notice in std::mem::take(&mut self.notices) {
            match drives.rest_of(notice) {
                Rest::Untouched(notice) => self.notices.push(notice),
                Rest::Open(notice) => open.push(notice),
                Rest::Nothing => {}
            }
        }
        self.notices.push(UrdfNotice::DriveFile { file: source, open });
        self.files.push(path);
        Ok(())
    }
}

/// Whether the `text` of `file` is a URDF: the content of an .xml decides.
pub(crate) fn is_urdf(file: &Path, text: &str) -> bool {
    file.extension().is_some_and(|end| end.eq_ignore_ascii_case("urdf")) || mjcf::is_urdf(text)
}

/// Reads the text of a file that describes a robot.
pub(crate) fn text_of(path: &Path) -> Result<String, RobotError> {
    read_text(path).map_err(|source| RobotError::Read { file: path.display().to_string(), source })
}
