//! Reasons why there is no physically consistent estimate.

use thiserror::Error;

use super::program::ProgramError;
use crate::base::AmbiguousRank;

/// No physically consistent estimate, with the numbers that say why.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum PhysicalError {
    /// The prior has a body that cannot exist.
    #[error(
        "the robot file's body {body} cannot exist (smallest eigenvalue of its pseudo-inertia \
         {smallest:.3e}): correct its mass or inertia, or give a mass to a link without one"
    )]
    ImpossiblePrior {
        /// Body, from 1.
        body: usize,
        /// Smallest eigenvalue of its pseudo-inertia.
        smallest: f64,
    },
    /// The robot file's own values violate its bounds, or a reduced set leaves no body that exists.
    #[error(
        "the robot file's own values violate the {what} (by {:.3e} of its size): widen the bound \
         or correct the values", -margin
    )]
    PriorOutside {
        /// Which constraint.
        what: String,
        /// By how much, relative; negative.
        margin: f64,
    },
    /// A setting outside of its range.
    #[error("{name} = {value} {requirement}")]
    Setting {
        /// Which.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What it must be.
        requirement: &'static str,
    },
    /// Cross-validation leaves periods out in turn.
    #[error(
        "the weight of the prior can be cross-validated on a motion that repeats at least 3 times; \
         whole periods in this one: {periods}; give the weight as a number"
    )]
    TooFewPeriods {
        /// Periods there are.
        periods: usize,
    },
    /// The parameters on which no torque depends could not be determined.
    #[error(transparent)]
    Rank(#[from] AmbiguousRank),
    /// The solver found no optimum.
    #[error("no optimum: {0}")]
    Program(#[from] ProgramError),
}
