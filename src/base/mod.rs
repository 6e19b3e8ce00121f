//! Which combinations of parameters can be known: section III-D of the paper.
//!
//! Enters: an arm and a [`Parameterisation`] of its equations of motion. Leaves: a [`BaseSet`]:
//! the independent columns, left to right, and the combinations that go with them, by name.

mod parameterisation;
mod set;

pub use parameterisation::{Parameterisation, ParameterisationError, Terms};
pub use set::{AmbiguousRank, BaseSet, RankGap};
