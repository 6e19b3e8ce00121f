//! A convex quadratic program over a product of cones, and its primal–dual solution.

mod settle;

use nalgebra::{Cholesky, DMatrix, DVector, DVectorView, Dyn};
use thiserror::Error;

use super::cone::{Cone, Scaling};
use crate::dot::dot;

/// The program: minimise ½ (y − y₀)ᵀH (y − y₀) − cᵀ(y − y₀) − Σ γ_i ln det s_i subject to s_i = A_i y + b_i ∈ K_i for
/// every constraint i.
///
/// H is positive definite. Each constraint involves only a few entries of y, so that it contributes small dense
/// blocks to a Newton step.
#[derive(Debug, Clone)]
pub struct ConeProgram {
    /// H.
    pub hessian: DMatrix<f64>,
    /// c.
    pub linear: DVector<f64>,
    /// y₀, about which the quadratic form is expanded. Near its minimum the objective is a small number; as the
    /// difference of two large ones it would be lost to round-off.
    pub centre: DVector<f64>,
    /// The constraints.
    pub constraints: Vec<Constraint>,
}

/// A_i y + b_i ∈ K_i.
#[derive(Debug, Clone)]
pub struct Constraint {
    /// K_i.
    pub cone: Cone,
    /// Entries of y that the constraint involves.
    pub columns: Vec<usize>,
    /// A_i: dimension of the cone × number of columns.
    pub map: DMatrix<f64>,
    /// b_i.
    pub offset: DVector<f64>,
    /// γ_i ≥ 0; zero for a plain constraint.
    pub barrier: f64,
}

/// A solution with the proof of how good it is.
#[derive(Debug, Clone)]
pub struct ConeSolution {
    /// y.
    pub y: DVector<f64>,
    /// ½ (y − y₀)ᵀH (y − y₀) − cᵀ(y − y₀) − Σ γ_i ln det s_i.
    pub objective: f64,
    /// Upper bound on the objective's distance from the minimum. It is the difference to the value of a dual point,
    /// so that it holds independently of the iteration.
    pub gap: f64,
    /// ‖H (y − y₀) − c − Aᵀz‖∞ over ‖c‖∞.
    pub dual_residual: f64,
    /// Newton steps taken.
    pub iterations: usize,
    /// Multiplier z_i of every constraint.
    pub multipliers: Vec<Vec<f64>>,
    /// Smallest eigenvalue of s_i of every constraint.
    pub margins: Vec<f64>,
    /// H + Σ A_iᵀ W_i⁻¹W_i⁻ᵀ A_i one step before the solution, factorised: it relates a shift of c to a shift of y.
    /// At the solution itself it is infinite in the directions that an active constraint fixes.
    pub stiffness: Cholesky<f64, Dyn>,
}

/// No solution was found.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ProgramError {
    /// The starting point must be inside all cones.
    #[error("the starting point is outside cone {constraint} by {margin:.3e}")]
    StartOutside {
        /// Number of the constraint.
        constraint: usize,
        /// Smallest eigenvalue at the starting point.
        margin: f64,
    },
    /// H has a direction without curvature.
    #[error("the quadratic form is not positive definite")]
    NotConvex,
    /// The gap stopped shrinking before it was small enough.
    #[error("after {iterations} steps the duality gap is {gap:.3e}, wanted {wanted:.3e}")]
    NotConverged {
        /// Steps taken.
        iterations: usize,
        /// Gap reached.
        gap: f64,
        /// Gap wanted.
        wanted: f64,
    },
}

/// Limit of the number of steps, far more than any problem has needed (10 to 25).
const MOST_STEPS: usize = 100;
/// Relative gap that is accepted where rounding ends the iteration early. At an objective of 100 it is 0.001, where
/// half a unit is one σ. The gap is reported as it is.
const ACCEPTABLE: f64 = 1e-5;
/// Share of the distance to the boundary that a step covers.
const SHORT_OF_BOUNDARY: f64 = 0.99;
/// A shorter step means that the second-order correction was misleading; a step back to the central path replaces it.
const TOO_SHORT: f64 = 0.1;

