//! Formulas for the bias and scatter of least squares with a filtered and noisy regressor.
//!
//! The true equations are y = Xθ. The equations that a processing solves differ: the torque is filtered by G_y and the
//! regressor by G_x. The velocity in the regressor is filtered by L (1 in the paper), and the acceleration is computed
//! from the velocity by a differentiator with the response jA(ω). The velocity of joint i contains its encoder's white
//! noise v_i of variance σ_i². With X̄ the mean of the regressor that is used, E its random part, and W the weights of
//! the joints,
//!
//! ```text
//! θ̂ → (X̄ᵀW²X̄ + N)⁻¹ X̄ᵀW² G_y y,   N = E[EᵀW²E]                                  (a)
//! V  = (X̄ᵀW²X̄ + N)⁻¹ Ω (X̄ᵀW²X̄ + N)⁻¹                                             (b)
//! ```
//!
//! **Filter branch** (N = 0): the acceleration lacks the part (1 − A/ω) q̈, and the parameters compensate the missing
//! torque. For (33), A/ω = 1/(1 + (f/f_c)²): a rotor inertia comes out too large by about (f/f_c)², with f the
//! frequency of the motion. This bias falls as 1/f_c².
//!
//! **Noise branch** (errors in variables): the acceleration noise a_i = A v_i has the variance
//!
//! ```text
//! σ_ai² = σ_i² · mean over all frequencies of (A G_x)²  →  σ_i² ω_c³/(4 f_s) for (33)
//! N     = Σ_i σ_ai² Σ_t D_iᵀW²D_i + N_friction,   D_i = ∂X/∂q̈_i
//! ```
//!
//! and attenuates inertias by the share σ_ai²/var(q̈_i | other columns). This bias grows as f_c³. N_friction is the
//! covariance of q̇ + Lv and tanh((q̇ + Lv)/ε), by quadrature; it hardly depends on the cut-off. The noise of velocity
//! and the noise of acceleration at the same instant are uncorrelated (A is odd).
//!
//! **Scatter**: Ω is the sum of a part from the torque noise (variance s_j², spectrum S, correlation C between joints)
//! and a part from the encoder noise, which enters the error of the equations to first order in v:
//!
//! ```text
//! Ω = Σ_jj' C_jj' s_j s_j' w_j² w_j'² Y_jᵀY_j' + Σ_i σ_i² g_iᵀg_i,   Y = √S G_y X̄
//! g_i = jA* [Σ_j w_j² (G_x X̄)_j (D_iθ)_j] + L [w_i² (G_x X̄)_i (rv_i + rc_i E[1 − tanh²]/ε)]
//! ```

use fourier::Complex64;
use nalgebra::{DMatrix, DVector};

use super::noisy_friction::NoisyFriction;
use super::periodic::Periodic;
use crate::base::{BaseSet, ColumnPlan};
use crate::dot::dot;
use crate::dynamics::{Model, Motion};
use crate::identify::{Assembler, Problem};
use crate::robot::JointSignals;

/// A real frequency response as a function of the frequency in Hz.
pub(super) type Response<'a> = &'a dyn Fn(f64) -> f64;

/// How a processing filters and weights a log.
pub(super) struct Treatment<'a> {
    /// A(f), rad/s: jA is the response that computes the acceleration from the velocity.
    pub differentiator: Response<'a>,
    /// L, the filter of the velocity in the regressor.
    pub velocity: Response<'a>,
    /// G_x, the filter of the regressor.
    pub regressor: Response<'a>,
    /// G_y, the filter of the torque.
    pub torque: Response<'a>,
    /// w_j, the weights of the joints.
    pub weights: &'a [f64],
}

/// The noise of a log.
pub(super) struct LogNoise<'a> {
    /// σ_i, the noise of each joint's velocity reading, rad/s.
    pub velocity_sd_rad_s: &'a [f64],
    /// s_j, the torque noise of each joint, Nm.
    pub torque_sd_nm: &'a [f64],
    /// S(f), the spectrum of the torque noise, with mean 1 over all frequencies.
    pub torque_power: Response<'a>,
    /// Correlation of the torque noise between any two joints.
    pub torque_correlation: f64,
}

