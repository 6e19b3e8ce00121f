//! The part of the torque that a prediction does not explain.

use crate::robot::JointSignals;

/// Size of the error of a prediction.
#[derive(Debug, Clone, PartialEq)]
pub struct Residual {
    /// Root mean square per joint, Nm.
    pub rms_nm: Vec<f64>,
    /// Root mean square of the torque itself per joint, Nm.
    pub torque_rms_nm: Vec<f64>,
    /// 100 ‖e_j‖/‖τ_j‖ per joint, percent.
    pub relative_percent: Vec<f64>,
    /// The paper's (21): √(eᵀe)/m, e over all joints, m time samples. Not an rms: it shrinks with
    /// the length of the record.
    pub e_n: f64,
}

impl Residual {
    /// From ‖e_j‖² and ‖τ_j‖² over `samples` time samples.
    pub fn from_squares(residual: &[f64], torque: &[f64], samples: usize) -> Self {
        let m = samples as f64;
        let pairs = residual.iter().zip(torque);
        Self {
            rms_nm: residual.iter().map(|e| (e / m).sqrt()).collect(),
            torque_rms_nm: torque.iter().map(|t| (t / m).sqrt()).collect(),
            relative_percent: pairs.map(|(e, t)| 100.0 * (e / t).sqrt()).collect(),
            e_n: residual.iter().sum::<f64>().sqrt() / m,
        }
    }

    /// From the samples of `error_nm` and `torque_nm` (same shape) for which `counts(joint, sample)` holds.
    pub fn of(
        error_nm: &JointSignals,
        torque_nm: &JointSignals,
        counts: impl Fn(usize, usize) -> bool,
    ) -> Self {
        let (n, samples) = (error_nm.joints(), error_nm.samples());
        let [mut rms_nm, mut torque_rms_nm] = [(); 2].map(|()| Vec::with_capacity(n));
        let mut relative_percent = Vec::with_capacity(n);
        let mut all = 0.0;
        for j in 0..n {
            let mut squares = [0.0; 2];
            let mut counted = 0usize;
            for k in (0..samples).filter(|&k| counts(j, k)) {
                squares[0] += error_nm.joint(j)[k].powi(2);
                squares[1] += torque_nm.joint(j)[k].powi(2);
                counted += 1;
            }
            rms_nm.push((squares[0] / counted as f64).sqrt());
            torque_rms_nm.push((squares[1] / counted as f64).sqrt());
            relative_percent.push(100.0 * (squares[0] / squares[1]).sqrt());
            all += squares[0];
        }
        Self { rms_nm, torque_rms_nm, relative_percent, e_n: all.sqrt() / samples as f64 }
    }
}
