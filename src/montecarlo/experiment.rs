//! A scenario prepared for its trials, and the trials themselves.

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

/// A scenario whose plant has run: everything that all trials share.
pub struct Experiment {
    /// The scenario, its run and its sensors.
    pub simulation: Simulation,
    /// The arm's equations of motion.
    pub model: Model,
    /// True base parameters.
    pub truth: Vec<f64>,
    /// Unit of the tally for each parameter: σ of the pilot trial, rounded to a few bits.
    pub scale: Vec<f64>,
    /// The Cramér–Rao bound of every parameter; `None` if it is not known.
    pub least_sigma: Option<Vec<f64>>,
    /// The estimator that suits the pilot's log; all trials use it.
    pub estimator: Estimator,
    /// The kind of covariance that suits the pilot's log; all trials use it.
    pub covariance: CovarianceKind,
    /// Whether the logs are runs that do not repeat, for which less coverage is claimed.
    pub single_run: bool,
}

/// Number of the pilot trial. Its noise is that of no other trial, and it is never counted.
const PILOT: u64 = u64::MAX;

/// A trial that gave no estimate.
#[derive(Debug, Error)]
pub enum TrialError {
    /// The plant did not run.
    #[error("the plant: {0}")]
    Plant(#[from] PlantError),
    /// The identification failed.
    #[error("{0}")]
    Identify(#[from] IdentifyError),
    /// The estimate of one parameter is too far off, or its σ is too large or zero, to count as an estimate.
    #[error("{parameter}: estimate {z:.3e} pilot σ off the truth, σ {sigma:.3e} pilot σ")]
    Unsound {
        /// Name of the base parameter.
        parameter: String,
        /// (θ̂ − θ)/scale.
        z: f64,
        /// σ̂/scale.
        sigma: f64,
    },
    /// The covariance is singular: it claims that some combination of parameters is known without error.
    #[error("the covariance of the base parameters is singular")]
    Singular,
    /// All parameters jointly are too far off to count as an estimate.
    #[error("all parameters together: squared error {squared:.3e} in units of their covariance")]
    TooFar {
        /// (θ̂ − θ)ᵀV⁻¹(θ̂ − θ).
        squared: f64,
    },
}

impl Experiment {
    /// Runs the plant once without noise, then a pilot trial that sets the scales, the estimator and the covariance.
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
            single_run: false,
        };
        let pilot = experiment.worker_with(pilot_options).identify(PILOT)?;
        experiment.scale = pilot.sigma().into_iter().map(rounded).collect();
        experiment.single_run = pilot.processing.periods == 1;
        experiment.estimator = pilot.estimator;
        experiment.covariance = pilot.covariance.kind;
        experiment.least_sigma = experiment.cramer_rao_bound()?;
        Ok(experiment)
    }

    /// Creates the working memory of one thread.
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

    /// Compares the estimates `theta` and their `covariance` with the truth, in the units of the tally.
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

/// Rounds `sigma` to four significant bits. Its last digits differ between kinds of processors, but the unit of exact
/// sums must not. Zero, NaN and infinity stay as they are, so that the trials fail.
fn rounded(sigma: f64) -> f64 {
    if !sigma.is_normal() {
        return sigma;
    }
    let unit = 2f64.powi(sigma.log2().floor() as i32 - 3);
    (sigma / unit).round() * unit
}

/// Working memory of one thread for trials of an [`Experiment`].
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

    /// Runs trial `trial` and compares its estimates with the truth.
    pub fn trial(&mut self, trial: u64) -> Result<Outcomes, TrialError> {
        let identification = self.identify(trial)?;
        self.experiment.outcomes(&identification.fit.theta, &identification.covariance)
    }
}

/// What all trials of a Monte Carlo run over estimates have in common.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Estimation {
    /// Name of the estimator, as it appears in the results.
    pub estimator: String,
    /// Name of the kind of covariance, as it appears in the results.
    pub covariance: String,
    /// See [`Experiment::single_run`].
    pub single_run: bool,
    /// The parameters with their true values and scales.
    pub parameters: Vec<ParameterHeader>,
}

/// One parameter of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParameterHeader {
    /// Name of the standard parameter whose column is kept.
    pub name: String,
    /// The full linear combination of standard parameters.
    pub formula: String,
    /// SI unit.
    pub unit: String,
    /// True value.
    pub truth: f64,
    /// Unit of the tally's sums for this parameter.
    pub scale: f64,
    /// The Cramér–Rao bound; `None` if it is not known.
    pub sigma_least: Option<f64>,
}

impl Content for Estimation {
    type Gathered = Tally;
    const SCHEMA: &'static str = "armid.shard/5";

    fn nothing(&self) -> Tally {
        Tally::new(self.parameters.len())
    }

