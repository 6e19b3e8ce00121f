//! The plant, which is the simulated truth: the arm in a physics engine, its drivetrain, controller and sensors.
//!
//! Input: an [`Arm`](crate::robot::Arm) whose parameters are the truth, a
//! [`Reference`](crate::excitation::Reference) to follow, a [`PlantConfig`] and a [`SensorConfig`].
//! Output: a noise-free [`Recording`] and, for each trial, the log [`Measured`] by the [`Sensors`].
//!
//! Everything that acts inside the integration (friction, elasticity, any state of the joint mechanics) belongs to a
//! [`Drivetrain`]; everything that acts on the readings belongs to the sensors. The equations of motion are those of
//! the engine. No code is shared with [`dynamics`](crate::dynamics) except in the controller, whose model represents
//! what the manufacturer of the arm believes.

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
pub use drivetrain::{Drivetrain, RigidDrivetrain, Stage, tied_to_held_torque};
pub use error::PlantError;
pub use integrate::{RungeKutta4, State};
pub use noise::{Colour, Component, NoiseModel};
pub use rapier_arm::RapierArm;
pub use recording::{Readings, Recording};
pub use repeating::run_repeating;
pub use sensors::{Effort, Encoders, Measured, PerJoint, SensorConfig, Sensors, TorqueNoise};
pub use simulate::{Plant, simulate};
pub use whitening::Whitening;
