//! Identification of the dynamic parameters of a serial robot arm, with uncertainties that are checked against a
//! simulated truth, and a diagnosis of what the model gets wrong.
//!
//! # Chapters
//! Each module is a chapter; its first lines say what enters and what leaves. Data flow in this direction, and no
//! chapter imports a later one:
//!
//! | chapter | what it holds |
//! |---|---|
//! | [`robot`] | the description of an arm, read from TOML, URDF or MJCF, and written again |
//! | [`dynamics`] | its equations of motion, and their form that is linear in the parameters |
//! | [`base`] | the combinations of parameters that torque can reveal |
//! | [`signal`] | filters, spectra, periods, and the noise between them |
//! | [`excitation`] | motions that reveal these combinations within all limits |
//! | [`plant`] | the simulated truth: a rigid-body engine, drives, sensors, hidden effects |
//! | [`log`] | files of measured motions |
//! | [`identify`] | base parameters with σ, and standard parameters that a real arm can have |
//! | [`diagnose`] | what the model misses, by name, size and interval |
//! | [`montecarlo`] | whether σ is true, and whether the diagnosis finds what is hidden |
//! | [`report`] | pages, plots, tables and JSON |
//! | [`cli`] | the commands of the two programs |
//!
//! # Example
//! Something is hidden in a simulated arm. The identification says that its model does not explain the log, and the
//! diagnosis says why.
//!
//! ```
//! use std::path::Path;
//!
//! use armid::diagnose::{Diagnoser, Kind};
//! use armid::dynamics::Model;
//! use armid::identify::Identifier;
//! use armid::montecarlo::{Scenario, Simulation};
//!
//! let scenario = r#"
//!     name = "example"
//!     robot = "ur5"
//!     seed = 1
//!     trials = 1
//!     [motion]
//!     trajectory = "ur5_identification"
//!     periods = 4
//!     [sensors]
//!     torque_sd_nm = [1.0, 1.0, 0.7, 0.15, 0.15, 0.15]
//!     [[effect]]
//!     kind = "load_friction"
//!     joint = 2
//!     mu = 0.06
//! "#;
//! let simulation = Simulation::run(Scenario::from_toml(scenario, "example", Path::new("."))?)?;
//! let log = simulation.log(0)?;
//! let measurement = log.measurement("example");
//!
//! // The arm as described, without its hidden effect.
//! let Scenario { arm, set, processing: options, .. } = &simulation.scenario;
//! let model = Model::new(arm);
//! let identification = Identifier::new(&model, set, options.clone()).identify(&measurement)?;
//! assert_eq!(identification.sigma().len(), 52);
//! assert!(identification.left()[1] > 0.01, "of joint 2's torque, the model leaves more than 1 %");
//!
//! let finding = Diagnoser::new(arm, &model, set, options.clone()).diagnose(&measurement, &[], None)?;
//! let cause = &finding.diagnosis.causes[0];
//! assert_eq!((cause.kind, cause.joint), (Kind::LoadFriction, Some(2)));
//! let [low, high] = cause.parameters["mu"].ci95;
//! assert!(low < 0.06 && 0.06 < high);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! A log from a file comes from [`log::read_log`], its torque from [`Log::torque_nm`](log::Log::torque_nm); the two
//! make a [`Measurement`](identify::Measurement).
#![warn(missing_docs)]

pub mod base;
pub mod cli;
mod cumulative_sum;
pub mod diagnose;
mod dot;
pub mod dynamics;
pub mod excitation;
pub mod identify;
mod input;
pub mod log;
mod median;
pub mod montecarlo;
pub mod number;
pub mod output;
pub mod plant;
pub mod random;
pub mod report;
pub mod robot;
pub mod signal;
