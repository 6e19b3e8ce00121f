//! Inverse dynamics by the recursive Newton–Euler algorithm.

use super::model::Model;
use super::real::Real;
use super::vector::Vec3;
use super::workspace::Workspace;

/// Motion of one body, in its own frame.
#[derive(Debug, Clone, Copy)]
pub(super) struct BodyMotion<T> {
    /// sin q, cos q of its joint.
    pub sin_cos: (T, T),
    /// Angular velocity, rad/s.
    pub omega: Vec3<T>,
    /// Angular acceleration, rad/s².
    pub alpha: Vec3<T>,
    /// Acceleration of the frame's origin minus gravity, m/s².
    pub accel: Vec3<T>,
}

impl Model {
    /// Motion of body `i` from that of body `i − 1` (`None`: the base, at rest in gravity).
    #[inline(always)]
    pub(super) fn next_motion<T: Real>(
        &self,
        i: usize,
        parent: Option<&BodyMotion<T>>,
        (q, qd, qdd): (T, T, T),
    ) -> BodyMotion<T> {
        let body = &self.bodies[i];
        let sin_cos = q.sin_cos();
        let Some(parent) = parent else {
            let [gx, gy, gz] = self.gravity;
            let zero = T::constant(0.0);
            return BodyMotion {
                sin_cos,
                omega: Vec3::new(zero, zero, qd),
                alpha: Vec3::new(zero, zero, qdd),
                accel: body.to_child(sin_cos, Vec3::constant([-gx, -gy, -gz])),
            };
        };
        let mut omega = body.to_child(sin_cos, parent.omega);
        let mut alpha = body.to_child(sin_cos, parent.alpha);
        // ω × ẑ q̇ = (ω_y, −ω_x, 0) q̇, with the parent's ω: the joint's own part is parallel to ẑ.
        alpha += Vec3::new(omega.y * qd, -(omega.x * qd), qdd);
        omega.z += qd;
        let swing = parent.omega.cross(parent.omega.cross_constant(body.origin));
        let accel = parent.accel + parent.alpha.cross_constant(body.origin) + swing;
        BodyMotion { sin_cos, omega, alpha, accel: body.to_child(sin_cos, accel) }
    }
}

/// Torque of every drive at its joint, Nm, friction included: the paper's (1) with (2)–(4),
///
/// τ = M(q) q̈ + c(q, q̇) + g(q) + Ia q̈ + rv q̇ + rc tanh(q̇/ε).
///
/// All slices have length N; angles in rad, rad/s, rad/s².
pub fn inverse_dynamics<T: Real>(
    model: &Model,
    ws: &mut Workspace<T>,
    q_rad: &[T],
    qd_rad_s: &[T],
    qdd_rad_s2: &[T],
    torque_nm: &mut [T],
) {
    rigid_torque(model, ws, q_rad, qd_rad_s, qdd_rad_s2, torque_nm);
    for (j, body) in model.bodies.iter().enumerate() {
        torque_nm[j] += qdd_rad_s2[j] * body.rotor_inertia + model.friction(j, qd_rad_s[j]);
    }
}

/// Torque of the links alone, M_links(q) q̈ + c(q, q̇) + g(q), without rotors and friction.
#[inline(always)]
pub fn rigid_torque<T: Real>(
    model: &Model,
    ws: &mut Workspace<T>,
    q_rad: &[T],
    qd_rad_s: &[T],
    qdd_rad_s2: &[T],
    torque_nm: &mut [T],
) {
    let n = model.dof();
    for i in 0..n {
        let parent = if i == 0 { None } else { Some(&ws.motion[i - 1]) };
        let motion = model.next_motion(i, parent, (q_rad[i], qd_rad_s[i], qdd_rad_s2[i]));
        let body = &model.bodies[i];
        let BodyMotion { omega, alpha, accel, .. } = motion;
        let h = body.first_moment();
        let swing = omega.cross(omega.cross_constant(h));
        let force = accel * T::constant(body.inertial[0]) + alpha.cross_constant(h) + swing;
        let spin = omega.cross(body.inertia_times(omega));
        // h × a = −(a × h)
        let moment = body.inertia_times(alpha) + spin - accel.cross_constant(h);
        ws.motion[i] = motion;
        ws.wrench[i] = (force, moment);
    }
    for i in (0..n).rev() {
        let (force, moment) = ws.wrench[i];
        torque_nm[i] = moment.z;
        if i > 0 {
            let body = &model.bodies[i];
            let sin_cos = ws.motion[i].sin_cos;
            let force = body.to_parent(sin_cos, force);
            let moment = body.to_parent(sin_cos, moment) - force.cross_constant(body.origin);
            ws.wrench[i - 1].0 += force;
            ws.wrench[i - 1].1 += moment;
        }
    }
}
