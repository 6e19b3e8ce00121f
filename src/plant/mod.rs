//! The simulated truth: the arm in a physics engine, its drivetrain, its controller and its sensors.
//!
//! Enters: an [`Arm`](crate::robot::Arm) whose parameters are the truth, a
//! [`Reference`](crate::excitation::Reference) to follow, a [`PlantConfig`] and a [`SensorConfig`].
//! Leaves: a noise-free [`Recording`], and per trial what the [`Sensors`] [`Measured`] of it.
//!
//! What acts inside the integration (friction, elasticity, any state of the joint mechanics) is a
//! [`Drivetrain`]; what acts on the readings is in the sensors. The equations of motion are the
//! engine's: this chapter shares none with [`dynamics`](crate::dynamics), except in the controller,
//! whose model is what the arm's maker believes.

mod config;
mod controller;
mod drivetrain;
mod engine_math;
mod error;
pub mod faults;
mod integrate;
mod noise;
mod rapier_arm;
mod recording;
mod repeating;
mod sensors;
mod simulate;
mod whitening;

pub use config::PlantConfig;
pub use controller::Controller;
pub use drivetrain::{Drivetrain, RigidDrivetrain, Stage};
pub use error::PlantError;
pub use integrate::{RungeKutta4, State};
pub use noise::{Colour, Component, NoiseModel};
pub use rapier_arm::RapierArm;
pub use recording::{Readings, Recording};
pub use repeating::run_repeating;
pub use sensors::{Effort, Encoders, Measured, PerJoint, SensorConfig, Sensors, TorqueNoise};
pub use simulate::{Plant, simulate};
pub use whitening::Whitening;