/// Bias and variance of the estimates.
#[derive(Debug, Clone)]
pub(super) struct Outcome {
    /// Limit of θ̂ minus θ.
    pub bias: Vec<f64>,
    /// Variance of θ̂.
    pub variance: Vec<f64>,
}

/// One period of an arm's exact motion, with the quantities that the formulas derive from it.
pub(super) struct NoisyRegressor<'a> {
    model: &'a Model,
    set: &'a BaseSet,
    theta: Vec<f64>,
    epsilon_rad_s: f64,
    motion: Motion,
    periodic: Periodic,
    rate_hz: f64,
    exact: Columns,
    torque_nm: Vec<Vec<f64>>,
    /// D_i = ∂X/∂q̈_i.
    slopes: Vec<Columns>,
}

/// For every joint, the columns of its equation, each with its base index.
type Columns = Vec<Vec<(usize, Vec<f64>)>>;

fn columns(problem: &Problem) -> Columns {
    let panels = problem.panels.iter().enumerate();
    panels
        .map(|(j, panel)| {
            let series = panel.x.chunks_exact(problem.samples).map(<[f64]>::to_vec);
            problem.plan.base_indices(j).zip(series).collect()
        })
        .collect()
}

impl<'a> NoisyRegressor<'a> {
    /// Prepares the formulas for one period `motion` of an arm with the base parameters `theta`.
    pub(super) fn new(
        model: &'a Model,
        set: &'a BaseSet,
        theta: Vec<f64>,
        epsilon_rad_s: f64,
        motion: Motion,
        rate_hz: f64,
    ) -> Self {
        let exact = assembled(model, set, &motion, rate_hz);
        let torque_nm =
            exact.iter().map(|joint| product(joint, &theta, motion.samples())).collect();
        let slopes = (0..motion.joints())
            .map(|i| {
                let mut faster = motion.clone();
                faster.qdd_rad_s2.joint_mut(i).iter_mut().for_each(|a| *a += 1.0);
                let mut slope = assembled(model, set, &faster, rate_hz);
                for (slope, exact) in slope.iter_mut().flatten().zip(exact.iter().flatten()) {
                    slope.1.iter_mut().zip(&exact.1).for_each(|(s, x)| *s -= x);
                }
                slope
            })
            .collect();
        Self {
            periodic: Periodic::new(motion.samples(), rate_hz),
            model,
            set,
            theta,
            epsilon_rad_s,
            motion,
            rate_hz,
            exact,
            torque_nm,
            slopes,
        }
    }

    /// √diag (XᵀW²X)⁻¹ with W = diag(1/s_j): the σ of `periods` periods with white torque noise of known size and an
    /// exact regressor.
    pub(super) fn least_sigma(&self, torque_sd_nm: &[f64], periods: f64) -> Vec<f64> {
        let weights: Vec<f64> = torque_sd_nm.iter().map(|s| 1.0 / s).collect();
        let inverse = inverse(self.gram(&self.exact, &weights));
        inverse.diagonal().iter().map(|v| (v / periods).sqrt()).collect()
    }

    /// √diag (XᵀX)⁻¹ over `periods` periods: the paper's (20) for an exact regressor.
    pub(super) fn paper_sigma(&self, periods: f64) -> Vec<f64> {
        self.least_sigma(&vec![1.0; self.exact.len()], periods)
    }

