//! The limits of the arm as a logarithmic barrier over one sampled period.

use nalgebra::{DMatrix, DMatrixView, DVector};

use super::space::DesignSpace;
use crate::dynamics::Motion;
use crate::excitation::{ClearanceModel, ClearanceWorkspace, Requirements};
use crate::robot::{Arm, JointSignals, Limits};

/// The barrier φ(x) = −(1/N) Σ_k Σ_c ln s_c(t_k).
///
/// s_c is the margin of the motion from limit c (position, velocity, acceleration, clearance) at sample k, linear in x
/// for the joint limits; outside the limits φ = +∞.
///
/// Limits are tightened so that they hold between the samples too. A trigonometric polynomial p of order L has |p̈| ≤
/// (ωL)² max|p| (Bernstein), so sampled every h its maximum is at most 1/(1 − (ωLh)²/8) times that of the samples:
/// velocity and acceleration limits shrink by (ωLh)²/8. The same holds for the angle measured from the middle of its
/// range, which is a polynomial of order L too; this share does not depend on the period. Angles of fast motions shrink
/// less, by max|q̈| h²/8. Distances have no such bound: they are assumed to accelerate with 2 m/s² and shrink by h²/8
/// times that, at most 5 mm; the fine check afterwards decides.
#[derive(Debug, Clone)]
pub struct LimitBarrier {
    limits: Vec<Limits>,
    clearance: ClearanceModel,
    clearance_m: f64,
}

/// Value of the barrier at one x, and what its curvature there needs beside the motion.
#[derive(Debug, Clone)]
pub struct BarrierTerms {
    /// φ.
    pub value: f64,
    /// Derivative of φ by ln T apart from that through the motion: from the ends of the range of a free period.
    pub period_slope: f64,
    period_curvature: f64,
    /// Σ (1/s²) ∇d ∇dᵀ of the distances, N_joints² numbers per sample.
    distances: Vec<f64>,
}

/// Scratch of the barrier for motions of one length.
#[derive(Debug, Clone)]
pub struct BarrierWorkspace {
    /// Derivatives of φ by q, q̇, q̈ at every sample of the last motion inside the limits.
    pub bar: Motion,
    clearance: ClearanceWorkspace,
    q: Vec<f64>,
    distances_m: Vec<f64>,
    gradients: Vec<f64>,
    /// Σ (1/s²) ∇d ∇dᵀ of the distances, N_joints² numbers per sample.
    curvatures: Vec<f64>,
}

/// Margin of a distance above which it is left out of the curvature, m: its contribution 1/s² is negligible.
const FAR_M: f64 = 0.2;

impl LimitBarrier {
    /// The limits of `arm` with the required clearance.
    pub fn new(arm: &Arm, requirements: &Requirements, clearance: ClearanceModel) -> Self {
        Self {
            limits: arm.joints.iter().map(|j| j.limits).collect(),
            clearance,
            clearance_m: requirements.clearance_m,
        }
    }

    /// Scratch for this barrier and motions of `samples` samples.
    pub fn workspace(&self, samples: usize) -> BarrierWorkspace {
        let n = self.limits.len();
        BarrierWorkspace {
            bar: Motion::at_rest(n, samples),
            clearance: self.clearance.workspace(),
            q: vec![0.0; n],
            distances_m: vec![0.0; self.clearance.len()],
            gradients: vec![0.0; self.clearance.len() * n],
            curvatures: vec![0.0; samples * n * n],
        }
    }

