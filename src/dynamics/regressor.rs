//! The regressor Θ(q, q̇, q̈) of the paper's (13): torque is linear in the standard parameters.
//!
//! For body i and joint j ≤ i, with the body's motion (ω, α, a; a minus gravity) and its Jacobian column (s, v:
//! angular and linear velocity of frame i per unit speed of joint j) in frame i, d'Alembert's principle gives the
//! torque of joint j
//!
//! τ_j = s·(J α + ω × J ω + h × a) + v·(m a + α × h + ω × (ω × h)),
//!
//! which is linear in the body's ten parameters (m, h = mρ, J). The torque of a joint j > i does not depend on body
//! i: only the 10·N(N+1)/2 structurally non-zero entries are computed and stored.

use nalgebra::DMatrix;

use super::model::Model;
use super::motion::Motion;
use super::newton_euler::BodyMotion;
use super::parameters::{Parameter, ParameterLayout};
use super::real::{LANES, Lanes, Real, with_widest_registers};
use super::vector::Vec3;
use super::workspace::Workspace;

/// Row of joint j over the ten parameters of one body, from its Jacobian column and motion.
#[inline(always)]
fn body_row<T: Real>((s, v): (Vec3<T>, Vec3<T>), m: &BodyMotion<T>) -> [T; 10] {
    let (w, al, a) = (m.omega, m.alpha, m.accel);
    // v·(ω × (ω × h)) = h·(ω (ω·v) − v ω²), v·(α × h) = h·(v × α), s·(h × a) = h·(a × s).
    let h = v.cross(al) + w * w.dot(v) - v * w.dot(w) + a.cross(s);
    // s·(ω × J ω) = (s × ω)·J ω.
    let u = s.cross(w);
    [
        v.dot(a),
        h.x,
        h.y,
        h.z,
        s.x * al.x + u.x * w.x,
        s.y * al.y + u.y * w.y,
        s.z * al.z + u.z * w.z,
        -(s.y * al.z + s.z * al.y + u.y * w.z + u.z * w.y),
        -(s.x * al.z + s.z * al.x + u.x * w.z + u.z * w.x),
        -(s.x * al.y + s.y * al.x + u.x * w.y + u.y * w.x),
    ]
}

/// Calls `sink(j, i, row)` for every joint j ≤ body i.
#[inline(always)]
pub(super) fn for_each_body_row<T: Real>(
    model: &Model,
    ws: &mut Workspace<T>,
    (q, qd, qdd): (&[T], &[T], &[T]),
    mut sink: impl FnMut(usize, usize, [T; 10]),
) {
    let zero = T::constant(0.0);
    for i in 0..model.dof() {
        let body = &model.bodies[i];
        let parent = if i == 0 { None } else { Some(&ws.motion[i - 1]) };
        let motion = model.next_motion(i, parent, (q[i], qd[i], qdd[i]));
        for (s, v) in &mut ws.jacobian[..i] {
            *v = body.to_child(motion.sin_cos, *v + s.cross_constant(body.origin));
            *s = body.to_child(motion.sin_cos, *s);
        }
        ws.jacobian[i] = (Vec3::new(zero, zero, T::constant(1.0)), Vec3::zero());
        for j in 0..=i {
            sink(j, i, body_row(ws.jacobian[j], &motion));
        }
        ws.motion[i] = motion;
    }
}

/// The dense N × 14N regressor of one sample, columns as in [`ParameterLayout`] (offsets last):
/// `regressor · standard_parameters = inverse_dynamics`.
pub fn regressor(
    model: &Model,
    ws: &mut Workspace<f64>,
    q_rad: &[f64],
    qd_rad_s: &[f64],
    qdd_rad_s2: &[f64],
) -> DMatrix<f64> {
    let n = model.dof();
    let layout = ParameterLayout::new(n);
    let mut theta = DMatrix::zeros(n, layout.count());
    for_each_body_row(model, ws, (q_rad, qd_rad_s, qdd_rad_s2), |j, i, row| {
        for (k, value) in row.into_iter().enumerate() {
            theta[(j, 10 * i + k)] = value;
        }
    });
    for j in 0..n {
        theta[(j, layout.index(Parameter::RotorInertia(j)))] = qdd_rad_s2[j];
        theta[(j, layout.index(Parameter::Viscous(j)))] = qd_rad_s[j];
        theta[(j, layout.index(Parameter::Coulomb(j)))] = model.friction_sign(qd_rad_s[j]);
        theta[(j, layout.index(Parameter::Offset(j)))] = 1.0;
    }
    theta
}

