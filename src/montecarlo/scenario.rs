//! Scenarios: an experiment on the simulated arm, as TOML.

use std::path::{Path, PathBuf};

use serde::Deserialize;
use sha2::{Digest, Sha256};
use thiserror::Error;

use crate::base::{BaseSet, Parameterisation, ParameterisationError};
use crate::excitation::{Excitation, ExcitationError, FourierSeries, Requirements};
use crate::identify::Options;
use crate::plant::faults::{Effect, FaultyPlant};
use crate::plant::{PlantConfig, PlantError, SensorConfig, Sensors};
use crate::robot::{Arm, RobotError};

/// The scenario that runs when none is named.
const DEFAULT: &str = include_str!("../../sims/default.toml");

/// A scenario that has been read and checked: it can be run.
#[derive(Debug, Clone)]
pub struct Scenario {
    /// Name; together with the seed it selects the random numbers.
    pub name: String,
    /// What it is for, in a sentence.
    pub description: String,
    /// SHA-256 of its text.
    pub sha256: String,
    /// The arm, its truth included.
    pub arm: Arm,
    /// Base parameters that are identified.
    pub set: BaseSet,
    /// The motion.
    pub excitation: Excitation,
    /// How the plant runs.
    pub plant: PlantConfig,
    /// What the sensors add.
    pub sensors: SensorConfig,
    /// What is hidden in the arm: the null model knows nothing of it.
    pub effects: Vec<Effect>,
    /// Whether the controller reads the noisy sensors (the plant then runs anew for every trial).
    pub controller_reads_sensors: bool,
    /// How logs are processed.
    pub processing: Options,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Trials of a full run.
    pub trials: u64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ScenarioFile {
    name: String,
    #[serde(default)]
    description: String,
    robot: String,
    /// A reduced parameter set instead of the full one.
    reduced: Option<String>,
    seed: u64,
    trials: u64,
    #[serde(default)]
    controller_reads_sensors: bool,
    motion: MotionEntry,
    #[serde(default)]
    plant: PlantConfig,
    #[serde(default)]
    sensors: SensorConfig,
    #[serde(default, rename = "effect")]
    effects: Vec<Effect>,
    #[serde(default)]
    processing: Options,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MotionEntry {
    /// Built-in name or JSON file.
    trajectory: String,
    periods: usize,
    /// Length of the run-in from rest, s; chosen inside the limits where left out.
    run_in_s: Option<f64>,
}

/// A scenario that cannot be run.
#[derive(Debug, Error)]
pub enum ScenarioError {
    /// The file could not be read.
    #[error("{file}: {source}")]
    Read {
        /// The file.
        file: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// Not valid TOML, an unknown key, or a value of the wrong type.
    #[error("{file}: {message}")]
    Toml {
        /// The file.
        file: String,
        /// The parser's message with line and key.
        message: String,
    },
    /// A number that makes no experiment.
    #[error("{file}: {key} = {value} {requirement}")]
    Setting {
        /// The file.
        file: String,
        /// The key.
        key: &'static str,
        /// Its value.
        value: f64,
        /// What it must be.
        requirement: &'static str,
    },
    /// The arm.
    #[error(transparent)]
    Robot(#[from] RobotError),
    /// The parameter set.
    #[error(transparent)]
    Parameters(#[from] ParameterisationError),
    /// The base set.
    #[error(transparent)]
    Base(#[from] crate::base::AmbiguousRank),
    /// The motion.
    #[error(transparent)]
    Excitation(#[from] ExcitationError),
    /// Plant or sensors.
    #[error(transparent)]
    Plant(#[from] PlantError),
}

impl Scenario {
    /// The scenario in `path`, or the default one.
    pub fn load(path: Option<&Path>) -> Result<Self, ScenarioError> {
        let Some(path) = path else {
            return Self::from_toml(DEFAULT, "sims/default.toml", Path::new(""));
        };
        let text = std::fs::read_to_string(path)
            .map_err(|source| ScenarioError::Read { file: path.to_owned(), source })?;
        let folder = path.parent().unwrap_or(Path::new(""));
        Self::from_toml(&text, &path.display().to_string(), folder)
    }

    /// From TOML text; `source` names it in messages, files in it are relative to `folder`.
    pub fn from_toml(text: &str, source: &str, folder: &Path) -> Result<Self, ScenarioError> {
        let file: ScenarioFile = toml::from_str(text)
            .map_err(|e| ScenarioError::Toml { file: source.to_owned(), message: e.to_string() })?;
        let check = |ok: bool, key, value, requirement| match ok {
            true => Ok(()),
            false => Err(ScenarioError::Setting { file: source.into(), key, value, requirement }),
        };
        check(file.trials > 0, "trials", 0.0, "must be at least 1")?;
        check(file.motion.periods > 0, "motion.periods", 0.0, "must be at least 1")?;
        let beside = |name: &str| match Path::new(name).extension() {
            Some(_) => folder.join(name).display().to_string(),
            None => name.to_owned(),
        };
        let arm = Arm::load(&beside(&file.robot))?;
        let parameterisation = match &file.reduced {
            Some(name) => Parameterisation::reduced(name, &arm)?,
            None => Parameterisation::full(arm.dof(), arm.torque_offsets),
        };
        let series = FourierSeries::load(&beside(&file.motion.trajectory))?;
        let excitation = match file.motion.run_in_s {
            Some(run_in_s) => Excitation::new(series, run_in_s, file.motion.periods)?,
            None => {
                let requirements = Requirements::default();
                Excitation::fitted(&arm, &requirements, series, file.motion.periods, false)?
            }
        };
        FaultyPlant::new(&arm, &file.effects, &file.plant)?;
        Sensors::new(&file.sensors, &arm, file.plant.log_rate_hz)?;
        Ok(Self {
            set: BaseSet::find(&arm, parameterisation)?,
            name: file.name,
            description: file.description,
            sha256: Sha256::digest(text).iter().map(|byte| format!("{byte:02x}")).collect(),
            arm,
            excitation,
            plant: file.plant,
            sensors: file.sensors,
            effects: file.effects,
            controller_reads_sensors: file.controller_reads_sensors,
            processing: file.processing,
            seed: file.seed,
            trials: file.trials,
        })
    }
}
