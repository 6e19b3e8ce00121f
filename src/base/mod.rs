//! Base parameters, the combinations of parameters that can be identified: section III-D of the paper.
//!
//! Enters: an arm and a [`Parameterisation`] of its equations of motion. Leaves: a [`BaseSet`]: the independent
//! columns, from left to right, and the corresponding combinations of parameters, by name; and which of the columns
//! each joint sees ([`ColumnPlan`]).

mod columns;
mod parameterisation;
mod set;

pub use columns::{ColumnPlan, PlannedColumn};
pub use parameterisation::{Parameterisation, ParameterisationError, Terms};
pub use set::{AmbiguousRank, BaseSet, NearlyDependent, RankGap};
