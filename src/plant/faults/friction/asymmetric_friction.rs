//! Friction that differs between the directions.

use serde::{Deserialize, Serialize};

use super::super::assembly::Assembly;
use super::super::effect::{Complaint, Fault, finite};

/// Friction that differs between the two directions: rc + a and rv + b for positive speed, rc − a and rv − b for
/// negative speed. At standstill, where dry friction has no direction, the asymmetric part vanishes too.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AsymmetricFriction {
    /// Joint, from 1.
    pub joint: usize,
    /// a: half of the difference of Coulomb friction between the directions, Nm.
    pub coulomb_nm: f64,
    /// b: half of the difference of viscous friction between the directions, Nm s/rad.
    pub viscous_nm_s_rad: f64,
}

impl Fault for AsymmetricFriction {
    fn joint(&self) -> Option<usize> {
        Some(self.joint)
    }

    fn check(&self) -> Result<(), Complaint> {
        finite("coulomb_nm", self.coulomb_nm)?;
        finite("viscous_nm_s_rad", self.viscous_nm_s_rad)
    }

    fn install(&self, assembly: &mut Assembly) -> Result<(), Complaint> {
        let friction = &mut assembly.joint(self.joint).friction;
        friction.asymmetric_nm += self.coulomb_nm;
        friction.asymmetric_nm_s_rad += self.viscous_nm_s_rad;
        Ok(())
    }
}
