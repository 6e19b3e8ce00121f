//! What can be run trial by trial, saved, resumed, split and merged.
//!
//! An experiment says what one trial is ([`Trials`]), what identifies a run besides its scenario
//! ([`Content`]), and what its trials add up to ([`Gathered`]). Everything else is the same for all of
//! them: [`super::shard`].

use std::fmt::{Debug, Display};
use std::panic::{AssertUnwindSafe, catch_unwind};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};

use super::Scenario;

/// An experiment that has been made ready.
pub trait Trials: Sync {
    /// What two parts of one run have in common.
    type Content: Content;
    /// One thread's memory.
    type Worker<'a>: Send
    where
        Self: 'a;
    /// Why a trial gives nothing.
    type Error: Display;

    /// Name, text and seed.
    fn scenario(&self) -> &Scenario;

    /// See [`Content`].
    fn content(&self) -> Self::Content;

    /// What one thread needs.
    fn worker(&self) -> Self::Worker<'_>;

    /// Runs trial `trial`: the same outcome on any worker, whatever it ran before.
    fn trial(worker: &mut Self::Worker<'_>, trial: u64) -> Result<OutcomeOf<Self>, Self::Error>;
}

/// What one trial of `T` gives.
pub type OutcomeOf<T> = <GatheredOf<T> as Gathered>::Outcome;
/// What the trials of `T` add up to.
pub type GatheredOf<T> = <<T as Trials>::Content as Content>::Gathered;

/// What must be equal for two parts of a run to belong together, besides scenario, seed and length.
pub trait Content: Debug + Clone + PartialEq + Serialize + DeserializeOwned {
    /// What the trials add up to.
    type Gathered: Gathered;
    /// Format of the files that hold it.
    const SCHEMA: &'static str;

    /// The sum of no trials.
    fn nothing(&self) -> Self::Gathered;

    /// The first part in which it differs from `expected`.
    fn difference(&self, expected: &Self) -> Option<Difference>;
}

/// A part in which two runs differ, and its two values.
#[derive(Debug, Clone, PartialEq)]
pub struct Difference {
    /// Which part.
    pub what: String,
    /// Its value.
    pub found: String,
    /// The value of the run it should belong to.
    pub expected: String,
}

impl Difference {
    /// Of the values of the part `what`, where they differ.
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

/// Sums over trials, or their list: the same in any order.
pub trait Gathered: Debug + Clone + PartialEq + Serialize + DeserializeOwned + Send + Sync {
    /// What one trial gives.
    type Outcome;

    /// Adds the outcome of trial `trial`.
    fn gather(&mut self, trial: u64, outcome: Self::Outcome);

    /// Adds a trial that gave nothing.
    fn gather_failure(&mut self, failure: Failure);

    /// Adds other trials of the same run.
    fn merge(&mut self, other: &Self);

    /// Trials so far, those that gave nothing included.
    fn trials(&self) -> u64;

    /// Whether the two can be merged without loss.
    fn fits(&self, other: &Self) -> bool;
}

/// A trial that gave nothing.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Failure {
    /// Which trial (from 0).
    pub trial: u64,
    /// Why.
    pub reason: String,
}

/// Runs trial `trial` and adds what comes of it to `gathered`. A panic inside is a failed trial.
pub(super) fn run_one<T: Trials>(
    worker: &mut T::Worker<'_>,
    trial: u64,
    gathered: &mut GatheredOf<T>,
) {
    // After a panic the scratch memory may be half written; every use overwrites it.
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
