//! One design problem: its objective, variables and limits.

use faer::Mat;
use nalgebra::{DMatrix, DVector};

use super::barrier::{BarrierTerms, BarrierWorkspace, LimitBarrier};
use super::criterion::Criterion;
use super::information::{Information, InformationWorkspace};
use super::space::DesignSpace;
use crate::dynamics::Motion;

/// Minimises f(x) = criterion(Λ(x) + Λ_prior) subject to the limits.
///
/// The torque limits enter through a barrier of their own, ψ = −(1/N) Σ ln(1 − (τ/τ_max)²). The torque is a by-product
/// of the regressor, and the derivative of ψ comes from the same reverse sweep as that of f.
#[derive(Debug, Clone)]
pub struct Problem {
    /// The variables.
    pub space: DesignSpace,
    /// Λ of the experiment (of one sample for unweighted criteria).
    pub information: Information,
    /// The criterion that is minimised.
    pub criterion: Criterion,
    /// Scale of every base parameter (for the relative criteria).
    pub scales: Vec<f64>,
    /// Prior information Λ_prior on the base parameters.
    pub prior: Option<Mat<f64>>,
    /// Barrier of joint limits and distances.
    pub barrier: LimitBarrier,
    /// Largest torque per joint, Nm.
    pub torque_nm: Vec<f64>,
}

/// Everything that a step needs to know about one feasible x.
#[derive(Debug, Clone)]
pub struct Point {
    /// The variables.
    pub x: DVector<f64>,
    /// The motion of x.
    pub motion: Motion,
    /// f with a smoothed criterion.
    pub smooth: f64,
    /// ψ.
    pub torque_barrier: f64,
    /// ∂(f + μψ)/∂x.
    pub gradient: DVector<f64>,
    /// φ, and what its curvature needs.
    pub terms: BarrierTerms,
    /// ∂φ/∂x.
    pub barrier_gradient: DVector<f64>,
}

impl Point {
    /// f + μ(φ + ψ).
    pub fn merit(&self, mu: f64) -> f64 {
        self.smooth + mu * (self.terms.value + self.torque_barrier)
    }
}

/// Scratch of one problem, one per thread.
#[derive(Debug, Clone)]
pub struct ProblemWorkspace {
    information: InformationWorkspace,
    barrier: BarrierWorkspace,
    torque_nm: Vec<f64>,
    torque_bar: Vec<f64>,
    motion: Motion,
    bar: Motion,
}

impl Problem {
    /// Scratch for this problem.
    pub fn workspace(&self) -> ProblemWorkspace {
        let (n, samples) = (self.space.joints(), self.space.samples());
        ProblemWorkspace {
            information: self.information.workspace(samples),
            barrier: self.barrier.workspace(samples),
            torque_nm: vec![0.0; n * samples],
            torque_bar: vec![0.0; n * samples],
            motion: Motion::at_rest(n, samples),
            bar: Motion::at_rest(n, samples),
        }
    }

