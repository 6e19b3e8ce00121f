//! Derivatives of the regressor with respect to the motion, contracted with weights: they yield the gradient of any
//! function of Θ without ever forming the 18·N·13N numbers of ∂Θ/∂(q, q̇, q̈).
//!
//! A function f of Θ with B = ∂f/∂Θ changes by Σ B_jc dΘ_jc. Row j of Θ contracted with row j of B is the torque of
//! joint j of an arm whose parameters are B_j. So for body i and joint j ≤ i, with b = (m, h, J) the weights of the
//! body's ten columns, the function to differentiate is
//!
//! φ = s·(J α + h × a + ω × J ω) + v·(m a + α × h + ω × (ω × h)),
//!
//! and a reverse sweep over the recursions of ω, α, a, s, v gives all derivatives at the cost of a few regressors.

use super::model::Model;
use super::motion::Motion;
use super::newton_euler::BodyMotion;
use super::real::{LANES, Lanes, Real, with_widest_registers};
use super::regressor::RegressorBlock;
use super::vector::Vec3;
use super::workspace::Workspace;

/// Scratch of the reverse sweep.
#[derive(Debug, Clone)]
pub struct AdjointWorkspace<T> {
    motion: Vec<BodyMotion<T>>,
    /// Jacobian column j in the frame of body i, at `i·N + j`.
    columns: Vec<(Vec3<T>, Vec3<T>)>,
    /// Adjoints of ω, α, a of every body.
    motion_bar: Vec<[Vec3<T>; 3]>,
    /// Adjoints of the Jacobian columns, in the frame of the body that the sweep has reached.
    column_bar: Vec<(Vec3<T>, Vec3<T>)>,
}

impl<T: Real> AdjointWorkspace<T> {
    /// Scratch for `model`.
    pub fn new(model: &Model) -> Self {
        let n = model.dof();
        let v = Vec3::zero();
        Self {
            motion: Workspace::new(model).motion,
            columns: vec![(v, v); n * n],
            motion_bar: vec![[v; 3]; n],
            column_bar: vec![(v, v); n],
        }
    }
}

/// K·v with the weights of `A B C D E F` arranged as the paper's inertia matrix (8).
#[inline(always)]
fn inertia_times<T: Real>(b: &[T; 10], v: Vec3<T>) -> Vec3<T> {
    let [_, _, _, _, a, bb, c, d, e, f] = *b;
    Vec3::new(
        a * v.x - f * v.y - e * v.z,
        bb * v.y - f * v.x - d * v.z,
        c * v.z - e * v.x - d * v.y,
    )
}

/// ∂/∂w of x·(w × (w × r)) = (w·x)(w·r) − (x·r)(w·w).
#[inline(always)]
fn swing_adjoint<T: Real>(w: Vec3<T>, r: Vec3<T>, x: Vec3<T>) -> Vec3<T> {
    x * w.dot(r) + r * w.dot(x) - w * (x.dot(r) * 2.0)
}

