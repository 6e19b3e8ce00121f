//! Friction that grows with the load of the gear.

use serde::{Deserialize, Serialize};

use super::super::assembly::Assembly;
use super::super::effect::{Complaint, Fault, require};

/// Dry friction that grows with the load: c = rc + μ |L|, with L the torque that the gear's output transmits to the
/// link (the torque that accelerates the rotor is not part of it). In a rigid gear, L depends on the acceleration and
/// the acceleration depends on friction: both are solved for together in every stage.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LoadFriction {
    /// Joint, from 1.
    pub joint: usize,
    /// μ: friction per gear torque, from 0 to 0.5.
    pub mu: f64,
}

impl Fault for LoadFriction {
    fn joint(&self) -> Option<usize> {
        Some(self.joint)
    }

    fn check(&self) -> Result<(), Complaint> {
        require((0.0..=0.5).contains(&self.mu), "mu", self.mu, "must be between 0 and 0.5")
    }

    fn install(&self, assembly: &mut Assembly) -> Result<(), Complaint> {
        assembly.require_torque_limit(self.joint - 1)?;
        let friction = &mut assembly.joint(self.joint).friction;
        friction.mu += self.mu;
        require(friction.mu <= 0.5, "mu", friction.mu, "must not sum to more than 0.5 on a joint")?;
        friction.check_load()
    }
}