impl ConeProgram {
    /// Solves from `start`, which is inside all cones, until the duality gap is below `tolerance` times
    /// 1 + |objective + `constant`|. (The constant is added to the objective to give "relative" a meaning.)
    ///
    /// Mehrotra's predictor–corrector method with Nesterov and Todd's scaling (L. Vandenberghe, "The CVXOPT linear
    /// and quadratic cone program solvers", 2010). s = A y + b holds throughout, so that only the dual equation and
    /// complementarity are left to Newton's method: s_i z_i = γ_i, which is the end of the central path for a plain
    /// constraint and a point on it for a barrier.
    ///
    /// # Certificate
    /// For z in the cones and r = H (y − y₀) − c − Aᵀz the dual value is objective(y) − Σ g_i − ½ rᵀH⁻¹r, so that
    /// gap = Σ g_i + ½ rᵀH⁻¹r. Here g_i = s_iᵀz_i for a plain constraint and g_i = s_iᵀz_i − γ_i (d_i + ln det(s_i
    /// z_i / γ_i)) for a barrier of degree d_i. Both are ≥ 0, and 0 only where complementarity holds.
    ///
    /// # Zeros
    /// The iteration ends slightly inside the cones. Entries of y that a constraint presses onto zero are
    /// finally set to zero, where the certificate allows it.
    pub fn solve(
        &self,
        start: DVector<f64>,
        constant: f64,
        tolerance: f64,
    ) -> Result<ConeSolution, ProgramError> {
        let hessian = Cholesky::new(self.hessian.clone()).ok_or(ProgramError::NotConvex)?;
        let mut point = Point::new(self, start)?;
        let mut step = Step::new(self);
        let scale = self.linear.amax().max(f64::MIN_POSITIVE);
        let mut last_factor: Option<Cholesky<f64, Dyn>> = None;
        let mut iterations = 0;
        loop {
            let objective = self.total(&point);
            let residual = self.dual_residual(&point);
            let gap = self.gap(&point, &residual, &hessian);
            let size = 1.0 + (objective + constant).abs();
            let wanted = tolerance * size;
            let done = gap <= wanted && last_factor.is_some();
            let exhausted = iterations == MOST_STEPS || !gap.is_finite();
            let next = if done || exhausted { None } else { step.prepare(self, &point) };
            let Some((scalings, factor)) = next else {
                return match last_factor {
                    Some(stiffness) if gap <= ACCEPTABLE * size => {
                        self.settle(&mut point, &hessian, &stiffness, gap);
                        let residual = self.dual_residual(&point);
                        Ok(ConeSolution {
                            objective: self.total(&point),
                            gap: self.gap(&point, &residual, &hessian),
                            dual_residual: residual.amax() / scale,
                            iterations,
                            margins: point.margins(self),
                            multipliers: point.z,
                            y: point.y,
                            stiffness,
                        })
                    }
                    _ => Err(ProgramError::NotConverged { iterations, gap, wanted }),
                };
            };
            let mu = point.excess(self) / self.degree() as f64;
            step.towards(self, &scalings, &factor, &residual, 0.0, Correction::None);
            let affine = step.longest(&scalings).min(1.0);
            let centring = (1.0 - affine).powi(3) * mu;
            step.towards(self, &scalings, &factor, &residual, centring, Correction::SecondOrder);
            let mut length = (SHORT_OF_BOUNDARY * step.longest(&scalings)).min(1.0);
            if length < TOO_SHORT {
                step.towards(self, &scalings, &factor, &residual, mu, Correction::None);
                length = (SHORT_OF_BOUNDARY * step.longest(&scalings)).min(1.0);
            }
            point.advance(self, &scalings, &step, length);
            last_factor = Some(factor);
            iterations += 1;
        }
    }