    /// Bias by (a) and variance by (b) for `periods` periods of data.
    pub(super) fn outcome(&self, how: &Treatment, noise: &LogNoise, periods: f64) -> Outcome {
        let b = self.set.rank();
        let n = self.motion.samples();
        let joints = self.exact.len();
        let differentiated = |f: f64| Complex64::new(0.0, (how.differentiator)(f));
        let real = |response: Response, x: &[f64]| {
            self.periodic.filtered(x, |f| Complex64::new(response(f), 0.0))
        };

        let mut motion = self.motion.clone();
        for j in 0..joints {
            let qdd = self.periodic.filtered(motion.qd_rad_s.joint(j), differentiated);
            motion.qdd_rad_s2.joint_mut(j).copy_from_slice(&qdd);
            let qd = real(how.velocity, motion.qd_rad_s.joint(j));
            motion.qd_rad_s.joint_mut(j).copy_from_slice(&qd);
        }
        let velocity_gain = self.periodic.noise_gain(how.velocity);
        let mut mean = assembled(self.model, self.set, &motion, self.rate_hz);
        let friction: Vec<NoisyFriction> = (0..joints)
            .map(|j| {
                let qd = motion.qd_rad_s.joint(j);
                let velocity_sd_rad_s = noise.velocity_sd_rad_s[j] * velocity_gain.sqrt();
                let epsilon = self.epsilon_rad_s;
                NoisyFriction::new(self.set, &self.theta, j, qd, epsilon, velocity_sd_rad_s)
            })
            .collect();
        for (joint, friction) in mean.iter_mut().zip(&friction) {
            for (base, column) in joint.iter_mut() {
                if Some(*base) == friction.coulomb {
                    column.copy_from_slice(&friction.mean_sign);
                }
                *column = real(how.regressor, column);
            }
        }

        let mut information = self.gram(&mean, how.weights);
        let acceleration_gain =
            self.periodic.noise_gain(|f| (how.differentiator)(f) * (how.regressor)(f));
        for (slope, sd) in self.slopes.iter().zip(noise.velocity_sd_rad_s) {
            information += self.gram(slope, how.weights) * (sd.powi(2) * acceleration_gain);
        }
        let both = self.periodic.noise_gain(|f| (how.regressor)(f) * (how.velocity)(f));
        let passed = both / velocity_gain;
        for (friction, weight) in friction.iter().zip(how.weights) {
            friction.add_covariance(&mut information, passed * weight * weight);
        }

        let mut right = DVector::zeros(b);
        for ((joint, torque), weight) in mean.iter().zip(&self.torque_nm).zip(how.weights) {
            let torque = real(how.torque, torque);
            for (base, column) in joint {
                right[*base] += weight * weight * dot(column, &torque);
            }
        }

        let inverse = inverse(information);
        let limit = &inverse * right;
        let mut omega = self.torque_part(&mean, how, noise);
        if noise.velocity_sd_rad_s.iter().any(|sd| *sd > 0.0) {
            let seen: Columns = mean
                .iter()
                .map(|joint| {
                    joint.iter().map(|(base, x)| (*base, real(how.regressor, x))).collect()
                })
                .collect();
            let mut score = DMatrix::zeros(n, b);
            for (i, sd) in noise.velocity_sd_rad_s.iter().enumerate() {
                score.fill(0.0);
                self.encoder_score(&seen, how, &friction, i, &mut score);
                omega += score.tr_mul(&score) * sd.powi(2);
            }
        }
        let variance = &inverse * omega * &inverse;
        Outcome {
            bias: limit.iter().zip(&self.theta).map(|(limit, theta)| limit - theta).collect(),
            variance: variance.diagonal().iter().map(|v| v / periods).collect(),
        }
    }

    /// The part of Ω from the torque noise.
    fn torque_part(&self, mean: &Columns, how: &Treatment, noise: &LogNoise) -> DMatrix<f64> {
        let b = self.set.rank();
        let shape = |f: f64| Complex64::new((noise.torque_power)(f).sqrt() * (how.torque)(f), 0.0);
        let seen: Columns = mean
            .iter()
            .zip(how.weights.iter().zip(noise.torque_sd_nm))
            .map(|(joint, (weight, sd))| {
                let scale = weight * weight * sd;
                let scaled = |column: &[f64]| {
                    self.periodic.filtered(column, shape).iter().map(|y| scale * y).collect()
                };
                joint.iter().map(|(base, column)| (*base, scaled(column))).collect()
            })
            .collect();
        let own = 1.0 - noise.torque_correlation;
        let mut omega = self.gram(&seen, &vec![1.0; seen.len()]) * own;
        if noise.torque_correlation > 0.0 {
            let mut sum = DMatrix::zeros(self.motion.samples(), b);
            for (base, column) in seen.iter().flatten() {
                let mut target = sum.column_mut(*base);
                target.iter_mut().zip(column).for_each(|(t, c)| *t += c);
            }
            omega += sum.tr_mul(&sum) * noise.torque_correlation;
        }
        omega
    }

