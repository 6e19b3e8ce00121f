//! Monte Carlo: runs the whole chain thousands of times and compares the results with the truth.
//!
//! Input: a [`Job`]. For a [`Scenario`] the output is a [`Tally`](tally::Tally) of its trials and a
//! [`Calibration`](calibration::Calibration), which says whether the σ that the identifier claims is true.
//! For a [`BlindPlan`](blind::BlindPlan) the output is [`Scores`](blind::Scores), which say whether the
//! diagnosis finds the hidden effects. [`shard`] runs both kinds; the results are the same to the last bit for
//! any number of threads and any split into shards.

pub mod blind;
pub mod calibration;
mod effect_size;
mod efficiency;
mod experiment;
mod extended;
pub mod folder;
mod job;
mod merged;
mod motion_noise;
mod scenario;
pub mod shard;
mod share;
mod simulation;
mod statistic;
pub mod study;
mod summary;
pub mod tally;
pub mod trials;

pub use effect_size::EffectSize;
pub use efficiency::Efficiency;
pub use experiment::{Estimation, Experiment, TrialError, Worker};
pub use job::Job;
pub use scenario::{Scenario, ScenarioError};
pub use share::Share;
pub use simulation::Simulation;
pub use summary::{CheckSummary, ParameterSummary, SUMMARY_SCHEMA, Summary};
