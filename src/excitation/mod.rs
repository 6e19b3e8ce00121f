//! Excitation: how to move the arm so that its parameters can be identified.
//!
//! Input: an [`Arm`](crate::robot::Arm) with its limits and clearance model. Output: a [`Reference`], the commanded
//! motion as a function of time; in particular an [`Excitation`], the paper's periodic series (24) with a smooth run-in
//! from rest, and the [`Margins`] by which it keeps every limit.

mod clearance;
pub mod design;
mod error;
pub mod export;
mod fourier;
mod limits;
mod planned;
mod reference;
mod run_in;
mod sampled;

pub use clearance::{ClearanceModel, ClearanceWorkspace, POSES_TRIED};
pub use error::ExcitationError;
pub use fourier::{FourierSeries, TRAJECTORY_SCHEMA, built_in_names};
pub use limits::{LimitKind, Margin, Margins, Requirements, check};
pub use planned::{PlannedError, PlannedMotion};
pub use reference::Reference;
pub use run_in::Excitation;
pub use sampled::SampledMotion;
