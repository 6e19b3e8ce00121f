//! Summary of the outcomes of all trials of a case.

use nalgebra::DVector;
use serde::Serialize;

use super::METHODS;
use super::trial::{Lost, Outcome, SIGMAS};
use super::validation::Validation;
use crate::identify::covariance::Z_95;
use crate::median::median;
use crate::montecarlo::experiment::Experiment;
use crate::montecarlo::trials::Failure;

/// Results of all trials of one scenario.
#[derive(Debug, Clone, Serialize)]
pub struct CaseResult {
    /// Name of the scenario.
    pub name: String,
    /// Description of the scenario, in a sentence.
    pub description: String,
    /// Number of trials with an outcome.
    pub trials: u64,
    /// Trials without an outcome.
    pub failures: Vec<Failure>,
    /// Wall time of all trials, s.
    pub seconds: f64,
    /// Number of base parameters.
    pub parameters: usize,
    /// Share of the unconstrained estimates that are not realisable by any links.
    pub not_realisable: f64,
    /// Share of the unconstrained estimates with a negative rotor inertia or friction coefficient.
    pub negative_drive: f64,
    /// Share of estimates whose mass matrix is not positive definite in some pose: unconstrained, constrained.
    pub indefinite: [f64; 2],
    /// Number of trials tested for whether the constraints raise the misfit by more than noise explains.
    pub tested: u64,
    /// Number of these trials in which they do, so that the model is called wrong.
    pub called_wrong: u64,
    /// Error on the other motion, per method; `None` if fewer than two trials tried the method.
    pub predictions: [Option<Prediction>; METHODS.len()],
    /// Coverage of 95 % intervals, for each σ of [`SIGMAS`].
    pub coverage: [Option<Coverage>; SIGMAS.len()],
    /// Median of the cross-validated weights: pull-back, entropic.
    pub weights: [Option<f64>; 2],
}

/// Error of the predicted torque in percent of the torque, as a root mean square over the joints.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Prediction {
    /// Trials.
    pub trials: usize,
    /// Total error, root mean square over the trials.
    pub error_percent: f64,
    /// 95 % interval of `error_percent`.
    pub interval_percent: [f64; 2],
    /// The part of the error that changes from trial to trial.
    pub scatter_percent: f64,
    /// The part of the error that is the same in all trials.
    pub systematic_percent: f64,
}

/// How often 95 % intervals hold the true value.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Coverage {
    /// Trials.
    pub trials: usize,
    /// Coverage, mean over the parameters.
    pub mean: f64,
    /// Standard error of `mean`, from the scatter between trials.
    pub standard_error: f64,
    /// Coverage of the parameter that is covered least often.
    pub worst: f64,
}

impl CaseResult {
    pub(super) fn of(
        experiment: &Experiment,
        validation: &Validation,
        outcomes: &[(u64, Result<Outcome, Lost>)],
        seconds: f64,
    ) -> Self {
        let scenario = &experiment.simulation.scenario;
        let sound: Vec<&Outcome> = outcomes.iter().filter_map(|(_, o)| o.as_ref().ok()).collect();
        let lost = |(trial, outcome): &(u64, Result<Outcome, Lost>)| {
            let reason = outcome.as_ref().err()?.to_string();
            Some(Failure { trial: *trial, reason })
        };
        let share = |is: &dyn Fn(&Outcome) -> bool| {
            sound.iter().filter(|o| is(o)).count() as f64 / sound.len() as f64
        };
        let tests: Vec<bool> = sound.iter().filter_map(|o| o.model_is_wrong).collect();
        let predictions = std::array::from_fn(|method| {
            let errors: Vec<_> = sound.iter().filter_map(|o| o.errors[method].as_ref()).collect();
            Prediction::of(&errors, validation.unexplained())
        });
        let coverage = std::array::from_fn(|sigma| {
            let covered: Vec<_> = sound.iter().filter_map(|o| o.covered[sigma].as_ref()).collect();
            Coverage::of(&covered)
        });
        let weights = [0, 1].map(|metric| {
            let mut weights: Vec<f64> = sound.iter().filter_map(|o| o.weights[metric]).collect();
            median(&mut weights)
        });
        Self {
            name: scenario.name.clone(),
            description: scenario.description.clone(),
            trials: sound.len() as u64,
            failures: outcomes.iter().filter_map(lost).collect(),
            seconds,
            parameters: experiment.truth.len(),
            not_realisable: share(&|o| !o.realisable),
            negative_drive: share(&|o| o.negative_drive),
            indefinite: [share(&|o| o.indefinite[0]), share(&|o| o.indefinite[1])],
            tested: tests.len() as u64,
            called_wrong: tests.iter().filter(|wrong| **wrong).count() as u64,
            predictions,
            coverage,
            weights,
        }
    }
}

impl Prediction {
    /// Splits the error into its parts, from R θ − ρ of every trial and the square that no θ explains.
    fn of(errors: &[&DVector<f64>], unexplained: f64) -> Option<Self> {
        let trials = errors.len();
        if trials < 2 {
            return None;
        }
        let n = trials as f64;
        let squares: Vec<f64> = errors.iter().map(|e| e.norm_squared()).collect();
        let square = squares.iter().sum::<f64>() / n;
        let mut mean = DVector::zeros(errors[0].len());
        errors.iter().for_each(|e| mean += *e / n);
        let scatter = (square - mean.norm_squared()).max(0.0) * n / (n - 1.0);
        let systematic = (mean.norm_squared() - scatter / n).max(0.0) + unexplained;
        let variance = squares.iter().map(|s| (s - square).powi(2)).sum::<f64>() / (n - 1.0);
        let half = Z_95 * (variance / n).sqrt();
        let percent = |square: f64| 100.0 * square.max(0.0).sqrt();
        Some(Self {
            trials,
            error_percent: percent(square + unexplained),
            interval_percent: [square - half, square + half].map(|s| percent(s + unexplained)),
            scatter_percent: percent(scatter),
            systematic_percent: percent(systematic),
        })
    }
}

impl Coverage {
    fn of(covered: &[&Vec<bool>]) -> Option<Self> {
        let trials = covered.len();
        let parameters = covered.first()?.len();
        let n = trials as f64;
        let held = |flags: &[bool]| flags.iter().filter(|held| **held).count() as f64;
        let shares: Vec<f64> = covered.iter().map(|c| held(c) / parameters as f64).collect();
        let mean = shares.iter().sum::<f64>() / n;
        let variance = shares.iter().map(|s| (s - mean).powi(2)).sum::<f64>() / (n - 1.0).max(1.0);
        let of_parameter = |k: usize| covered.iter().filter(|c| c[k]).count() as f64 / n;
        Some(Self {
            trials,
            mean,
            standard_error: (variance / n).sqrt(),
            worst: (0..parameters).map(of_parameter).fold(1.0, f64::min),
        })
    }
}
