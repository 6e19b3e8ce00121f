//! One scenario made ready, and its trials.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::scenario::Scenario;
use super::simulation::Simulation;
use super::tally::{Outcome, Outcomes, Tally};
use super::trials::{Content, Difference, Trials};
use crate::dynamics::Model;
use crate::identify::covariance::{Covariance, CovarianceKind, squared_distance};
use crate::identify::{Estimator, Identification, Identifier, IdentifyError, Options};
use crate::plant::{Measured, PlantError};

/// A scenario whose plant has run: what all trials share.
pub struct Experiment {
    /// The scenario, its run and its sensors.
    pub simulation: Simulation,
    /// The arm's equations of motion.
    pub model: Model,
    /// True base parameters.
    pub truth: Vec<f64>,
    /// σ of the pilot trial per parameter: the unit of the tally.
    pub scale: Vec<f64>,
    /// The Cramér–Rao bound of every parameter; `None` where it is not known.
    pub least_sigma: Option<Vec<f64>>,
    /// The estimator that the pilot's log calls for, and all trials' with it.
    pub estimator: Estimator,
    /// The covariance that the pilot's log calls for, and all trials' with it.
    pub covariance: CovarianceKind,
}

/// Number of the pilot trial: its noise is its own and it is never counted.
const PILOT: u64 = u64::MAX;

/// A trial that gave no estimate.
#[derive(Debug, Error)]
pub enum TrialError {
    /// The plant did not run.
    #[error("the plant: {0}")]
    Plant(#[from] PlantError),
    /// The log was not identified.
    #[error("{0}")]
    Identify(#[from] IdentifyError),
    /// An estimate so far off that it is no estimate.
    #[error("{parameter}: estimate {z:.3e} pilot σ off the truth, σ {sigma:.3e} pilot σ")]
    Unsound {
        /// Name of the base parameter.
        parameter: String,
        /// (θ̂ − θ)/scale.
        z: f64,
        /// σ̂/scale.
        sigma: f64,
    },
    /// A combination of parameters that is said to be known without error.
    #[error("the covariance of the base parameters is singular")]
    Singular,
    /// All parameters together so far off that this is no estimate.
    #[error("all parameters together: squared error {squared:.3e} in units of their covariance")]
    TooFar {
        /// (θ̂ − θ)ᵀV⁻¹(θ̂ − θ).
        squared: f64,
    },
}

impl Experiment {
    /// Runs the plant once without noise, and a pilot trial that sets the scales.
    pub fn prepare(scenario: Scenario) -> Result<Self, TrialError> {
        let model = Model::new(&scenario.arm);
        let truth = scenario.set.values(&model.standard_parameters());
        let scale = vec![1.0; truth.len()];
        let pilot_options = scenario.processing.clone();
        let mut experiment = Self {
            simulation: Simulation::run(scenario)?,
            model,
            truth,
            scale,
            least_sigma: None,
            estimator: Estimator::Wls,
            covariance: CovarianceKind::Wls,
        };
        let pilot = experiment.worker_with(pilot_options).identify(PILOT)?;
        experiment.scale = pilot.sigma();
        experiment.estimator = pilot.estimator;
        experiment.covariance = pilot.covariance.kind;
        experiment.least_sigma = experiment.cramer_rao_bound()?;
        Ok(experiment)
    }

    /// What one thread needs to run trials.
    pub fn worker(&self) -> Worker<'_> {
        self.worker_with(Options {
            estimator: Some(self.estimator),
            covariance: Some(self.covariance),
            ..self.simulation.scenario.processing.clone()
        })
    }

    fn worker_with(&self, options: Options) -> Worker<'_> {
        Worker {
            experiment: self,
            identifier: Identifier::new(&self.model, &self.simulation.scenario.set, options),
            measured: Measured::like(&self.simulation.recording),
        }
    }

