//! The whole chain, thousands of times, against the truth.
//!
//! Enters: a [`Job`]. A [`Scenario`] leaves a [`Tally`](tally::Tally) of its trials and a
//! [`Calibration`](calibration::Calibration): whether the σ that the identifier claims is true. A
//! [`BlindPlan`](blind::BlindPlan) leaves [`Scores`](blind::Scores): whether the diagnosis finds what is
//! hidden. Both are run by [`shard`], with the same bits for any number of threads and any split.

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
