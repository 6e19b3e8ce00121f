//! Drivetrains: the mechanics between the torque of a drive and the torque that reaches the link.

use super::config::PlantConfig;
use super::error::PlantError;
use super::rapier_arm::RapierArm;
use crate::robot::Arm;

/// Arguments of one evaluation of the equations of motion.
#[derive(Debug, Clone, Copy)]
pub struct Stage<'a> {
    /// Time, s.
    pub time_s: f64,
    /// Joint angles, rad.
    pub q_rad: &'a [f64],
    /// Joint velocities, rad/s.
    pub qd_rad_s: &'a [f64],
    /// The drivetrain's own states.
    pub states: &'a [f64],
    /// Torque of the drives i_G k I at the joints, before friction, Nm.
    pub drive_torque_nm: &'a [f64],
}

/// Joint mechanics: computes joint accelerations from drive torques, using the dynamics of the links.
///
/// A drivetrain itself calls [`RapierArm::forward_dynamics`], if necessary more than once per stage, so that a friction
/// law can find the load that the gear really carries. It may also have states of its own, which are integrated along
/// with those of the joints: bristle deflections, motor angles behind an elastic gear, temperatures.
pub trait Drivetrain: Send {
    /// Number of the drivetrain's own states.
    fn states(&self) -> usize {
        0
    }

    /// Prepares the arm and the own states for a run at whose start the encoders read (`q_rad`, `qd_rad_s`). Replaces
    /// both by the angles and speeds of the links, which are the same if the gears are rigid and the encoders have no
    /// offset.
    fn start(
        &mut self,
        arm: &mut RapierArm,
        q_rad: &mut [f64],
        qd_rad_s: &mut [f64],
        states: &mut [f64],
    );

    /// Replaces the links' angles and speeds by those at the encoders, including mounting errors. By default the
    /// encoders are on the joints themselves.
    fn encoder_side(&self, _states: &[f64], _q_rad: &mut [f64], _qd_rad_s: &mut [f64]) {}

    /// Replaces the links' accelerations by those at the encoders, from the time derivatives of the own states. By
    /// default they are the same.
    fn encoder_acceleration(&self, _states_rate: &[f64], _qdd_rad_s2: &mut [f64]) {}

    /// Largest number of parts into which a step may be divided if [`Self::fastest_decay_per_s`] requires it. By
    /// default a step that is too long is refused.
    fn most_substeps(&self) -> usize {
        1
    }

    /// Fastest rate (1/s) at which a disturbance of a joint's speed decays, given the arm's diag(M⁻¹) in kg⁻¹ m⁻². This
    /// rate limits the step of an explicit integrator.
    fn fastest_decay_per_s(&self, inverse_inertia_per_kg_m2: &[f64]) -> f64;

    /// Computes the joint accelerations `qdd_rad_s2` (rad/s²) and the time derivatives of the own states.
    fn rates(
        &mut self,
        arm: &mut RapierArm,
        stage: &Stage<'_>,
        qdd_rad_s2: &mut [f64],
        states_rate: &mut [f64],
    );
}

/// A rigid gear with the regularised friction of the paper's (2) and (3):
/// τ_link = τ_drive − rv q̇ − rc tanh(q̇/ε).
#[derive(Debug, Clone)]
pub struct RigidDrivetrain {
    epsilon_rad_s: f64,
    /// Per joint: rv (Nm s/rad), rc (Nm), Ia (kg m²).
    joints: Vec<[f64; 3]>,
    link_torque_nm: Vec<f64>,
}

impl RigidDrivetrain {
    /// The drivetrain with the friction and the rotor inertias of `arm`.
    pub fn new(arm: &Arm) -> Self {
        let joints = arm
            .joints
            .iter()
            .map(|j| [j.drive.viscous_nm_s_rad, j.drive.coulomb_nm, j.drive.rotor_inertia_kg_m2])
            .collect();
        let epsilon_rad_s = arm.friction_epsilon_rad_s;
        Self { epsilon_rad_s, joints, link_torque_nm: vec![0.0; arm.dof()] }
    }