    /// Evaluates the barrier at the motion of `x` and leaves its derivatives by the motion in `ws.bar`; `None` if the
    /// motion exceeds a (tightened) limit.
    pub fn evaluate(
        &self,
        ws: &mut BarrierWorkspace,
        space: &DesignSpace,
        x: &[f64],
        motion: &Motion,
    ) -> Option<BarrierTerms> {
        let period_room = period_room(space, x);
        if !self.joints_are_inside(space, motion)
            || period_room.is_some_and(|room| !is_inside(room))
        {
            return None;
        }
        let (n, samples) = (self.limits.len(), motion.samples());
        let share = 1.0 / samples as f64;
        let mut value = 0.0;
        for (j, limits) in self.limits.iter().enumerate() {
            let bar = &mut ws.bar;
            let bars = [&mut bar.q_rad, &mut bar.qd_rad_s, &mut bar.qdd_rad_s2];
            let sources = signals(motion).into_iter().zip(bars);
            for ((source, bar), range) in sources.zip(tightened(limits, space)) {
                let half = 0.5 * (range[1] - range[0]);
                for (y, bar) in source.joint(j).iter().zip(bar.joint_mut(j)) {
                    let [above, below] = room(*y, range);
                    value -= share * (above / half * below / half).ln();
                    *bar = share * (1.0 / below - 1.0 / above);
                }
            }
        }
        let mut period_slope = 0.0;
        let mut period_curvature = 0.0;
        if let Some([above, below]) = period_room {
            value -= (above * below).ln();
            period_slope = 1.0 / below - 1.0 / above;
            period_curvature = 1.0 / (below * below) + 1.0 / (above * above);
        }
        ws.curvatures.fill(0.0);
        let step_s = step_s(space);
        let required_m = self.clearance_m + (0.25 * step_s * step_s).min(0.005);
        for k in 0..samples {
            motion.q_rad.sample_into(k, &mut ws.q);
            self.clearance.distances_and_gradients(
                &mut ws.clearance,
                &ws.q,
                &mut ws.distances_m,
                &mut ws.gradients,
            );
            for (d, gradient) in ws.distances_m.iter().zip(ws.gradients.chunks_exact(n)) {
                let s = d - required_m;
                if s.is_nan() || s <= 0.0 {
                    return None;
                }
                value -= share * s.ln();
                for (j, slope) in gradient.iter().enumerate() {
                    ws.bar.q_rad.joint_mut(j)[k] -= share * slope / s;
                }
                if s < FAR_M {
                    let block = &mut ws.curvatures[k * n * n..(k + 1) * n * n];
                    for (i, row) in block.chunks_exact_mut(n).enumerate() {
                        for (entry, slope) in row.iter_mut().zip(gradient) {
                            *entry += share / (s * s) * gradient[i] * slope;
                        }
                    }
                }
            }
        }
        let distances = ws.curvatures.clone();
        Some(BarrierTerms { value, period_slope, period_curvature, distances })
    }

    /// Whether the joints keep their tightened limits at every sample.
    fn joints_are_inside(&self, space: &DesignSpace, motion: &Motion) -> bool {
        self.limits.iter().enumerate().all(|(j, limits)| {
            let mut sources = signals(motion).into_iter().zip(tightened(limits, space));
            sources
                .all(|(source, range)| source.joint(j).iter().all(|y| is_inside(room(*y, range))))
        })
    }

    /// Computes ∂²φ by x without the second derivatives of the distances (and of a free period): positive semidefinite,
    /// and exact for the joint limits.
    pub fn curvature(
        &self,
        terms: &BarrierTerms,
        space: &DesignSpace,
        x: &[f64],
        motion: &Motion,
    ) -> DMatrix<f64> {
        let (n, samples) = (self.limits.len(), motion.samples());
        let share = 1.0 / samples as f64;
        let mut total: DMatrix<f64> = DMatrix::zeros(x.len(), x.len());
        let bases: Vec<_> = (0..n).map(|j| space.basis(x, motion, j)).collect();
        let mut add = |rows: &[usize], columns: &[usize], block: &DMatrix<f64>| {
            for (c, &column) in columns.iter().enumerate() {
                for (r, &row) in rows.iter().enumerate() {
                    total[(row, column)] += block[(r, c)];
                }
            }
        };
        for (j, (basis, places)) in bases.iter().enumerate() {
            let sources = signals(motion).into_iter().zip(tightened(&self.limits[j], space));
            for (basis, (source, range)) in basis.iter().zip(sources) {
                let weight = |y: &f64| {
                    let [above, below] = room(*y, range);
                    share * (1.0 / (below * below) + 1.0 / (above * above))
                };
                let weights: Vec<f64> = source.joint(j).iter().map(weight).collect();
                let all = basis.columns(0, basis.ncols());
                add(places, places, &weighted_gram(all, &weights, basis));
            }
            for (i, (other, other_places)) in bases.iter().enumerate() {
                // Only the lower triangle is summed. Of the blocks above the diagonal it has the row of ln T, which is
                // the last variable of every joint.
                let first = match (i <= j, space.log_period_at()) {
                    (true, _) => 0,
                    (false, Some(_)) => places.len() - 1,
                    (false, None) => continue,
                };
                let weights: Vec<f64> =
                    (0..samples).map(|k| terms.distances[(k * n + j) * n + i]).collect();
                let rows = basis[0].columns(first, places.len() - first);
                add(&places[first..], other_places, &weighted_gram(rows, &weights, &other[0]));
            }
        }
        if let Some(at) = space.log_period_at() {
            total[(at, at)] += terms.period_curvature;
        }
        total.fill_upper_triangle_with_lower_triangle();
        total
    }

