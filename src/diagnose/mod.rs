//! Diagnosis: what the rigid model gets wrong along a log.
//!
//! Input: a log, the arm and its base set. Output: a [`Diagnosis`], which names causes with their sizes and intervals
//! and lists the alternatives that the data cannot tell from them, what is left unexplained, how small an effect would
//! have been seen, and how much the extended model gains on data it was not fitted to.
//!
//! 1. The log is processed as for identification, and its equations are whitened ([`Whitening`]). Where the motion
//!    repeats, the noise is known from the scatter between the periods, less the part of it that drifting friction
//!    causes; along a single run the residual itself serves as the noise. How the drives answer dry friction belongs to
//!    the null model (`drives`); the differences between single drives count as noise. Friction is evaluated between
//!    the samples of a log ([`Scene::as_logged`], [`Scene::turning_rad_s`]).
//! 2. The null model is projected out of the columns of every family. The squared length of the residual's projection
//!    on them, T = ‖P r‖² ~ χ²_k(λ), is the score statistic for adding the family.
//! 3. Nonlinear parameters are refined continuously. The best family is added if chance does not explain it. All causes
//!    are then refined together, and exchanged or removed where another set is better; the search repeats until nothing
//!    is added. A law may explain a joint best at an end of its range where it is no longer that law: play without a
//!    flight, or a Stribeck curve that spans the whole range of speeds or only the speeds at which the sign turns
//!    round. There it stands in for something unknown and is not named.
//! 4. The remaining residual is tested against noise, joint by joint and on all joints together. If it is not noise and
//!    no family fits it, the diagnosis says so; little of what a law does may be left because its form is not exact.

pub mod candidates;

mod against;
mod arm_in_doubt;
mod bristles;
pub mod chance;
mod channel;
mod cleaned;
mod clustered;
mod coarse_angles;
mod common_motion;
mod contact;
mod contenders;
mod data_faults;
mod delta_method;
mod detection_limits;
mod diagnoser;
mod dictionary;
mod distinct_shapes;
mod drives;
mod error;
mod explanation;
mod extended;
mod extension;
mod finding;
mod form_error;
mod gain;
mod held;
mod held_out;
mod image;
mod intervals;
mod judgement;
mod kept_bands;
mod kind;
mod lateness;
mod load;
mod mean_spectrum;
mod memory;
mod mended;
mod misfit;
mod modesty;
mod noise_power;
#[cfg(test)]
mod noisy_periods;
mod outliers;
mod payload;
mod peak;
mod price;
mod reading_steps;
mod record;
mod record_fault;
mod refinement;
mod remarks;
mod repeated;
pub mod replay;
mod rests;
mod reversal_answer;
mod reversals;
mod rms;
mod scene;
mod selection;
mod sentences;
mod settled;
mod setup;
mod significance;
mod slow_stretches;
mod stale;
mod stalls;
mod statistic;
mod study;
mod told;
mod verdict;
mod whitening;

pub use against::Nominal;
pub use channel::Channel;
pub use diagnoser::Diagnoser;
pub use error::DiagnoseError;
pub use extension::{Effect, Extension};
pub use finding::Finding;
pub use held_out::Validation;
pub use image::Column;
pub use kind::Kind;
pub use mended::Mended;
pub use payload::PayloadFinding;
pub use record_fault::RecordFault;
pub use repeated::{Repeated, repeated};
pub use scene::{Scene, equivalent_arm};
pub use verdict::{
    BaseParameter, Cause, DIAGNOSE_SCHEMA, DetectionLimit, Diagnosis, Estimate, HeldOut, Moved,
    Rival, Rms, Unexplained, Verdict, class_holds,
};
pub use whitening::Whitening;
