//! The plant with hidden effects, from the scenario to the readings.

use super::assembly::Assembly;
use super::drivetrain::HiddenDrivetrain;
use super::effect::{Complaint, Effect, require};
use crate::excitation::Reference;
use crate::plant::{Encoders, Measured, Plant, PlantConfig, PlantError, Recording};
use crate::random::TrialStreams;
use crate::robot::{Arm, JointSignals};

/// An arm with hidden effects, driven by a controller that knows the nominal arm only.
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
    /// [`PlantError::Effect`] if a parameter makes no sense, with the effect, the key and the value;
    /// [`PlantError::FrictionDrives`] if the effects on a joint together would make friction drive it.
    pub fn new(
        nominal: &Arm,
        effects: &[Effect],
        config: &PlantConfig,
    ) -> Result<Self, PlantError> {
        Self::with_controller(nominal, nominal, effects, config)
    }

    /// As [`Self::new`], but the true arm is built from `arm`, while the model of the controller is `nominal`.
    ///
    /// # Errors
    /// As [`Self::new`]; [`PlantError::Joints`] if the two arms have different numbers of joints.
    pub fn with_controller(
        arm: &Arm,
        nominal: &Arm,
        effects: &[Effect],
        config: &PlantConfig,
    ) -> Result<Self, PlantError> {
        config.validate()?;
        if arm.dof() != nominal.dof() {
            let what = "the true arm";
            return Err(PlantError::Joints { what, found: arm.dof(), expected: nominal.dof() });
        }
        let mut assembly = Assembly::new(arm, config.friction_feedforward);
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
            if let Some(least_nm) = joint.friction.not_held_nm() {
                return Err(PlantError::BristlesWithoutFriction { joint: j + 1, least_nm });
            }
        }
        Ok(Self {
            limit_nm: nominal.joints.iter().map(|j| j.limits.torque_nm).collect(),
            nominal: nominal.clone(),
            assembly,
            config: config.clone(),
        })
    }

    /// The true arm: its bodies, lengths and gravity contain the effects; its drives are nominal.
    pub fn true_arm(&self) -> &Arm {
        &self.assembly.arm
    }

    /// Performs one run along `reference`. The recording holds what the channels of the log would read without noise.
    /// The controller reads the true values at the encoders or, if `encoders` are given, their readings.
    pub fn run(
        &self,
        reference: &dyn Reference,
        encoders: Option<Encoders>,
    ) -> Result<Recording, PlantError> {
        let mut recording = self.run_before_limits(reference, encoders)?;
        self.end_at_limits(&mut recording.torque_nm);
        Ok(recording)
    }

    /// As [`Self::run`], but no reading of the torque ends at a limit: that is what noise is added to. The limits then
    /// cut the noise off as well ([`Self::spoil`]).
    pub fn run_before_limits(
        &self,
        reference: &dyn Reference,
        encoders: Option<Encoders>,
    ) -> Result<Recording, PlantError> {
        if self.assembly.timing.is_exact() {
            return self.plant(reference, &self.config)?.run(reference, encoders);
        }
        let (config, every) = self.dense_config()?;
        let dense = self.plant(reference, &config)?.run(reference, encoders)?;
        Ok(self.assembly.timing.sample(&dense, config.log_rate_hz, every))
    }

    /// As [`Self::run`] without encoder errors, but also returns the accelerations (rad/s²) at the encoders at the
    /// instants at which the rows of the log are read.
    pub fn run_with_acceleration(
        &self,
        reference: &dyn Reference,
    ) -> Result<(Recording, JointSignals), PlantError> {
        let (config, every) = self.dense_config()?;
        let rate_hz = config.log_rate_hz;
        let (dense, accelerations) =
            self.plant(reference, &config)?.run_with_acceleration(reference)?;
        let timing = &self.assembly.timing;
        let mut recording = timing.sample(&dense, rate_hz, every);
        let at_rows = timing.sample_one(&accelerations, &recording, rate_hz, every);
        self.end_at_limits(&mut recording.torque_nm);
        Ok((recording, at_rows))
    }

    /// Applies the faults of single readings of one trial to `log`, which comes directly from the sensors.
    pub fn spoil(&self, streams: &TrialStreams, log: &mut Measured) {
        self.end_at_limits(&mut log.torque_nm);
        for (effect, fault) in &self.assembly.readings {
            fault.apply(*effect, &self.limit_nm, streams, log);
        }
    }

    /// The plant for a run along `reference`, without the timing errors.
    fn plant(&self, reference: &dyn Reference, config: &PlantConfig) -> Result<Plant, PlantError> {
        if reference.joints() != self.nominal.dof() {
            let (found, expected) = (reference.joints(), self.nominal.dof());
            return Err(PlantError::Joints { what: "the reference", found, expected });
        }
        let drivetrain = Box::new(HiddenDrivetrain::new(&self.assembly, reference));
        let fed_forward: Vec<f64> = self.assembly.joints.iter().map(|j| j.fed_forward).collect();
        Plant::with_drivetrain(&self.assembly.arm, &self.nominal, &fed_forward, drivetrain, config)
    }

    /// A configuration with a denser log, and the number of its samples per sample of the log. It logs at every
    /// decision of the controller, or at every step if the instants of the log are not instants of decision.
    fn dense_config(&self) -> Result<(PlantConfig, usize), PlantError> {
        let (log, control) = (self.config.steps_per_log()?, self.config.steps_per_control()?);
        let steps = if log.is_multiple_of(control) { control } else { 1 };
        let every = log / steps;
        let log_rate_hz = self.config.log_rate_hz * every as f64;
        Ok((PlantConfig { log_rate_hz, ..self.config.clone() }, every))
    }

    /// Ends the readings of the torque at their limits.
    pub fn end_at_limits(&self, torque_nm: &mut JointSignals) {
        for (j, joint) in self.assembly.joints.iter().enumerate() {
            let limit = joint.reading_limit_nm;
            if limit.is_finite() {
                torque_nm.joint_mut(j).iter_mut().for_each(|t| *t = t.clamp(-limit, limit));
            }
        }
    }
}
