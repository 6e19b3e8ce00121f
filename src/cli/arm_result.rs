//! Reads the identified arm from a result of `armid identify --physical`.

use std::path::{Path, PathBuf};

use serde::Deserialize;
use thiserror::Error;

use super::robot::{OtherRobot, SavedRobot, load_robot};
use crate::dynamics::{Model, Parameter, ParameterLayout};
use crate::montecarlo::Scenario;
use crate::report::identify::{CONTRADICTED, IDENTIFY_SCHEMA};
use crate::report::physical::DecidedBy;
use crate::report::saved::{SavedError, load};
use crate::robot::{Arm, Frames, LoadedArm, RobotError, UrdfLink};

/// An identified arm.
#[derive(Debug, Clone, PartialEq)]
pub struct ArmResult {
    /// The robot with the identified parameters.
    pub arm: Arm,
    /// Constant torque offset per joint, Nm; kept here because an [`Arm`] has no offsets.
    pub offsets_nm: Vec<f64>,
    /// Names of the standard parameters that the robot file decided rather than the data.
    pub by_prior: Vec<String>,
    /// A warning if the identified model was wrong along its log or contradicted by it.
    pub doubt: Option<String>,
    /// Named frames on the bodies of the arm.
    pub frames: Frames,
    /// Files that describe the robot.
    pub files: Vec<PathBuf>,
    /// Links of the first file if it is a URDF or an MJCF; empty for other robots.
    pub urdf_links: Vec<UrdfLink>,
}

/// Why no arm can be read from a result file.
#[derive(Debug, Error)]
pub enum ResultError {
    /// The file cannot be read, or is not a result of `armid identify`.
    #[error("{0} (wanted: a result of armid identify --physical --json)")]
    Saved(#[from] SavedError),
    /// The result holds only base parameters, that is, combinations of standard parameters.
    #[error(
        "{file}: it has no standard parameters, only combinations of them: run identify --physical"
    )]
    BaseOnly {
        /// The file.
        file: String,
    },
    /// The result is about another robot than the one given.
    #[error("{file}: {fault}")]
    OtherRobot {
        /// The file.
        file: String,
        /// The difference.
        fault: OtherRobot,
    },
    /// The robot file is not where the result says.
    #[error(
        "{file}: the robot that it is about is found neither from here nor from the folder of that file: {fault}; say where it is with \
         --robot"
    )]
    NoRobot {
        /// The file.
        file: String,
        /// Why it could not be loaded.
        fault: Box<RobotError>,
    },
    /// A parameter is unknown, missing, duplicate or not a finite number.
    #[error("{file}: standard parameter \"{name}\" {fault}")]
    Parameter {
        /// The file.
        file: String,
        /// Name of the parameter.
        name: String,
        /// What is wrong with it.
        fault: &'static str,
    },
    /// The robot description itself is faulty.
    #[error(transparent)]
    Robot(#[from] RobotError),
}

#[derive(Deserialize)]
struct ResultFile {
    #[serde(flatten)]
    about: SavedRobot,
    standard_parameters: Option<Vec<Value>>,
    physical: Option<Found>,
    #[serde(default)]
    verdict: String,
}

/// How the standard parameters were found.
#[derive(Deserialize)]
struct Found {
    sentence: String,
    model_is_wrong: bool,
}

#[derive(Deserialize)]
struct Value {
    name: String,
    value: Option<f64>,
    decided_by: Option<DecidedBy>,
}

impl ArmResult {
    /// Reads the result in `path`. The arm is `robot`; without `robot`, the one that the result names; if that one is
    /// not found, the arm of the same name in `scenario`.
    pub fn load(
        path: &Path,
        robot: Option<&str>,
        scenario: Option<&Scenario>,
    ) -> Result<Self, ResultError> {
        let file = path.display().to_string();
        let result: ResultFile = load(path, IDENTIFY_SCHEMA)?;
        let values = result.standard_parameters.filter(|values| !values.is_empty());
        let values = values.ok_or_else(|| ResultError::BaseOnly { file: file.clone() })?;
        let LoadedArm { arm, frames, files, urdf_links, .. } = match robot {
            Some(robot) => load_robot(robot)?,
            None => named(&result.about, path, scenario)?,
        };
        let other = |fault| ResultError::OtherRobot { file: file.clone(), fault };
        result.about.check(&arm).map_err(other)?;
        let standard = standard(&arm, &values).map_err(|(name, fault)| ResultError::Parameter {
            file: file.clone(),
            name,
            fault,
        })?;
        let layout = ParameterLayout::new(arm.dof());
        let by_prior = values.into_iter().filter(|v| v.decided_by == Some(DecidedBy::Prior));
        let offset = |j| standard[layout.index(Parameter::Offset(j))];
        Ok(Self {
            offsets_nm: (0..arm.dof()).map(offset).collect(),
            arm: layout.apply(&standard, &arm),
            by_prior: by_prior.map(|v| v.name).collect(),
            doubt: match result.physical {
                _ if result.verdict == CONTRADICTED => Some(format!(
                    "{file}: its log contradicts the arm; this is the nearest arm that can exist"
                )),
                Some(found) if found.model_is_wrong => Some(format!(
                    "{file}: an arm with these parameters does not move as the recorded one did: {}",
                    found.sentence
                )),
                _ => None,
            },
            frames,
            files,
            urdf_links,
        })
    }
}

/// Loads the robot that the result in `path` names, or the robot of `scenario` if that is missing and has the same
/// name.
fn named(
    about: &SavedRobot,
    path: &Path,
    scenario: Option<&Scenario>,
) -> Result<LoadedArm, ResultError> {
    let same = scenario.filter(|scenario| scenario.arm.name == about.robot);
    match (about.load(path), same) {
        (Err(RobotError::Read { .. } | RobotError::UnknownName { .. }), Some(scenario)) => {
            Ok(load_robot(&scenario.robot)?)
        }
        (Err(fault @ (RobotError::Read { .. } | RobotError::UnknownName { .. })), None) => {
            Err(ResultError::NoRobot { file: path.display().to_string(), fault: Box::new(fault) })
        }
        (found, _) => Ok(found?),
    }
}

/// The values in the order of the parameter layout; torque offsets may be left out. An error consists of the name of a
/// parameter and what is wrong with it.
fn standard(arm: &Arm, values: &[Value]) -> Result<Vec<f64>, (String, &'static str)> {
    let layout = ParameterLayout::new(arm.dof());
    let mut standard: Vec<Option<f64>> = vec![None; layout.count()];
    for Value { name, value, .. } in values {
        let index = (0..layout.count())
            .find(|&k| layout.name(k) == *name)
            .ok_or_else(|| (name.clone(), "is not one of this arm"))?;
        let value = value.filter(|v| v.is_finite());
        let value = value.ok_or_else(|| (name.clone(), "is not a finite number"))?;
        if standard[index].replace(value).is_some() {
            return Err((name.clone(), "is there twice"));
        }
    }
    let nothing = Model::new(arm).standard_parameters();
    standard
        .into_iter()
        .enumerate()
        .map(|(k, value)| match (value, layout.parameter(k)) {
            (Some(value), _) => Ok(value),
            (None, Parameter::Offset(_)) => Ok(nothing[k]),
            (None, _) => Err((layout.name(k), "is missing")),
        })
        .collect()
}
