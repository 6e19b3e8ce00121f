//! Interface of experiments that are run trial by trial, and can be saved, resumed, split and merged.
//!
//! An experiment defines what one trial is ([`Trials`]), what identifies a run besides its scenario ([`Content`]), and
//! what its trials add up to ([`Gathered`]). Everything else is the same for all experiments and is in
//! [`super::shard`].

use std::fmt::{Debug, Display};
use std::panic::{AssertUnwindSafe, catch_unwind};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::Scenario;

/// An experiment that has been prepared for its trials.
pub trait Trials: Sync {
    /// Part of the header that all parts of one run have in common.
    type Content: Content;
    /// Working memory of one thread.
    type Worker<'a>: Send
    where
        Self: 'a;
    /// Why a trial failed.
    type Error: Display;

    /// The scenario, for its name, fingerprint and seed.
    fn scenario(&self) -> &Scenario;

    /// The content of the header; see [`Content`].
    fn content(&self) -> Self::Content;

    /// Creates the working memory of one thread.
    fn worker(&self) -> Self::Worker<'_>;

    /// Runs trial `trial`. The outcome is the same on any worker, whatever trials it ran before.
    fn trial(worker: &mut Self::Worker<'_>, trial: u64) -> Result<OutcomeOf<Self>, Self::Error>;
}

/// Outcome of one trial of `T`.
pub type OutcomeOf<T> = <GatheredOf<T> as Gathered>::Outcome;
/// Sum or list of the outcomes of all trials of `T`.
pub type GatheredOf<T> = <<T as Trials>::Content as Content>::Gathered;

/// Everything, besides scenario, seed and length, that must be equal for two parts to belong to the same run.
pub trait Content: Debug + Clone + PartialEq + Serialize + DeserializeOwned {
    /// Sum or list of the outcomes of the trials.
    type Gathered: Gathered;
    /// Schema of the shard files that hold it.
    const SCHEMA: &'static str;

    /// The empty sum or list, without any trials.
    fn nothing(&self) -> Self::Gathered;

    /// The first part in which the content differs from `expected`.
    fn difference(&self, expected: &Self) -> Option<Difference>;
}

/// A part of the header in which two runs differ, with its two values.
#[derive(Debug, Clone, PartialEq)]
pub struct Difference {
    /// Name of the part.
    pub what: String,
    /// Its value in the run at hand.
    pub found: String,
    /// Its value in the run to which this one should belong.
    pub expected: String,
}

impl Difference {
    /// The difference between two values of the part `what`; `None` if they are equal.
    pub fn between<V: PartialEq + ToString>(
        what: impl Into<String>,
        found: V,
        expected: V,
    ) -> Option<Self> {
        (found != expected).then(|| Self {
            what: what.into(),
            found: found.to_string(),
            expected: expected.to_string(),
        })
    }
}

/// Sum over trials, or a list of them, that is the same for any order of the trials.
pub trait Gathered: Debug + Clone + PartialEq + Serialize + DeserializeOwned + Send + Sync {
    /// Outcome of one trial.
    type Outcome;

    /// Adds the outcome of trial `trial`.
    fn gather(&mut self, trial: u64, outcome: Self::Outcome);

    /// Adds a failed trial.
    fn gather_failure(&mut self, failure: Failure);

    /// Adds other trials of the same run.
    fn merge(&mut self, other: &Self);

    /// Number of trials so far, including failed ones.
    fn trials(&self) -> u64;

    /// Whether `self` and `other` can be merged without loss.
    fn fits(&self, other: &Self) -> bool;
}

/// A failed trial.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Failure {
    /// Number of the trial (from 0).
    pub trial: u64,
    /// Why it failed.
    pub reason: String,
}

/// Runs trial `trial` and adds its outcome to `gathered`. A panic inside the trial counts as a failure.
pub(super) fn run_one<T: Trials>(
    worker: &mut T::Worker<'_>,
    trial: u64,
    gathered: &mut GatheredOf<T>,
) {
    // After a panic the worker's memory may be half written; this is safe because every trial overwrites it.
    let reason = match catch_unwind(AssertUnwindSafe(|| T::trial(worker, trial))) {
        Ok(Ok(outcome)) => return gathered.gather(trial, outcome),
        Ok(Err(error)) => error.to_string(),
        Err(panic) => {
            let text = panic.downcast_ref::<String>().map(String::as_str);
            let message = text.or_else(|| panic.downcast_ref::<&str>().copied());
            format!("panicked: {}", message.unwrap_or("no message"))
        }
    };
    gathered.gather_failure(Failure { trial, reason });
}