    /// ½ (y − y₀)ᵀH (y − y₀) − cᵀ(y − y₀): the objective without its barriers.
    pub fn objective(&self, y: &DVector<f64>) -> f64 {
        let away = y - &self.centre;
        0.5 * away.dot(&(&self.hessian * &away)) - self.linear.dot(&away)
    }

    /// H (y − y₀) − c: the gradient of [`Self::objective`].
    fn gradient(&self, y: &DVector<f64>) -> DVector<f64> {
        &self.hessian * (y - &self.centre) - &self.linear
    }

    /// The objective with its barriers.
    fn total(&self, point: &Point) -> f64 {
        self.objective(&point.y) + point.barriers(self)
    }

    /// Upper bound on the objective's distance from its minimum, with r = `residual`.
    fn gap(&self, point: &Point, residual: &DVector<f64>, hessian: &Cholesky<f64, Dyn>) -> f64 {
        point.gap(self) + 0.5 * residual.dot(&hessian.solve(residual))
    }

    /// Σ of the cones' degrees.
    fn degree(&self) -> usize {
        self.constraints.iter().map(|c| c.cone.degree()).sum()
    }

    /// r = H (y − y₀) − c − Aᵀz.
    fn dual_residual(&self, point: &Point) -> DVector<f64> {
        let mut residual = self.gradient(&point.y);
        for (constraint, z) in self.constraints.iter().zip(&point.z) {
            constraint.add_transposed(-1.0, z, &mut residual);
        }
        residual
    }
}

impl Constraint {
    /// A_i y, written into `out`.
    fn apply(&self, y: &DVector<f64>, out: &mut [f64]) {
        out.fill(0.0);
        for (&column, entries) in self.columns.iter().zip(self.map.column_iter()) {
            for (o, a) in out.iter_mut().zip(entries.iter()) {
                *o += a * y[column];
            }
        }
    }

    /// Smallest eigenvalue of A_i y + b_i.
    pub fn margin(&self, y: &DVector<f64>) -> f64 {
        let mut point = vec![0.0; self.cone.dimension()];
        self.apply(y, &mut point);
        point.iter_mut().zip(self.offset.iter()).for_each(|(s, b)| *s += b);
        self.cone.margin(&point)
    }

    /// target += factor·A_iᵀ z.
    fn add_transposed(&self, factor: f64, z: &[f64], target: &mut DVector<f64>) {
        let z = DVectorView::from_slice(z, z.len());
        for (&column, entries) in self.columns.iter().zip(self.map.column_iter()) {
            target[column] += factor * entries.dot(&z);
        }
    }
}

/// Current point of the iteration: y, s = A y + b and z.
struct Point {
    y: DVector<f64>,
    s: Vec<Vec<f64>>,
    z: Vec<Vec<f64>>,
}

impl Point {
    /// The starting point: s from `y`, and z = μ s⁻¹ on the central path's dual side. μ is of the size of the
    /// objective, so that primal and dual start equally far from the solution.
    fn new(program: &ConeProgram, y: DVector<f64>) -> Result<Self, ProgramError> {
        let zeros: Vec<Vec<f64>> =
            program.constraints.iter().map(|c| vec![0.0; c.cone.dimension()]).collect();
        let mut point = Self { y, s: zeros.clone(), z: zeros };
        point.update_s(program);
        let gradient = program.gradient(&point.y);
        let most = program.constraints.iter().map(|c| c.barrier).fold(1.0, f64::max);
        let mu = (gradient.dot(&point.y).abs() / program.degree() as f64).max(most);
        for (k, constraint) in program.constraints.iter().enumerate() {
            let margin = constraint.cone.margin(&point.s[k]);
            if margin.is_nan() || margin <= 0.0 {
                return Err(ProgramError::StartOutside { constraint: k, margin });
            }
            constraint.cone.invert(&point.s[k], &mut point.z[k]);
            point.z[k].iter_mut().for_each(|z| *z *= mu);
        }
        Ok(point)
    }

