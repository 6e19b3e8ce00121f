//! What laws that were found on a joint say about its friction, as far as other laws of the joint depend on it: all of its
//! friction warms up, all of it turns round over the same range of speeds, and bristles hold its Stribeck curve.

use crate::diagnose::bristles::Bristles;

/// Width of the sharpest law whose reversal is simulated, as a share of that of the robot's file.
pub const SHARPEST: f64 = 0.05;

/// How dry friction turns round.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Turn {
    /// Range of speeds w of tanh(q̇/w), rad/s.
    pub width_rad_s: f64,
    /// Share of dry friction that the drive feeds forward meanwhile, with the width of the robot's file.
    pub fed: f64,
}

/// Friction of one joint as far as it is not Coulomb and viscous friction that turns round as in the robot's file.
#[derive(Debug, Clone)]
pub struct OtherFriction {
    /// `None`: as in the robot's file, with the drive's answer that the log tells.
    pub turn: Option<Turn>,
    /// Bristles, which hold the friction near rest of other laws.
    pub bristles: Option<Bristles>,
    /// Torque of the other laws at the samples, as logged, Nm; empty if there are none.
    pub torque_nm: Vec<f64>,
    /// Mean over the log of the factor by which friction has changed since it began.
    pub warm: f64,
}

impl Default for OtherFriction {
    fn default() -> Self {
        Self { turn: None, bristles: None, torque_nm: Vec::new(), warm: 1.0 }
    }
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
