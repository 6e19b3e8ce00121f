//! Least squares with and without weights.

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::problem::Problem;
use super::triangle::Triangle;
use crate::base::BaseSet;

/// How the equations are weighted against each other.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
#[value(rename_all = "snake_case")]
pub enum Estimator {
    /// The paper's (18), (19): every equation counts the same.
    Ols,
    /// Each joint's equation divided by the standard deviation of its own residual, s_j, iterated
    /// (Gautier 1997).
    Wls,
    /// Seemingly unrelated regressions: the joints' equations weighted by the N × N covariance of
    /// their residuals (Zellner 1962).
    Sur,
    /// Each joint's equations filtered so that its residuals become white (autoregression), then weighted per joint.
    Gls,
    /// Torque and regressor low-passed and thinned, then weighted per joint (Gautier 1997).
    Decimated,
    /// Instrumental variables, against noise in the measured motion: the instruments are the regressor along a
    /// smoother motion; weighted per joint (after Janot, Vandanjon and Gautier 2014).
    Iv,
    /// Each harmonic of a repeating motion, and each joint, weighted by the noise that the periods show there,
    /// including the correlation between joints.
    Spectral,
}

impl std::fmt::Display for Estimator {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(match self {
            Self::Ols => "ols",
            Self::Wls => "wls",
            Self::Sur => "sur",
            Self::Gls => "gls",
            Self::Decimated => "decimated",
            Self::Iv => "iv",
            Self::Spectral => "spectral",
        })
    }
}

/// How least squares weighs the equations of a problem.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Weighting {
    /// All equations alike.
    Equal,
    /// Each joint's equations divided by the standard deviation of its residual, iterated.
    PerJoint,
}

/// The reason why the data cannot determine the parameters.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum FitError {
    /// Fewer equations than unknowns.
    #[error("{rows} equations for {parameters} parameters: the record is too short")]
    TooFewRows {
        /// Torque samples over all joints.
        rows: usize,
        /// Base parameters.
        parameters: usize,
    },
    /// Noise cannot be told from motion in a single run.
    #[error(
        "weights frequency by frequency need at least {needed} whole periods of a motion that \
         repeats; the log has {periods}"
    )]
    TooFewPeriods {
        /// Whole periods found.
        periods: usize,
        /// Periods needed.
        needed: usize,
    },
    /// Nothing moves.
    #[error("the arm stands still, or its periods do not tell how it is accelerated")]
    StandsStill,
    /// The smoother motion carries no information about some parameters.
    #[error(
        "the motion below the cutoff of the instruments does not excite all parameters: choose a \
         higher cutoff, or another estimator than iv"
    )]
    WeakInstruments,
    /// The smoother motion was not given.
    #[error("the estimator iv needs the regressor along a smoother motion, and has none")]
    NoInstruments,
    /// Columns of the regressor vanish or coincide along this motion.
    #[error(
        "the motion does not excite {}: along it their columns are dependent on the others to \
         within rounding", parameters.join(", ")
    )]
    NotExcited {
        /// Names of the base parameters.
        parameters: Vec<String>,
    },
}

/// A least-squares solution, with the triangle that represents all its equations.
#[derive(Debug, Clone)]
pub struct Fit {
    /// θ̂, base parameters in their SI units.
    pub theta: Vec<f64>,
    /// θ̂ of each period alone (P of them).
    pub theta_periods: Vec<Vec<f64>>,
    /// s_j: standard deviation of one torque sample's residual per joint, Nm.
    pub joint_sigma_nm: Vec<f64>,
    /// Weight of each joint's equations: 1/s_j, or 1 where a joint's equations are not weighted as a whole.
    pub weights: Vec<f64>,
    /// QR of the weighted (whitened) W X of one period, and of W y of every period.
    pub triangle: Triangle,
    /// R⁻¹ of that triangle, b × b: (XᵀW²X)⁻¹ = R⁻¹R⁻ᵀ of one period.
    pub inverse: DMatrix<f64>,
    /// ‖e_j‖² over all samples and periods, Nm².
    pub residual_squares: Vec<f64>,
    /// ‖y_j‖² over all samples and periods, Nm².
    pub torque_squares: Vec<f64>,
}

