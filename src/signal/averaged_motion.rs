//! The result of averaging the periods of a motion.

use crate::robot::JointSignals;

/// One period of a motion with its derivatives, and their accuracy.
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
    /// Accuracy of the acceleration by harmonic, per joint.
    pub acceleration: Vec<HarmonicPower>,
}

/// Mean squares of harmonics 1, 2, … of the averaged acceleration of a joint, rad²/s⁴.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct HarmonicPower {
    /// Mean square of the estimate.
    pub estimate: Vec<f64>,
    /// Mean square of the noise in the estimate: 2(hω)⁴ v_h.
    pub noise: Vec<f64>,
}
