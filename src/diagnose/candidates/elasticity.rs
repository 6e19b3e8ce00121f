//! A gear that gives way: link angle q_L, motor angle q_M, (q_M − q_L) k = τ_L.
//!
//! Where the log has the motor's angle, the links move by δ = τ_L/k less: the torques change by
//! τ(q − δ, q̇ − δ̇, q̈ − δ̈) − τ(q, q̇, q̈) on every joint (variant 0). Where it has the link's, the rotor
//! and its friction move more: I_a δ̈ + F_v δ̇ + F_c [tanh((q̇ + δ̇)/ε) − tanh(q̇/ε)] on the joint itself
//! (variant 1; the friction reverses where the motor does, so that the stiffness is in the shape as well).

use super::*;
use crate::dynamics::Motion;

/// See the module.
pub struct Elasticity;

/// Softness at which the torque change is taken, rad/Nm: small, so that it is linear.
const SMALL_RAD_NM: f64 = 1e-6;

/// Torques on all joints when joint `j` lags by `delta` (rad), per unit of `scale`.
pub(super) fn give_way(scene: &Scene, j: usize, delta: &[f64], scale: f64) -> Column {
    let rate = scene.derivative(delta);
    let acceleration = scene.derivative(&rate);
    let mut motion: Motion = scene.motion.clone();
    for k in 0..scene.samples() {
        motion.q_rad.joint_mut(j)[k] -= delta[k];
        motion.qd_rad_s.joint_mut(j)[k] -= rate[k];
        motion.qdd_rad_s2.joint_mut(j)[k] -= acceleration[k];
    }
    Column::everywhere(&scene.torque_change(&scene.arm, &motion)).scaled(1.0 / scale)
}

impl Candidate for Elasticity {
    fn kind(&self) -> Kind {
        Kind::Elasticity
    }

    fn shapes(&self, _: &Scene, _: Option<usize>) -> Vec<Shape> {
        let linear = Shape { variant: 0, value: 0.0 };
        let stiffness = geometric(2e3, 2e5, 5).map(|value| Shape { variant: 1, value });
        std::iter::once(linear).chain(stiffness).collect()
    }

    fn search(&self) -> Search {
        Search::Logarithmic
    }

    fn columns(&self, scene: &Scene, site: Option<usize>, shape: Shape) -> Vec<Column> {
        let j = joint(site);
        let delta: Vec<f64> = scene.link_nm.joint(j).iter().map(|l| l * SMALL_RAD_NM).collect();
        if shape.variant == 0 {
            return vec![give_way(scene, j, &delta, SMALL_RAD_NM)];
        }
        let drive = &scene.arm.joints[j].drive;
        let softness = 1.0 / shape.value;
        let rate = scene.derivative(scene.link_nm.joint(j));
        let acceleration = scene.derivative(&rate);
        let (qd, sign) = (scene.motion.qd_rad_s.joint(j), scene.sign.joint(j));
        let epsilon = scene.arm.friction_epsilon_rad_s;
        let extra = samples(scene, |k| {
            let motor_sign = ((qd[k] + softness * rate[k]) / epsilon).tanh();
            drive.rotor_inertia_kg_m2 * acceleration[k]
                + drive.viscous_nm_s_rad * rate[k]
                + drive.coulomb_nm * (motor_sign - sign[k]) / softness
        });
        vec![Column::on(j, extra)]
    }

    fn quantities(&self, _: &Scene, _: Option<usize>, _: Shape, b: &[f64]) -> Vec<Quantity> {
        vec![quantity("stiffness_nm_rad", 1.0 / b[0], "Nm/rad")]
    }

    fn separating_experiment(&self) -> &'static str {
        "motor and link encoder in one log, or a tap on the link: the resonance tells the stiffness"
    }

    fn is_possible(&self, _: Shape, b: &[f64]) -> bool {
        b[0] > 0.0
    }

    fn in_words(&self) -> &'static str {
        "a gear that gives way under load"
    }
}
