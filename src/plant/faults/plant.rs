//! A plant with hidden effects, from its scenario to its readings.

use super::assembly::Assembly;
use super::drivetrain::HiddenDrivetrain;
use super::effect::{Complaint, Effect, require};
use crate::excitation::Reference;
use crate::plant::{Encoders, Measured, Plant, PlantConfig, PlantError, Recording};
use crate::random::TrialStreams;
use crate::robot::Arm;

/// An arm with hidden effects under the controller of the nominal arm.
#[derive(Debug, Clone)]
pub struct FaultyPlant {
    nominal: Arm,
    assembly: Assembly,
    config: PlantConfig,
    limit_nm: Vec<f64>,
}

impl FaultyPlant {
    /// Checks `effects` and builds the true arm from the nominal one.
    ///
    /// # Errors
    /// [`PlantError::Effect`] names the effect, its key and the value that makes no sense;
    /// [`PlantError::FrictionDrives`] where the sum of what was asked for on a joint is no friction.
    pub fn new(
        nominal: &Arm,
        effects: &[Effect],
        config: &PlantConfig,
    ) -> Result<Self, PlantError> {
        config.validate()?;
        let mut assembly = Assembly::new(nominal);
        for (i, effect) in effects.iter().enumerate() {
            let install = |assembly: &mut Assembly| {
                let fault = effect.as_fault();
                assembly.number = u8::try_from(i).map_err(|_| Complaint {
                    key: "effect",
                    value: effects.len() as f64,
                    requirement: "tables are too many: at most 256",
                })?;
                if let Some(joint) = fault.joint() {
                    let exists = (1..=nominal.dof()).contains(&joint);
                    let requirement = "must be a joint of the arm, counted from 1";
                    require(exists, "joint", joint as f64, requirement)?;
                }
                fault.check()?;
                fault.install(assembly)
            };
            install(&mut assembly).map_err(|Complaint { key, value, requirement }| {
                PlantError::Effect { number: i + 1, kind: effect.kind(), key, value, requirement }
            })?;
        }
        for (j, joint) in assembly.joints.iter().enumerate() {
            let limit = nominal.joints[j].limits.velocity_rad_s;
            if let Some((qd_rad_s, torque_nm)) = joint.friction.first_driving(limit) {
                return Err(PlantError::FrictionDrives { joint: j + 1, qd_rad_s, torque_nm });
            }
        }
        Ok(Self {
            limit_nm: nominal.joints.iter().map(|j| j.limits.torque_nm).collect(),
            nominal: nominal.clone(),
            assembly,
            config: config.clone(),
        })
    }

    /// The arm as it is: bodies, lengths and gravity with their errors, nominal drives.
    pub fn true_arm(&self) -> &Arm {
        &self.assembly.arm
    }

    /// One run along `reference`, as the log's channels would read without noise. The controller
    /// reads what the encoders sit on, or, where they are given, what `encoders` make of it.
    pub fn run(
        &self,
        reference: &dyn Reference,
        encoders: Option<Encoders>,
    ) -> Result<Recording, PlantError> {
        let mut recording = if self.assembly.timing.is_exact() {
            self.record(reference, encoders, &self.config)?
        } else {
            let (config, every) = self.dense_config()?;
            let dense = self.record(reference, encoders, &config)?;
            self.assembly.timing.sample(&dense, config.log_rate_hz, every)
        };
        self.end_at_limits(&mut recording.torque_nm);
        Ok(recording)
    }

    /// Applies to `log`, fresh from the sensors, what goes wrong with single readings in this trial.
    pub fn spoil(&self, streams: &TrialStreams, log: &mut Measured) {
        self.end_at_limits(&mut log.torque_nm);
        for (effect, fault) in &self.assembly.readings {
            fault.apply(*effect, &self.limit_nm, streams, log);
        }
    }

    /// The run at every sample of a log as `config` wants it, every channel read in time.
    fn record(
        &self,
        reference: &dyn Reference,
        encoders: Option<Encoders>,
        config: &PlantConfig,
    ) -> Result<Recording, PlantError> {
        if reference.joints() != self.nominal.dof() {
            let (found, expected) = (reference.joints(), self.nominal.dof());
            return Err(PlantError::Joints { what: "the reference", found, expected });
        }
        let drivetrain = Box::new(HiddenDrivetrain::new(&self.assembly, reference));
        let arm = &self.assembly.arm;
        Plant::with_drivetrain(arm, &self.nominal, drivetrain, config)?.run(reference, encoders)
    }

    /// A configuration that logs at every decision of the controller (or at every step, where the
    /// log's instants are no instants of decision), and its samples per sample of the log.
    fn dense_config(&self) -> Result<(PlantConfig, usize), PlantError> {
        let (log, control) = (self.config.steps_per_log()?, self.config.steps_per_control()?);
        let steps = if log.is_multiple_of(control) { control } else { 1 };
        let every = log / steps;
        let log_rate_hz = self.config.log_rate_hz * every as f64;
        Ok((PlantConfig { log_rate_hz, ..self.config.clone() }, every))
    }

    fn end_at_limits(&self, torque_nm: &mut crate::robot::JointSignals) {
        for (j, joint) in self.assembly.joints.iter().enumerate() {
            let limit = joint.reading_limit_nm;
            if limit.is_finite() {
                torque_nm.joint_mut(j).iter_mut().for_each(|t| *t = t.clamp(-limit, limit));
            }
        }
    }
}