/// The structurally non-zero columns of the regressor over a block of consecutive samples.
///
/// Joint j's row contains the bodies j…N−1 and its own drive. Each of these columns is one contiguous run of samples;
/// a block of a few hundred samples stays in cache while it is used.
#[derive(Debug, Clone)]
pub struct RegressorBlock {
    pub(super) dof: usize,
    pub(super) capacity: usize,
    pub(super) samples: usize,
    /// First column of each joint's row block, in units of columns.
    pub(super) first: Vec<usize>,
    pub(super) columns: Vec<f64>,
}

/// Number of columns of a joint's drive, after its body columns: Ia, rv, rc, off.
const DRIVE_COLUMNS: usize = 4;

impl RegressorBlock {
    /// Room for `capacity` samples, rounded up to whole lanes.
    pub fn new(model: &Model, capacity: usize) -> Self {
        let dof = model.dof();
        let capacity = capacity.next_multiple_of(LANES);
        let mut first = vec![0];
        for j in 0..dof {
            first.push(first[j] + 10 * (dof - j) + DRIVE_COLUMNS);
        }
        Self { dof, capacity, samples: 0, columns: vec![0.0; first[dof] * capacity], first }
    }

    /// Samples held now.
    pub fn samples(&self) -> usize {
        self.samples
    }

    /// Largest number of samples the block can hold.
    pub fn capacity(&self) -> usize {
        self.capacity
    }

    /// Joint `joint`'s column of the standard parameter `parameter`, one value per sample; `None`
    /// where the structure makes it zero.
    pub fn column(&self, joint: usize, parameter: Parameter) -> Option<&[f64]> {
        let start = self.start(joint, parameter)?;
        Some(&self.columns[start..start + self.samples])
    }

    /// The same column for writing, in blocks that hold weights on a regressor.
    pub fn column_mut(&mut self, joint: usize, parameter: Parameter) -> Option<&mut [f64]> {
        let start = self.start(joint, parameter)?;
        Some(&mut self.columns[start..start + self.samples])
    }

    /// Sets the block to `samples` samples of zeros, to be written column by column.
    ///
    /// # Panics
    /// If `samples` exceeds the capacity.
    pub fn set_samples(&mut self, samples: usize) {
        assert!(samples <= self.capacity);
        self.samples = samples;
        self.columns.fill(0.0);
    }

    fn start(&self, joint: usize, parameter: Parameter) -> Option<usize> {
        let drive = 10 * (self.dof - joint);
        let within = match parameter {
            Parameter::Body(body, k) if body >= joint => 10 * (body - joint) + k,
            Parameter::RotorInertia(j) if j == joint => drive,
            Parameter::Viscous(j) if j == joint => drive + 1,
            Parameter::Coulomb(j) if j == joint => drive + 2,
            Parameter::Offset(j) if j == joint => drive + 3,
            _ => return None,
        };
        Some((self.first[joint] + within) * self.capacity)
    }

    /// Fills the block with the regressor of `motion` at the samples `range`.
    ///
    /// # Panics
    /// If the range is longer than the capacity or outside the motion.
    pub fn fill(
        &mut self,
        model: &Model,
        ws: &mut Workspace<Lanes>,
        motion: &Motion,
        range: std::ops::Range<usize>,
    ) {
        assert!(range.len() <= self.capacity && range.end <= motion.samples());
        self.samples = range.len();
        with_widest_registers(
            #[inline(always)]
            || self.fill_lanes(model, ws, motion, range.start),
        );
    }

