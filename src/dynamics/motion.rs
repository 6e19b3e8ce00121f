//! A motion of the arm sampled in time.

use crate::robot::JointSignals;

/// Angles, velocities and accelerations of all joints at the same instants.
#[derive(Debug, Clone, PartialEq)]
pub struct Motion {
    /// Joint angles, rad.
    pub q_rad: JointSignals,
    /// Joint velocities, rad/s.
    pub qd_rad_s: JointSignals,
    /// Joint accelerations, rad/s².
    pub qdd_rad_s2: JointSignals,
}

impl Motion {
    /// All joints at zero, not moving.
    pub fn at_rest(joints: usize, samples: usize) -> Self {
        let zeros = JointSignals::zeros(joints, samples);
        Self { q_rad: zeros.clone(), qd_rad_s: zeros.clone(), qdd_rad_s2: zeros }
    }

    /// Number of samples.
    pub fn samples(&self) -> usize {
        self.q_rad.samples()
    }

    /// Number of joints.
    pub fn joints(&self) -> usize {
        self.q_rad.joints()
    }

    /// The samples `range`.
    pub fn slice(&self, range: std::ops::Range<usize>) -> Self {
        Self {
            q_rad: self.q_rad.slice(range.clone()),
            qd_rad_s: self.qd_rad_s.slice(range.clone()),
            qdd_rad_s2: self.qdd_rad_s2.slice(range),
        }
    }
}
