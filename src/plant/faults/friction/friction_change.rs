//! Friction with other coefficients than assumed.

use serde::{Deserialize, Serialize};

use super::super::assembly::Assembly;
use super::super::effect::{Complaint, Fault, finite, not_negative};

/// Friction of the nominal form but with other coefficients than the controller and the nominal simulation assume:
/// rc + a and rv + b.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FrictionChange {
    /// Joint, from 1.
    pub joint: usize,
    /// a, Nm.
    pub coulomb_nm: f64,
    /// b, Nm s/rad.
    pub viscous_nm_s_rad: f64,
}

impl Fault for FrictionChange {
    fn joint(&self) -> Option<usize> {
        Some(self.joint)
    }

    fn check(&self) -> Result<(), Complaint> {
        finite("coulomb_nm", self.coulomb_nm)?;
        finite("viscous_nm_s_rad", self.viscous_nm_s_rad)
    }

    fn install(&self, assembly: &mut Assembly) -> Result<(), Complaint> {
        let friction = &mut assembly.joint(self.joint).friction;
        friction.coulomb_nm += self.coulomb_nm;
        friction.viscous_nm_s_rad += self.viscous_nm_s_rad;
        not_negative("coulomb_nm", friction.coulomb_nm)?;
        not_negative("viscous_nm_s_rad", friction.viscous_nm_s_rad)
    }
}