/// Computes the derivatives of Σ_ij Σ_k `weights(j, i)[k]`·Θ[j, body i, k] with respect to (q, q̇, q̈) and adds them
/// to `q_bar`, `qd_bar`, `qdd_bar`.
#[inline(always)]
fn sweep<T: Real>(
    model: &Model,
    ws: &mut AdjointWorkspace<T>,
    (q, qd, qdd): (&[T], &[T], &[T]),
    weights: impl Fn(usize, usize) -> [T; 10],
    (q_bar, qd_bar, qdd_bar): (&mut [T], &mut [T], &mut [T]),
) {
    let n = model.dof();
    let one = Vec3::new(T::constant(0.0), T::constant(0.0), T::constant(1.0));
    for i in 0..n {
        let body = &model.bodies[i];
        let parent = if i == 0 { None } else { Some(&ws.motion[i - 1]) };
        let motion = model.next_motion(i, parent, (q[i], qd[i], qdd[i]));
        for j in 0..i {
            let (s, v) = ws.columns[(i - 1) * n + j];
            ws.columns[i * n + j] = (
                body.to_child(motion.sin_cos, s),
                body.to_child(motion.sin_cos, v + s.cross_constant(body.origin)),
            );
        }
        ws.columns[i * n + i] = (one, Vec3::zero());
        ws.motion[i] = motion;
    }
    ws.motion_bar.fill([Vec3::zero(); 3]);
    ws.column_bar.fill((Vec3::zero(), Vec3::zero()));
    for i in (0..n).rev() {
        let BodyMotion { sin_cos, omega: w, alpha: al, accel: a } = ws.motion[i];
        let [mut w_bar, mut al_bar, mut a_bar] = ws.motion_bar[i];
        for j in 0..=i {
            let (s, v) = ws.columns[i * n + j];
            let b = weights(j, i);
            let h = Vec3::new(b[1], b[2], b[3]);
            let kw = inertia_times(&b, w);
            let (s_bar, v_bar) = &mut ws.column_bar[j];
            *s_bar += inertia_times(&b, al) + h.cross(a) + w.cross(kw);
            *v_bar += a * b[0] + al.cross(h) + w * w.dot(h) - h * w.dot(w);
            a_bar += v * b[0] + s.cross(h);
            al_bar += inertia_times(&b, s) + h.cross(v);
            w_bar += swing_adjoint(w, h, v) + kw.cross(s) + inertia_times(&b, s.cross(w));
        }

        // ω_i = E ω_p + ẑ q̇, α_i = E α_p + (E ω_p) × ẑ q̇ + ẑ q̈.
        qd_bar[i] += w_bar.z + al_bar.x * w.y - al_bar.y * w.x;
        qdd_bar[i] += al_bar.z;
        w_bar.x += -(al_bar.y * qd[i]);
        w_bar.y += al_bar.x * qd[i];
        // y = E x turns with q: ∂y/∂q = y × ẑ.
        let turned = |bar: Vec3<T>, x: T, y: T| bar.x * y - bar.y * x;
        q_bar[i] += turned(w_bar, w.x, w.y)
            + turned(al_bar, al.x - w.y * qd[i], al.y + w.x * qd[i])
            + turned(a_bar, a.x, a.y);
        let body = &model.bodies[i];
        let r = Vec3::constant(body.origin);
        for j in 0..i {
            let (s, v) = ws.columns[i * n + j];
            let (s_bar, v_bar) = ws.column_bar[j];
            q_bar[i] += turned(s_bar, s.x, s.y) + turned(v_bar, v.x, v.y);
            let v_bar = body.to_parent(sin_cos, v_bar);
            ws.column_bar[j] = (body.to_parent(sin_cos, s_bar) + r.cross(v_bar), v_bar);
        }
        if i > 0 {
            let a_bar = body.to_parent(sin_cos, a_bar);
            let parent = ws.motion[i - 1].omega;
            let [pw_bar, pal_bar, pa_bar] = &mut ws.motion_bar[i - 1];
            *pw_bar += body.to_parent(sin_cos, w_bar) + swing_adjoint(parent, r, a_bar);
            *pal_bar += body.to_parent(sin_cos, al_bar) + r.cross(a_bar);
            *pa_bar += a_bar;
        }
    }
}

impl RegressorBlock {
    /// Writes into `gradient` the derivatives of Σ_jc B_jc(t)·Θ_jc(q(t), q̇(t), q̈(t)) with respect to q, q̇, q̈ at
    /// every sample t of `range`. This block holds B instead of a regressor (set through
    /// [`column_mut`](Self::column_mut)).
    ///
    /// # Panics
    /// If `range` is outside the motion or not as long as the block's samples.
    pub fn pull_back(
        &self,
        model: &Model,
        ws: &mut AdjointWorkspace<Lanes>,
        motion: &Motion,
        range: std::ops::Range<usize>,
        gradient: &mut Motion,
    ) {
        assert!(range.len() == self.samples && range.end <= motion.samples());
        with_widest_registers(
            #[inline(always)]
            || self.pull_back_lanes(model, ws, motion, range.start, gradient),
        );
    }