    /// Evaluates the point x; `None` if it is not strictly inside the limits or gives no information about some
    /// parameter.
    pub fn point(
        &self,
        ws: &mut ProblemWorkspace,
        x: DVector<f64>,
        mu: f64,
        sharpness: f64,
    ) -> Option<Point> {
        let samples = self.space.samples();
        let motion = &mut ws.motion;
        self.space.motion(x.as_slice(), motion);
        let terms = self.barrier.evaluate(&mut ws.barrier, &self.space, x.as_slice(), motion)?;
        let mut information =
            self.information.evaluate(&mut ws.information, motion, &mut ws.torque_nm);
        let mut torque_barrier = 0.0;
        for (joint, limit) in self.torque_nm.iter().enumerate() {
            let range = joint * samples..(joint + 1) * samples;
            if limit.is_infinite() {
                ws.torque_bar[range].fill(0.0);
                continue;
            }
            for (tau, bar) in ws.torque_nm[range.clone()].iter().zip(&mut ws.torque_bar[range]) {
                let free = (limit - tau) * (limit + tau);
                if free.is_nan() || free <= 0.0 || tau.abs() >= *limit {
                    return None;
                }
                torque_barrier -= (free / (limit * limit)).ln() / samples as f64;
                *bar = mu * 2.0 * tau / free / samples as f64;
            }
        }
        if let Some(prior) = &self.prior {
            information += prior;
        }
        let (smooth, g) = self.criterion.smooth(&information, &self.scales, sharpness)?;
        if !smooth.is_finite() {
            return None;
        }
        self.information.pull_back(&mut ws.information, motion, &g, &ws.torque_bar, &mut ws.bar);
        let mut gradient = DVector::zeros(x.len());
        self.space.pull_back(x.as_slice(), motion, &ws.bar, gradient.as_mut_slice());
        let mut barrier_gradient = DVector::zeros(x.len());
        self.space.pull_back(
            x.as_slice(),
            motion,
            &ws.barrier.bar,
            barrier_gradient.as_mut_slice(),
        );
        if let Some(at) = self.space.log_period_at() {
            barrier_gradient[at] += terms.period_slope;
        }
        let motion = motion.clone();
        Some(Point { x, motion, smooth, torque_barrier, gradient, terms, barrier_gradient })
    }

    /// Λ + Λ_prior at x, whether x is feasible or not.
    pub fn total_information(&self, ws: &mut ProblemWorkspace, x: &DVector<f64>) -> Mat<f64> {
        self.space.motion(x.as_slice(), &mut ws.motion);
        let mut information =
            self.information.evaluate(&mut ws.information, &ws.motion, &mut ws.torque_nm);
        if let Some(prior) = &self.prior {
            information += prior;
        }
        information
    }

    /// The exact criterion (not smoothed) at x on this problem's grid.
    pub fn exact(&self, ws: &mut ProblemWorkspace, x: &DVector<f64>) -> Option<f64> {
        let information = self.total_information(ws, x);
        self.criterion.value(&information, &self.scales)
    }

