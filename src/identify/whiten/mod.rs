//! Problems with the same parameters and whiter noise.
//!
//! Enters: a [`Problem`](super::problem::Problem). Leaves: another one, whose rows are combinations
//! of its rows chosen so that noise is alike and independent from row to row: plain least squares on
//! it is the weighted least squares of the one that entered.

mod autoregression;
mod cross_joint;
mod decimate;
mod instruments;
mod replicates;
mod spectrum;

pub(super) use autoregression::{autoregression, prewhiten};
pub(super) use cross_joint::{decorrelate, decorrelation, mix};
pub(super) use decimate::decimate;
pub(super) use instruments::{SMOOTHER, instrument, smoothed};
pub(super) use replicates::ReplicateWhitening;
pub use spectrum::Spectrum;
