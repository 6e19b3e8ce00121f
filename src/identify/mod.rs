//! From a log to parameters with an uncertainty: sections III-D and IV-B of the paper.

pub mod covariance;

mod columns;
mod fit;
mod problem;
mod triangle;

pub use columns::ColumnPlan;
pub use fit::{Estimator, Fit, FitError, Fitter};
pub use problem::{Assembler, Panel, Problem};
pub use triangle::Triangle;
