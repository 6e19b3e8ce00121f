//! What laws that were found on a joint say about its friction, as far as other laws of the joint depend on it: all of its
//! friction warms up, and all of it turns round over the same range of speeds.

/// Friction of one joint as far as it is not Coulomb and viscous friction of the usual width.
#[derive(Debug, Clone, Default)]
pub struct OtherFriction {
    /// Speed over which dry friction turns round, rad/s; `None`: as in the robot's file.
    pub width_rad_s: Option<f64>,
    /// Torque of the other laws at the samples, as logged, Nm; empty if there are none.
    pub torque_nm: Vec<f64>,
}

impl OtherFriction {
    /// Adds the torque `b` times `more`.
    pub fn add(&mut self, more: &[f64], b: f64) {
        self.torque_nm.resize(more.len(), 0.0);
        self.torque_nm.iter_mut().zip(more).for_each(|(sum, more)| *sum += b * more);
    }

    /// Torque of the other laws at sample `k`, Nm.
    pub fn at(&self, k: usize) -> f64 {
        self.torque_nm.get(k).copied().unwrap_or(0.0)
    }
}
