//! Torques that a rigid arm needs along a motion, and the inertias of its links and rotors.

use super::sum;
use crate::dynamics::{
    LANES, Lanes, Model, Motion, Real, Workspace, rigid_torque, with_widest_registers,
};
use crate::robot::{Arm, JointSignals};

/// A rigid arm along a motion: the torque and the inertias of its links, and those of its rotors.
pub struct RigidArm {
    /// Torque that moves the links, M_links q̈ + c + g, Nm.
    pub link_nm: JointSignals,
    /// Mass matrix M of the links, kg m², column by column.
    pub mass_kg_m2: Vec<JointSignals>,
    /// Inertia I_a of every rotor, kg m², no less than a small share of the inertia of its links.
    pub rotor_kg_m2: Vec<f64>,
}

impl RigidArm {
    /// The `arm`, whose `model` is given, along `motion`.
    pub fn along(model: &Model, arm: &Arm, motion: &Motion) -> Self {
        let link_nm = rigid_torque_along(model, motion);
        let mass_kg_m2 = mass_along(model, motion, &link_nm);
        let rotor_kg_m2 = rotors_kg_m2(arm, &mass_kg_m2);
        Self { link_nm, mass_kg_m2, rotor_kg_m2 }
    }
}

/// Torque on the gear of every sample, Nm: M q̈ + c + g of links and rotors, without friction.
pub fn load_along(model: &Model, arm: &Arm, motion: &Motion) -> JointSignals {
    sum(&rigid_torque_along(model, motion), &rotors_along(arm, motion))
}

/// M_links q̈ + c + g at every sample, eight samples at a time with the widest registers of the machine.
pub fn rigid_torque_along(model: &Model, motion: &Motion) -> JointSignals {
    let mut out = JointSignals::zeros(motion.joints(), motion.samples());
    with_widest_registers(
        #[inline(always)]
        || fill_rigid_torque(model, motion, &mut out),
    );
    out
}

#[inline(always)]
fn fill_rigid_torque(model: &Model, motion: &Motion, out: &mut JointSignals) {
    let (joints, n) = (motion.joints(), motion.samples());
    let mut workspace = Workspace::<Lanes>::new(model);
    let zero = <Lanes as Real>::constant(0.0);
    let (mut q, mut qd, mut qdd) = (vec![zero; joints], vec![zero; joints], vec![zero; joints]);
    let mut torque = vec![zero; joints];
    for start in (0..n).step_by(LANES) {
        let count = LANES.min(n - start);
        for j in 0..joints {
            for lane in 0..count {
                q[j].0[lane] = motion.q_rad.joint(j)[start + lane];
                qd[j].0[lane] = motion.qd_rad_s.joint(j)[start + lane];
                qdd[j].0[lane] = motion.qdd_rad_s2.joint(j)[start + lane];
            }
        }
        rigid_torque(model, &mut workspace, &q, &qd, &qdd, &mut torque);
        for (j, torque) in torque.iter().enumerate() {
            out.joint_mut(j)[start..start + count].copy_from_slice(&torque.0[..count]);
        }
    }
}

/// M at every sample, kg m², column by column: the additional torque on all joints, over `link_nm`, when one joint
/// accelerates by one rad/s² more.
fn mass_along(model: &Model, motion: &Motion, link_nm: &JointSignals) -> Vec<JointSignals> {
    (0..motion.joints())
        .map(|j| {
            let mut faster = motion.clone();
            faster.qdd_rad_s2.joint_mut(j).iter_mut().for_each(|qdd| *qdd += 1.0);
            let torque = rigid_torque_along(model, &faster);
            torque.map_joints(|i, t| t.iter().zip(link_nm.joint(i)).map(|(t, r)| t - r).collect())
        })
        .collect()
}

/// Least inertia of a rotor, as a share of the mean inertia of its links. A gear that gives way has two sides, and
/// models without rotors count the inertia of the rotors with that of the links.
const LIGHTEST_ROTOR: f64 = 0.02;

/// I_a of every joint, kg m², at least the share `LIGHTEST_ROTOR` of the mean inertia of the links; `mass_kg_m2` comes
/// from [`mass_along`].
fn rotors_kg_m2(arm: &Arm, mass_kg_m2: &[JointSignals]) -> Vec<f64> {
    let rotor = |(j, mass): (usize, &JointSignals)| {
        let own = mass.joint(j);
        let lightest = LIGHTEST_ROTOR * own.iter().sum::<f64>() / own.len() as f64;
        arm.joints[j].drive.rotor_inertia_kg_m2.max(lightest).max(f64::MIN_POSITIVE)
    };
    mass_kg_m2.iter().enumerate().map(rotor).collect()
}

/// I_a q̈ at every sample, Nm.
pub(super) fn rotors_along(arm: &Arm, motion: &Motion) -> JointSignals {
    motion.qdd_rad_s2.map_joints(|j, qdd| {
        let inertia = arm.joints[j].drive.rotor_inertia_kg_m2;
        qdd.iter().map(|qdd| inertia * qdd).collect()
    })
}
