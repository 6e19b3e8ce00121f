//! The limits of the arm as a logarithmic barrier over one sampled period.

use nalgebra::{DMatrix, DVector};

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
/// velocity and acceleration limits shrink by (ωLh)²/8. Positions shrink by max|q̈| h²/8. Distances have no such bound:
/// they are assumed to accelerate with 2 m/s² and shrink by h²/8 times that, at most 5 mm; the fine check afterwards
/// decides.
#[derive(Debug, Clone)]
pub struct LimitBarrier {
    limits: Vec<Limits>,
    clearance: ClearanceModel,
    clearance_m: f64,
}

/// Value and derivatives of the barrier at one x.
#[derive(Debug, Clone)]
pub struct BarrierTerms {
    /// φ.
    pub value: f64,
    /// Derivatives of φ by q, q̇, q̈ at every sample.
    pub bar: Motion,
    /// Derivative of φ by ln T apart from that through the motion: from the ends of the range of a free period.
    pub period_slope: f64,
    /// Diagonal of ∂²φ by q, q̇, q̈: the part of the joint limits.
    curvature: [JointSignals; 3],
    period_curvature: f64,
    /// Σ (1/s²) ∇d ∇dᵀ of the distances, N_joints² numbers per sample.
    distances: Vec<f64>,
}

/// Scratch of the barrier.
#[derive(Debug, Clone)]
pub struct BarrierWorkspace {
    clearance: ClearanceWorkspace,
    q: Vec<f64>,
    distances_m: Vec<f64>,
    gradients: Vec<f64>,
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

    /// Scratch for this barrier.
    pub fn workspace(&self) -> BarrierWorkspace {
        let n = self.limits.len();
        BarrierWorkspace {
            clearance: self.clearance.workspace(),
            q: vec![0.0; n],
            distances_m: vec![0.0; self.clearance.len()],
            gradients: vec![0.0; self.clearance.len() * n],
        }
    }

    /// Evaluates the barrier at the motion of `x`; `None` if the motion exceeds a (tightened) limit.
    pub fn evaluate(
        &self,
        ws: &mut BarrierWorkspace,
        space: &DesignSpace,
        x: &[f64],
        motion: &Motion,
    ) -> Option<BarrierTerms> {
        let (n, samples) = (self.limits.len(), motion.samples());
        let share = 1.0 / samples as f64;
        let zeros = JointSignals::zeros(n, samples);
        let mut bar = Motion::at_rest(n, samples);
        let mut curvature = [zeros.clone(), zeros.clone(), zeros];
        let mut value = 0.0;
        for (j, limits) in self.limits.iter().enumerate() {
            let ranges = tightened(limits, space);
            let sources = [&motion.q_rad, &motion.qd_rad_s, &motion.qdd_rad_s2];
            let bars = [&mut bar.q_rad, &mut bar.qd_rad_s, &mut bar.qdd_rad_s2];
            for (((source, bar), curvature), [low, high]) in
                sources.into_iter().zip(bars).zip(&mut curvature).zip(ranges)
            {
                let (bar, curvature) = (bar.joint_mut(j), curvature.joint_mut(j));
                for (k, y) in source.joint(j).iter().enumerate() {
                    let (above, below) = (y - low, high - y);
                    if !(above > 0.0 && below > 0.0) {
                        return None;
                    }
                    let half = 0.5 * (high - low);
                    value -= share * (above / half * below / half).ln();
                    bar[k] = share * (1.0 / below - 1.0 / above);
                    curvature[k] = share * (1.0 / (below * below) + 1.0 / (above * above));
                }
            }
        }
        let mut period_slope = 0.0;
        let mut period_curvature = 0.0;
        if let (Some(at), Some([low, high])) =
            (space.log_period_at(), space.variables().period_range_s)
        {
            let (above, below) = (x[at] - low.ln(), high.ln() - x[at]);
            if !(above > 0.0 && below > 0.0) {
                return None;
            }
            value -= (above * below).ln();
            period_slope = 1.0 / below - 1.0 / above;
            period_curvature = 1.0 / (below * below) + 1.0 / (above * above);
        }
        let mut distances = vec![0.0; samples * n * n];
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
                    bar.q_rad.joint_mut(j)[k] -= share * slope / s;
                }
                if s < FAR_M {
                    let block = &mut distances[k * n * n..(k + 1) * n * n];
                    for (i, row) in block.chunks_exact_mut(n).enumerate() {
                        for (entry, slope) in row.iter_mut().zip(gradient) {
                            *entry += share / (s * s) * gradient[i] * slope;
                        }
                    }
                }
            }
        }
        Some(BarrierTerms { value, bar, period_slope, curvature, period_curvature, distances })
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
        let mut total = DMatrix::zeros(x.len(), x.len());
        let bases: Vec<_> = (0..n).map(|j| space.basis(x, motion, j)).collect();
        let mut add = |rows: &[usize], columns: &[usize], block: &DMatrix<f64>| {
            for (c, &column) in columns.iter().enumerate() {
                for (r, &row) in rows.iter().enumerate() {
                    total[(row, column)] += block[(r, c)];
                }
            }
        };
        for (j, (basis, places)) in bases.iter().enumerate() {
            for (basis, curvature) in basis.iter().zip(&terms.curvature) {
                add(places, places, &weighted_gram(basis, curvature.joint(j), basis));
            }
            for (i, (other, other_places)) in bases.iter().enumerate() {
                let weights: Vec<f64> =
                    (0..samples).map(|k| terms.distances[(k * n + j) * n + i]).collect();
                add(places, other_places, &weighted_gram(&basis[0], &weights, &other[0]));
            }
        }
        if let Some(at) = space.log_period_at() {
            total[(at, at)] += terms.period_curvature;
        }
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

/// Longest time between two samples, s.
fn step_s(space: &DesignSpace) -> f64 {
    space.longest_period_s() / space.samples() as f64
}

/// Lowest and highest q, q̇ and q̈ allowed at the samples, such that the joint stays inside `limits` between them too.
fn tightened(limits: &Limits, space: &DesignSpace) -> [[f64; 2]; 3] {
    let step_s = step_s(space);
    let shrink = 1.0 - space.finest_phase_rad().powi(2) / 8.0;
    let guard_rad = limits.acceleration_rad_s2 * step_s * step_s / 8.0;
    let [low, high] = limits.position_rad;
    let v = shrink * limits.velocity_rad_s;
    let a = shrink * limits.acceleration_rad_s2;
    [[low + guard_rad, high - guard_rad], [-v, v], [-a, a]]
}

/// Aᵀ diag(w) B.
fn weighted_gram(a: &DMatrix<f64>, weights: &[f64], b: &DMatrix<f64>) -> DMatrix<f64> {
    let mut scaled = b.clone();
    let weights = DVector::from_column_slice(weights);
    for mut column in scaled.column_iter_mut() {
        column.component_mul_assign(&weights);
    }
    a.tr_mul(&scaled)
}
