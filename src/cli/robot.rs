//! Loads the robot that a command is about.

use std::path::Path;

use serde::Deserialize;
use thiserror::Error;

use crate::base::{BaseSet, Parameterisation};
use crate::report::ReportError;
use crate::report::json::Input;
use crate::robot::{Arm, Kinematics, KinematicsDifference, LoadedArm, RobotError, UrdfNotice};

/// Loads the robot given by `--robot` and prints the assumptions made about it, in one line where they are usual ones.
pub fn load_robot(name_or_path: &str) -> Result<LoadedArm, RobotError> {
    load_and_tell(name_or_path, |notices| {
        let mut brief: Vec<String> = notices.iter().filter_map(UrdfNotice::brief).collect();
        // There is a notice for every body with fixed links.
        brief.dedup();
        let line = format!(
            "assumed or interpreted: {} (in full: armid base --robot {name_or_path})",
            brief.join("; ")
        );
        let is_long = |notice: &&UrdfNotice| {
            notice.brief().is_none() && !matches!(notice, UrdfNotice::Shapes(_))
        };
        let long = notices.iter().filter(is_long).map(ToString::to_string);
        (!brief.is_empty()).then_some(line).into_iter().chain(long).collect()
    })
}

/// As [`load_robot`], with every assumption in full.
pub fn load_robot_in_full(name_or_path: &str) -> Result<LoadedArm, RobotError> {
    load_and_tell(name_or_path, |notices| notices.iter().map(ToString::to_string).collect())
}

/// Loads a robot and prints the `lines` about its notices.
fn load_and_tell(
    name_or_path: &str,
    lines: impl Fn(&[UrdfNotice]) -> Vec<String>,
) -> Result<LoadedArm, RobotError> {
    let loaded = LoadedArm::load(name_or_path)?;
    for line in lines(&loaded.notices) {
        eprintln!("note: {name_or_path}: {line}");
    }
    let arm = &loaded.arm;
    // A rank that is not clear is the business of the commands that need it.
    let set = BaseSet::find(arm, Parameterisation::full(arm.dof(), arm.torque_offsets));
    if let Some(doubt) = set.ok().and_then(|set| set.nearly_dependent()) {
        eprintln!("note: {name_or_path}: {doubt}");
    }
    Ok(loaded)
}

/// Files as inputs of a document, with checksums.
pub fn inputs<'a>(
    files: impl IntoIterator<Item = &'a (impl AsRef<Path> + ?Sized + 'a)>,
) -> Result<Vec<Input>, ReportError> {
    files.into_iter().map(|file| Input::of(file.as_ref())).collect()
}

/// The robot in a result of `armid identify`.
#[derive(Debug, Deserialize)]
pub struct SavedRobot {
    /// Name of the robot.
    pub robot: String,
    /// The argument from which `identify` loaded the robot. Missing in results of older versions.
    robot_source: Option<String>,
    /// Kinematics of the robot. Missing in results of older versions.
    kinematics: Option<Kinematics>,
}

/// The result cannot be used for the given robot.
#[derive(Debug, Error)]
pub enum OtherRobot {
    /// The names differ.
    #[error("it is about \"{found}\", not \"{expected}\"")]
    Name {
        /// Name in the result.
        found: String,
        /// Name of the given robot.
        expected: String,
    },
    /// The result holds a reduced parameter set, whose parameters differ from those of the full set.
    #[error(
        "it was identified with --reduced {set}, whose parameters are not those of the full set: identify without --reduced"
    )]
    Reduced {
        /// Name of the parameter set.
        set: String,
    },
    /// The names agree, but the kinematics differ.
    #[error(
        "it is about another \"{name}\" than the one given: {difference}; give the robot that was identified \
         with --robot"
    )]
    Kinematics {
        /// Name of both robots.
        name: String,
        /// The difference.
        difference: KinematicsDifference,
    },
}

impl SavedRobot {
    /// Loads the robot from which the result in `path` was identified: first from the working folder, as it was given
    /// to `identify`, then from the folder of the result.
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

    /// Refuses an `arm` that the result is not about.
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
