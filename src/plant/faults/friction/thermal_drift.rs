//! Friction that changes as the joint warms up.

use serde::{Deserialize, Serialize};

use super::super::assembly::Assembly;
use super::super::effect::{Complaint, Fault, positive, require};

/// Friction that changes as the joint warms up: all friction is multiplied by 1 + φ Θ. The warmth Θ is 0 at the start
/// of the run and then obeys T Θ̇ = p/p̄ − Θ, with p the present and p̄ the mean power of nominal friction along the
/// motion, so that Θ settles around 1. Because grease thins, φ is usually negative.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ThermalDrift {
    /// Joint, from 1.
    pub joint: usize,
    /// φ: relative change of friction once warm, above −0.5 and up to 1.
    pub fraction: f64,
    /// Time constant T, s.
    pub time_constant_s: f64,
}

impl Fault for ThermalDrift {
    fn joint(&self) -> Option<usize> {
        Some(self.joint)
    }

    fn check(&self) -> Result<(), Complaint> {
        positive("time_constant_s", self.time_constant_s)?;
        let ok = self.fraction > -0.5 && self.fraction <= 1.0;
        require(ok, "fraction", self.fraction, "must be above -0.5 and at most 1")
    }

    fn install(&self, assembly: &mut Assembly) -> Result<(), Complaint> {
        let friction = &mut assembly.joint(self.joint).friction;
        let present = friction.thermal.replace(*self).is_some();
        require(!present, "joint", self.joint as f64, "has a thermal drift already")?;
        friction.check_load()
    }
}
