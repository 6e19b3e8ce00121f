//! Friction that builds up over an angle, by bristles.

use serde::{Deserialize, Serialize};

use super::super::assembly::Assembly;
use super::super::effect::{Complaint, Fault, not_negative, positive, require};

/// Dry friction that builds up over an angle instead of at once: τ = c (z + T ż) with ż = k (q̇ − |q̇| z), in place of
/// c tanh(q̇/ε); the damping c T ż leaves out friction that grows with load. Without damping (T = 0) this is Dahl's
/// model (1968).
///
/// On a joint with Stribeck friction d(q̇), the bristle holds the curve: it comes to rest at ±γ = ±(1 + d(q̇)/rc), by
/// ż = k (q̇ − |q̇| z/γ), and the direction of dry friction is z/γ. With Coulomb, viscous and Stribeck friction alone,
/// this is LuGre's model (Canudas de Wit et al. 1995), τ = rc (z + T ż) + rv q̇, whose σ₀ is rc k, σ₁ rc k T and σ₂ rv.
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

    /// T ż for the `direction` z/γ: the damping torque over rc.
    #[inline]
    pub(super) fn damping(&self, qd_rad_s: f64, direction: f64) -> f64 {
        self.damping_s * self.stiffness_per_rad * (qd_rad_s - qd_rad_s.abs() * direction)
    }

    /// ż = k (q̇ − |q̇| z/γ), 1/s, which is a decay towards ±γ, where the bristle is at `rest`, at the rate k |q̇|/γ.
    /// The rate is limited to `fastest_per_s`.
    #[inline]
    pub(super) fn bristle_rate(
        &self,
        qd_rad_s: f64,
        rest: f64,
        fastest_per_s: f64,
        bristle: f64,
    ) -> f64 {
        let decay_per_s = (self.stiffness_per_rad * qd_rad_s.abs() / rest).min(fastest_per_s);
        decay_per_s * (rest * qd_rad_s.signum() - bristle)
    }
}

/// Fastest decay of bristles of the stiffness k that matters, 1/s, for a joint that starts at rest with an acceleration
/// of at most a. When the joint has moved by d after a reversal, its speed is at most √(2 a d), and the deviation of
/// the bristle has shrunk to e^(−k d). The bristle has therefore completed its reversal (k d = 18) before the decay
/// rate k q̇ exceeds √(2 a k · 18). From then on it stays where it rests, and the rate has no effect; where a curve
/// changes that rest, the bristle then follows it by a little more than it would (0.002 in place of 0.0014 of Coulomb
/// friction, for k of 10 000 /rad and a curve of 0.4 that falls within 0.2 rad/s, along 11 rad/s²).
pub(super) fn fastest_turn_per_s(stiffness_per_rad: f64, acceleration_rad_s2: f64) -> f64 {
    (2.0 * acceleration_rad_s2 * stiffness_per_rad * TURNED_ROUND).sqrt()
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
        let friction = &mut assembly.joint(self.joint).friction;
        let present = friction.presliding.replace(*self).is_some();
        require(!present, "joint", self.joint as f64, "has presliding already")
    }
}

#[cfg(test)]
mod tests {
    use super::super::{Fall, Friction, Stribeck};
    use super::*;

    /// The bristle with a Stribeck curve against LuGre's own equations, σ₀ ż = σ₀ (q̇ − σ₀ |q̇| z/g), τ = σ₀ z + σ₁ ż +
    /// σ₂ q̇, along q̇ = 0.3 sin 5t: both integrated by Euler's method, in which they are the same up to rounding.
    #[test]
    fn bristles_that_hold_a_curve_are_those_of_lugre() {
        let drive = crate::robot::Arm::built_in("ur5").unwrap().joints[0].drive;
        let (k, damping_s, extra_nm, vs_rad_s) = (800.0, 0.004, 2.5, 0.05);
        let (rc, rv) = (drive.coulomb_nm, drive.viscous_nm_s_rad);
        let friction = Friction {
            stribeck: vec![Stribeck {
                joint: 1,
                extra_nm,
                vs_rad_s,
                exponent: 2,
                fall: Fall::Exponential,
            }],
            presliding: Some(Presliding { damping_s, ..Presliding::new(1, k) }),
            ..Friction::nominal(&drive, 0.02)
        };
        let (sigma0, sigma1) = (rc * k, rc * k * damping_s);
        let step_s = 1e-5;
        let (mut bristle, mut z, mut most_nm) = (0.0, 0.0, 0.0_f64);
        for step in 0..200_000 {
            let v = 0.3 * (5.0 * step as f64 * step_s).sin();
            let g = rc + extra_nm * (-(v / vs_rad_s).powi(2)).exp();
            let rate = v - sigma0 * v.abs() * z / g;
            let lugre_nm = sigma0 * z + sigma1 * rate + rv * v;
            let torque_nm = friction.torque_nm(0.0, v, Some(bristle), 0.0, 0.0);
            // Rounding of numbers of some 10 Nm; what is left of earlier steps decays with the bristle.
            assert!((torque_nm - lugre_nm).abs() < 1e-11, "{step}: {torque_nm} {lugre_nm}");
            z += step_s * rate;
            bristle += step_s * friction.bristle_rate(v, f64::INFINITY, bristle);
            most_nm = most_nm.max((torque_nm - rv * v).abs());
        }
        // It was on the curve, above Coulomb friction.
        assert!(most_nm > rc + 0.3 * extra_nm, "{most_nm}");
    }

    /// After a reversal, q = a t²/2, the bristle moves from −1 to 1 as 1 − 2 e^(−k q), even though its decay rate is
    /// limited.
    #[test]
    fn a_bristle_turns_round_as_if_no_decay_were_too_fast() {
        let (presliding, a) = (Presliding::new(1, 1e4), 20.0);
        let fastest = fastest_turn_per_s(presliding.stiffness_per_rad, a);
        let step_s = 1e-6;
        let (mut z, mut worst) = (-1.0, 0.0_f64);
        for step in 0..20_000 {
            let t = step as f64 * step_s;
            // A step of the midpoint rule.
            let half = z + 0.5 * step_s * presliding.bristle_rate(a * t, 1.0, fastest, z);
            z += step_s * presliding.bristle_rate(a * (t + 0.5 * step_s), 1.0, fastest, half);
            let q = 0.5 * a * (t + step_s).powi(2);
            worst = worst.max((z - 1.0 + 2.0 * (-1e4 * q).exp()).abs());
        }
        assert!(1e4 * a * 0.02 > fastest, "the decay was bounded");
        // The limited rate contributes 2 e^(−18) = 3e-8, the midpoint rule about 2e-8.
        assert!(worst < 4e-8, "{worst}");
    }
}
