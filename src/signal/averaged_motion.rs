//! What is known of a motion whose periods were averaged.

use crate::robot::JointSignals;

/// One period of a motion with its derivatives, and how well they are known.
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
}

/// Mean squares of harmonics 1, 2, … of a joint's averaged acceleration, rad²/s⁴.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct HarmonicPower {
    /// Of the estimate.
    pub estimate: Vec<f64>,
    /// Of the noise in it: 2(hω)⁴ v_h.
    pub noise: Vec<f64>,
}
