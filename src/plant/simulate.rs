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
        encoders: Option<Encoders>,
        mut accelerations: Option<&mut Vec<f64>>,
    ) -> Result<Recording, PlantError> {
        let n = self.arm.dof();
        expect_joints("the reference", reference.joints(), n)?;
        let engine = RapierArm::new(&self.arm)?;
        let PlantConfig { step_s, log_rate_hz, .. } = self.config;
        let per_control = self.config.steps_per_control()?;
        let per_log = self.config.steps_per_log()?;
        if encoders.is_some() && !per_log.is_multiple_of(per_control) {
            return Err(PlantError::Setting {
                key: "log_rate_hz",
                value: log_rate_hz,
                requirement: "must divide control_rate_hz where the controller reads the encoders, \
                              so that the log holds what it read",
            });
        }
        // If the duration is a whole number of samples up to round-off, its last sample is kept.
        let logged = (reference.duration_s() * log_rate_hz + 1e-6).floor() as usize;
        let mut recording = Recording::zeros(n, logged + 1, encoders.is_some());
        let mut run = Run::start(self, engine, reference, encoders)?;
        let last = logged * per_log;
        for step in 0..=last {
            let time_s = step as f64 * step_s;
            if step % per_control == 0 {
                recording.saturated_decisions += usize::from(run.decide(time_s));
            }
            if step % per_log == 0 {
                let k = step / per_log;
                recording.time_s[k] = k as f64 / log_rate_hz;
                run.record(k, &mut recording);
                if let Some(series) = &mut accelerations {
                    series.extend(run.mean_acceleration(time_s));
                }
            }
            if step < last {
                run.advance(time_s)?;
            }
        }
        write_targets(reference, &mut recording);
        Ok(recording)
    }

    /// Number of parts into which a step is divided because friction would make it unstable, and their length, s. How
    /// fast friction stops a joint follows from diag(M⁻¹) at the start of the run, kg⁻¹ m⁻².
    fn substeps(&self, inverse_inertia_per_kg_m2: &[f64]) -> Result<(usize, f64), PlantError> {
        let step_s = self.config.step_s;
        let decay_per_s = self.drivetrain.fastest_decay_per_s(inverse_inertia_per_kg_m2);
        let parts = (step_s * decay_per_s / RungeKutta4::LARGEST_STEP_DECAY).ceil();
        let most = self.drivetrain.most_substeps();
        // `max` below would make one part of a decay that is NaN.
        if parts.is_nan() || parts > most as f64 {
            let longest_s = most as f64 * RungeKutta4::LARGEST_STEP_DECAY / decay_per_s;
            return Err(PlantError::StepTooLong { step_s, decay_per_s, longest_s });
        }
        let parts = parts.max(1.0);
        Ok((parts as usize, step_s / parts))
    }

    /// Readings of ideal encoders in `state`.
    fn seen(&self, state: &State, q_rad: &mut [f64], qd_rad_s: &mut [f64]) {
        q_rad.copy_from_slice(state.q_rad());
        qd_rad_s.copy_from_slice(state.qd_rad_s());
        self.drivetrain.encoder_side(state.own(), q_rad, qd_rad_s);
    }
}

/// A run at one instant: the state of the plant, what its controller has read, and the torque that it holds.
struct Run<'a> {
    plant: &'a mut Plant,
    reference: &'a dyn Reference,
    /// What the controller reads; `None`: the truth.
    encoders: Option<Encoders>,
    engine: RapierArm,
    state: State,
    integrator: RungeKutta4,
    /// Number of parts into which a step is divided.
    substeps: usize,
    /// Length of one of these parts, s.
    substep_s: f64,
    /// Angles, rad, and velocities, rad/s, that the controller read last.
    read: [Vec<f64>; 2],
    /// Drive torques that are held up to this instant, Nm.
    held_before_nm: Vec<f64>,
    /// Drive torques that are held from this instant on, Nm.
    held_nm: Vec<f64>,
    /// Angles, velocities and torques of a row that is recorded.
    row: [Vec<f64>; 3],
}

