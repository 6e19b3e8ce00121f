//! Pools several logs whose motion repeats into one estimate, each weighted by the noise between its own periods.

use nalgebra::{DMatrix, DVector};
use serde::Serialize;
use statrs::distribution::{ContinuousCDF, FisherSnedecor};

use super::covariance::{Covariance, CovarianceKind};
use super::drifting_friction::DriftingFriction;
use super::error::IdentifyError;
use super::fit::{Estimator, Fit};
use super::identification::Identification;
use super::identifier::{Identifier, MANY_PERIODS};
use super::lack_of_fit::LackOfFit;
use super::prepared::Processing;
use super::regression::Regression;
use super::triangle::Triangle;

/// Test whether several logs contradict each other.
///
/// With log i's triangle R_i of one of its P_i whitened periods, its own estimate θ̂_i and the pooled θ̂, the logs
/// differ by Q = Σ P_i ‖R_i (θ̂_i − θ̂)‖². If the arm is the same in all logs, the expectation of Q follows from the
/// logs' covariances V_i, and Q/E Q is compared with F((L − 1) b, ν) for L logs and b parameters. This assumes that
/// V_i is proportional to (P_i R_iᵀR_i)⁻¹, as it is where the periods show the noise that the weights were taken
/// from. ν = Σ b (P_i − 1) counts one degree of freedom per period beyond the first in each of the b directions,
/// although several harmonics inform each of them.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Agreement {
    /// Q/E Q: about 1 where the logs differ by their noise alone.
    pub statistic: f64,
    /// (L − 1) b and ν.
    pub degrees_of_freedom: [f64; 2],
    /// Probability of a larger statistic if the arm is the same and the model holds.
    pub p_value: f64,
    /// Index of the base parameter that differs most, in units of its noise.
    pub parameter: usize,
    /// The log, from 0, whose own estimate of that parameter differs most.
    pub log: usize,
    /// By how many standard deviations that estimate differs from the pooled one.
    pub sigmas: f64,
}

impl Agreement {
    /// Below this probability the logs come from different arms, or from one arm whose model is wrong along one of
    /// the motions.
    pub const REJECT_BELOW: f64 = 1e-3;

    /// Whether noise explains the differences between the logs.
    pub fn holds(&self) -> bool {
        self.p_value >= Self::REJECT_BELOW
    }
}

/// How several logs are used.
#[derive(Debug)]
pub enum Several {
    /// Each log is identified by itself; the estimates are to be [`pooled`].
    Apart(Vec<Identification>),
    /// The rows are stacked into one log: there is only one, or another method was asked for.
    AsOne,
    /// The rows are stacked, because one of the logs cannot be identified alone.
    Together {
        /// That log, from 0.
        log: usize,
        /// Why it cannot be identified alone.
        reason: String,
    },
}

/// Identifies every log by itself if all of them allow it: their motions repeat often enough and excite all
/// parameters.
pub fn each_alone(
    identifier: &mut Identifier,
    regressions: &[Regression],
) -> Result<Several, IdentifyError> {
    if regressions.len() < 2 || !identifier.may_weigh_by_periods() {
        return Ok(Several::AsOne);
    }
    let short = regressions.iter().position(|r| r.prepared.processing.periods < MANY_PERIODS);
    if let Some(log) = short {
        let reason = format!("its motion does not repeat {MANY_PERIODS} times");
        return Ok(Several::Together { log, reason });
    }
    let mut parts = Vec::with_capacity(regressions.len());
    for (log, regression) in regressions.iter().enumerate() {
        match identifier.identify_regression(regression) {
            Ok(part) if part.estimator == Estimator::Spectral => parts.push(part),
            // The periods of this log had no scatter from which to weight the harmonics.
            Ok(_) => {
                let reason = "its periods are alike to the last digit".to_owned();
                return Ok(Several::Together { log, reason });
            }
            Err(error) => {
                let reason = match error {
                    IdentifyError::Fit(error) => error.to_string(),
                    // Without the log's name, beside which the reason is told.
                    IdentifyError::Covariance { error, .. } => error.to_string(),
                    other => return Err(other),
                };
                return Ok(Several::Together { log, reason });
            }
        }
    }
    Ok(Several::Apart(parts))
}

