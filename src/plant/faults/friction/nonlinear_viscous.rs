//! Viscous friction that is curved in speed.

use serde::{Deserialize, Serialize};

use super::super::assembly::Assembly;
use super::super::effect::{Complaint, Fault, finite, require};

/// Viscous friction that is not proportional to speed, by the additional term A |q̇/(1 rad/s)|ᵖ sign q̇. The law is
/// concave for A > 0 with p < 1 (thinning grease) and for A < 0 with p > 1, and convex otherwise.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NonlinearViscous {
    /// Joint, from 1.
    pub joint: usize,
    /// A: deviation from the linear law at 1 rad/s, Nm.
    pub amplitude_nm: f64,
    /// Exponent p, above 0 and up to 4.
    pub exponent: f64,
}

impl Fault for NonlinearViscous {
    fn joint(&self) -> Option<usize> {
        Some(self.joint)
    }

    fn check(&self) -> Result<(), Complaint> {
        finite("amplitude_nm", self.amplitude_nm)?;
        let ok = self.exponent > 0.0 && self.exponent <= 4.0;
        require(ok, "exponent", self.exponent, "must be above 0 and at most 4")
    }

    fn install(&self, assembly: &mut Assembly) -> Result<(), Complaint> {
        assembly.joint(self.joint).friction.powers.push(*self);
        Ok(())
    }
}
