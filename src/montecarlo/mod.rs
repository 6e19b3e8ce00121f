//! The whole chain, thousands of times, against the truth.

pub mod calibration;
pub mod tally;