    fn update_s(&mut self, program: &ConeProgram) {
        for (constraint, s) in program.constraints.iter().zip(&mut self.s) {
            constraint.apply(&self.y, s);
            s.iter_mut().zip(constraint.offset.iter()).for_each(|(s, b)| *s += b);
        }
    }

    /// Every constraint with its s and z.
    fn pairs<'a>(
        &'a self,
        program: &'a ConeProgram,
    ) -> impl Iterator<Item = (&'a Constraint, &'a [f64], &'a [f64])> {
        let points = self.s.iter().zip(&self.z);
        program.constraints.iter().zip(points).map(|(c, (s, z))| (c, &s[..], &z[..]))
    }

    /// Σ g_i: the violation of complementarity in the certificate.
    fn gap(&self, program: &ConeProgram) -> f64 {
        self.pairs(program)
            .map(|(Constraint { cone, barrier, .. }, s, z)| match *barrier {
                0.0 => dot(s, z),
                weight => {
                    let degree = cone.degree() as f64;
                    let logarithm = cone.log_det(s) + cone.log_det(z) - degree * weight.ln();
                    dot(s, z) - weight * (degree + logarithm)
                }
            })
            .sum()
    }

    /// Sum of the distances of the s_iᵀz_i from their targets γ_i d_i.
    fn excess(&self, program: &ConeProgram) -> f64 {
        let off = |(c, s, z): (&Constraint, &[f64], &[f64])| {
            (dot(s, z) - c.barrier * c.cone.degree() as f64).abs()
        };
        self.pairs(program).map(off).sum()
    }

    /// −Σ γ_i ln det s_i.
    fn barriers(&self, program: &ConeProgram) -> f64 {
        let weighted = self.pairs(program).filter(|(c, ..)| c.barrier > 0.0);
        -weighted.map(|(c, s, _)| c.barrier * c.cone.log_det(s)).sum::<f64>()
    }

    fn scalings(&self, program: &ConeProgram) -> Option<Vec<Scaling>> {
        let points = self.s.iter().zip(&self.z);
        program.constraints.iter().zip(points).map(|(c, (s, z))| c.cone.scaling(s, z)).collect()
    }

    fn margins(&self, program: &ConeProgram) -> Vec<f64> {
        program.constraints.iter().zip(&self.s).map(|(c, s)| c.cone.margin(s)).collect()
    }

    fn advance(&mut self, program: &ConeProgram, scalings: &[Scaling], step: &Step, length: f64) {
        self.y.axpy(length, &step.y, 1.0);
        self.update_s(program);
        let mut unscaled = [0.0; 10];
        for ((z, direction), scaling) in self.z.iter_mut().zip(&step.z).zip(scalings) {
            scaling.dual(direction, &mut unscaled[..z.len()]);
            z.iter_mut().zip(&unscaled).for_each(|(z, d)| *z += length * d);
        }
    }
}

/// Term of the affine step that the right-hand side of the next step includes.
#[derive(Clone, Copy, PartialEq)]
enum Correction {
    /// None, as for the affine step itself.
    None,
    /// The product of the affine step's primal and dual parts, which the linearisation leaves out.
    SecondOrder,
}

/// A Newton step with scaled primal and dual directions, and the memory to compute it.
struct Step {
    y: DVector<f64>,
    s: Vec<Vec<f64>>,
    z: Vec<Vec<f64>>,
    /// B_i = W_i⁻ᵀ A_i.
    maps: Vec<DMatrix<f64>>,
}

impl Step {
    fn new(program: &ConeProgram) -> Self {
        let zeros: Vec<Vec<f64>> =
            program.constraints.iter().map(|c| vec![0.0; c.cone.dimension()]).collect();
        Self {
            y: DVector::zeros(program.linear.len()),
            s: zeros.clone(),
            z: zeros,
            maps: program.constraints.iter().map(|c| c.map.clone()).collect(),
        }
    }

