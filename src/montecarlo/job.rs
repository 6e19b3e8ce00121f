//! Jobs: what a scenario file asks for.

use std::path::Path;

use super::blind::BlindPlan;
use super::scenario::{Scenario, ScenarioError, Source};

/// A job that `montecarlo` can run.
#[derive(Debug, Clone)]
pub enum Job {
    /// One arm, identified from many noisy logs.
    Estimates(Box<Scenario>),
    /// Many arms with hidden effects, each diagnosed from one log.
    Blind(Box<BlindPlan>),
}

impl Job {
    /// Loads the job in the file `path`, or the default scenario if `path` is `None`.
    pub fn load(path: Option<&Path>) -> Result<Self, ScenarioError> {
        Self::from_source(&Source::load(path)?)
    }

    /// Reads the job from TOML text; messages refer to the text as `name`.
    pub fn from_toml(text: &str, name: &str) -> Result<Self, ScenarioError> {
        Self::from_source(&Source::new(text, name, Path::new("")))
    }

    fn from_source(source: &Source) -> Result<Self, ScenarioError> {
        let mut file = source.parse()?;
        Ok(match file.blind.take() {
            Some(entry) => {
                let base = Scenario::from_file(file, source)?;
                let plan = BlindPlan::new(base, entry, source);
                Self::Blind(Box::new(plan.map_err(|error| error.within(&source.name))?))
            }
            None => Self::Estimates(Box::new(Scenario::from_file(file, source)?)),
        })
    }

    /// The scenario; for a blind benchmark the base scenario, to which each trial adds its draws.
    pub fn scenario_mut(&mut self) -> &mut Scenario {
        match self {
            Self::Estimates(scenario) => scenario,
            Self::Blind(plan) => &mut plan.base,
        }
    }
}
