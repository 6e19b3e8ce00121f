//! From a log to parameters with an uncertainty: sections III-D and IV-B of the paper.

pub mod covariance;

mod columns;
mod error;
mod fit;
mod identifier;
mod options;
mod prepare;
mod problem;
mod triangle;

pub use columns::ColumnPlan;
pub use error::IdentifyError;
pub use fit::{Estimator, Fit, FitError, Fitter};
pub use identifier::{Identification, Identifier, Regression, Residual};
pub use options::Options;
pub use prepare::{Measurement, Prepared, Preparer, Processing};
pub use problem::{Assembler, Panel, Problem};
pub use triangle::Triangle;
