//! Descends from one start to a local optimum, inside the limits all the way.

use nalgebra::{Cholesky, DMatrix, DVector};

use super::problem::{Point, Problem, ProblemWorkspace};
use crate::dynamics::Motion;

/// One stage: f + μ·barrier is minimised with a criterion smoothed to `sharpness`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Stage {
    /// μ: weight of the barrier.
    pub mu: f64,
    /// p of the smoothed spectrum.
    pub sharpness: f64,
    /// Largest number of steps.
    pub steps: usize,
}

/// How a descent ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ending {
    /// The predicted decrease fell below the tolerance in the last stage.
    Converged,
    /// The last stage used all its steps.
    StepLimit,
    /// The descent was told to stop; its point is feasible all the same.
    Interrupted,
}

/// Where a descent ended.
#[derive(Debug, Clone)]
pub struct Descent {
    /// The variables, strictly inside the (tightened) limits.
    pub x: DVector<f64>,
    /// Number of points evaluated.
    pub evaluations: usize,
    /// How it ended.
    pub ending: Ending,
}

/// A predicted decrease of the merit below this ends a stage: the criteria are logarithms, so it is
/// a relative change of a condition number or a variance.
const TOLERANCE: f64 = 1e-6;
/// Fraction of the distance to the nearest joint limit that one step may use.
const KEEP: f64 = 0.98;

/// Minimises `problem` from the feasible `start` through the `stages`. `None` if the start is not
/// strictly feasible.
///
/// Each step solves (B + μ H) d = −∇(f + μ φ). H is the curvature of the barrier, exact for the joint limits and
/// Gauss–Newton for the distances. B is a BFGS approximation of the curvature of the criterion alone, damped (Powell)
/// to stay positive definite. The barrier is the stiff part and its curvature is known, so B has to learn only the
/// smooth criterion, and remains valid when μ changes. A backtracking search on the merit f + μ φ keeps every iterate
/// strictly feasible.
pub fn descend(
    problem: &Problem,
    ws: &mut ProblemWorkspace,
    start: DVector<f64>,
    stages: &[Stage],
    interrupted: &dyn Fn() -> bool,
) -> Option<Descent> {
    let first = stages.first()?;
    let mut point = problem.point(ws, start, first.mu, first.sharpness)?;
    let mut b: Option<DMatrix<f64>> = None;
    let mut evaluations = 1;
    let mut ending = Ending::StepLimit;
    let mut change = point.motion.clone();
    for stage in stages {
        point = problem.point(ws, point.x.clone(), stage.mu, stage.sharpness)?;
        evaluations += 1;
        ending = Ending::StepLimit;
        for _ in 0..stage.steps {
            if interrupted() {
                let ending = Ending::Interrupted;
                return Some(Descent { x: point.x, evaluations, ending });
            }
            let slope = &point.gradient + &point.barrier_gradient * stage.mu;
            let d = direction(problem, &point, b.as_ref(), stage.mu, &slope);
            let decrease = -slope.dot(&d);
            if decrease.is_nan() || decrease < TOLERANCE {
                ending = Ending::Converged;
                break;
            }
            let (next, tried) = search(problem, ws, &point, &d, decrease, stage, &mut change);
            evaluations += tried;
            let Some(next) = next else {
                // A descent direction without decrease: rounding, or a misleading B.
                if b.take().is_none() {
                    ending = Ending::Converged;
                    break;
                }
                continue;
            };
            let s = &next.x - &point.x;
            let y = &next.gradient - &point.gradient;
            update(&mut b, &s, &y);
            point = next;
        }
    }
    Some(Descent { x: point.x, evaluations, ending })
}

/// The step −(B + μ H)⁻¹ ∇. Before the first update, B is the identity times the norm of the gradient, which gives a
/// first step of order 1.
fn direction(
    problem: &Problem,
    point: &Point,
    b: Option<&DMatrix<f64>>,
    mu: f64,
    slope: &DVector<f64>,
) -> DVector<f64> {
    let n = slope.len();
    let mut k = problem.curvature(point) * mu;
    match b {
        Some(b) => k += b,
        None => k += DMatrix::identity(n, n) * point.gradient.norm().max(1e-6),
    }
    let mut ridge = 1e-9 * k.diagonal().amax().max(1e-12);
    loop {
        let shifted = &k + DMatrix::identity(n, n) * ridge;
        if let Some(factor) = Cholesky::new(shifted) {
            return -factor.solve(slope);
        }
        ridge *= 100.0;
        if !ridge.is_finite() {
            return -slope;
        }
    }
}

/// Backtracking line search: returns the first of t, t/2, t/4 … that is feasible and decreases the merit by a fraction
/// of what the slope predicts (Armijo), if any, and the number of points tried.
fn search(
    problem: &Problem,
    ws: &mut ProblemWorkspace,
    point: &Point,
    d: &DVector<f64>,
    decrease: f64,
    stage: &Stage,
    change: &mut Motion,
) -> (Option<Point>, usize) {
    const ARMIJO: f64 = 1e-4;
    const TRIALS: usize = 30;
    let space = &problem.space;
    let mut t = 1.0;
    if space.log_period_at().is_none() {
        // The motion is affine in x, so the distance to the joint limits is known.
        space.motion((&point.x + d).as_slice(), change);
        subtract(change, &point.motion);
        t = problem.barrier.longest_step(space, &point.motion, change, KEEP);
    }
    let merit = point.merit(stage.mu);
    for trial in 1..=TRIALS {
        let x = &point.x + d * t;
        if let Some(next) = problem.point(ws, x, stage.mu, stage.sharpness)
            && next.merit(stage.mu) <= merit - ARMIJO * t * decrease
        {
            return (Some(next), trial);
        }
        t *= 0.5;
    }
    (None, TRIALS)
}