    /// Estimates `theta` with their `covariance` against the truth, in units of the tally.
    pub fn outcomes(&self, theta: &[f64], covariance: &Covariance) -> Result<Outcomes, TrialError> {
        let Self { truth, scale, simulation, .. } = self;
        let (sigma, quantile_95) = (covariance.sigma(), covariance.quantile_95());
        let error: Vec<f64> = theta.iter().zip(truth).map(|(theta, truth)| theta - truth).collect();
        let outcome = |(k, ((error, sigma), scale)): (usize, ((&f64, &f64), &f64))| {
            let outcome = Outcome { z: error / scale, sigma: sigma / scale, quantile_95 };
            if outcome.is_sound() {
                return Ok(outcome);
            }
            let parameter = simulation.scenario.set.name(k).to_owned();
            Err(TrialError::Unsound { parameter, z: outcome.z, sigma: outcome.sigma })
        };
        let estimates = error.iter().zip(&sigma).zip(scale).enumerate();
        let parameters: Vec<Outcome> = estimates.map(outcome).collect::<Result<_, _>>()?;
        let squared = squared_distance(&covariance.matrix, &error).ok_or(TrialError::Singular)?;
        let distance = covariance.mean_distance().map(|mean| squared / mean);
        let outcomes = Outcomes { parameters, distance };
        match outcomes.is_sound() {
            true => Ok(outcomes),
            false => Err(TrialError::TooFar { squared }),
        }
    }
}

/// One thread's memory for trials of an [`Experiment`].
pub struct Worker<'a> {
    experiment: &'a Experiment,
    identifier: Identifier<'a>,
    measured: Measured,
}

impl Worker<'_> {
    /// Identifies trial `trial` from its log.
    pub fn identify(&mut self, trial: u64) -> Result<Identification, TrialError> {
        let experiment = self.experiment;
        experiment.simulation.log_into(trial, &mut self.measured)?;
        Ok(self.identifier.identify(&self.measured.measurement("simulated log"))?)
    }

    /// Runs trial `trial` and compares with the truth.
    pub fn trial(&mut self, trial: u64) -> Result<Outcomes, TrialError> {
        let identification = self.identify(trial)?;
        self.experiment.outcomes(&identification.fit.theta, &identification.covariance)
    }
}

/// What the trials of a Monte Carlo over estimates have in common.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Estimation {
    /// Estimator and covariance, as they appear in the results.
    pub estimator: String,
    /// See `estimator`.
    pub covariance: String,
    /// The parameters with their truth and scale.
    pub parameters: Vec<ParameterHeader>,
}

/// One parameter of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParameterHeader {
    /// Name of the kept column.
    pub name: String,
    /// The whole combination.
    pub formula: String,
    /// SI unit.
    pub unit: String,
    /// True value.
    pub truth: f64,
    /// Unit of the tally's sums.
    pub scale: f64,
    /// The Cramér–Rao bound, where it is known.
    pub sigma_least: Option<f64>,
}

impl Content for Estimation {
    type Gathered = Tally;
    const SCHEMA: &'static str = "armid.shard/4";

    fn nothing(&self) -> Tally {
        Tally::new(self.parameters.len())
    }

    fn difference(&self, expected: &Self) -> Option<Difference> {
        let methods = |e: &Self| format!("{} with {}", e.estimator, e.covariance);
        if methods(self) != methods(expected) {
            let (found, expected) = (methods(self), methods(expected));
            return Some(Difference { what: "estimator", found, expected });
        }
        (self.parameters != expected.parameters).then(|| Difference {
            what: "parameters",
            found: format!("{} of them or their truth", self.parameters.len()),
            expected: format!("{} others", expected.parameters.len()),
        })
    }
}

impl Trials for Experiment {
    type Content = Estimation;
    type Worker<'a> = Worker<'a>;
    type Error = TrialError;
    const BATCH_PER_THREAD: u64 = 16;

    fn scenario(&self) -> &Scenario {
        &self.simulation.scenario
    }

    fn content(&self) -> Estimation {
        let set = &self.simulation.scenario.set;
        let parameters = (0..set.rank())
            .map(|k| ParameterHeader {
                name: set.name(k).to_owned(),
                formula: set.formula(k),
                unit: set.unit(k).to_owned(),
                truth: self.truth[k],
                scale: self.scale[k],
                sigma_least: self.least_sigma.as_ref().map(|least| least[k]),
            })
            .collect();
        Estimation {
            estimator: self.estimator.to_string(),
            covariance: self.covariance.to_string(),
            parameters,
        }
    }

    fn worker(&self) -> Worker<'_> {
        Self::worker(self)
    }

    fn trial(worker: &mut Worker<'_>, trial: u64) -> Result<Outcomes, TrialError> {
        worker.trial(trial)
    }
}