    /// The scalings at `point` and the factor of H + Σ B_iᵀB_i; `None` where rounding has moved the point out of a
    /// cone.
    fn prepare(
        &mut self,
        program: &ConeProgram,
        point: &Point,
    ) -> Option<(Vec<Scaling>, Cholesky<f64, Dyn>)> {
        let scalings = point.scalings(program)?;
        self.scale_maps(program, &scalings);
        let mut matrix = program.hessian.clone();
        self.add_curvature(program, &mut matrix);
        Some((scalings, Cholesky::new(matrix)?))
    }

    fn scale_maps(&mut self, program: &ConeProgram, scalings: &[Scaling]) {
        for ((constraint, scaling), map) in
            program.constraints.iter().zip(scalings).zip(&mut self.maps)
        {
            for (source, mut target) in constraint.map.column_iter().zip(map.column_iter_mut()) {
                scaling.primal(source.as_slice(), target.as_mut_slice());
            }
        }
    }

    /// matrix += Σ B_iᵀB_i.
    fn add_curvature(&self, program: &ConeProgram, matrix: &mut DMatrix<f64>) {
        for (constraint, map) in program.constraints.iter().zip(&self.maps) {
            for (a, &row) in constraint.columns.iter().enumerate() {
                for (b, &column) in constraint.columns.iter().enumerate() {
                    matrix[(row, column)] += map.column(a).dot(&map.column(b));
                }
            }
        }
    }

    /// Computes the step of H Δy − AᵀΔz = −r, λ∘(Δz̃ + Δs̃) = (γ + σμ) e − λ∘λ − (correction), Δs̃ = B Δy. With
    /// d = λ\(…) it is (H + BᵀB) Δy = −r + Bᵀd and Δz̃ = d − B Δy.
    fn towards(
        &mut self,
        program: &ConeProgram,
        scalings: &[Scaling],
        factor: &Cholesky<f64, Dyn>,
        residual: &DVector<f64>,
        centring: f64,
        correction: Correction,
    ) {
        const NOTHING: [f64; 10] = [0.0; 10];
        self.y.copy_from(residual);
        self.y.neg_mut();
        let mut d = [0.0; 10];
        for (k, (constraint, scaling)) in program.constraints.iter().zip(scalings).enumerate() {
            let length = constraint.cone.dimension();
            let (a, b) = match correction {
                Correction::None => (&NOTHING[..length], &NOTHING[..length]),
                Correction::SecondOrder => (&self.s[k][..], &self.z[k][..]),
            };
            scaling.complementarity(constraint.barrier + centring, a, b, &mut d[..length]);
            self.z[k].copy_from_slice(&d[..length]);
            let d = DVectorView::from_slice(&d, length);
            for (&column, map) in constraint.columns.iter().zip(self.maps[k].column_iter()) {
                self.y[column] += map.dot(&d);
            }
        }
        factor.solve_mut(&mut self.y);
        for (k, constraint) in program.constraints.iter().enumerate() {
            self.s[k].fill(0.0);
            for (&column, map) in constraint.columns.iter().zip(self.maps[k].column_iter()) {
                for (s, b) in self.s[k].iter_mut().zip(map.iter()) {
                    *s += b * self.y[column];
                }
            }
            self.z[k].iter_mut().zip(&self.s[k]).for_each(|(z, s)| *z -= s);
        }
    }

    /// Longest step that keeps s and z in the cones.
    fn longest(&self, scalings: &[Scaling]) -> f64 {
        let directions = self.s.iter().zip(&self.z);
        scalings.iter().zip(directions).fold(f64::INFINITY, |longest, (scaling, (s, z))| {
            longest.min(scaling.longest_step(s)).min(scaling.longest_step(z))
        })
    }
}
