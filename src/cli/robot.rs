//! The robot that a command is about.

use std::path::Path;

use serde::Deserialize;
use thiserror::Error;

use crate::report::ReportError;
use crate::report::json::Input;
use crate::robot::{Arm, Kinematics, KinematicsDifference, LoadedArm, RobotError};

/// The robot that `--robot` names; what was assumed about it goes to the terminal.
pub fn load_robot(name_or_path: &str) -> Result<LoadedArm, RobotError> {
    let loaded = LoadedArm::load(name_or_path)?;
    for notice in &loaded.notices {
        eprintln!("note: {name_or_path}: {notice}");
    }
    Ok(loaded)
}

/// Files as inputs of a document.
pub fn inputs<'a>(
    files: impl IntoIterator<Item = &'a (impl AsRef<Path> + ?Sized + 'a)>,
) -> Result<Vec<Input>, ReportError> {
    files.into_iter().map(|file| Input::of(file.as_ref())).collect()
}

/// The robot that a result of `armid identify` is about.
#[derive(Debug, Deserialize)]
pub struct SavedRobot {
    /// Its name.
    pub robot: String,
    /// What `identify` loaded it by. Not in results of older programs.
    robot_source: Option<String>,
    /// Nor this.
    kinematics: Option<Kinematics>,
}

/// A result is about another robot than the one given.
#[derive(Debug, Error)]
pub enum OtherRobot {
    /// By its name.
    #[error("it is about \"{found}\", not \"{expected}\"")]
    Name {
        /// Of the result.
        found: String,
        /// Of the robot given.
        expected: String,
    },
    /// With parameters about other frames.
    #[error(
        "it was identified with --reduced {set}, whose parameters are not those of the full set: identify without --reduced"
    )]
    Reduced {
        /// Name of its parameter set.
        set: String,
    },
    /// Of the same name, and yet another.
    #[error(
        "it is about another \"{name}\" than the one given: {difference}; give the robot that was identified \
         with --robot"
    )]
    Kinematics {
        /// Of both.
        name: String,
        /// In what they differ.
        difference: KinematicsDifference,
    },
}

impl SavedRobot {
    /// The robot by which the result in `path` was identified: from the working folder, as `identify` was given it, or from the
    /// folder of the result.
    pub fn load(&self, path: &Path) -> Result<LoadedArm, RobotError> {
        let name = self.robot_source.as_ref().unwrap_or(&self.robot);
        match load_robot(name) {
            Err(missing @ RobotError::Read { .. }) => {
                let beside = path.with_file_name(name).display().to_string();
                match load_robot(&beside) {
                    Err(RobotError::Read { .. }) => Err(missing),
                    found => found,
                }
            }
            found => found,
        }
    }

    /// Refuses an `arm` about which the result says nothing.
    pub fn check(&self, arm: &Arm) -> Result<(), OtherRobot> {
        if self.robot != arm.name {
            let (found, expected) = (self.robot.clone(), arm.name.clone());
            return Err(OtherRobot::Name { found, expected });
        }
        match self.kinematics.as_ref().and_then(|own| own.difference(arm)) {
            Some(difference) => Err(OtherRobot::Kinematics { name: arm.name.clone(), difference }),
            None => Ok(()),
        }
    }
}
