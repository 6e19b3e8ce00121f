//! What is known of a motion whose periods were averaged.

use crate::robot::JointSignals;

/// One period of a motion with its derivatives, and how noisy the record was.
#[derive(Debug, Clone, PartialEq)]
pub struct AveragedMotion {
    /// Joint angles over one period, rad.
    pub q_rad: JointSignals,
    /// Joint velocities over one period, rad/s.
    pub qd_rad_s: JointSignals,
    /// Joint accelerations over one period, rad/s².
    pub qdd_rad_s2: JointSignals,
    /// Highest harmonic kept in the acceleration, per joint; 0 for a joint that stands still.
    pub harmonics: Vec<usize>,
    /// How well the acceleration is known, harmonic by harmonic, per joint.
    pub acceleration: Vec<HarmonicPower>,
    /// Noise of one raw sample of q, per joint, rad: rms scatter between periods.
    pub sigma_q_rad: Vec<f64>,
    /// Noise of one raw sample of q̇, per joint, rad/s.
    pub sigma_qd_rad_s: Vec<f64>,
    /// Noise left in `qdd_rad_s2`, per joint, rad/s²: √(Σ 2(hω)⁴ v_h).
    pub sigma_qdd_rad_s2: Vec<f64>,
}

/// Mean squares of harmonics 1, 2, … of a joint's averaged acceleration, rad²/s⁴.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct HarmonicPower {
    /// Of the estimate.
    pub estimate: Vec<f64>,
    /// Of the noise in it.
    pub noise: Vec<f64>,
}
