//! Runs of the arm under its controller.

use super::config::PlantConfig;
use super::controller::Controller;
use super::drivetrain::{Drivetrain, RigidDrivetrain, Stage};
use super::error::PlantError;
use super::integrate::{RungeKutta4, State};
use super::rapier_arm::RapierArm;
use super::recording::Recording;
use super::sensors::Encoders;
use crate::excitation::Reference;
use crate::robot::{Arm, JointSignals};

/// The arm with its drivetrain and controller: everything that a run needs except the motion.
///
/// Every run starts from a newly built engine, so that runs do not influence each other.
pub struct Plant {
    arm: Arm,
    drivetrain: Box<dyn Drivetrain>,
    controller: Controller,
    config: PlantConfig,
}

impl Plant {
    /// A plant with the true arm `arm`, rigid gears, and a controller whose model is the same arm.
    pub fn new(arm: &Arm, config: &PlantConfig) -> Result<Self, PlantError> {
        let fed_forward = vec![config.friction_feedforward; arm.dof()];
        Self::with_drivetrain(arm, arm, &fed_forward, Box::new(RigidDrivetrain::new(arm)), config)
    }

    /// A plant with the true arm `arm`, the given `drivetrain`, and a controller whose model is `nominal`.
    /// `fed_forward` is the share of the nominal friction that the controller feeds forward at each joint.
    pub fn with_drivetrain(
        arm: &Arm,
        nominal: &Arm,
        fed_forward: &[f64],
        drivetrain: Box<dyn Drivetrain>,
        config: &PlantConfig,
    ) -> Result<Self, PlantError> {
        config.validate()?;
        expect_joints("the controller's arm", nominal.dof(), arm.dof())?;
        Ok(Self {
            arm: arm.clone(),
            drivetrain,
            controller: Controller::new(nominal, fed_forward, config),
            config: config.clone(),
        })
    }

    /// Follows `reference` from start to end. The controller reads the true angles and speeds or, if `encoders` are
    /// given, the readings of the encoders.
    pub fn run(
        &mut self,
        reference: &dyn Reference,
        encoders: Option<Encoders>,
    ) -> Result<Recording, PlantError> {
        self.follow(reference, encoders, None)
    }

    /// As [`Self::run`] with true readings, but also returns the accelerations at the encoders (rad/s²). At instants at
    /// which the controller decides, these are the means of the accelerations before and after, as for the recorded
    /// torque.
    pub fn run_with_acceleration(
        &mut self,
        reference: &dyn Reference,
    ) -> Result<(Recording, JointSignals), PlantError> {
        let mut series = Vec::new();
        let recording = self.follow(reference, None, Some(&mut series))?;
        let n = self.arm.dof();
        let at = |j: usize, k: usize| series[k * n + j];
        let samples = recording.time_s.len();
        Ok((recording, JointSignals::from_fn(n, samples, at)))
    }

