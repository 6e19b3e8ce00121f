//! What became of each trial.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::case::Case;
use crate::diagnose::{BaseParameter, Cause, Diagnosis, HeldOut, Kind};
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
    /// What the data cannot tell from it, as the diagnosis says it.
    pub class: Vec<String>,
    /// Stated probability of the class.
    pub confidence: f64,
    /// √λ̂; `None` where it is not a number.
    pub strength: Option<f64>,
    /// Parameters whose interval is finite.
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

/// What is left without an explanation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Left {
    /// On what it depends.
    pub axis: String,
    /// Joint from 1.
    pub joint: usize,
    /// Size, Nm.
    pub rms_nm: f64,
}

/// Squared residuals along a motion that was not used, without noise, summed over the joints in units
/// of each joint's noise.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HeldOutGain {
    /// Of the model without causes.
    pub before: f64,
    /// Of the extended model.
    pub after: f64,
    /// Of a model that is right, with parameters identified under the same noise: the same arm without effects, its
    /// log, and its next motion.
    pub least: f64,
}

impl HeldOutGain {
    /// Of the residuals of `hidden` and of those of the arm without effects, with the standard deviations `sd_nm` of
    /// the noise.
    pub fn of(hidden: &HeldOut, clean: &HeldOut, sd_nm: &[f64]) -> Self {
        let sum =
            |rms_nm: &[f64]| rms_nm.iter().zip(sd_nm).map(|(rms, sd)| (rms / sd).powi(2)).sum();
        Self {
            before: sum(&hidden.before_rms_nm),
            after: sum(&hidden.after_rms_nm),
            least: sum(&clean.before_rms_nm),
        }
    }

    /// Share that the causes remove.
    pub fn share(&self) -> f64 {
        1.0 - self.after / self.before
    }

    /// Share that the right cause could remove at most: the rest is the noise of the arm's parameters.
    pub fn possible(&self) -> f64 {
        1.0 - self.least / self.before
    }
}

/// What the diagnosis says.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Answer {
    /// Causes in the order of the diagnosis: faults of the record, then the strongest first.
    pub named: Vec<Named>,
    /// What is left over.
    pub left: Option<Left>,
    /// Gain along another motion, where it was measured.
    pub gain: Option<HeldOutGain>,
    /// Base parameters of the extended model whose 95 % interval holds the truth.
    pub base: Share,
}

/// 95 % of a normal distribution lie within so many σ.
const Z_95: f64 = 1.959_963_984_540_054;

/// Base parameters whose 95 % interval holds the truth.
fn covered(estimates: &[BaseParameter], truth: &[f64]) -> Share {
    Share::of(estimates.iter().zip(truth), |(p, truth)| (p.value - **truth).abs() <= Z_95 * p.sigma)
}

impl Answer {
    /// Of a diagnosis; `truth` are the base parameters of the arm that was hidden.
    pub fn of(diagnosis: &Diagnosis, gain: Option<HeldOutGain>, truth: &[f64]) -> Self {
        Self {
            named: diagnosis.causes.iter().map(Named::of).collect(),
            left: diagnosis.unexplained.as_ref().map(|u| Left {
                axis: u.axis.to_owned(),
                joint: u.joint,
                rms_nm: u.rms_nm,
            }),
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
    /// Which trial.
    pub trial: u64,
    /// The truth.
    pub case: Case,
    /// The answer.
    pub answer: Answer,
}

/// All trials, by number.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Records {
    /// Trials with an answer.
    pub records: Vec<Record>,
    /// Trials without.
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