fn subtract(from: &mut Motion, what: &Motion) {
    for (from, what) in [
        (&mut from.q_rad, &what.q_rad),
        (&mut from.qd_rad_s, &what.qd_rad_s),
        (&mut from.qdd_rad_s2, &what.qdd_rad_s2),
    ] {
        for j in 0..what.joints() {
            for (x, y) in from.joint_mut(j).iter_mut().zip(what.joint(j)) {
                *x -= y;
            }
        }
    }
}

/// Damped BFGS update: y is moved towards B s until sᵀy ≥ 0.2 sᵀB s (Powell 1978).
fn update(b: &mut Option<DMatrix<f64>>, s: &DVector<f64>, y: &DVector<f64>) {
    let n = s.len();
    let b = b.get_or_insert_with(|| {
        // Magnitude of the curvature along the first step.
        let scale = (y.norm() / s.norm().max(f64::MIN_POSITIVE)).clamp(1e-6, 1e6);
        DMatrix::identity(n, n) * scale
    });
    let bs = &*b * s;
    let sbs = s.dot(&bs);
    let sy = s.dot(y);
    if sbs.is_nan() || sbs <= f64::MIN_POSITIVE {
        return;
    }
    let theta = if sy >= 0.2 * sbs { 1.0 } else { 0.8 * sbs / (sbs - sy) };
    let r = y * theta + &bs * (1.0 - theta);
    let sr = s.dot(&r);
    b.ger(1.0 / sr, &r, &r, 1.0);
    b.ger(-1.0 / sbs, &bs, &bs, 1.0);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::excitation::design::Criterion;
    use crate::excitation::design::problem::tests::{feasible_point, small_problem};

    /// Every iterate is feasible, so the end is; and the merit in the last stage can only decrease.
    #[test]
    fn a_descent_ends_feasible_and_lower() {
        for criterion in [Criterion::D, Criterion::Cond] {
            let problem = small_problem(criterion);
            let mut ws = problem.workspace();
            let start = feasible_point(&problem);
            let stages = [Stage { mu: 0.1, sharpness: 8.0, steps: 25 }];
            let before = problem.point(&mut ws, start.clone(), 0.1, 8.0).unwrap();
            let end = descend(&problem, &mut ws, start, &stages, &|| false).unwrap();
            let after = problem.point(&mut ws, end.x, 0.1, 8.0).unwrap();
            assert!(after.merit(0.1) < before.merit(0.1) - 0.1, "{criterion:?}");
            assert!(end.evaluations > 1);
        }
    }

    #[test]
    fn an_interrupted_descent_returns_its_feasible_start() {
        let problem = small_problem(Criterion::D);
        let mut ws = problem.workspace();
        let start = feasible_point(&problem);
        let stages = [Stage { mu: 0.1, sharpness: 8.0, steps: 25 }];
        let end = descend(&problem, &mut ws, start.clone(), &stages, &|| true).unwrap();
        assert_eq!(end.ending, Ending::Interrupted);
        assert_eq!(end.x, start);
    }

    /// No step reaches an infinite decrease, so the search fails, but still counts its trials.
    #[test]
    fn a_search_that_finds_nothing_has_tried_as_well() {
        let problem = small_problem(Criterion::D);
        let mut ws = problem.workspace();
        let stage = Stage { mu: 0.1, sharpness: 8.0, steps: 1 };
        let start = feasible_point(&problem);
        let point = problem.point(&mut ws, start, stage.mu, stage.sharpness).unwrap();
        let d = -&point.gradient;
        let mut change = point.motion.clone();
        let (next, tried) =
            search(&problem, &mut ws, &point, &d, f64::INFINITY, &stage, &mut change);
        assert!(next.is_none() && tried > 1, "{tried}");
    }

    #[test]
    fn an_infeasible_start_is_refused() {
        let problem = small_problem(Criterion::D);
        let start = DVector::from_element(problem.space.count(), 50.0);
        let stages = [Stage { mu: 0.1, sharpness: 8.0, steps: 25 }];
        assert!(descend(&problem, &mut problem.workspace(), start, &stages, &|| false).is_none());
    }

    /// After an update B s = y whenever sᵀy is clearly positive (the secant equation), and B stays
    /// positive definite even where it is not.
    #[test]
    fn the_update_meets_the_secant_equation_and_stays_positive() {
        let s = DVector::from_vec(vec![1.0, -0.5, 0.3]);
        let y = DVector::from_vec(vec![2.0, -0.4, 1.0]);
        let mut b = Some(DMatrix::identity(3, 3));
        update(&mut b, &s, &y);
        let b_updated = b.clone().unwrap();
        assert!((&b_updated * &s - &y).norm() < 1e-14);
        update(&mut b, &s, &-y);
        assert!(b.unwrap().symmetric_eigenvalues().min() > 0.0);
    }
}
