//! Extra friction near standstill that falls with speed.

use serde::{Deserialize, Serialize};

use super::super::assembly::Assembly;
use super::super::effect::{Complaint, Fault, finite, positive, require};

/// Extra dry friction near standstill: c = rc + d exp(−|q̇/v_s|ⁿ) (Bo and Pavelescu 1982; exponent 2
/// as in Armstrong-Hélouvry, Dupont, Canudas de Wit 1994, 1 as in Tustin 1947).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stribeck {
    /// Joint, from 1.
    pub joint: usize,
    /// d: static minus Coulomb friction, Nm.
    pub extra_nm: f64,
    /// v_s, rad/s.
    pub vs_rad_s: f64,
    /// n: 1 or 2. Default 2.
    #[serde(default = "gaussian")]
    pub exponent: i32,
}

fn gaussian() -> i32 {
    2
}

impl Stribeck {
    /// Steepest slope of d exp(−|q̇/v_s|ⁿ): √(2/e) d/v_s at v_s/√2 for n = 2, and d/v_s at rest for n = 1.
    pub(super) fn steepest_nm_s_rad(&self) -> f64 {
        let shape = if self.exponent == 1 { 1.0 } else { (2.0 / std::f64::consts::E).sqrt() };
        shape * self.extra_nm.abs() / self.vs_rad_s
    }
}

impl Fault for Stribeck {
    fn joint(&self) -> Option<usize> {
        Some(self.joint)
    }

    fn check(&self) -> Result<(), Complaint> {
        finite("extra_nm", self.extra_nm)?;
        positive("vs_rad_s", self.vs_rad_s)?;
        let ok = (1..=2).contains(&self.exponent);
        require(ok, "exponent", f64::from(self.exponent), "must be 1 or 2")
    }

    fn install(&self, assembly: &mut Assembly) -> Result<(), Complaint> {
        assembly.joint(self.joint).friction.stribeck.push(*self);
        Ok(())
    }
}
