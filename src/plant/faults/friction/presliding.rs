//! Friction that builds up over an angle, by bristles.

use serde::{Deserialize, Serialize};

use super::super::assembly::Assembly;
use super::super::effect::{Complaint, Fault, not_negative, positive, require};

/// Dry friction that builds up over an angle instead of at once: τ = c (z + T ż) with ż = k (q̇ − |q̇| z), in place of
/// c tanh(q̇/ε); the damping c T ż leaves out friction that grows with load. Without damping (T = 0) this is Dahl's model
/// (1968), with it the bristles of LuGre's (Canudas de Wit et al. 1995), whose σ₀ is c k, σ₁ is c k T and σ₂ the joint's
/// viscous friction.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Presliding {
    /// Joint, from 1.
    pub joint: usize,
    /// k: inverse of the angle over which friction reverses, 1/rad.
    pub stiffness_per_rad: f64,
    /// T: damping of the bristles over their stiffness, s. Default 0.
    #[serde(default)]
    pub damping_s: f64,
}

/// Exponent after which a bristle counts as reversed: the remaining deviation is then e⁻¹⁸ = 1.5e-8.
const TURNED_ROUND: f64 = 18.0;

impl Presliding {
    /// Undamped bristles.
    pub fn new(joint: usize, stiffness_per_rad: f64) -> Self {
        Self { joint, stiffness_per_rad, damping_s: 0.0 }
    }

    /// T ż: the damping torque over the level of dry friction.
    #[inline]
    pub(super) fn damping(&self, qd_rad_s: f64, bristle: f64) -> f64 {
        self.damping_s * self.stiffness_per_rad * (qd_rad_s - qd_rad_s.abs() * bristle)
    }

    /// ż = k (q̇ − |q̇| z), 1/s, which is a decay towards ±1 at the rate k |q̇|. The rate is limited to
    /// `fastest_per_s`.
    #[inline]
    pub(in super::super) fn bristle_rate(
        &self,
        qd_rad_s: f64,
        fastest_per_s: f64,
        bristle: f64,
    ) -> f64 {
        let decay_per_s = (self.stiffness_per_rad * qd_rad_s.abs()).min(fastest_per_s);
        decay_per_s * (qd_rad_s.signum() - bristle)
    }

    /// Fastest decay of the bristle that matters, 1/s, for a joint that starts at rest with an acceleration of at most
    /// a. When the joint has moved by d after a reversal, its speed is at most √(2 a d), and the deviation of the
    /// bristle has shrunk to e^(−k d). The bristle has therefore completed its reversal (k d = 18) before the decay
    /// rate k q̇ exceeds √(2 a k · 18). From then on it stays at ±1, where the rate has no effect.
    pub(in super::super) fn fastest_turn_per_s(&self, acceleration_rad_s2: f64) -> f64 {
        (2.0 * acceleration_rad_s2 * self.stiffness_per_rad * TURNED_ROUND).sqrt()
    }
}

impl Fault for Presliding {
    fn joint(&self) -> Option<usize> {
        Some(self.joint)
    }

    fn check(&self) -> Result<(), Complaint> {
        positive("stiffness_per_rad", self.stiffness_per_rad)?;
        not_negative("damping_s", self.damping_s)
    }

    fn install(&self, assembly: &mut Assembly) -> Result<(), Complaint> {
        let present = assembly.joint(self.joint).friction.presliding.replace(*self).is_some();
        require(!present, "joint", self.joint as f64, "has presliding already")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// After a reversal, q = a t²/2, the bristle moves from −1 to 1 as 1 − 2 e^(−k q), even though its decay rate is
    /// limited.
    #[test]
    fn a_bristle_turns_round_as_if_no_decay_were_too_fast() {
        let (presliding, a) = (Presliding::new(1, 1e4), 20.0);
        let fastest = presliding.fastest_turn_per_s(a);
        let step_s = 1e-6;
        let (mut z, mut worst) = (-1.0, 0.0_f64);
        for step in 0..20_000 {
            let t = step as f64 * step_s;
            // A step of the midpoint rule.
            let half = z + 0.5 * step_s * presliding.bristle_rate(a * t, fastest, z);
            z += step_s * presliding.bristle_rate(a * (t + 0.5 * step_s), fastest, half);
            let q = 0.5 * a * (t + step_s).powi(2);
            worst = worst.max((z - 1.0 + 2.0 * (-1e4 * q).exp()).abs());
        }
        assert!(1e4 * a * 0.02 > fastest, "the decay was bounded");
        // The limited rate contributes 2 e^(−18) = 3e-8, the midpoint rule about 2e-8.
        assert!(worst < 4e-8, "{worst}");
    }
}
