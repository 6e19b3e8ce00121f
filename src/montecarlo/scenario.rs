//! Scenarios: experiments on the simulated arm, described in TOML.

use std::path::{Path, PathBuf};

use serde::Deserialize;
use sha2::{Digest, Sha256};
use thiserror::Error;

use super::blind::BlindEntry;
use crate::base::{BaseSet, Parameterisation, ParameterisationError};
use crate::excitation::design::LONGEST_S;
use crate::excitation::{Excitation, ExcitationError, FourierSeries, Requirements};
use crate::identify::{Improper, Options};
use crate::input::read_text;
use crate::plant::faults::{Effect, FaultyPlant};
use crate::plant::{PlantConfig, PlantError, SensorConfig, Sensors};
use crate::robot::{Arm, LoadedArm, RobotError};

/// The scenario that runs when no file is given.
const DEFAULT: &str = include_str!("../../sims/default.toml");

/// A scenario that has been read and checked, ready to run.
#[derive(Debug, Clone)]
pub struct Scenario {
    /// Name; together with the seed it determines the random numbers.
    pub name: String,
    /// Purpose of the scenario, in a sentence.
    pub description: String,
    /// SHA-256 of the scenario's text and of the robot and the motions that it names.
    pub sha256: String,
    /// The files that the scenario names: robot and motions that are not built in.
    pub files: Vec<PathBuf>,
    /// The robot in the form that [`LoadedArm::load`] accepts from the working folder; empty if the scenario was not
    /// read from a file.
    pub robot: String,
    /// The arm with its true parameters.
    pub arm: Arm,
    /// Name of the reduced parameter set; `None` if the full set is identified.
    pub reduced: Option<String>,
    /// Base parameters that are identified.
    pub set: BaseSet,
    /// Name or file of the motion's trajectory.
    pub trajectory: String,
    /// The motion.
    pub excitation: Excitation,
    /// How the plant runs.
    pub plant: PlantConfig,
    /// Errors that the sensors add.
    pub sensors: SensorConfig,
    /// Effects hidden in the arm, of which the null model knows nothing.
    pub effects: Vec<Effect>,
    /// Whether the controller reads the noisy sensors, in which case the plant runs again for every trial.
    pub controller_reads_sensors: bool,
    /// How logs are processed.
    pub processing: Options,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Number of trials of a full run.
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
    /// Present if the scenario is a blind benchmark.
    pub(super) blind: Option<BlindEntry>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct MotionEntry {
    /// Built-in name or JSON file.
    pub(super) trajectory: String,
    periods: usize,
    /// Length of the run-in from rest, s. If left out, one that keeps the arm within its limits is chosen, or the one
    /// that exceeds them least.
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
        /// Why reading failed.
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
    /// The file is JSON, like the results of other commands.
    #[error(
        "{file}: is JSON, a scenario is TOML; `armid simulate --arm` takes a result of `armid identify --physical`"
    )]
    Json {
        /// The file.
        file: String,
    },
    /// The file is a blind benchmark, but a single arm was asked for.
    #[error("{file}: is a blind benchmark ([blind]), which only `montecarlo` can run")]
    Blind {
        /// The file.
        file: String,
    },
    /// A number with which no experiment is possible.
    #[error("{file}: {key} = {value} {requirement}")]
    Setting {
        /// The file.
        file: String,
        /// The key.
        key: &'static str,
        /// The value of the key.
        value: f64,
        /// Condition that the value must meet.
        requirement: &'static str,
    },
    /// The motion of the log does not repeat, so it cannot become the motion of a scenario.
    #[error(
        "{log}: its motion does not repeat, and that of a scenario does: --extended-scenario needs a log that repeats (--replay works \
         for a single run as well)"
    )]
    OnePeriod {
        /// The log.
        log: String,
    },
    /// Something that the file asks for is not possible.
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
    /// Adds the name of the file to an error that does not name it yet.
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
    /// Loads the scenario in `path`, or the default scenario if `path` is `None`.
    pub fn load(path: Option<&Path>) -> Result<Self, ScenarioError> {
        let source = Source::load(path)?;
        Self::from_toml(&source.text, &source.name, &source.folder)
    }

    /// The same experiment with another arm and that arm's base parameters.
    ///
    /// # Errors
    /// [`ScenarioError`] if the base parameters of that arm cannot be determined.
    pub fn with_arm(self, arm: Arm) -> Result<Self, ScenarioError> {
        let parameterisation = Parameterisation::of(&arm, self.reduced.as_deref())?;
        Ok(Self { set: BaseSet::find(&arm, parameterisation)?, arm, ..self })
    }

    /// All files of the scenario: its own file `path` and the files that it names.
    pub fn sources(&self, path: &Path) -> Vec<PathBuf> {
        [&[path.to_owned()], &self.files[..]].concat()
    }

    /// Reads a scenario from TOML text. Messages refer to the text as `source`; files that it names are relative to
    /// `folder`.
    pub fn from_toml(text: &str, source: &str, folder: &Path) -> Result<Self, ScenarioError> {
        let source = Source::new(text, source, folder);
        let file = source.parse()?;
        if file.blind.is_some() {
            return Err(ScenarioError::Blind { file: source.name });
        }
        Self::from_file(file, &source)
    }

    /// Builds the scenario from a parsed file.
    pub(super) fn from_file(file: ScenarioFile, source: &Source) -> Result<Self, ScenarioError> {
        Self::asked_for(file, source).map_err(|error| error.within(&source.name))
    }

    fn asked_for(file: ScenarioFile, source: &Source) -> Result<Self, ScenarioError> {
        source.check(file.trials > 0, "trials", 0.0, "must be at least 1")?;
        if let Some(Improper { key, value, requirement }) = file.processing.improper() {
            source.check(false, key, value, requirement)?;
        }
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

/// SHA-256 of all `texts` in sequence.
pub(super) fn fingerprint<'a>(texts: impl IntoIterator<Item = &'a String>) -> String {
    let mut hasher = Sha256::new();
    texts.into_iter().for_each(|text| hasher.update(text));
    hasher.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

impl MotionEntry {
    /// File of the trajectory; `None` for a built-in one.
    pub(super) fn file(&self, source: &Source) -> Option<PathBuf> {
        let path = PathBuf::from(source.beside(&self.trajectory));
        path.extension().is_some().then_some(path)
    }

    /// The motion that the entry describes, for `arm`.
    pub(super) fn excitation(
        &self,
        arm: &Arm,
        source: &Source,
    ) -> Result<Excitation, ScenarioError> {
        source.check(self.periods > 0, "motion.periods", 0.0, "must be at least 1")?;
        let series = FourierSeries::load(&source.beside(&self.trajectory))?;
        let data_s = self.periods as f64 * series.period_s;
        let requirement = "must make at most 86400 s of data";
        source.check(data_s <= LONGEST_S, "motion.periods", self.periods as f64, requirement)?;
        Ok(match self.run_in_s {
            Some(run_in_s) => {
                let excitation = Excitation::new(series, run_in_s, self.periods)?;
                let requirement = "and the periods must together make at most 86400 s";
                source.check(
                    data_s + run_in_s <= LONGEST_S,
                    "motion.run_in_s",
                    run_in_s,
                    requirement,
                )?;
                excitation
            }
            None => {
                let requirements = Requirements::default();
                Excitation::fitted_without_limits(arm, &requirements, series, self.periods)?
            }
        })
    }
}

/// The text of a scenario and where it comes from.
pub(super) struct Source {
    pub(super) text: String,
    /// Name of the text in messages.
    pub(super) name: String,
    /// Folder to which the files named in the text are relative.
    folder: PathBuf,
}

impl Source {
    pub(super) fn new(text: &str, name: &str, folder: &Path) -> Self {
        Self { text: text.to_owned(), name: name.to_owned(), folder: folder.to_owned() }
    }

    /// Reads the file `path`, or takes the default scenario if `path` is `None`.
    pub(super) fn load(path: Option<&Path>) -> Result<Self, ScenarioError> {
        let Some(path) = path else {
            let name = "sims/default.toml".to_owned();
            return Ok(Self { text: DEFAULT.to_owned(), name, folder: PathBuf::new() });
        };
        let text = read_text(path)
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

    /// Resolves `name`: a file relative to the scenario's folder, possibly followed by `#` and the last link of an arm,
    /// or the name of something built in.
    fn beside(&self, name: &str) -> String {
        let is_file = |name: &str| Path::new(name).extension().is_some();
        // Look for a file extension before the `#` only: names of links may contain slashes.
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

#[cfg(test)]
mod tests {
    use super::*;

    /// The periods of the default scenario take less than the longest time that a log may take, and a run-in of 1e8 s
    /// would not fit into memory.
    #[test]
    fn a_run_in_counts_with_the_periods() {
        let with_run_in = |run_in_s: &str| {
            let text = DEFAULT.replace("[motion]", &format!("[motion]\nrun_in_s = {run_in_s}"));
            Scenario::from_toml(&text, "long.toml", Path::new(""))
        };
        let loaded = with_run_in("2.0").unwrap();
        let whole_s = loaded.excitation.periods() as f64 * loaded.excitation.series().period_s;
        for too_long_s in [LONGEST_S - whole_s + 1.0, 1e8] {
            let message = with_run_in(&format!("{too_long_s:?}")).unwrap_err().to_string();
            let expected = format!(
                "long.toml: motion.run_in_s = {too_long_s} and the periods must together make at most 86400 s"
            );
            assert_eq!(message, expected);
        }
        with_run_in(&format!("{:?}", LONGEST_S - whole_s)).unwrap();
    }
}
