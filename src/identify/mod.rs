//! Identifies parameters with their uncertainty from a log: sections III-D and IV-B of the paper.
//!
//! Enters: time stamps, angles, velocities and torques of one log or of several ([`Measurement`]), the
//! [`Model`](crate::dynamics::Model) of the arm and its [`BaseSet`](crate::base::BaseSet). Leaves: the log on an even
//! clock, laid out as equations ([`Regression`]); base parameters with their covariance, a test of what the model
//! lacks and friction that drifted ([`Identification`]), or how the log should have been read ([`Misreading`]); the torque predicted along
//! other logs ([`Prediction`]) and planned motions ([`Forecast`]); standard parameters that a real arm can have
//! ([`physical`]).

pub mod covariance;
pub mod physical;

mod bound;
mod course;
mod doubt;
mod drifting_friction;
mod drive_answers;
mod drive_limits;
mod error;
mod estimation;
mod even;
mod fit;
mod forecast;
mod friction_drift;
mod gravity;
mod held_at_rest;
mod identification;
mod identifier;
mod lack_of_fit;
mod lowered;
mod measurement;
mod misreading;
mod motion_noise;
mod negative_friction;
mod negative_inertia;
mod options;
mod pauses;
mod pooled;
mod prediction;
mod prepare;
mod prepared;
mod problem;
mod quality;
mod regression;
mod residual;
mod rest;
mod several_logs;
mod triangle;
mod unlike;
mod untorn;
mod whiten;

pub use bound::{KnownNoise, cramer_rao};
pub use course::Course;
pub use doubt::Doubt;
pub use drifting_friction::DriftingFriction;
pub use drive_answers::{FEEDBACK_RAD_S, drive_answers, feedback_per_tick};
pub use drive_limits::{AtLimit, drive_limit_remark, drives_at_limits};
pub use error::IdentifyError;
pub use estimation::{Estimate, Estimation, MotionAids};
pub use even::BetweenRows;
pub use fit::{Estimator, Fit, FitError, Fitter, Weighting};
pub use forecast::{Forecast, prediction_sd};
pub use friction_drift::FrictionDrift;
pub use held_at_rest::{HeldAtRest, MOST_HELD};
pub use identification::Identification;
pub use identifier::{Identifier, MANY_PERIODS, kept_every};
pub use lack_of_fit::{Floor, LackOfFit, by_noise_in_words};
pub use lowered::Lowered;
pub use measurement::Measurement;
pub use misreading::{Change, Channels, Match, Misreading};
pub use options::{Improper, Options, Repetition};
pub use pauses::pauses;
pub use pooled::Agreement;
pub use prediction::{MOVING_RAD_S, Prediction, resting_joints};
pub use prepare::Preparer;
pub use prepared::{Prepared, Processing};
pub use problem::{Assembler, Domain, Panel, Problem};
pub use quality::{Condition, identifies_the_arm, not_identified, plausible_size};
pub use regression::Regression;
pub use residual::Residual;
pub use rest::{Rest, nothing_moves};
pub use several_logs::SeveralLogs;
pub use triangle::Triangle;
pub use unlike::unlike;
pub use untorn::Untorn;
pub use whiten::Spectrum;
