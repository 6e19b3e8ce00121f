//! Friction that depends on the angle.

use serde::{Deserialize, Serialize};

use super::super::assembly::Assembly;
use super::super::effect::{Complaint, Fault, finite};

/// Dry friction that varies over a turn, c = rc + P cos(q + ψ), because a gear or seal is not round.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PositionFriction {
    /// Joint, from 1.
    pub joint: usize,
    /// Amplitude P, Nm.
    pub amplitude_nm: f64,
    /// Phase ψ, rad.
    pub phase_rad: f64,
}

impl Fault for PositionFriction {
    fn joint(&self) -> Option<usize> {
        Some(self.joint)
    }

    fn check(&self) -> Result<(), Complaint> {
        finite("amplitude_nm", self.amplitude_nm)?;
        finite("phase_rad", self.phase_rad)
    }

    fn install(&self, assembly: &mut Assembly) -> Result<(), Complaint> {
        assembly.joint(self.joint).friction.positions.push(*self);
        Ok(())
    }
}
