//! A gear that gives way: link angle q_L, motor angle q_M, k (q_M − q_L) = τ_L.
//!
//! Where the log has the motor's angle, the links move by δ less than it says: the torques change by
//! τ(q − δ, q̇ − δ̇, q̈ − δ̈) − τ(q, q̇, q̈) on every joint (variant 0). The link swings on its spring, so that
//! δ = τ_L/(k − M_jj ω² + i d ω) at the frequency ω, τ_L the load of the motor's motion. Where the log has
//! the link's angle, the rotor and its friction move more: I_a δ̈ + F_v δ̇ + F_c [tanh((q̇ + δ̇)/ε) −
//! tanh(q̇/ε)] on the joint itself, δ = τ_L/(k + i d ω) (further variants; the friction reverses where the motor
//! does). The stiffness is in the shape as well as in the coefficient 1/k.

use super::*;
use crate::dynamics::Motion;
use realfft::num_complex::Complex64;

/// See the module.
pub struct Elasticity;

/// Damping d over that of the rotor on the spring, 2 √(k Ia): a few percent in strain-wave gears.
const DAMPING_RATIO: f64 = 0.05;
/// The same where the encoder sits on the link, by variant: a loop closed over the gear needs damping.
const LINK_DAMPING_RATIO: [f64; 2] = [0.05, 0.3];

/// The motion of the links when joint `j` is `delta` (rad) behind its encoder.
pub(super) fn lagging_by(scene: &Scene, j: usize, delta: &[f64]) -> Motion {
    lagging_at(scene, j, delta, &scene.derivative(delta))
}

/// The same with the rate of `delta` at the samples, rad/s, which may hold more than their differences.
pub(super) fn lagging_at(scene: &Scene, j: usize, delta: &[f64], rate: &[f64]) -> Motion {
    let acceleration = scene.derivative(rate);
    let mut motion: Motion = scene.motion.clone();
    for k in 0..scene.samples() {
        motion.q_rad.joint_mut(j)[k] -= delta[k];
        motion.qd_rad_s.joint_mut(j)[k] -= rate[k];
        motion.qdd_rad_s2.joint_mut(j)[k] -= acceleration[k];
    }
    motion
}

/// Torques on all joints when the links move as `motion`, per unit of `scale`.
pub(super) fn give_way(scene: &Scene, motion: &Motion, scale: f64) -> Column {
    Column::everywhere(&scene.torque_change(&scene.arm, motion)).scaled(1.0 / scale)
}

impl Candidate for Elasticity {
    fn kind(&self) -> Kind {
        Kind::Elasticity
    }

    fn shapes(&self, _: &Scene, _: Option<usize>) -> Vec<Shape> {
        (0..1 + LINK_DAMPING_RATIO.len())
            .flat_map(|variant| geometric(2e3, 2e5, 5).map(move |value| Shape { variant, value }))
            .collect()
    }

    fn search(&self) -> Search {
        Search::Logarithmic
    }

    fn columns(&self, scene: &Scene, site: Option<usize>, shape: Shape) -> Vec<Column> {
        let j = joint(site);
        let drive = &scene.arm.joints[j].drive;
        if shape.variant == 0 {
            let stiffness = shape.value;
            let inertia = scene.own_inertia_kg_m2.joint(j);
            let inertia = inertia.iter().sum::<f64>() / inertia.len() as f64;
            let damping = 2.0 * DAMPING_RATIO * (stiffness * drive.rotor_inertia_kg_m2).sqrt();
            let delta = scene.filtered(scene.link_nm.joint(j), |omega| {
                Complex64::new(stiffness - inertia * omega * omega, damping * omega).inv()
            });
            return vec![give_way(scene, &lagging_by(scene, j, &delta), 1.0 / stiffness)];
        }
        let (stiffness, ratio) = (shape.value, LINK_DAMPING_RATIO[shape.variant - 1]);
        let damping = 2.0 * ratio * (stiffness * drive.rotor_inertia_kg_m2).sqrt();
        let delta = scene.filtered(scene.link_nm.joint(j), |omega| {
            Complex64::new(stiffness, damping * omega).inv()
        });
        let rate = scene.derivative(&delta);
        let acceleration = scene.derivative(&rate);
        let (qd, sign) = (scene.motion.qd_rad_s.joint(j), scene.sign.joint(j));
        let epsilon = scene.arm.friction_epsilon_rad_s;
        let extra = samples(scene, |k| {
            let motor_sign = ((qd[k] + rate[k]) / epsilon).tanh();
            let more = drive.rotor_inertia_kg_m2 * acceleration[k]
                + drive.viscous_nm_s_rad * rate[k]
                + drive.coulomb_nm * (motor_sign - sign[k]);
            stiffness * more
        });
        vec![Column::on(j, extra)]
    }

    fn quantities(&self, _: &Scene, _: Option<usize>, _: Shape, b: &[f64]) -> Vec<Quantity> {
        vec![quantity("stiffness_nm_rad", 1.0 / b[0], "Nm/rad")]
    }

    fn in_shape(&self, shape: Shape) -> Option<Quantity> {
        // Seen by the link's encoder, the torque is 1/k times a shape that hardly depends on k.
        let in_both = shape.variant == 0;
        in_both.then(|| quantity("stiffness_nm_rad", shape.value, "Nm/rad"))
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
