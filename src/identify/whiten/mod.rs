//! Transforms problems into problems with the same parameters and whiter noise.
//!
//! Enters: a [`Problem`](super::problem::Problem). Leaves: another one, whose rows are combinations of the first
//! one's rows, chosen so that the noise has equal variance and is independent from row to row. Plain least squares on
//! the second problem is weighted least squares on the first.

mod autoregression;
mod cross_joint;
mod decimate;
mod instruments;
mod replicates;
mod spectrum;

pub(super) use autoregression::{autoregression, prewhiten};
pub(super) use cross_joint::{decorrelate, mix};
pub(super) use decimate::decimate;
pub(super) use instruments::{SMOOTHER, instrument, smoothed};
pub(super) use replicates::{ROWS_END, ReplicateWhitening, noise_of_rows};
pub use spectrum::Spectrum;
