//! Logs of the simulated UR5, with what a scenario hides in them.

use std::path::Path;

use armid::base::BaseSet;
use armid::diagnose::Diagnoser;
use armid::diagnose::candidates::Candidate;
use armid::dynamics::Model;
use armid::identify::Options;
use armid::montecarlo::{Scenario, Simulation};
use armid::plant::Measured;
use armid::robot::Arm;

/// Torque sensors with the white noise of a UR5's.
pub const TORQUE_NOISE: &str = "torque_sd_nm = [1.0, 1.0, 0.7, 0.15, 0.15, 0.15]\n";
/// The same, and encoders with noise.
pub const NOISE: &str =
    "torque_sd_nm = [1.0, 1.0, 0.7, 0.15, 0.15, 0.15]\nq_sd_rad = 2e-5\nqd_sd_rad_s = 1e-3\n";

/// So many periods of a built-in trajectory.
pub type Along<'a> = (&'a str, usize);

/// Scenario `name`, whose noise hangs on it and on `seed`: behind `sensors`, then the `rest` of its file, effects first of all.
pub fn scenario(
    (name, seed): (&str, u64),
    (trajectory, periods): Along,
    sensors: &str,
    rest: &str,
) -> Scenario {
    let text = format!(
        "name = \"{name}\"\nrobot = \"ur5\"\nseed = {seed}\ntrials = 1\n[motion]\ntrajectory = \"{trajectory}\"\n\
         periods = {periods}\n[sensors]\n{sensors}\n{rest}"
    );
    Scenario::from_toml(&text, name, Path::new(".")).unwrap()
}

/// An arm and one log of it.
pub struct Run {
    pub arm: Arm,
    pub model: Model,
    pub set: BaseSet,
    pub options: Options,
    pub log: Measured,
}

impl Run {
    pub fn new(scenario: Scenario) -> Self {
        Self::of(&Simulation::run(scenario).unwrap(), 0)
    }

    /// One of several logs of a plant that has run.
    pub fn of(simulation: &Simulation, trial: u64) -> Self {
        let Scenario { arm, set, processing, .. } = &simulation.scenario;
        let (arm, set, options) = (arm.clone(), set.clone(), processing.clone());
        Self { model: Model::new(&arm), arm, set, options, log: simulation.log(trial).unwrap() }
    }

    /// One that knows all families.
    pub fn diagnoser(&self) -> Diagnoser<'_> {
        Diagnoser::new(&self.arm, &self.model, &self.set, self.options.clone())
    }

    /// One that knows these.
    pub fn diagnoser_with(&self, families: Vec<Box<dyn Candidate>>) -> Diagnoser<'_> {
        let Self { arm, model, set, options, .. } = self;
        Diagnoser::with_families(arm, model, set, options.clone(), families)
    }
}