/// The contribution of one log.
struct Part {
    /// θ̂_i.
    theta: DVector<f64>,
    /// √P_i R_i, a root of the log's information matrix P_i R_iᵀR_i.
    root: DMatrix<f64>,
    /// V_i.
    covariance: DMatrix<f64>,
    /// Degrees of freedom of V_i.
    freedom: f64,
    /// P_i.
    periods: usize,
}

impl Part {
    fn of(identification: &Identification) -> Self {
        let Fit { triangle, theta, .. } = &identification.fit;
        let b = theta.len();
        let periods = triangle.right_hand_sides();
        let scale = (periods as f64).sqrt();
        Self {
            theta: DVector::from_column_slice(theta),
            root: DMatrix::from_fn(b, b, |i, k| scale * triangle.r(i, k)),
            covariance: identification.covariance.matrix.clone(),
            freedom: identification.covariance.degrees_of_freedom,
            periods,
        }
    }
}

/// Pools `parts`, which [`each_alone`] identified from the logs behind `joined`, into one estimate. θ̂ minimises Σ_i
/// P_i ‖R_i θ − z̄_i‖², each log's equations being in units of its own noise. So θ̂ = Σ W_i θ̂_i with W_i = A⁻¹ P_i
/// R_iᵀR_i and A = Σ P_i R_iᵀR_i, and its covariance is Σ W_i V_i W_iᵀ. Residuals refer to the torque in `joined`.
pub fn pooled(parts: &[Identification], joined: &Regression) -> Identification {
    let each: Vec<Part> = parts.iter().map(Part::of).collect();
    let triangle = stacked(parts, &each);
    let b = triangle.columns();
    let mut theta = triangle.rhs(0).to_vec();
    triangle.solve_in_place(&mut theta);
    let inverse = DMatrix::from_vec(b, b, triangle.inverse());
    let weights: Vec<DMatrix<f64>> = each
        .iter()
        .map(|part| &inverse * (&part.root * &inverse).transpose() * &part.root)
        .collect();
    let covariance = covariance(&each, &weights);
    let agreement = agreement(&each, &weights, &DVector::from_column_slice(&theta));
    let mut fit = Fit {
        theta_periods: vec![theta.clone()],
        theta,
        joint_sigma_nm: Vec::new(),
        weights: vec![1.0; joined.problem.joints()],
        triangle,
        inverse,
        residual_squares: Vec::new(),
        torque_squares: Vec::new(),
    };
    fit.state_residuals_of(&joined.problem);
    let periods = each.iter().map(|part| part.periods).sum();
    let drifting = |(log, part): (usize, &Identification)| {
        let named = |found: &DriftingFriction| DriftingFriction { log, ..*found };
        part.drifting_friction.iter().map(named).collect::<Vec<_>>()
    };
    let held = |(log, part): (usize, &Identification)| {
        let mut all = part.held_at_rest.clone();
        all.iter_mut().for_each(|found| found.log = log);
        all
    };
    Identification {
        estimator: Estimator::Spectral,
        fit,
        covariance,
        covariance_reason: parts[0].covariance_reason,
        processing: Processing { periods, ..joined.prepared.processing.clone() },
        samples: joined.problem.samples * joined.problem.periods,
        replicates: None,
        explainable_nm: None,
        lack_of_fit: lack_of_fit(parts),
        agreement: Some(agreement),
        drifting_friction: parts.iter().enumerate().flat_map(drifting).collect(),
        may_be_held: Vec::new(),
        held_at_rest: parts.iter().enumerate().flat_map(held).collect(),
        warnings: joined.prepared.warnings.clone(),
    }
}

