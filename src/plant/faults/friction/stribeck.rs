//! Extra friction near standstill that falls with speed.

use serde::{Deserialize, Serialize};

use super::super::assembly::Assembly;
use super::super::effect::{Complaint, Fault, finite, positive, require};

/// Extra dry friction near standstill: c = rc + d exp(−|q̇/v_s|ⁿ) (Bo and Pavelescu 1982; exponent 2
/// as in Armstrong-Hélouvry, Dupont, Canudas de Wit 1994, 1 as in Tustin 1947), or c = rc + d/(1 + |q̇/v_s|ⁿ) (exponent
/// 2: Hess and Soom 1990). With presliding on the same joint, its bristles hold the curve
/// ([`Presliding`](super::Presliding)).
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
    /// How friction falls. Default: exponentially.
    #[serde(default)]
    pub fall: Fall,
}

/// How Stribeck friction falls with speed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Fall {
    /// exp(−|q̇/v_s|ⁿ).
    #[default]
    Exponential,
    /// 1/(1 + |q̇/v_s|ⁿ).
    Rational,
}

fn gaussian() -> i32 {
    2
}

impl Stribeck {
    /// The extra friction, Nm.
    #[inline]
    pub(super) fn level_nm(&self, qd_rad_s: f64) -> f64 {
        let x = (qd_rad_s / self.vs_rad_s).abs().powi(self.exponent);
        match self.fall {
            Fall::Exponential => self.extra_nm * (-x).exp(),
            Fall::Rational => self.extra_nm / (1.0 + x),
        }
    }

    /// Steepest slope. For n = 1 it is d/v_s at rest; for n = 2, √(2/e) d/v_s at v_s/√2, and 3 √3/8 d/v_s at v_s/√3.
    pub(super) fn steepest_nm_s_rad(&self) -> f64 {
        let shape = match (self.exponent, self.fall) {
            (1, _) => 1.0,
            (_, Fall::Exponential) => (2.0 / std::f64::consts::E).sqrt(),
            (_, Fall::Rational) => 0.375 * 3f64.sqrt(),
        };
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