    #[inline(always)]
    fn pull_back_lanes(
        &self,
        model: &Model,
        ws: &mut AdjointWorkspace<Lanes>,
        motion: &Motion,
        start: usize,
        gradient: &mut Motion,
    ) {
        let n = self.dof;
        let zero = vec![Lanes::constant(0.0); n];
        let mut state = [zero.clone(), zero.clone(), zero.clone()];
        let mut bars = [zero.clone(), zero.clone(), zero];
        for k in (0..self.samples).step_by(LANES) {
            let width = LANES.min(self.samples - k);
            for (lanes, source) in
                state.iter_mut().zip([&motion.q_rad, &motion.qd_rad_s, &motion.qdd_rad_s2])
            {
                for (j, lane) in lanes.iter_mut().enumerate() {
                    let series = &source.joint(j)[start + k..start + k + width];
                    lane.0 = std::array::from_fn(|l| series[l.min(width - 1)]);
                }
            }
            let weight = |column: usize| {
                let at = column * self.capacity + k;
                let mut lanes = Lanes::constant(0.0);
                lanes.0.copy_from_slice(&self.columns[at..at + LANES]);
                lanes
            };
            let [q, qd, qdd] = &state;
            let [q_bar, qd_bar, qdd_bar] = &mut bars;
            for j in 0..n {
                let drive = self.first[j] + 10 * (n - j);
                // d tanh(x/ε)/dx = (1 − tanh²)/ε.
                let sign = model.friction_sign(qd[j]);
                let slope = (Lanes::constant(1.0) - sign * sign) * model.inverse_epsilon;
                q_bar[j] = Lanes::constant(0.0);
                qd_bar[j] = weight(drive + 1) + weight(drive + 2) * slope;
                qdd_bar[j] = weight(drive);
            }
            let body_weights = |j: usize, i: usize| {
                let base = self.first[j] + 10 * (i - j);
                std::array::from_fn(|p| weight(base + p))
            };
            sweep(model, ws, (q, qd, qdd), body_weights, (q_bar, qd_bar, qdd_bar));
            let targets = [&mut gradient.q_rad, &mut gradient.qd_rad_s, &mut gradient.qdd_rad_s2];
            for (target, bar) in targets.into_iter().zip(&bars) {
                for (j, lane) in bar.iter().enumerate() {
                    target.joint_mut(j)[start + k..start + k + width]
                        .copy_from_slice(&lane.0[..width]);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dynamics::{Parameter, ParameterLayout, regressor};
    use crate::robot::{Arm, JointSignals};
    use rand::rngs::ChaCha8Rng;
    use rand::{RngExt, SeedableRng};

    /// Σ B_jc Θ_jc at one state, straight from the dense regressor.
    fn contracted(model: &Model, weights: &RegressorBlock, k: usize, x: &[Vec<f64>; 3]) -> f64 {
        let layout = ParameterLayout::new(model.dof());
        let theta = regressor(model, &mut Workspace::new(model), &x[0], &x[1], &x[2]);
        let mut sum = 0.0;
        for j in 0..model.dof() {
            for c in 0..layout.count() {
                sum += weights.column(j, layout.parameter(c)).map_or(0.0, |b| b[k]) * theta[(j, c)];
            }
        }
        sum
    }

    /// Central differences with h = 1e-6. Round-off is 1e-16·Σ|BΘ|/h ≈ 1e-8 (Σ is about 300). Truncation is smaller
    /// except across the friction sign, whose third derivative is 2/ε³, and h²/6 of it 4e-8. A tolerance of 1e-6 is
    /// therefore met by the true derivative only.
    #[test]
    fn derivatives_are_finite_differences() {
        for name in ["ur5", "ur10e"] {
            let model = Model::new(&Arm::built_in(name).unwrap());
            let layout = ParameterLayout::new(6);
            let samples = 11;
            let mut rng = ChaCha8Rng::seed_from_u64(3);
            let mut signals = |amplitude: f64| {
                JointSignals::from_fn(6, samples, |_, _| rng.random_range(-amplitude..amplitude))
            };
            let motion =
                Motion { q_rad: signals(3.0), qd_rad_s: signals(2.0), qdd_rad_s2: signals(5.0) };
            let mut weights = RegressorBlock::new(&model, samples);
            weights.set_samples(samples);
            for j in 0..6 {
                for c in 0..layout.count() {
                    if let Some(column) = weights.column_mut(j, layout.parameter(c)) {
                        column.iter_mut().for_each(|b| *b = rng.random_range(-1.0..1.0));
                    }
                }
            }
            let mut gradient = Motion::at_rest(6, samples);
            let mut ws = AdjointWorkspace::new(&model);
            weights.pull_back(&model, &mut ws, &motion, 0..samples, &mut gradient);
            let h = 1e-6;
            for k in 0..samples {
                let mut x: [Vec<f64>; 3] = std::array::from_fn(|_| vec![0.0; 6]);
                motion.q_rad.sample_into(k, &mut x[0]);
                motion.qd_rad_s.sample_into(k, &mut x[1]);
                motion.qdd_rad_s2.sample_into(k, &mut x[2]);
                let computed = [&gradient.q_rad, &gradient.qd_rad_s, &gradient.qdd_rad_s2];
                for (d, computed) in computed.iter().enumerate() {
                    for j in 0..6 {
                        let (mut up, mut down) = (x.clone(), x.clone());
                        up[d][j] += h;
                        down[d][j] -= h;
                        let slope = (contracted(&model, &weights, k, &up)
                            - contracted(&model, &weights, k, &down))
                            / (2.0 * h);
                        let error = (slope - computed.joint(j)[k]).abs();
                        assert!(
                            error < 1e-6 * slope.abs().max(10.0),
                            "{name} {k} {d} {j}: {error:e}"
                        );
                    }
                }
            }
        }
    }

    /// The derivative of the joint torques with respect to q̈ is the mass matrix: with B_j = p for one joint, the
    /// pull-back must return the joint's row of it.
    #[test]
    fn pulling_back_one_torque_gives_a_row_of_the_mass_matrix() {
        let model = Model::new(&Arm::built_in("ur5").unwrap());
        let layout = ParameterLayout::new(6);
        let p = model.standard_parameters();
        let q = [0.3, -1.1, 0.8, -0.4, 1.3, 0.2];
        let motion =
            Motion { q_rad: JointSignals::from_fn(6, 1, |j, _| q[j]), ..Motion::at_rest(6, 1) };
        let mut m = nalgebra::DMatrix::zeros(6, 6);
        crate::dynamics::mass_matrix(&model, &mut Workspace::new(&model), &q, &mut m);
        for row in 0..6 {
            let mut weights = RegressorBlock::new(&model, 1);
            weights.set_samples(1);
            for (c, value) in p.iter().enumerate() {
                if let Some(column) = weights.column_mut(row, layout.parameter(c)) {
                    column[0] = *value;
                }
            }
            assert!(weights.column_mut(row, Parameter::Offset(row)).is_some());
            let mut gradient = Motion::at_rest(6, 1);
            let mut ws = AdjointWorkspace::new(&model);
            weights.pull_back(&model, &mut ws, &motion, 0..1, &mut gradient);
            for j in 0..6 {
                assert!((gradient.qdd_rad_s2.joint(j)[0] - m[(row, j)]).abs() < 1e-12);
            }
        }
    }
}
