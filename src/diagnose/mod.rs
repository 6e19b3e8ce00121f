//! What the model gets wrong: candidates, tests, verdict, extended model, gain.
//!
//! Enters: a log, the arm and its base set. Leaves: a [`Diagnosis`]: causes with names, sizes and
//! intervals, what cannot be told apart, what is left unexplained, what would not have been seen, and
//! how much the extended model gains on data it was not fitted to.
//!
//! 1. The log is processed as for identification, and its equations are whitened ([`Whitening`]): with
//!    periods by the scatter between them (less what drifting friction does there), without by the residual itself.
//!    How the drives answer dry friction belongs to the null model (`drives`), what single ones differ by to the
//!    noise, and friction is looked at between the samples of a log ([`Scene::as_logged`], [`Scene::turning_rad_s`]).
//! 2. Every family's columns lose what the null model spans; the squared length of the residual along
//!    them, T = ‖P r‖² ~ χ²_k(λ), is the score test of adding the family.
//! 3. Nonlinear parameters are refined continuously, the best family is added if chance does not explain
//!    it, all causes are refined together, exchanged and removed where another set is better, and again.
//!    Where a law explains a joint best at an end of its range that is not its own (play without a flight,
//!    Stribeck's curve over the whole range of speeds, or while the sign turns round), it stands in for something
//!    unknown and is not named.
//! 4. What is left is tested against noise; if it is none and no family fits, the answer says so.

pub mod candidates;

mod against;
pub mod chance;
mod cleaned;
mod clustered;
mod common_motion;
mod contact;
mod data_faults;
mod detection_limits;
mod diagnoser;
mod distinct_shapes;
mod drives;
mod error;
mod extension;
mod friction_drift;
mod gain;
mod held_out;
mod image;
mod intervals;
mod judgement;
mod kind;
mod load;
mod memory;
mod misfit;
mod modesty;
mod noise_power;
mod outliers;
mod payload;
mod price;
mod record;
mod repeated;
pub mod replay;
mod reversal_answer;
mod reversals;
mod rms;
mod scene;
mod selection;
mod sentences;
mod settled;
mod significance;
mod stale;
mod stalls;
mod statistic;
mod study;
mod told;
mod verdict;
mod whitening;

pub use against::Nominal;
pub use diagnoser::{Diagnoser, Finding};
pub use error::DiagnoseError;
pub use extension::{Effect, Extension};
pub use held_out::Validation;
pub use image::Column;
pub use kind::Kind;
pub use payload::PayloadFinding;
pub use repeated::{Repeated, repeated};
pub use scene::{Scene, equivalent_arm};
pub use verdict::{
    BaseParameter, Cause, DIAGNOSE_SCHEMA, DetectionLimit, Diagnosis, Estimate, HeldOut, Moved,
    Rival, Rms, Unexplained, Verdict, class_holds,
};
pub use whitening::Whitening;