/// √P_i R_i and √P_i z̄_i of all logs, stacked and reduced to one triangle.
fn stacked(parts: &[Identification], each: &[Part]) -> Triangle {
    let b = each[0].theta.len();
    let mut all = Triangle::new(b, 1);
    let mut block = Vec::new();
    for (identification, part) in parts.iter().zip(each) {
        let triangle = &identification.fit.triangle;
        let sum = |i: usize| (0..part.periods).map(|p| triangle.rhs(p)[i]).sum::<f64>();
        let scale = (part.periods as f64).sqrt();
        block.clear();
        block.extend_from_slice(part.root.as_slice());
        block.extend((0..b).map(|i| sum(i) / scale));
        all.append(&mut block, b);
    }
    all
}

/// Σ W_i V_i W_iᵀ with Satterthwaite's degrees of freedom: parameter k, of whose variance log i contributes the share
/// c_ik, has (Σ c_ik)²/Σ (c_ik²/ν_i). As for each single log, their harmonic mean over the parameters is stated.
fn covariance(each: &[Part], weights: &[DMatrix<f64>]) -> Covariance {
    let shares: Vec<DMatrix<f64>> =
        each.iter().zip(weights).map(|(part, w)| w * &part.covariance * w.transpose()).collect();
    let b = weights[0].nrows();
    let matrix = shares.iter().fold(DMatrix::zeros(b, b), |sum, share| sum + share);
    let inverse_freedom = |k: usize| {
        let squares: f64 =
            shares.iter().zip(each).map(|(c, part)| c[(k, k)].powi(2) / part.freedom).sum();
        squares / matrix[(k, k)].powi(2)
    };
    let sum: f64 = (0..b).map(inverse_freedom).sum();
    Covariance { kind: CovarianceKind::Spectral, matrix, degrees_of_freedom: b as f64 / sum }
}

/// Tests the agreement of the logs. Because the W_j add up to one, θ̂_i − θ̂ = (Σ_{j≠i} W_j) θ̂_i − Σ_{j≠i} W_j θ̂_j;
/// its covariance is the sum of the covariances of these independent terms.
fn agreement(each: &[Part], weights: &[DMatrix<f64>], pooled: &DVector<f64>) -> Agreement {
    let b = pooled.len();
    let (mut squares, mut expected) = (0.0, 0.0);
    let (mut parameter, mut log, mut sigmas) = (0, 0, 0.0f64);
    for (i, part) in each.iter().enumerate() {
        let others = || each.iter().zip(weights).enumerate().filter(move |(j, _)| *j != i);
        let rest = others().fold(DMatrix::zeros(b, b), |sum, (_, (_, w))| sum + w);
        let own = &rest * &part.covariance * rest.transpose();
        let scatter =
            others().fold(own, |sum, (_, (part, w))| sum + w * &part.covariance * w.transpose());
        let difference = &part.theta - pooled;
        squares += (&part.root * &difference).norm_squared();
        expected += (&part.root * &scatter).component_mul(&part.root).sum();
        for k in 0..b {
            let z = difference[k] / scatter[(k, k)].sqrt();
            if z.abs() > sigmas.abs() {
                (parameter, log, sigmas) = (k, i, z);
            }
        }
    }
    let first = ((each.len() - 1) * b) as f64;
    let second = each.iter().map(|part| (b * (part.periods - 1)) as f64).sum::<f64>();
    let statistic = squares / expected;
    let law = FisherSnedecor::new(first, second).ok().filter(|_| statistic.is_finite());
    let p_value = law.map_or(f64::NAN, |law| law.sf(statistic));
    Agreement { statistic, degrees_of_freedom: [first, second], p_value, parameter, log, sigmas }
}

/// Lack-of-fit test of the log that fits worst. Its p-value is multiplied by the number of logs (Bonferroni), because
/// the worst of them is taken; each log that fails has been tested twice, as described in [`LackOfFit`].
fn lack_of_fit(parts: &[Identification]) -> Option<LackOfFit> {
    let tests: Vec<LackOfFit> = parts.iter().map(|part| part.lack_of_fit).collect::<Option<_>>()?;
    let worst = tests.iter().min_by(|a, b| a.p_value.total_cmp(&b.p_value))?;
    Some(LackOfFit { p_value: (worst.p_value * tests.len() as f64).min(1.0), ..*worst })
}