    /// Performs the run. If `accelerations` is given, appends the accelerations of all joints to it, sample by sample.
    fn follow(
        &mut self,
        reference: &dyn Reference,
        mut encoders: Option<Encoders>,
        mut accelerations: Option<&mut Vec<f64>>,
    ) -> Result<Recording, PlantError> {
        let n = self.arm.dof();
        expect_joints("the reference", reference.joints(), n)?;
        let mut arm = RapierArm::new(&self.arm)?;
        let h = self.config.step_s;
        let per_control = self.config.steps_per_control()?;
        let per_log = self.config.steps_per_log()?;
        if encoders.is_some() && !per_log.is_multiple_of(per_control) {
            return Err(PlantError::Setting {
                key: "log_rate_hz",
                value: self.config.log_rate_hz,
                requirement: "must divide control_rate_hz where the controller reads the encoders, \
                              so that the log holds what it read",
            });
        }
        // If the duration is a whole number of samples up to round-off, its last sample is kept.
        let logged = (reference.duration_s() * self.config.log_rate_hz + 1e-6).floor() as usize;
        let mut recording = Recording::zeros(n, logged + 1, encoders.is_some());

        let mut state = State::zeros(n, self.drivetrain.states());
        let (q, qd, own) = state.parts_mut();
        reference.sample(0.0, q, qd, &mut vec![0.0; n]);
        self.drivetrain.start(&mut arm, q, qd, own);
        let (_, inverse) = arm.response(q);
        let decay_per_s = self.drivetrain.fastest_decay_per_s(inverse.diagonal().as_slice());
        let parts = (h * decay_per_s / RungeKutta4::LARGEST_STEP_DECAY).ceil().max(1.0);
        let most = self.drivetrain.most_substeps();
        // This also catches a decay that is NaN, which the cast below would hide.
        if parts.is_nan() || parts > most as f64 {
            let longest_s = most as f64 * RungeKutta4::LARGEST_STEP_DECAY / decay_per_s;
            return Err(PlantError::StepTooLong { step_s: h, decay_per_s, longest_s });
        }
        let (substeps, substep_s) = (parts as usize, h / parts);
        let mut integrator = RungeKutta4::new(&state);

        let (mut q_read, mut qd_read) = (vec![0.0; n], vec![0.0; n]);
        let (mut q_seen, mut qd_seen) = (vec![0.0; n], vec![0.0; n]);
        let (mut held_before, mut held) = (vec![0.0; n], vec![0.0; n]);
        let last = logged * per_log;
        for step in 0..=last {
            let time_s = step as f64 * h;
            held_before.copy_from_slice(&held);
            if step % per_control == 0 {
                self.seen(&state, &mut q_read, &mut qd_read);
                if let Some(encoders) = &mut encoders {
                    encoders.read(&mut q_read, &mut qd_read);
                }
                let (q, qd, qdd) = self.controller.target_mut();
                reference.sample(time_s, q, qd, qdd);
                let saturated = self.controller.torque(&q_read, &qd_read, &mut held);
                recording.saturated_decisions += usize::from(saturated);
                if step == 0 {
                    held_before.copy_from_slice(&held);
                }
            }
            if step % per_log == 0 {
                let k = step / per_log;
                recording.time_s[k] = k as f64 / self.config.log_rate_hz;
                self.seen(&state, &mut q_seen, &mut qd_seen);
                recording.q_rad.set_sample(k, &q_seen);
                recording.qd_rad_s.set_sample(k, &qd_seen);
                if let Some(readings) = &mut recording.readings {
                    readings.q_rad.set_sample(k, &q_read);
                    readings.qd_rad_s.set_sample(k, &qd_read);
                }
                if let Some(series) = &mut accelerations {
                    let mut mean = vec![0.0; n];
                    let mut rate = vec![0.0; n + state.own().len()];
                    for drive_torque_nm in [&held_before, &held] {
                        let (q_rad, qd_rad_s, states) =
                            (state.q_rad(), state.qd_rad_s(), state.own());
                        let stage = Stage { time_s, q_rad, qd_rad_s, states, drive_torque_nm };
                        let (qdd, own) = rate.split_at_mut(n);
                        self.drivetrain.rates(&mut arm, &stage, qdd, own);
                        self.drivetrain.encoder_acceleration(own, qdd);
                        mean.iter_mut().zip(&*qdd).for_each(|(m, a)| *m += 0.5 * a);
                    }
                    series.extend(mean);
                }
                for (before, after) in held_before.iter_mut().zip(&held) {
                    *before = 0.5 * (*before + after);
                }
                recording.torque_nm.set_sample(k, &held_before);
            }
            if step == last {
                break;
            }
            for part in 0..substeps {
                let time_s = time_s + part as f64 * substep_s;
                let drivetrain = &mut *self.drivetrain;
                integrator.step(&mut arm, drivetrain, &mut state, time_s, substep_s, &held);
            }
            if let Some(j) = state.first_not_finite() {
                let (q_rad, qd_rad_s) = (state.q_rad()[j], state.qd_rad_s()[j]);
                return Err(PlantError::Diverged { time_s, joint: j + 1, q_rad, qd_rad_s });
            }
        }
        write_targets(reference, &mut recording);
        Ok(recording)
    }

    /// Readings of ideal encoders in `state`.
    fn seen(&self, state: &State, q_rad: &mut [f64], qd_rad_s: &mut [f64]) {
        q_rad.copy_from_slice(state.q_rad());
        qd_rad_s.copy_from_slice(state.qd_rad_s());
        self.drivetrain.encoder_side(state.own(), q_rad, qd_rad_s);
    }
}

/// Performs one run of `arm` with rigid gears and a controller whose model is the same arm.
pub fn simulate(
    arm: &Arm,
    reference: &dyn Reference,
    config: &PlantConfig,
    encoders: Option<Encoders>,
) -> Result<Recording, PlantError> {
    Plant::new(arm, config)?.run(reference, encoders)
}

fn write_targets(reference: &dyn Reference, recording: &mut Recording) {
    let n = reference.joints();
    let (mut q, mut qd, mut qdd) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    for (k, &time_s) in recording.time_s.iter().enumerate() {
        reference.sample(time_s, &mut q, &mut qd, &mut qdd);
        recording.target_q_rad.set_sample(k, &q);
        recording.target_qd_rad_s.set_sample(k, &qd);
        recording.target_qdd_rad_s2.set_sample(k, &qdd);
    }
}

fn expect_joints(what: &'static str, found: usize, expected: usize) -> Result<(), PlantError> {
    if found == expected { Ok(()) } else { Err(PlantError::Joints { what, found, expected }) }
}