    fn difference(&self, expected: &Self) -> Option<Difference> {
        let methods = |e: &Self| format!("{} with {}", e.estimator, e.covariance);
        let runs = |e: &Self| if e.single_run { "a single run" } else { "repeated" };
        let counts = [self, expected].map(|e| e.parameters.len());
        let mut pairs = self.parameters.iter().zip(&expected.parameters);
        Difference::between("estimator", methods(self), methods(expected))
            .or_else(|| Difference::between("motion", runs(self), runs(expected)))
            .or_else(|| Difference::between("number of parameters", counts[0], counts[1]))
            .or_else(|| pairs.find_map(|(own, other)| own.difference(other)))
    }
}

/// Two true values that differ by less than this share of a σ count as equal, and so do two σ that differ by less than
/// this share of themselves. Kinds of processors differ by some 1e-14, while 10⁹ trials determine a mean to 3e-5 of a
/// σ and a σ to 2e-5 of itself.
const ROUND_OFF: f64 = 1e-6;

impl ParameterHeader {
    /// The first part in which the header differs from `expected` by more than round-off. The scale, as the unit of
    /// exact sums, must agree exactly.
    fn difference(&self, expected: &Self) -> Option<Difference> {
        let of = |what: &str| format!("{what} of {}", self.name);
        let in_words = |p: &Self| format!("{} in {}", p.formula, p.unit);
        let is_near = |own: f64, other: f64, unit: f64| (own - other).abs() <= ROUND_OFF * unit;
        let truth = || {
            let is_same = is_near(self.truth, expected.truth, self.scale);
            let different = Difference::between(of("truth"), self.truth, expected.truth);
            different.filter(|_| !is_same)
        };
        let least = || {
            let [own, other] = [self, expected].map(|p| p.sigma_least);
            let is_same = own.zip(other).is_some_and(|(own, other)| is_near(own, other, own));
            let [own, other] =
                [own, other].map(|s| s.map_or("unknown".to_owned(), |s| s.to_string()));
            Difference::between(of("least σ"), own, other).filter(|_| !is_same)
        };
        Difference::between("parameter", in_words(self), in_words(expected))
            .or_else(truth)
            .or_else(least)
            .or_else(|| Difference::between(of("unit"), self.scale, expected.scale))
    }
}

impl Trials for Experiment {
    type Content = Estimation;
    type Worker<'a> = Worker<'a>;
    type Error = TrialError;

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
            single_run: self.single_run,
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

#[cfg(test)]
mod tests {
    use super::*;

    fn estimation(truth: f64, scale: f64, sigma_least: Option<f64>) -> Estimation {
        let parameter = ParameterHeader {
            name: "mx2".into(),
            formula: "mx2 - 0.425 m3".into(),
            unit: "kg m".into(),
            truth,
            scale,
            sigma_least,
        };
        Estimation {
            estimator: "spectral".into(),
            covariance: "spectral".into(),
            single_run: false,
            parameters: vec![parameter],
        }
    }

    /// Processors with and without fused multiply-add differ by some 1e-14 of a σ. The threshold lies well above that,
    /// and well below any difference that trials could resolve.
    #[test]
    fn round_off_is_no_other_run() {
        let expected = estimation(-3.9, 0.0025, Some(0.002));
        let near = estimation(-3.9 + 1e-12 * 0.0025, 0.0025, Some(0.002 * (1.0 + 1e-12)));
        assert_eq!(near.difference(&expected), None);
        let unknown = estimation(-3.9, 0.0025, None);
        assert_eq!(unknown.difference(&unknown), None);
        let cases = [
            (estimation(-3.8, 0.0025, Some(0.002)), "truth of mx2", "-3.8", "-3.9"),
            (estimation(-3.9, 0.0025, Some(0.003)), "least σ of mx2", "0.003", "0.002"),
            (unknown, "least σ of mx2", "unknown", "0.002"),
            (estimation(-3.9, 0.003, Some(0.002)), "unit of mx2", "0.003", "0.0025"),
        ];
        for (other, what, found, wanted) in cases {
            let difference = other.difference(&expected).unwrap();
            let Difference { what: part, found: own, expected: others } = &difference;
            assert_eq!([part, own, others], [what, found, wanted]);
        }
    }

    /// Only about one σ in 10¹¹ lies so close to the midpoint between two values of four significant bits that
    /// round-off decides how it is rounded.
    #[test]
    fn the_unit_of_the_sums_is_free_of_round_off() {
        assert_eq!(rounded(0.0), 0.0);
        assert!(rounded(f64::NAN).is_nan() && rounded(f64::INFINITY).is_infinite());
        for sigma in [2.531e-3, 1.0, 0.999_999, 7.3e4, 1e-9] {
            let unit = rounded(sigma);
            assert!((unit / sigma - 1.0).abs() <= 1.0 / 16.0, "{unit} of {sigma}");
            for off in [-1e-13, 1e-13] {
                assert_eq!(rounded(sigma * (1.0 + off)), unit);
            }
        }
    }
}
