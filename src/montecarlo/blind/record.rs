//! Records: the truth and the answer of each trial.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::case::Case;
use crate::diagnose::{BaseParameter, Cause, Diagnosis, HeldOut, Kind, Unexplained};
use crate::identify::covariance::Z_95;
use crate::montecarlo::share::Share;
use crate::montecarlo::trials::{Failure, Gathered};

/// A parameter with its 95 % interval.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Interval {
    /// Estimate.
    pub value: f64,
    /// Lower end.
    pub low: f64,
    /// Upper end.
    pub high: f64,
}

/// A named cause.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Named {
    /// Family.
    pub kind: Kind,
    /// Joint from 1.
    pub joint: Option<usize>,
    /// Aliases: causes that the data cannot distinguish from this one, in the wording of the diagnosis.
    pub class: Vec<String>,
    /// Stated probability of the class.
    pub confidence: f64,
    /// √λ̂; `None` if it is not finite.
    pub strength: Option<f64>,
    /// Parameters whose estimate and interval are finite.
    pub parameters: BTreeMap<String, Interval>,
}

impl Named {
    fn of(cause: &Cause) -> Self {
        let parameters = cause
            .parameters
            .iter()
            .filter(|(_, e)| e.value.is_finite() && e.ci95.iter().all(|end| end.is_finite()))
            .map(|(name, e)| {
                let [low, high] = e.ci95;
                ((*name).to_owned(), Interval { value: e.value, low, high })
            });
        Self {
            kind: cause.kind,
            joint: cause.joint,
            class: cause.class.clone(),
            confidence: cause.confidence,
            strength: cause.strength.is_finite().then_some(cause.strength),
            parameters: parameters.collect(),
        }
    }
}

/// Residual that is left without an explanation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Left {
    /// Variable on which the residual depends.
    pub axis: String,
    /// Joint from 1.
    pub joint: usize,
    /// Root mean square, Nm.
    pub rms_nm: f64,
    /// Whether only the joints together tell it from noise.
    #[serde(default)]
    pub of_all_joints: bool,
}

impl Left {
    fn of(unexplained: &Unexplained) -> Self {
        Self {
            axis: unexplained.axis.to_owned(),
            joint: unexplained.joint,
            rms_nm: unexplained.rms_nm,
            of_all_joints: unexplained.of_all_joints,
        }
    }
}

/// Mean squared residuals along a noise-free motion that was not used for the diagnosis, in units of each joint's noise
/// variance and summed over the joints.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HeldOutGain {
    /// Residuals of the model without causes.
    pub before: f64,
    /// Residuals of the model extended by the causes named.
    pub after: f64,
    /// Residuals of a correct model with parameters identified under the same noise: the null model for the same arm
    /// without effects, identified from that arm's log and tested on that arm's next motion.
    pub least: f64,
}

impl HeldOutGain {
    /// Sums up the residuals of the arm with its effects (`hidden`) and without them (`clean`); `sd_nm` are the
    /// standard deviations of the torque noise.
    pub fn of(hidden: &HeldOut, clean: &HeldOut, sd_nm: &[f64]) -> Self {
        let sum =
            |rms_nm: &[f64]| rms_nm.iter().zip(sd_nm).map(|(rms, sd)| (rms / sd).powi(2)).sum();
        Self {
            before: sum(&hidden.before_rms_nm),
            after: sum(&hidden.after_rms_nm),
            least: sum(&clean.before_rms_nm),
        }
    }

    /// Share of the squared residuals that the causes named remove.
    pub fn share(&self) -> f64 {
        1.0 - self.after / self.before
    }

    /// Share that the right cause could remove at most; the remainder is due to the noise of the arm's parameters.
    pub fn possible(&self) -> f64 {
        1.0 - self.least / self.before
    }
}

/// The answer of the diagnosis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Answer {
    /// Causes in the order of the diagnosis.
    pub named: Vec<Named>,
    /// The unexplained residual, if any.
    pub left: Option<Left>,
    /// What the laws of a joint leave because they are not exact, if anything.
    #[serde(default)]
    pub form_error: Option<Left>,
    /// Gain along another motion, if it was measured.
    pub gain: Option<HeldOutGain>,
    /// Share of the base parameters of the extended model whose 95 % interval holds the true value.
    pub base: Share,
}

/// Share of the base parameters whose 95 % interval holds the true value.
fn covered(estimates: &[BaseParameter], truth: &[f64]) -> Share {
    Share::of(estimates.iter().zip(truth), |(p, truth)| (p.value - **truth).abs() <= Z_95 * p.sigma)
}

impl Answer {
    /// Extracts the answer from a diagnosis; `truth` are the true base parameters of the arm with its effects.
    pub fn of(diagnosis: &Diagnosis, gain: Option<HeldOutGain>, truth: &[f64]) -> Self {
        Self {
            named: diagnosis.causes.iter().map(Named::of).collect(),
            left: diagnosis.unexplained.as_ref().map(Left::of),
            form_error: diagnosis.form_error.as_ref().map(Left::of),
            base: covered(&diagnosis.base_parameters, truth),
            gain: gain
                .filter(|g| [g.before, g.after, g.least].iter().all(|square| square.is_finite())),
        }
    }
}

/// One trial: the truth and the answer.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Record {
    /// Number of the trial.
    pub trial: u64,
    /// The truth.
    pub case: Case,
    /// The answer.
    pub answer: Answer,
}

/// All trials, sorted by number.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Records {
    /// Trials with an answer.
    pub records: Vec<Record>,
    /// Trials without an answer.
    pub failures: Vec<Failure>,
}

impl Gathered for Records {
    type Outcome = Record;

    fn gather(&mut self, trial: u64, record: Record) {
        let at = self.records.partition_point(|known| known.trial < trial);
        self.records.insert(at, record);
    }

    fn gather_failure(&mut self, failure: Failure) {
        let at = self.failures.partition_point(|known| known < &failure);
        self.failures.insert(at, failure);
    }

    fn merge(&mut self, other: &Self) {
        other.records.iter().for_each(|r| self.gather(r.trial, r.clone()));
        other.failures.iter().for_each(|f| self.gather_failure(f.clone()));
    }

    fn trials(&self) -> u64 {
        (self.records.len() + self.failures.len()) as u64
    }

    fn fits(&self, _: &Self) -> bool {
        true
    }
}
