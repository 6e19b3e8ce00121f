//! One trial: a log identified with and without the constraints.

use nalgebra::DVector;

use super::validation::Validation;
use super::{METHODS, Method};
use crate::identify::Identification;
use crate::identify::physical::{
    PhysicalError, PhysicalEstimate, PhysicalOptions, PriorMetric, PriorWeight, Solver,
};
use crate::montecarlo::experiment::{Experiment, TrialError, Worker};
use crate::montecarlo::study::indefinite_share;

/// Outcome of one trial.
#[derive(Debug, Clone)]
pub struct Outcome {
    /// R θ − ρ of the validation, per method; `None` if the method was not tried.
    pub errors: [Option<DVector<f64>>; METHODS.len()],
    /// Whether the unconstrained base parameters are realisable, that is, some set of physically possible links has
    /// them.
    pub realisable: bool,
    /// Whether a rotor inertia or friction coefficient among the unconstrained base parameters is negative.
    pub negative_drive: bool,
    /// Whether the mass matrix is not positive definite in some pose: unconstrained, constrained.
    pub indefinite: [bool; 2],
    /// Whether the constraints raise the misfit by more than noise explains; `None` if not tested.
    pub model_is_wrong: Option<bool>,
    /// Which parameters' 95 % intervals hold the true value, for each σ of [`SIGMAS`]; `None` if not computed.
    pub covered: [Option<Vec<bool>>; SIGMAS.len()],
    /// Cross-validated weight of the prior: pull-back, entropic.
    pub weights: [Option<f64>; 2],
}

/// The σ whose intervals are counted: that of the unconstrained estimate, and three of the constrained estimate.
pub const SIGMAS: [&str; 4] = ["unconstrained", "held", "released", "drawn"];

/// Working memory of one thread.
pub struct Bench<'a> {
    experiment: &'a Experiment,
    worker: Worker<'a>,
    solver: &'a Solver,
    validation: &'a Validation,
}

impl<'a> Bench<'a> {
    pub fn new(experiment: &'a Experiment, solver: &'a Solver, validation: &'a Validation) -> Self {
        Self { experiment, worker: experiment.worker(), solver, validation }
    }

    /// Runs a trial; a `thorough` one also runs the bootstrap, the test of the model and the cross-validation.
    pub fn trial(&mut self, trial: u64, thorough: bool) -> Result<Outcome, Lost> {
        let found = self.worker.identify(trial)?;
        let draws = if thorough { PhysicalOptions::default().bootstrap } else { 0 };
        let plain = PhysicalOptions { bootstrap: draws, seed: trial, ..PhysicalOptions::default() };
        let estimate = self.solve(&found, &plain)?;
        let mut outcome = self.outcome(&found, &estimate);
        // Cross-validation leaves out periods, which a single run does not have.
        if thorough && found.fit.theta_periods.len() > 2 {
            for (k, metric) in
                [PriorMetric::PullBack, PriorMetric::Entropic].into_iter().enumerate()
            {
                let prior_weight = PriorWeight::CrossValidated;
                let options = PhysicalOptions { metric, prior_weight, bootstrap: 0, ..plain };
                let pulled = self.solve(&found, &options)?;
                let method = [Method::PullBack, Method::Entropic][k];
                outcome.errors[method as usize] = Some(self.validation.error(&pulled.base));
                outcome.weights[k] = Some(pulled.prior.weight);
            }
        }
        Ok(outcome)
    }

    fn solve(
        &self,
        found: &Identification,
        options: &PhysicalOptions,
    ) -> Result<PhysicalEstimate, PhysicalError> {
        self.solver.estimate(&found.fit, &found.covariance, options)
    }

    fn outcome(&self, found: &Identification, estimate: &PhysicalEstimate) -> Outcome {
        let theta = &found.fit.theta;
        let quantile = found.covariance.quantile_95();
        let truth = &self.experiment.truth;
        let covered = |values: &[f64], sigma: &[f64]| -> Vec<bool> {
            let inside = |((v, s), t): ((&f64, &f64), &f64)| (v - t).abs() <= quantile * s;
            values.iter().zip(sigma).zip(truth).map(inside).collect()
        };
        let scatter = &estimate.scatter;
        Outcome {
            errors: [
                Some(self.validation.error(theta)),
                Some(self.validation.error(&estimate.base)),
                None,
                None,
            ],
            realisable: estimate.evidence.is_realisable(),
            negative_drive: self.has_negative_drive(theta),
            indefinite: [self.is_indefinite(theta), self.is_indefinite(&estimate.base)],
            model_is_wrong: estimate.evidence.p_value().map(|_| estimate.evidence.model_is_wrong()),
            covered: [
                Some(covered(theta, &estimate.unconstrained_sigma)),
                Some(covered(&estimate.base, &scatter.held.base)),
                Some(covered(&estimate.base, &scatter.released.base)),
                scatter.drawn.as_ref().map(|drawn| covered(&estimate.base, &drawn.base)),
            ],
            weights: [None, None],
        }
    }

    /// Whether a rotor inertia or friction coefficient in `theta` is negative; examines the base parameters named after
    /// one.
    fn has_negative_drive(&self, theta: &[f64]) -> bool {
        let set = &self.experiment.simulation.scenario.set;
        let is_drive = |name: &str| ["Ia", "rv", "rc"].iter().any(|kind| name.starts_with(kind));
        theta.iter().enumerate().any(|(k, value)| *value < 0.0 && is_drive(set.name(k)))
    }

    fn is_indefinite(&self, theta: &[f64]) -> bool {
        let Experiment { model, simulation, .. } = self.experiment;
        indefinite_share(model, &simulation.scenario.set, theta).0 > 0.0
    }
}

/// Why a trial has no outcome.
#[derive(Debug, thiserror::Error)]
pub enum Lost {
    /// There is no estimate at all.
    #[error(transparent)]
    Trial(#[from] TrialError),
    /// There is no constrained estimate.
    #[error(transparent)]
    Physical(#[from] PhysicalError),
}