    /// The largest step t ≤ 1 along the motion `change` (linear in t) that uses at most the fraction `keep` of the
    /// distance to the nearest joint limit.
    pub fn longest_step(
        &self,
        space: &DesignSpace,
        motion: &Motion,
        change: &Motion,
        keep: f64,
    ) -> f64 {
        let mut longest: f64 = 1.0;
        for (j, limits) in self.limits.iter().enumerate() {
            let [q_rad, qd_rad_s, qdd_rad_s2] = tightened(limits, space);
            for (from, by, [low, high]) in [
                (&motion.q_rad, &change.q_rad, q_rad),
                (&motion.qd_rad_s, &change.qd_rad_s, qd_rad_s),
                (&motion.qdd_rad_s2, &change.qdd_rad_s2, qdd_rad_s2),
            ] {
                for (y, d) in from.joint(j).iter().zip(by.joint(j)) {
                    let room = if *d > 0.0 { (high - y) / d } else { (low - y) / d };
                    if *d != 0.0 {
                        longest = longest.min(keep * room);
                    }
                }
            }
        }
        longest.max(0.0)
    }
}

/// q, q̇ and q̈ of `motion`.
fn signals(motion: &Motion) -> [&JointSignals; 3] {
    [&motion.q_rad, &motion.qd_rad_s, &motion.qdd_rad_s2]
}

/// Distances of `y` from the ends of a range: above the lower and below the higher one.
fn room(y: f64, [low, high]: [f64; 2]) -> [f64; 2] {
    [y - low, high - y]
}

/// Whether a value with this room lies strictly inside its range; not if it is NaN.
fn is_inside([above, below]: [f64; 2]) -> bool {
    above > 0.0 && below > 0.0
}

/// Distances of ln T from the ends of its range, if the period is free.
fn period_room(space: &DesignSpace, x: &[f64]) -> Option<[f64; 2]> {
    let (at, range_s) = space.log_period_at().zip(space.variables().period_range_s)?;
    Some(room(x[at], range_s.map(f64::ln)))
}

/// Longest time between two samples, s.
fn step_s(space: &DesignSpace) -> f64 {
    space.longest_period_s() / space.samples() as f64
}

/// Lowest and highest q, q̇ and q̈ allowed at the samples, such that the joint stays inside `limits` between them too.
fn tightened(limits: &Limits, space: &DesignSpace) -> [[f64; 2]; 3] {
    let step_s = step_s(space);
    let share = space.finest_phase_rad().powi(2) / 8.0;
    let [low, high] = limits.position_rad;
    let by_acceleration_rad = limits.acceleration_rad_s2 * step_s * step_s / 8.0;
    let by_range_rad = share * 0.5 * (high - low);
    let guard_rad = by_acceleration_rad.min(by_range_rad);
    let shrink = 1.0 - share;
    let v = shrink * limits.velocity_rad_s;
    let a = shrink * limits.acceleration_rad_s2;
    [[low + guard_rad, high - guard_rad], [-v, v], [-a, a]]
}

/// Aᵀ diag(w) B.
fn weighted_gram(a: DMatrixView<f64>, weights: &[f64], b: &DMatrix<f64>) -> DMatrix<f64> {
    let mut scaled = b.clone();
    let weights = DVector::from_column_slice(weights);
    for mut column in scaled.column_iter_mut() {
        column.component_mul_assign(&weights);
    }
    a.tr_mul(&scaled)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::excitation::design::Variables;

    fn space(period_s: f64, period_range_s: Option<[f64; 2]>) -> DesignSpace {
        let variables = Variables {
            order: 5,
            period_s,
            period_range_s,
            fixed_offsets_rad: vec![None; 6],
            rest_start: false,
        };
        DesignSpace::new(variables, 100)
    }

    /// Samples are 2π/100 apart in the phase of the base frequency, whatever the period. Of ±π rad they leave all but
    /// the share (2π·5/100)²/8 = 1.23 %; at 10 s, 10 rad/s² · (0.1 s)²/8 = 0.0125 rad is less.
    #[test]
    fn the_room_between_the_samples_does_not_grow_with_the_period() {
        let elbow = Arm::built_in("ur5").unwrap().joints[2].limits;
        let guard_rad =
            |space: &DesignSpace| elbow.position_rad[1] - tightened(&elbow, space)[0][1];
        let pi = std::f64::consts::PI;
        assert!((guard_rad(&space(10.0, None)) - 0.0125).abs() < 1e-14);
        for slow in [space(200.0, None), space(4000.0, None), space(10.0, Some([5.0, 170.0]))] {
            assert!((guard_rad(&slow) - pi * (0.1 * pi).powi(2) / 8.0).abs() < 1e-14);
        }
    }
}
