//! Why there is no design.

use thiserror::Error;

use crate::base::{AmbiguousRank, ParameterisationError};
use crate::excitation::{ExcitationError, LimitKind, POSES_TRIED};

/// A specification that cannot be met or makes no sense.
#[derive(Debug, Error)]
pub enum DesignError {
    /// A number outside what is possible.
    #[error("{what} = {value} must be {must}")]
    Value {
        /// Which quantity.
        what: String,
        /// Its value.
        value: f64,
        /// What is allowed.
        must: String,
    },
    /// One number per joint is needed.
    #[error("{what}: {found} values, but \"{arm}\" has {dof} joints")]
    Length {
        /// Which list.
        what: &'static str,
        /// How many there are.
        found: usize,
        /// Name of the arm.
        arm: String,
        /// How many there must be.
        dof: usize,
    },
    /// Something is too near wherever the arm is.
    #[error(
        "{limit}: at most {most_m:.3} m in {POSES_TRIED} poses all over the range of the joints, and {clearance_m} m are asked for"
    )]
    NeverClear {
        /// What is too near.
        limit: String,
        /// The largest distance, m; negative where they overlap.
        most_m: f64,
        /// What is asked for, m.
        clearance_m: f64,
    },
    /// Fixed offsets at which the arm may not even stand.
    #[error("the fixed offsets are no pose the arm may take: {limit} is short by {short}")]
    FixedPose {
        /// The limit that is passed.
        limit: LimitKind,
        /// By how much, with its unit.
        short: String,
    },
    /// A condition number is about one motion alone.
    #[error(
        "the condition number of Θ does not know what was known before: use a prior with d, a or e"
    )]
    PriorUnused,
    /// What is known already belongs to another model.
    #[error("{file}: {message}")]
    Prior {
        /// The file.
        file: String,
        /// What does not fit.
        message: String,
    },
    /// None of the starts became a motion inside the limits.
    #[error(
        "no motion inside the limits was found from {starts} starts: ask for less clearance ({clearance_m} m), \
         free the offsets, or look at the limits of \"{arm}\""
    )]
    Infeasible {
        /// How many were tried.
        starts: usize,
        /// Clearance asked for.
        clearance_m: f64,
        /// Name of the arm.
        arm: String,
    },
    /// Time was over before a start became a motion inside the limits.
    #[error(
        "time was over after {tried} of {starts} starts, and none of these is a motion inside the limits: give more \
         --seconds"
    )]
    OutOfTime {
        /// How many were looked at.
        tried: usize,
        /// How many there are.
        starts: usize,
    },
    /// Designs were found, but none passed the check on the fine grid together with a run-in.
    #[error("{candidates} designs were found, none of which passes the final check: {last}")]
    CheckFailed {
        /// How many.
        candidates: usize,
        /// Why the last one failed.
        last: String,
    },
    /// From the trajectory.
    #[error(transparent)]
    Excitation(#[from] ExcitationError),
    /// From the base parameters.
    #[error(transparent)]
    Rank(#[from] AmbiguousRank),
    /// From the parameterisation.
    #[error(transparent)]
    Parameterisation(#[from] ParameterisationError),
}

impl DesignError {
    /// Whether it may be what the arm is to keep clear of that leaves no motion.
    pub fn is_about_clearance(&self) -> bool {
        match self {
            Self::NeverClear { .. } | Self::Infeasible { .. } => true,
            Self::FixedPose { limit, .. } => limit.is_distance(),
            _ => false,
        }
    }
}
