//! Scenarios: an experiment on the simulated arm, as TOML.

use std::path::{Path, PathBuf};

use serde::Deserialize;
use sha2::{Digest, Sha256};
use thiserror::Error;

use super::blind::BlindEntry;
use crate::base::{BaseSet, Parameterisation, ParameterisationError};
use crate::excitation::{Excitation, ExcitationError, FourierSeries, Requirements};
use crate::identify::Options;
use crate::plant::faults::{Effect, FaultyPlant};
use crate::plant::{PlantConfig, PlantError, SensorConfig, Sensors};
use crate::robot::{Arm, LoadedArm, RobotError};

/// The scenario that runs when none is named.
const DEFAULT: &str = include_str!("../../sims/default.toml");

/// A scenario that has been read and checked: it can be run.
#[derive(Debug, Clone)]
pub struct Scenario {
    /// Name; together with the seed it selects the random numbers.
    pub name: String,
    /// What it is for, in a sentence.
    pub description: String,
    /// SHA-256 of its text and of the robot and the motions that it names.
    pub sha256: String,
    /// The files that it names: robot and motions that are not built in.
    pub files: Vec<PathBuf>,
    /// Its robot as [`LoadedArm::load`] takes it from the working folder; empty where no file names it.
    pub robot: String,
    /// The arm, its truth included.
    pub arm: Arm,
    /// Name of the reduced parameter set, if not the full one is identified.
    pub reduced: Option<String>,
    /// Base parameters that are identified.
    pub set: BaseSet,
    /// Name or file of the motion's trajectory.
    pub trajectory: String,
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
pub(super) struct ScenarioFile {
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
    /// Makes it a blind benchmark.
    pub(super) blind: Option<BlindEntry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MotionEntry {
    /// Built-in name or JSON file.
    pub(super) trajectory: String,
    periods: usize,
    /// Length of the run-in from rest, s; where left out chosen inside the limits, if there is one.
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
    /// JSON, as the results of other commands are.
    #[error(
        "{file}: is JSON, a scenario is TOML; `armid simulate --arm` takes a result of `armid identify --physical`"
    )]
    Json {
        /// The file.
        file: String,
    },
    /// A blind benchmark where one arm is asked for.
    #[error("{file}: is a blind benchmark ([blind]), which only `montecarlo` can run")]
    Blind {
        /// The file.
        file: String,
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
    /// A motion that does not repeat is no scenario's.
    #[error("{log}: its motion does not repeat, and that of a scenario does")]
    OnePeriod {
        /// The log.
        log: String,
    },
    /// Something that the file asks for.
    #[error("{file}: {source}")]
    Within {
        /// The file.
        file: String,
        /// What is wrong.
        source: Box<ScenarioError>,
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

impl ScenarioError {
    /// The same with the file's name, where it has none.
    pub(super) fn within(self, file: &str) -> Self {
        match self {
            Self::Robot(_)
            | Self::Parameters(_)
            | Self::Base(_)
            | Self::Excitation(_)
            | Self::Plant(_) => Self::Within { file: file.to_owned(), source: Box::new(self) },
            named => named,
        }
    }
}

impl Scenario {
    /// The scenario in `path`, or the default one.
    pub fn load(path: Option<&Path>) -> Result<Self, ScenarioError> {
        let source = Source::load(path)?;
        Self::from_toml(&source.text, &source.name, &source.folder)
    }

    /// The same experiment with another arm, its own base parameters among it.
    ///
    /// # Errors
    /// [`ScenarioError`] where the base parameters of that arm cannot be told.
    pub fn with_arm(self, arm: Arm) -> Result<Self, ScenarioError> {
        let parameterisation = Parameterisation::of(&arm, self.reduced.as_deref())?;
        Ok(Self { set: BaseSet::find(&arm, parameterisation)?, arm, ..self })
    }

    /// All files behind it: its own, `path`, and those that it names.
    pub fn sources(&self, path: &Path) -> Vec<PathBuf> {
        [&[path.to_owned()], &self.files[..]].concat()
    }

    /// From TOML text; `source` names it in messages, files in it are relative to `folder`.
    pub fn from_toml(text: &str, source: &str, folder: &Path) -> Result<Self, ScenarioError> {
        let source = Source::new(text, source, folder);
        let file = source.parse()?;
        if file.blind.is_some() {
            return Err(ScenarioError::Blind { file: source.name });
        }
        Self::from_file(file, &source)
    }

    /// From a parsed file.
    pub(super) fn from_file(file: ScenarioFile, source: &Source) -> Result<Self, ScenarioError> {
        Self::asked_for(file, source).map_err(|error| error.within(&source.name))
    }

    fn asked_for(file: ScenarioFile, source: &Source) -> Result<Self, ScenarioError> {
        source.check(file.trials > 0, "trials", 0.0, "must be at least 1")?;
        let robot = source.beside(&file.robot);
        let LoadedArm { arm, mut files, .. } = LoadedArm::load(&robot)?;
        let parameterisation = Parameterisation::of(&arm, file.reduced.as_deref())?;
        let excitation = file.motion.excitation(&arm, source)?;
        files.extend(file.motion.file(source));
        FaultyPlant::new(&arm, &file.effects, &file.plant)?;
        Sensors::new(&file.sensors, &arm, file.plant.log_rate_hz)?;
        Ok(Self {
            set: BaseSet::find(&arm, parameterisation)?,
            name: file.name,
            description: file.description,
            sha256: fingerprint([&source.text, &arm.to_toml(), &excitation.series().to_json()]),
            files,
            robot,
            arm,
            reduced: file.reduced,
            excitation,
            trajectory: file.motion.trajectory,
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

/// SHA-256 of all `texts`.
pub(super) fn fingerprint<'a>(texts: impl IntoIterator<Item = &'a String>) -> String {
    let mut hasher = Sha256::new();
    texts.into_iter().for_each(|text| hasher.update(text));
    hasher.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

impl MotionEntry {
    /// Its trajectory's file; `None` for one that is built in.
    pub(super) fn file(&self, source: &Source) -> Option<PathBuf> {
        let path = PathBuf::from(source.beside(&self.trajectory));
        path.extension().is_some().then_some(path)
    }

    /// The motion of `arm`.
    pub(super) fn excitation(
        &self,
        arm: &Arm,
        source: &Source,
    ) -> Result<Excitation, ScenarioError> {
        source.check(self.periods > 0, "motion.periods", 0.0, "must be at least 1")?;
        let series = FourierSeries::load(&source.beside(&self.trajectory))?;
        Ok(match self.run_in_s {
            Some(run_in_s) => Excitation::new(series, run_in_s, self.periods)?,
            None => {
                let requirements = Requirements::default();
                Excitation::fitted_without_limits(arm, &requirements, series, self.periods)?
            }
        })
    }
}

/// Where a scenario's text comes from.
pub(super) struct Source {
    pub(super) text: String,
    /// For messages.
    pub(super) name: String,
    /// Files that the text names are relative to it.
    folder: PathBuf,
}

impl Source {
    pub(super) fn new(text: &str, name: &str, folder: &Path) -> Self {
        Self { text: text.to_owned(), name: name.to_owned(), folder: folder.to_owned() }
    }

    /// The file `path`, or the default scenario.
    pub(super) fn load(path: Option<&Path>) -> Result<Self, ScenarioError> {
        let Some(path) = path else {
            let name = "sims/default.toml".to_owned();
            return Ok(Self { text: DEFAULT.to_owned(), name, folder: PathBuf::new() });
        };
        let text = std::fs::read_to_string(path)
            .map_err(|source| ScenarioError::Read { file: path.to_owned(), source })?;
        let folder = path.parent().unwrap_or(Path::new("")).to_owned();
        Ok(Self { text, name: path.display().to_string(), folder })
    }

    pub(super) fn parse(&self) -> Result<ScenarioFile, ScenarioError> {
        if self.text.trim_start().starts_with('{') {
            return Err(ScenarioError::Json { file: self.name.clone() });
        }
        toml::from_str(&self.text)
            .map_err(|e| ScenarioError::Toml { file: self.name.clone(), message: e.to_string() })
    }

    /// A file beside it, perhaps with the last link of an arm behind `#`, or the name of something built in.
    fn beside(&self, name: &str) -> String {
        let is_file = |name: &str| Path::new(name).extension().is_some();
        // Names of links may have slashes in them.
        if is_file(name) || name.rsplit_once('#').is_some_and(|(file, _)| is_file(file)) {
            self.folder.join(name).display().to_string()
        } else {
            name.to_owned()
        }
    }

    pub(super) fn check(
        &self,
        ok: bool,
        key: &'static str,
        value: f64,
        requirement: &'static str,
    ) -> Result<(), ScenarioError> {
        let file = || self.name.clone();
        if ok {
            Ok(())
        } else {
            Err(ScenarioError::Setting { file: file(), key, value, requirement })
        }
    }
}
