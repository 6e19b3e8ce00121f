//! Torque as measured and as predicted by a set of parameters, sample by sample.

use super::course::Course;
use super::regression::Regression;
use super::residual::Residual;
use crate::robot::JointSignals;

/// Measured and predicted torque along a log or several, with the processing of the regression.
#[derive(Debug, Clone)]
pub struct Prediction {
    /// Time, s; see [`Course`].
    pub time_s: Vec<f64>,
    /// Joint velocity, rad/s: to tell motion from standstill.
    pub qd_rad_s: JointSignals,
    /// Measured torque, Nm.
    pub measured_nm: JointSignals,
    /// X θ, Nm.
    pub predicted_nm: JointSignals,
}

/// Speed beyond which a joint counts as moving, rad/s.
pub const MOVING_RAD_S: f64 = 0.02;

/// The joints (0-based) that never move faster than [`MOVING_RAD_S`].
pub fn resting_joints(qd_rad_s: &JointSignals) -> Vec<usize> {
    let rests = |j: &usize| qd_rad_s.joint(*j).iter().all(|qd| qd.abs() < MOVING_RAD_S);
    (0..qd_rad_s.joints()).filter(rests).collect()
}

impl Prediction {
    /// Predicts the torque of the parameters `theta` along the log of `regression`.
    pub fn of(regression: &Regression, theta: &[f64]) -> Self {
        let problem = &regression.problem;
        let (n, periods, joints) = (problem.samples, problem.periods, problem.joints());
        let residual = problem.residuals(theta);
        let measured_nm = JointSignals::from_fn(joints, n * periods, |j, k| problem.panels[j].y[k]);
        let predicted_nm = JointSignals::from_fn(joints, n * periods, |j, k| {
            measured_nm.joint(j)[k] - residual.joint(j)[k]
        });
        let Course { time_s, qd_rad_s } = regression.course();
        Self { time_s, qd_rad_s, measured_nm, predicted_nm }
    }

    /// Number of samples.
    pub fn samples(&self) -> usize {
        self.time_s.len()
    }

    /// Measured minus predicted, Nm.
    pub fn error_nm(&self) -> JointSignals {
        JointSignals::from_fn(self.measured_nm.joints(), self.samples(), |j, k| {
            self.measured_nm.joint(j)[k] - self.predicted_nm.joint(j)[k]
        })
    }

    /// Residual over all samples.
    pub fn residual(&self) -> Residual {
        Residual::of(&self.error_nm(), &self.measured_nm, |_, _| true)
    }

    /// Residual over the samples in which the joint itself moves faster than [`MOVING_RAD_S`].
    pub fn moving_residual(&self) -> Residual {
        Residual::of(&self.error_nm(), &self.measured_nm, |j, k| {
            self.qd_rad_s.joint(j)[k].abs() > MOVING_RAD_S
        })
    }
}
