//! Errors of the design of an excitation.

use thiserror::Error;

use crate::base::{AmbiguousRank, ParameterisationError};
use crate::excitation::error::readable;
use crate::excitation::{ExcitationError, LimitKind, POSES_TRIED};

/// A specification that cannot be met or makes no sense.
#[derive(Debug, Error)]
pub enum DesignError {
    /// A number outside what is possible.
    #[error("{what} = {} must be {must}", readable(*value))]
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
    /// A distance is too small wherever the arm is.
    #[error(
        "{limit}: at most {most_m:.3} m in {POSES_TRIED} poses all over the range of the joints, and {} m are asked for",
        readable(*clearance_m)
    )]
    NeverClear {
        /// The distance, in words.
        limit: String,
        /// The largest value of the distance, m; negative if the two always overlap.
        most_m: f64,
        /// The clearance that is required, m.
        clearance_m: f64,
    },
    /// The fixed offsets are a pose that the arm may not take.
    #[error("the fixed offsets are no pose the arm may take: {limit} is short by {short}")]
    FixedPose {
        /// The limit that is exceeded.
        limit: LimitKind,
        /// By how much, with its unit.
        short: String,
    },
    /// A prior is combined with a condition number, which depends on one motion alone.
    #[error(
        "the condition number of Θ does not know what was known before: use a prior with d, a or e"
    )]
    PriorUnused,
    /// The prior belongs to another model.
    #[error("{file}: {message}")]
    Prior {
        /// The file.
        file: String,
        /// What does not fit.
        message: String,
    },
    /// None of the starts became a motion inside the limits.
    #[error(
        "no motion inside the limits was found from {starts} starts: ask for less --clearance ({clearance_m} m) or another \
         --period (speeds and accelerations limit short ones, the ranges of the joints long ones), allow more of the limits \
         (--velocity-share, --torque-share), or look at the limits of \"{arm}\""
    )]
    Infeasible {
        /// How many were tried.
        starts: usize,
        /// Clearance that was required, m.
        clearance_m: f64,
        /// Name of the arm.
        arm: String,
    },
    /// Time ran out before any start became a motion inside the limits.
    #[error(
        "time was over after {tried} of {starts} starts, and none of these is a motion inside the limits: give more \
         --seconds"
    )]
    OutOfTime {
        /// Number of starts tried.
        tried: usize,
        /// Number of starts.
        starts: usize,
    },
    /// Designs were found, but none passed the check on the fine grid together with a run-in.
    #[error("{}: {last}", none_passes(*candidates))]
    CheckFailed {
        /// How many.
        candidates: usize,
        /// Why the last one failed.
        last: String,
    },
    /// An error of the trajectory.
    #[error(transparent)]
    Excitation(#[from] ExcitationError),
    /// An error of the base parameters.
    #[error(transparent)]
    Rank(#[from] AmbiguousRank),
    /// An error of the parameterisation.
    #[error(transparent)]
    Parameterisation(#[from] ParameterisationError),
}

impl DesignError {
    /// Whether the required clearances may be the reason that no motion is left.
    pub fn is_about_clearance(&self) -> bool {
        match self {
            Self::NeverClear { .. } | Self::Infeasible { .. } => true,
            Self::FixedPose { limit, .. } => limit.is_distance(),
            _ => false,
        }
    }
}

fn none_passes(candidates: usize) -> String {
    match candidates {
        1 => "one design was found, which does not pass the final check".to_owned(),
        more => format!("{more} designs were found, none of which passes the final check"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_design_is_no_plural() {
        let of = |candidates: usize| {
            DesignError::CheckFailed { candidates, last: "why".into() }.to_string()
        };
        assert_eq!(of(1), "one design was found, which does not pass the final check: why");
        assert_eq!(of(2), "2 designs were found, none of which passes the final check: why");
    }
}