    #[inline(always)]
    fn fill_lanes(
        &mut self,
        model: &Model,
        ws: &mut Workspace<Lanes>,
        motion: &Motion,
        start: usize,
    ) {
        let Self { dof, capacity, samples, ref first, ref mut columns } = *self;
        let mut state = [vec_of(dof), vec_of(dof), vec_of(dof)];
        for k in (0..samples).step_by(LANES) {
            let width = LANES.min(samples - k);
            let sources = [&motion.q_rad, &motion.qd_rad_s, &motion.qdd_rad_s2];
            for (lanes, source) in state.iter_mut().zip(sources) {
                for (j, lane) in lanes.iter_mut().enumerate() {
                    let series = &source.joint(j)[start + k..start + k + width];
                    // A short last group repeats its last sample: valid numbers that are never read.
                    lane.0 = std::array::from_fn(|l| series[l.min(width - 1)]);
                }
            }
            let [q, qd, qdd] = &state;
            let mut store = |column: usize, value: Lanes| {
                let at = column * capacity + k;
                columns[at..at + LANES].copy_from_slice(&value.0);
            };
            for_each_body_row(model, ws, (q, qd, qdd), |j, i, row| {
                let base = first[j] + 10 * (i - j);
                for (p, value) in row.into_iter().enumerate() {
                    store(base + p, value);
                }
            });
            for j in 0..dof {
                let drive = first[j] + 10 * (dof - j);
                store(drive, qdd[j]);
                store(drive + 1, qd[j]);
                store(drive + 2, model.friction_sign(qd[j]));
                store(drive + 3, Lanes::constant(1.0));
            }
        }
    }
}

fn vec_of(n: usize) -> Vec<Lanes> {
    vec![Lanes::constant(0.0); n]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dynamics::{forward_dynamics, inverse_dynamics};
    use crate::robot::{Arm, JointSignals};
    use nalgebra::DVector;

    fn wobble(seed: usize, amplitude: f64) -> impl FnMut(usize, usize) -> f64 {
        move |j, k| amplitude * ((1.3 * j as f64 + 0.7 * k as f64 + seed as f64) * 1.7).sin()
    }

    fn some_motion(samples: usize) -> Motion {
        Motion {
            q_rad: JointSignals::from_fn(6, samples, wobble(1, 3.0)),
            qd_rad_s: JointSignals::from_fn(6, samples, wobble(2, 2.0)),
            qdd_rad_s2: JointSignals::from_fn(6, samples, wobble(3, 8.0)),
        }
    }

    #[test]
    fn block_equals_single_samples_bit_for_bit_and_times_parameters_gives_the_torque() {
        let model = Model::new(&Arm::built_in("ur5").unwrap());
        let layout = ParameterLayout::new(6);
        let p = DVector::from_vec(model.standard_parameters());
        let motion = some_motion(37);
        let mut block = RegressorBlock::new(&model, 37);
        block.fill(&model, &mut Workspace::new(&model), &motion, 0..37);
        let mut ws = Workspace::new(&model);
        let (mut q, mut qd, mut qdd, mut tau) = ([0.0; 6], [0.0; 6], [0.0; 6], [0.0; 6]);
        for k in 0..37 {
            motion.q_rad.sample_into(k, &mut q);
            motion.qd_rad_s.sample_into(k, &mut qd);
            motion.qdd_rad_s2.sample_into(k, &mut qdd);
            let theta = regressor(&model, &mut ws, &q, &qd, &qdd);
            for j in 0..6 {
                for c in 0..layout.count() {
                    let stored = block.column(j, layout.parameter(c)).map_or(0.0, |v| v[k]);
                    // Adding zero turns −0 into +0.
                    let same = (theta[(j, c)] + 0.0).to_bits() == (stored + 0.0).to_bits();
                    assert!(same, "joint {j}, {}: {} {stored}", layout.name(c), theta[(j, c)]);
                }
            }
            inverse_dynamics(&model, &mut ws, &q, &qd, &qdd, &mut tau);
            let linear = &theta * &p;
            for j in 0..6 {
                // 84 products of terms up to about 100 Nm.
                assert!((linear[j] - tau[j]).abs() < 84.0 * 100.0 * f64::EPSILON, "joint {j}");
            }
            let mut back = [0.0; 6];
            forward_dynamics(&model, &mut ws, &q, &qd, &tau, &mut back).unwrap();
            for j in 0..6 {
                assert!((back[j] - qdd[j]).abs() < 1e-9);
            }
        }
    }
}