impl<'a> Run<'a> {
    /// The `plant` at the start of `reference`. The arm moves in `engine`.
    fn start(
        plant: &'a mut Plant,
        mut engine: RapierArm,
        reference: &'a dyn Reference,
        encoders: Option<Encoders>,
    ) -> Result<Self, PlantError> {
        let n = plant.arm.dof();
        let mut state = State::zeros(n, plant.drivetrain.states());
        let (q, qd, own) = state.parts_mut();
        reference.sample(0.0, q, qd, &mut vec![0.0; n]);
        plant.drivetrain.start(&mut engine, q, qd, own);
        let (_, inverse) = engine.response(q);
        let (substeps, substep_s) = plant.substeps(inverse.diagonal().as_slice())?;
        Ok(Self {
            plant,
            reference,
            encoders,
            engine,
            integrator: RungeKutta4::new(&state),
            state,
            substeps,
            substep_s,
            read: [vec![0.0; n], vec![0.0; n]],
            held_before_nm: vec![0.0; n],
            held_nm: vec![0.0; n],
            row: [vec![0.0; n], vec![0.0; n], vec![0.0; n]],
        })
    }

    /// Lets the controller read and decide at `time_s`. Returns whether any drive was at its limit.
    fn decide(&mut self, time_s: f64) -> bool {
        let [q_read, qd_read] = &mut self.read;
        self.plant.seen(&self.state, q_read, qd_read);
        if let Some(encoders) = &mut self.encoders {
            encoders.read(q_read, qd_read);
        }
        let controller = &mut self.plant.controller;
        let (q, qd, qdd) = controller.target_mut();
        self.reference.sample(time_s, q, qd, qdd);
        let saturated = controller.torque(q_read, qd_read, &mut self.held_nm);
        // Nothing was held before the first decision.
        if time_s == 0.0 {
            self.held_before_nm.copy_from_slice(&self.held_nm);
        }
        saturated
    }

    /// Writes what there is at this instant to row `k` of `recording`.
    fn record(&mut self, k: usize, recording: &mut Recording) {
        let [q_rad, qd_rad_s, torque_nm] = &mut self.row;
        self.plant.seen(&self.state, q_rad, qd_rad_s);
        recording.q_rad.set_sample(k, q_rad);
        recording.qd_rad_s.set_sample(k, qd_rad_s);
        if let Some(readings) = &mut recording.readings {
            let [q_read, qd_read] = &self.read;
            readings.q_rad.set_sample(k, q_read);
            readings.qd_rad_s.set_sample(k, qd_read);
        }
        let held = self.held_before_nm.iter().zip(&self.held_nm);
        for (nm, (before, after)) in torque_nm.iter_mut().zip(held) {
            *nm = 0.5 * (before + after);
        }
        recording.torque_nm.set_sample(k, torque_nm);
    }

    /// Mean of the accelerations at the encoders just before and just after `time_s`, which is this instant, rad/s².
    fn mean_acceleration(&mut self, time_s: f64) -> Vec<f64> {
        let (q_rad, qd_rad_s) = (self.state.q_rad(), self.state.qd_rad_s());
        let (n, states) = (q_rad.len(), self.state.own());
        let mut mean = vec![0.0; n];
        let mut rate = vec![0.0; n + states.len()];
        let drivetrain = &mut self.plant.drivetrain;
        for drive_torque_nm in [&self.held_before_nm, &self.held_nm] {
            let stage = Stage { time_s, q_rad, qd_rad_s, states, drive_torque_nm };
            let (qdd, own) = rate.split_at_mut(n);
            drivetrain.rates(&mut self.engine, &stage, qdd, own);
            drivetrain.encoder_acceleration(own, qdd);
            mean.iter_mut().zip(&*qdd).for_each(|(m, a)| *m += 0.5 * a);
        }
        mean
    }

    /// Integrates one step from `time_s`, which is this instant.
    fn advance(&mut self, time_s: f64) -> Result<(), PlantError> {
        for part in 0..self.substeps {
            let time_s = time_s + part as f64 * self.substep_s;
            self.integrator.step(
                &mut self.engine,
                &mut *self.plant.drivetrain,
                &mut self.state,
                time_s,
                self.substep_s,
                &self.held_nm,
            );
        }
        if let Some(j) = self.state.first_not_finite() {
            let (q_rad, qd_rad_s) = (self.state.q_rad()[j], self.state.qd_rad_s()[j]);
            return Err(PlantError::Diverged { time_s, joint: j + 1, q_rad, qd_rad_s });
        }
        self.held_before_nm.copy_from_slice(&self.held_nm);
        Ok(())
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
