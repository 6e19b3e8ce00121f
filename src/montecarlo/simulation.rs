//! Runs a scenario's arm and reads its sensors: everything in a scenario except the identification.

use std::borrow::Cow;

use super::scenario::Scenario;
use crate::excitation::Reference;
use crate::identify::Measurement;
use crate::plant::faults::{Effect, FaultyPlant};
use crate::plant::{
    Measured, PlantError, Recording, SensorConfig, Sensors, TorqueNoise, run_repeating,
};
use crate::random::TrialStreams;

/// A scenario whose plant has run: everything that the logs of all its trials share.
pub struct Simulation {
    /// The scenario.
    pub scenario: Scenario,
    /// The run that the sensors read: without noise, and without limits of the readings, which cut noise off as well.
    pub recording: Recording,
    pub(super) plant: FaultyPlant,
    sensors: Sensors,
}

impl Simulation {
    /// Runs the plant once without noise; with [`run_repeating`] if every effect in the arm repeats from period to
    /// period.
    pub fn run(scenario: Scenario) -> Result<Self, PlantError> {
        let plant = FaultyPlant::new(&scenario.arm, &scenario.effects, &scenario.plant)?;
        let excitation = &scenario.excitation;
        let run = |reference: &dyn Reference| plant.run_before_limits(reference, None);
        let recording = match scenario.effects.iter().all(Effect::repeats) {
            true => run_repeating(excitation, &scenario.plant, run)?,
            false => run(excitation)?,
        };
        Self::with_recording(scenario, plant, recording)
    }

    /// Builds the simulation from a `recording` that `plant` has already made.
    pub(super) fn with_recording(
        scenario: Scenario,
        plant: FaultyPlant,
        recording: Recording,
    ) -> Result<Self, PlantError> {
        let sensors = Sensors::new(&scenario.sensors, &scenario.arm, scenario.plant.log_rate_hz)?;
        Ok(Self { scenario, recording, plant, sensors })
    }

    /// The same run, read by other sensors.
    ///
    /// # Errors
    /// [`PlantError`] if a setting makes no sense, or if the controller reads the sensors, because other sensors would
    /// then change the run.
    pub fn read_by(&self, sensors: SensorConfig) -> Result<Self, PlantError> {
        if self.scenario.controller_reads_sensors {
            let requirement = "must be false where one run is read by several sensors";
            let key = "controller_reads_sensors";
            return Err(PlantError::Setting { key, value: 1.0, requirement });
        }
        let scenario = Scenario { sensors, ..self.scenario.clone() };
        Ok(Self {
            recording: self.recording.clone(),
            plant: self.plant.clone(),
            sensors: Sensors::new(&scenario.sensors, &scenario.arm, scenario.plant.log_rate_hz)?,
            scenario,
        })
    }

    /// The random number streams of a trial.
    pub fn streams(&self, trial: u64) -> TrialStreams {
        TrialStreams::new(self.scenario.seed, self.scenario.name.as_bytes(), trial)
    }

    /// The run behind the log of a trial: the shared one, or the trial's own one if the controller reads the sensors.
    pub fn recording(&self, trial: u64) -> Result<Cow<'_, Recording>, PlantError> {
        if !self.scenario.controller_reads_sensors {
            return Ok(Cow::Borrowed(&self.recording));
        }
        let encoders = self.sensors.encoders(&self.streams(trial));
        let excitation = &self.scenario.excitation;
        Ok(Cow::Owned(self.plant.run_before_limits(excitation, Some(encoders))?))
    }

    /// The shared run as sensors without noise read it.
    pub fn without_noise(&self) -> Recording {
        let mut recording = self.recording.clone();
        self.plant.end_at_limits(&mut recording.torque_nm);
        recording
    }

    /// The law of the torque noise; `None` if rounding adds to the noise.
    pub fn known_torque_noise(&self) -> Option<TorqueNoise<'_>> {
        self.sensors.torque_noise()
    }

    /// The log of a trial: the run as the sensors read it, including readings spoilt by faults.
    pub fn log(&self, trial: u64) -> Result<Measured, PlantError> {
        let mut log = Measured::like(&self.recording);
        self.log_into(trial, &mut log)?;
        Ok(log)
    }

    /// As [`Self::log`], but writes into existing memory, which is reused from trial to trial.
    pub fn log_into(&self, trial: u64, log: &mut Measured) -> Result<(), PlantError> {
        let recording = self.recording(trial)?;
        let streams = self.streams(trial);
        self.sensors.measure(&recording, &streams, log);
        self.plant.spoil(&streams, log);
        Ok(())
    }
}

impl Measured {
    /// The log in the form that identification and diagnosis read; messages refer to it as `source`.
    pub fn measurement<'a>(&'a self, source: &'a str) -> Measurement<'a> {
        Measurement {
            source,
            time_s: &self.time_s,
            q_rad: &self.q_rad,
            qd_rad_s: &self.qd_rad_s,
            torque_nm: &self.torque_nm,
        }
    }
}