    /// ∂²φ at `point`.
    pub fn curvature(&self, point: &Point) -> DMatrix<f64> {
        self.barrier.curvature(&point.terms, &self.space, point.x.as_slice(), &point.motion)
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::base::{BaseSet, Parameterisation};
    use crate::dynamics::Model;
    use crate::excitation::design::{Variables, parameter_scales};
    use crate::excitation::{ClearanceModel, FourierSeries, Requirements};
    use crate::robot::Arm;

    /// UR5, order 2, free period, on a coarse grid, with a prior.
    pub fn small_problem(criterion: Criterion) -> Problem {
        let arm = Arm::built_in("ur5").unwrap();
        let model = Model::new(&arm);
        let base = BaseSet::find(&arm, Parameterisation::full(6, false)).unwrap();
        let scales = parameter_scales(&base, &model);
        let variables = Variables {
            order: 2,
            period_s: 8.0,
            period_range_s: Some([4.0, 20.0]),
            fixed_offsets_rad: vec![None; 6],
            rest_start: false,
        };
        let weights =
            if criterion.whitened() { vec![1.0, 1.0, 2.0, 40.0, 40.0, 40.0] } else { vec![1.0; 6] };
        let requirements = Requirements::default();
        Problem {
            space: DesignSpace::new(variables, 48),
            information: Information::new(&model, &base, weights),
            criterion,
            prior: Some(Mat::from_fn(base.rank(), base.rank(), |i, k| {
                if i == k { 1e-3 / (scales[i] * scales[i]) } else { 0.0 }
            })),
            scales,
            barrier: LimitBarrier::new(&arm, &requirements, ClearanceModel::new(&arm)),
            torque_nm: arm.joints.iter().map(|j| 0.9 * j.limits.torque_nm).collect(),
        }
    }

    /// A moderate motion about a safe pose.
    pub fn feasible_point(problem: &Problem) -> DVector<f64> {
        let wave = |j: usize, l: usize| 0.2 * (1.9 * j as f64 + 2.3 * l as f64).sin() + 0.05;
        let series = FourierSeries {
            period_s: 8.0,
            q0_rad: vec![0.3, -1.2, 0.85, -1.1, -0.1, 0.77],
            a_rad_s: (0..6).map(|j| (0..2).map(|l| wave(j, l)).collect()).collect(),
            b_rad_s: (0..6).map(|j| (0..2).map(|l| wave(j + 7, l)).collect()).collect(),
        };
        DVector::from_vec(problem.space.project(&series))
    }

    /// A drive without a torque limit has no torque barrier.
    #[test]
    fn a_torque_without_limit_bars_nothing() {
        let mut problem = small_problem(Criterion::D);
        let mut ws = problem.workspace();
        let x = feasible_point(&problem);
        let all = problem.point(&mut ws, x.clone(), 0.3, 6.0).unwrap();
        problem.torque_nm[2] = f64::INFINITY;
        let without = problem.point(&mut ws, x, 0.3, 6.0).unwrap();
        assert!(without.torque_barrier < all.torque_barrier);
        assert!(without.gradient.iter().all(|slope| slope.is_finite()));
    }

    /// The whole chain of criterion, information, regressor, motion and coefficients is compared with central
    /// differences, for every criterion and a free period. Round-off of a small eigenvalue is 1e-16 of the largest, up
    /// to some 1e-11 of itself here, which over h = 1e-5 gives 1e-6; truncation is h² times third derivatives, of order
    /// 1/ε² = 2500 from tanh. Both stay below 1e-5.
    #[test]
    fn gradients_are_finite_differences() {
        for criterion in
            [Criterion::D, Criterion::A, Criterion::E, Criterion::Cond, Criterion::Scaled]
        {
            let problem = small_problem(criterion);
            let mut ws = problem.workspace();
            let x = feasible_point(&problem);
            let (mu, sharpness, h) = (0.3, 6.0, 1e-5);
            let point = problem.point(&mut ws, x.clone(), mu, sharpness).unwrap();
            let mut at = |v: usize, by: f64| {
                let mut moved = x.clone();
                moved[v] += by;
                let p = problem.point(&mut ws, moved, mu, sharpness).unwrap();
                (p.smooth + mu * p.torque_barrier, p.terms.value)
            };
            for v in 0..x.len() {
                let (up, down) = (at(v, h), at(v, -h));
                let slope = (up.0 - down.0) / (2.0 * h);
                let barrier_slope = (up.1 - down.1) / (2.0 * h);
                let scale = point.gradient.norm().max(1.0);
                assert!(
                    (slope - point.gradient[v]).abs() < 1e-5 * scale,
                    "{criterion:?}, variable {v}: {slope} {}",
                    point.gradient[v]
                );
                let error = (barrier_slope - point.barrier_gradient[v]).abs();
                assert!(error < 1e-5 * scale, "barrier, variable {v}: {error:e}");
            }
        }
    }

    /// The curvature of the joint limits is exact: far from every distance limit and for a fixed period, it equals the
    /// difference of barrier gradients.
    #[test]
    fn curvature_is_positive_and_close_to_differences_of_the_gradient() {
        let problem = small_problem(Criterion::D);
        let mut ws = problem.workspace();
        let x = feasible_point(&problem);
        let point = problem.point(&mut ws, x.clone(), 1.0, 1.0).unwrap();
        let h = problem.curvature(&point);
        assert!(h.clone().symmetric_eigenvalues().min() > -1e-12);
        // Joint 1 turns the whole arm: no distance depends on it, and its limits are linear in x.
        let step = 1e-6;
        for v in 0..5 {
            let (mut up, mut down) = (x.clone(), x.clone());
            up[v] += step;
            down[v] -= step;
            let up = problem.point(&mut ws, up, 1.0, 1.0).unwrap().barrier_gradient;
            let down = problem.point(&mut ws, down, 1.0, 1.0).unwrap().barrier_gradient;
            for w in 0..5 {
                let slope = (up[w] - down[w]) / (2.0 * step);
                assert!((slope - h[(v, w)]).abs() < 1e-6, "{v} {w}: {slope} {}", h[(v, w)]);
            }
        }
    }
}