    /// Adds g_i, the response of the score of every parameter to the encoder noise v_i, to `score`; `seen` is G_x X̄.
    fn encoder_score(
        &self,
        seen: &Columns,
        how: &Treatment,
        friction: &[NoisyFriction],
        i: usize,
        score: &mut DMatrix<f64>,
    ) {
        let n = self.motion.samples();
        // The adjoint filter of jA.
        let adjoint = |f: f64| Complex64::new(0.0, -(how.differentiator)(f));
        for (j, joint) in seen.iter().enumerate() {
            let slope = product(&self.slopes[i][j], &self.theta, n);
            let weight = how.weights[j].powi(2);
            for (base, seen) in joint {
                let mut target = score.column_mut(*base);
                let answers: Vec<f64> =
                    seen.iter().zip(&slope).map(|(x, d)| x * d * weight).collect();
                let passed = self.periodic.filtered(&answers, adjoint);
                target.iter_mut().zip(&passed).for_each(|(t, p)| *t += p);
                if i == j {
                    let slope = &friction[i].slope_nm_s_rad;
                    let direct: Vec<f64> =
                        seen.iter().zip(slope).map(|(x, d)| x * d * weight).collect();
                    let velocity = |f: f64| Complex64::new((how.velocity)(f), 0.0);
                    let passed = self.periodic.filtered(&direct, velocity);
                    target.iter_mut().zip(&passed).for_each(|(t, p)| *t += p);
                }
            }
        }
    }

    /// Σ_j w_j² X_jᵀX_j.
    fn gram(&self, columns: &Columns, weights: &[f64]) -> DMatrix<f64> {
        let b = self.set.rank();
        let mut gram = DMatrix::zeros(b, b);
        for (joint, weight) in columns.iter().zip(weights) {
            for (k, (row, x)) in joint.iter().enumerate() {
                for (column, y) in &joint[..=k] {
                    let value = weight * weight * dot(x, y);
                    gram[(*row, *column)] += value;
                    if row != column {
                        gram[(*column, *row)] += value;
                    }
                }
            }
        }
        gram
    }
}

fn assembled(model: &Model, set: &BaseSet, motion: &Motion, rate_hz: f64) -> Columns {
    let mut problem = Problem::new(ColumnPlan::new(model, set), rate_hz);
    let torque = JointSignals::zeros(motion.joints(), motion.samples());
    Assembler::new(model).assemble(&mut problem, model, motion, &torque);
    columns(&problem)
}

/// X_j θ for the columns of one joint.
fn product(joint: &[(usize, Vec<f64>)], theta: &[f64], samples: usize) -> Vec<f64> {
    let mut sum = vec![0.0; samples];
    for (base, column) in joint {
        sum.iter_mut().zip(column).for_each(|(s, x)| *s += theta[*base] * x);
    }
    sum
}

/// Inverse of a symmetric positive definite matrix, which is scaled to a unit diagonal first. All entries are NaN if
/// the matrix is not positive definite.
fn inverse(mut matrix: DMatrix<f64>) -> DMatrix<f64> {
    let b = matrix.nrows();
    let scale = DVector::from_fn(b, |k, _| 1.0 / matrix[(k, k)].sqrt());
    matrix = DMatrix::from_fn(b, b, |i, k| matrix[(i, k)] * scale[i] * scale[k]);
    match matrix.cholesky() {
        Some(factor) => {
            let inverse = factor.inverse();
            DMatrix::from_fn(b, b, |i, k| inverse[(i, k)] * scale[i] * scale[k])
        }
        None => DMatrix::from_element(b, b, f64::NAN),
    }
}

#[cfg(test)]
mod tests;
