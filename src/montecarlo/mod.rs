//! The whole chain, thousands of times, against the truth.
//!
//! Enters: a [`Scenario`]. Leaves: a [`Tally`](tally::Tally) of its trials, the same for any number
//! of threads and any split into shards, and a [`Calibration`](calibration::Calibration): whether
//! the σ that the identifier claims is true.

pub mod calibration;
mod effect_size;
mod efficiency;
mod experiment;
mod scenario;
pub mod shard;
mod simulation;
pub mod study;
mod summary;
pub mod tally;

pub use effect_size::EffectSize;
pub use efficiency::Efficiency;
pub use experiment::{Experiment, TrialError, Worker};
pub use scenario::{Scenario, ScenarioError};
pub use simulation::Simulation;
pub use summary::{ParameterSummary, SUMMARY_SCHEMA, Summary};