impl Fit {
    /// Replaces residuals and torques by those of `problem`, whose whitened rows were solved.
    pub(super) fn state_residuals_of(&mut self, problem: &Problem) {
        self.residual_squares = problem.residual_squares(&self.theta);
        self.torque_squares =
            problem.panels.iter().map(|p| p.y.iter().map(|v| v * v).sum()).collect();
        let equations = (problem.samples * problem.periods) as f64;
        let share = self.theta.len() as f64 / problem.joints() as f64;
        let sigma = |squares: &f64| (squares / (equations - share).max(1.0)).sqrt();
        self.joint_sigma_nm = self.residual_squares.iter().map(sigma).collect();
    }
}

/// Iterations of the weights: the first uses the residuals of OLS, the second those of the first.
const WEIGHT_ITERATIONS: usize = 2;
/// Smallest pivot, relative to the length of its column, that is more than rounding of double precision.
const PIVOT_FLOOR: f64 = 1e-9;
/// Rows eliminated together.
const BLOCK: usize = 256;

/// Scratch for fitting problems of one shape: the joints' own triangles.
pub struct Fitter {
    joints: Vec<Triangle>,
    block: Vec<f64>,
}

impl Fitter {
    /// Scratch for problems shaped like `problem`, whatever its number of samples.
    pub fn new(problem: &Problem) -> Self {
        let columns = |joint| problem.plan.base_indices(joint).len();
        let triangles = (0..problem.joints()).map(|j| Triangle::new(columns(j), problem.periods));
        Self { joints: triangles.collect(), block: Vec::new() }
    }

    /// Solves `problem`.
    ///
    /// Each joint's equations are reduced to a triangle once; weights only scale triangles, so the
    /// iterations cost nothing in the number of samples.
    pub fn fit(
        &mut self,
        problem: &Problem,
        set: &BaseSet,
        weighting: Weighting,
    ) -> Result<Fit, FitError> {
        let b = problem.parameters();
        let rows = problem.joints() * problem.samples;
        if rows < b {
            return Err(FitError::TooFewRows { rows, parameters: b });
        }
        self.reduce(problem);
        let mut weights = vec![1.0; problem.joints()];
        let mut triangle = self.combine(problem, set, &weights)?;
        let mut theta = mean_solution(&triangle);
        let mut joint_sigma_nm = self.joint_sigma(problem, &theta, &triangle, &weights);
        if weighting == Weighting::PerJoint {
            for _ in 0..WEIGHT_ITERATIONS {
                // A joint without any residual (noise-free data) must not weigh infinitely.
                let floor = 1e-9 * joint_sigma_nm.iter().fold(f64::MIN_POSITIVE, |a, s| a.max(*s));
                weights = joint_sigma_nm.iter().map(|s| 1.0 / s.max(floor)).collect();
                triangle = self.combine(problem, set, &weights)?;
                theta = mean_solution(&triangle);
                joint_sigma_nm = self.joint_sigma(problem, &theta, &triangle, &weights);
            }
        }
        let theta_periods = (0..problem.periods)
            .map(|p| {
                let mut solution = triangle.rhs(p).to_vec();
                triangle.solve_in_place(&mut solution);
                solution
            })
            .collect();
        let square = |values: &[f64]| values.iter().map(|v| v * v).sum::<f64>();
        Ok(Fit {
            theta_periods,
            weights,
            inverse: DMatrix::from_vec(b, b, triangle.inverse()),
            triangle,
            residual_squares: self.residual_squares(problem, &theta),
            torque_squares: problem.panels.iter().map(|panel| square(&panel.y)).collect(),
            theta,
            joint_sigma_nm,
        })
    }

