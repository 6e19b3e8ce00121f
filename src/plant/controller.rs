//! The controller of the simulated arm: computed torque with saturation, at its own rate.

use crate::dynamics::{Model, Workspace, inverse_dynamics};
use crate::robot::Arm;

use super::config::PlantConfig;

/// Computed-torque controller about the reference (q_r, q̇_r, q̈_r) with feedback of the readings (q, q̇):
///
/// τ = ID(q_r, q̇_r, q̈_r + ω² (q_r − q) + 2 ζ ω (q̇_r − q̇)), limited to each drive's torque.
///
/// ID is the inverse dynamics of a nominal arm whose friction is a given share of the arm's own, because a controller
/// never knows friction fully. The feedback passes through the nominal mass matrix, so that every joint has the same
/// bandwidth ω and damping ζ in every pose (Siciliano et al., Robotics: Modelling, Planning and Control, section
/// 8.5.2). As in industrial controllers, the model is evaluated at the reference.
#[derive(Debug, Clone)]
pub struct Controller {
    model: Model,
    workspace: Workspace<f64>,
    stiffness_per_s2: f64,
    damping_per_s: f64,
    limit_nm: Vec<f64>,
    q_rad: Vec<f64>,
    qd_rad_s: Vec<f64>,
    qdd_rad_s2: Vec<f64>,
    command_rad_s2: Vec<f64>,
}

impl Controller {
    /// A controller whose model is `nominal`, with gains from `config`. `fed_forward` is the share of the nominal
    /// friction that it feeds forward at each joint.
    pub fn new(nominal: &Arm, fed_forward: &[f64], config: &PlantConfig) -> Self {
        let mut believed = nominal.clone();
        for (joint, share) in believed.joints.iter_mut().zip(fed_forward) {
            joint.drive.viscous_nm_s_rad *= share;
            joint.drive.coulomb_nm *= share;
        }
        let model = Model::new(&believed);
        let zeros = vec![0.0; nominal.dof()];
        Self {
            workspace: Workspace::new(&model),
            model,
            stiffness_per_s2: config.bandwidth_rad_s.powi(2),
            damping_per_s: 2.0 * config.damping * config.bandwidth_rad_s,
            limit_nm: nominal.joints.iter().map(|j| j.limits.torque_nm).collect(),
            q_rad: zeros.clone(),
            qd_rad_s: zeros.clone(),
            qdd_rad_s2: zeros.clone(),
            command_rad_s2: zeros,
        }
    }

    /// The reference q, q̇, q̈ (rad, rad/s, rad/s²), to be set before each call of [`Self::torque`].
    pub fn target_mut(&mut self) -> (&mut [f64], &mut [f64], &mut [f64]) {
        (&mut self.q_rad, &mut self.qd_rad_s, &mut self.qdd_rad_s2)
    }

    /// Computes the drive torque (Nm) for the readings (`q_rad`, `qd_rad_s`). Returns whether any drive was at its
    /// limit.
    pub fn torque(&mut self, q_rad: &[f64], qd_rad_s: &[f64], torque_nm: &mut [f64]) -> bool {
        for (j, command) in self.command_rad_s2.iter_mut().enumerate() {
            *command = self.qdd_rad_s2[j]
                + self.stiffness_per_s2 * (self.q_rad[j] - q_rad[j])
                + self.damping_per_s * (self.qd_rad_s[j] - qd_rad_s[j]);
        }
        let Self { model, workspace, q_rad, qd_rad_s, command_rad_s2, .. } = self;
        inverse_dynamics(model, workspace, q_rad, qd_rad_s, command_rad_s2, torque_nm);
        let mut saturated = false;
        for (torque, &limit) in torque_nm.iter_mut().zip(&self.limit_nm) {
            saturated |= torque.abs() > limit;
            *torque = torque.clamp(-limit, limit);
        }
        saturated
    }
}