    /// Rate (1/s) at which friction stops each joint at rest, where its curve is steepest: (rv + rc/ε) (M⁻¹)_jj.
    fn decays_per_s(&self, inverse_inertia_per_kg_m2: &[f64]) -> impl Iterator<Item = f64> {
        let slopes = self.joints.iter().map(|[rv, rc, _]| rv + rc / self.epsilon_rad_s);
        slopes.zip(inverse_inertia_per_kg_m2).map(|(slope, inverse)| slope * inverse)
    }
}

impl Drivetrain for RigidDrivetrain {
    fn start(&mut self, arm: &mut RapierArm, _: &mut [f64], _: &mut [f64], _: &mut [f64]) {
        for (j, [_, _, rotor]) in self.joints.iter().enumerate() {
            arm.set_rotor_inertia(j, *rotor);
        }
    }

    fn fastest_decay_per_s(&self, inverse_inertia_per_kg_m2: &[f64]) -> f64 {
        self.decays_per_s(inverse_inertia_per_kg_m2).fold(0.0, f64::max)
    }

    fn rates(
        &mut self,
        arm: &mut RapierArm,
        stage: &Stage<'_>,
        qdd_rad_s2: &mut [f64],
        _: &mut [f64],
    ) {
        for (j, [viscous, coulomb, _]) in self.joints.iter().enumerate() {
            let speed = stage.qd_rad_s[j];
            let friction = viscous * speed + coulomb * (speed / self.epsilon_rad_s).tanh();
            self.link_torque_nm[j] = stage.drive_torque_nm[j] - friction;
        }
        arm.forward_dynamics(stage.q_rad, stage.qd_rad_s, &self.link_torque_nm, qdd_rad_s2);
    }
}

/// Rates, in periods of the controller, at which friction may stop a joint: with 10 a torque 0.1 ms early was named in
/// a fifth of logs, with 2.6 in none.
const TIED: f64 = 3.0;

/// Joints (0-based) of `arm` that friction stops at the pose `q_rad` within a third of a period of the controller, and
/// the rate of the controller, Hz, that would be enough for all of them.
///
/// Such a joint follows the torque that is held. The logged torque, the mean of what is held before and after a sample,
/// then belongs to a later velocity than the one of the sample, by up to half a period. Joints with a rotor are slower.
///
/// # Errors
/// [`PlantError`] if the arm cannot be built.
pub fn tied_to_held_torque(
    arm: &Arm,
    config: &PlantConfig,
    q_rad: &[f64],
) -> Result<(Vec<usize>, f64), PlantError> {
    let mut drivetrain = RigidDrivetrain::new(arm);
    let mut engine = RapierArm::new(arm)?;
    let (mut pose, mut at_rest) = (q_rad.to_vec(), vec![0.0; arm.dof()]);
    drivetrain.start(&mut engine, &mut pose, &mut at_rest, &mut []);
    let (_, inverse) = engine.response(&pose);
    let enough_hz: Vec<f64> =
        drivetrain.decays_per_s(inverse.diagonal().as_slice()).map(|decay| decay / TIED).collect();
    let is_tied = |j: &usize| enough_hz[*j] > config.control_rate_hz;
    let most_hz = enough_hz.iter().copied().fold(0.0, f64::max);
    Ok(((0..arm.dof()).filter(is_tied).collect(), most_hz))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The rotors of a UR5 are heavy. Without them, friction stops the wrist within a millisecond.
    #[test]
    fn a_joint_without_a_rotor_follows_the_held_torque() {
        let mut arm = Arm::built_in("ur5").unwrap();
        let config = PlantConfig::default();
        let pose = [0.3, -1.2, 1.0, -1.5, 0.3, 0.2];
        assert!(tied_to_held_torque(&arm, &config, &pose).unwrap().0.is_empty());
        arm.joints.iter_mut().for_each(|joint| joint.drive.rotor_inertia_kg_m2 = 0.0);
        let (tied, enough_hz) = tied_to_held_torque(&arm, &config, &pose).unwrap();
        assert!(tied.contains(&5), "{tied:?}");
        let fast = PlantConfig { control_rate_hz: enough_hz, ..config };
        assert!(tied_to_held_torque(&arm, &fast, &pose).unwrap().0.is_empty());
    }
}