    fn reduce(&mut self, problem: &Problem) {
        let n = problem.samples;
        for (triangle, panel) in self.joints.iter_mut().zip(&problem.panels) {
            if triangle.right_hand_sides() != problem.periods {
                *triangle = Triangle::new(triangle.columns(), problem.periods);
            }
            triangle.clear();
            for start in (0..n).step_by(BLOCK) {
                let rows = BLOCK.min(n - start);
                self.block.clear();
                for column in panel.x.chunks_exact(n).chain(panel.y.chunks_exact(n)) {
                    self.block.extend_from_slice(&column[start..start + rows]);
                }
                triangle.append(&mut self.block, rows);
            }
        }
    }

    /// Stacks the joints' weighted triangles and reduces them to one.
    fn combine(
        &mut self,
        problem: &Problem,
        set: &BaseSet,
        weights: &[f64],
    ) -> Result<Triangle, FitError> {
        let b = problem.parameters();
        let periods = problem.periods;
        let mut all = Triangle::new(b, periods);
        for (j, (joint, &weight)) in self.joints.iter().zip(weights).enumerate() {
            let c = joint.columns();
            self.block.clear();
            self.block.resize(c * (b + periods), 0.0);
            for (k, base) in problem.plan.base_indices(j).enumerate() {
                for i in 0..=k {
                    self.block[base * c + i] = weight * joint.r(i, k);
                }
            }
            for p in 0..periods {
                for (i, z) in joint.rhs(p).iter().enumerate() {
                    self.block[(b + p) * c + i] = weight * z;
                }
            }
            all.append(&mut self.block, c);
        }
        let dependent: Vec<String> = (0..b)
            .filter(|&k| all.r(k, k).abs() <= PIVOT_FLOOR * all.column_length(k))
            .map(|k| set.name(k).to_owned())
            .collect();
        if !dependent.is_empty() {
            return Err(FitError::NotExcited { parameters: dependent });
        }
        Ok(all)
    }

    fn residual_squares(&self, problem: &Problem, theta: &[f64]) -> Vec<f64> {
        self.joints
            .iter()
            .enumerate()
            .map(|(j, joint)| {
                let x: Vec<f64> = problem.plan.base_indices(j).map(|base| theta[base]).collect();
                (0..problem.periods).map(|p| joint.residual_squares(&x, p)).sum()
            })
            .collect()
    }

    /// s_j² = ‖e_j‖² / (P n − p_j), with joint j's share p_j of the parameters: the trace of its
    /// part of the hat matrix, w_j² ‖R_j R⁻¹‖² (Σ p_j = b).
    fn joint_sigma(
        &self,
        problem: &Problem,
        theta: &[f64],
        triangle: &Triangle,
        weights: &[f64],
    ) -> Vec<f64> {
        let b = problem.parameters();
        let inverse = triangle.inverse();
        let squares = self.residual_squares(problem, theta);
        self.joints
            .iter()
            .enumerate()
            .map(|(j, joint)| {
                let base: Vec<usize> = problem.plan.base_indices(j).collect();
                let mut share = 0.0;
                for column in inverse.chunks_exact(b) {
                    for i in 0..joint.columns() {
                        let entry: f64 =
                            (i..joint.columns()).map(|k| joint.r(i, k) * column[base[k]]).sum();
                        share += entry * entry;
                    }
                }
                share *= weights[j] * weights[j];
                let equations = problem.equations(j) as f64;
                (squares[j] / (equations - share).max(1.0)).sqrt()
            })
            .collect()
    }
}

/// Solution for the mean torque: the mean of the periods' solutions.
fn mean_solution(triangle: &Triangle) -> Vec<f64> {
    let periods = triangle.right_hand_sides();
    let mut mean = vec![0.0; triangle.columns()];
    for p in 0..periods {
        mean.iter_mut().zip(triangle.rhs(p)).for_each(|(m, z)| *m += z / periods as f64);
    }
    triangle.solve_in_place(&mut mean);
    mean
}
