//! Identification of the dynamic parameters of a serial robot arm, with uncertainties that are checked against a
//! simulated truth, and a diagnosis of what the model gets wrong.
#![warn(missing_docs)]

pub mod base;
pub mod cli;
pub mod diagnose;
mod dot;
pub mod dynamics;
pub mod excitation;
pub mod identify;
pub mod log;
mod median;
pub mod montecarlo;
pub mod number;
pub mod output;
pub mod plant;
pub mod random;
pub mod report;
pub mod robot;
pub mod signal;
