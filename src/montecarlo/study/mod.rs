//! Studies: many methods over many scenarios.
//!
//! Enters: scenarios. Leaves: tables of what each method claims and what is true.

mod noise;

pub use noise::{Bound, MethodResult, NoiseStudy, ScenarioResult, study};
