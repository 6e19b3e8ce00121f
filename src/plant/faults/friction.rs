//! Friction of a joint, and all effects by which it can deviate from its nominal model.

use serde::{Deserialize, Serialize};

use super::assembly::Assembly;
use super::effect::{Complaint, Fault, finite, not_negative, positive, require};
use crate::robot::Drive;

/// Largest warmth Θ for which friction is checked and steps are chosen. Θ is the power lost over its mean along the
/// motion, averaged over the memory T: about 1 once warm, and above 2 only where the motion pauses for longer than T.
const WARMEST: f64 = 2.0;
/// Largest load-dependent friction of a warm gear: the factor by which errors of the load fall in an iteration.
const MOST_WARM_MU: f64 = 0.65;

/// Friction torque of one joint on the motor side of its gear:
///
/// ```text
/// τ_f = (1 + φ Θ) · [ rv q̇ + c(q, q̇, L) z + Σ A |q̇|ᵖ s + a z² + b |q̇| ]
/// c   = rc + Σ d exp(−|q̇/v_s|ⁿ) + Σ P cos(q + ψ) + μ |L|
/// s   = tanh(q̇/ε);   z = s, or the bristle's state with presliding, whose damping adds (c − μ |L|) T ż
/// ```
#[derive(Debug, Clone)]
pub(super) struct Friction {
    epsilon_rad_s: f64,
    viscous_nm_s_rad: f64,
    coulomb_nm: f64,
    stribeck: Vec<Stribeck>,
    powers: Vec<NonlinearViscous>,
    asymmetric_nm: f64,
    asymmetric_nm_s_rad: f64,
    positions: Vec<PositionFriction>,
    /// Coefficient μ of the load-dependent part.
    pub(super) mu: f64,
    /// Presliding by bristles, if any.
    pub(super) presliding: Option<Presliding>,
    /// Thermal drift, if any.
    pub(super) thermal: Option<ThermalDrift>,
}

impl Friction {
    /// Friction by the paper's (2) and (3), with the drive's own rv and rc.
    pub(super) fn nominal(drive: &Drive, epsilon_rad_s: f64) -> Self {
        Self {
            epsilon_rad_s,
            viscous_nm_s_rad: drive.viscous_nm_s_rad,
            coulomb_nm: drive.coulomb_nm,
            stribeck: Vec::new(),
            powers: Vec::new(),
            asymmetric_nm: 0.0,
            asymmetric_nm_s_rad: 0.0,
            positions: Vec::new(),
            mu: 0.0,
            presliding: None,
            thermal: None,
        }
    }

    /// τ_f, Nm, for the motor's angle and speed, the state of the bristle (if there is one), the warmth Θ and the
    /// torque L at the output of the gear.
    #[inline]
    pub(super) fn torque_nm(
        &self,
        q_rad: f64,
        qd_rad_s: f64,
        bristle: Option<f64>,
        warmth: f64,
        load_nm: f64,
    ) -> f64 {
        let sign = (qd_rad_s / self.epsilon_rad_s).tanh();
        let direction = bristle.unwrap_or(sign);
        let damping = match (&self.presliding, bristle) {
            (Some(presliding), Some(bristle)) => presliding.damping(qd_rad_s, bristle),
            _ => 0.0,
        };
        let level = self.level_nm(q_rad, qd_rad_s, load_nm);
        let speed = qd_rad_s.abs();
        // Damping that grew with the load would make the load iteration diverge.
        let unloaded = level - self.mu * load_nm.abs();
        let mut torque = self.viscous_nm_s_rad * qd_rad_s + level * direction + unloaded * damping;
        torque += self.asymmetric_nm * direction * direction + self.asymmetric_nm_s_rad * speed;
        for power in &self.powers {
            torque += power.amplitude_nm * speed.powf(power.exponent) * sign;
        }
        torque * self.warm(warmth)
    }

    /// Friction at the warmth Θ over friction when cold, 1 + φ Θ.
    #[inline]
    fn warm(&self, warmth: f64) -> f64 {
        1.0 + self.thermal.as_ref().map_or(0.0, |thermal| thermal.fraction * warmth)
    }

    /// Refuses load-dependent friction that is too strong, once warm, for the loads of the gears to be found by
    /// iteration.
    fn check_load(&self) -> Result<(), Complaint> {
        let mu = self.mu * self.warm(WARMEST).max(1.0);
        require(mu <= MOST_WARM_MU, "mu", mu, "of warm friction must not be above 0.65")
    }

    /// The level c of dry friction, Nm.
    #[inline]
    fn level_nm(&self, q_rad: f64, qd_rad_s: f64, load_nm: f64) -> f64 {
        let mut level = self.coulomb_nm + self.mu * load_nm.abs();
        for part in &self.stribeck {
            level += part.extra_nm * (-(qd_rad_s / part.vs_rad_s).abs().powi(part.exponent)).exp();
        }
        for part in &self.positions {
            level += part.amplitude_nm * (q_rad + part.phase_rad).cos();
        }
        level
    }

    /// Power lost at `qd_rad_s` under the nominal law, W.
    pub(super) fn nominal_power_w(&self, qd_rad_s: f64) -> f64 {
        let sign = (qd_rad_s / self.epsilon_rad_s).tanh();
        (self.viscous_nm_s_rad * qd_rad_s + self.coulomb_nm * sign) * qd_rad_s
    }

    /// First of a series of speeds up to `largest_rad_s` at which friction would drive the joint instead of slowing it,
    /// with the friction torque there, Nm.
    pub(super) fn first_driving(&self, largest_rad_s: f64) -> Option<(f64, f64)> {
        const SPEEDS: i32 = 48;
        let wave: f64 = self.positions.iter().map(|p| p.amplitude_nm.abs()).sum();
        let unphased = Self { positions: Vec::new(), ..self.clone() };
        (0..SPEEDS)
            .map(|k| largest_rad_s * 0.8_f64.powi(k))
            .flat_map(|speed| [speed, -speed])
            .find_map(|v| {
                let sign = (v / self.epsilon_rad_s).tanh();
                // Warm friction has the sign of cold friction.
                let torque = unphased.torque_nm(0.0, v, None, 0.0, 0.0) - wave * sign;
                (torque * v < 0.0).then_some((v, torque))
            })
    }

    /// Upper bounds of the slopes of friction at speeds up to `largest_rad_s` and gear loads up to `load_nm`: dτ_f/dq̇,
    /// Nm s/rad, and dτ_f/dq of the bristles, Nm/rad.
    pub(super) fn slopes(&self, largest_rad_s: f64, load_nm: f64) -> (f64, f64) {
        // Without load-dependent friction the load does not matter, even if it is infinite.
        let loaded = if self.mu == 0.0 { 0.0 } else { self.mu * load_nm };
        let stribeck_nm = self.stribeck.iter().map(|p| p.extra_nm.abs()).sum::<f64>();
        let level = self.coulomb_nm
            + loaded
            + stribeck_nm
            + self.positions.iter().map(|p| p.amplitude_nm.abs()).sum::<f64>();
        let power = |p: &NonlinearViscous| {
            // The slope of |v|ᵖ tanh(v/ε) is at most p vᵖ⁻¹ for p ≥ 1, and about εᵖ⁻¹ near standstill for p < 1.
            let at = if p.exponent < 1.0 { self.epsilon_rad_s } else { largest_rad_s };
            p.amplitude_nm.abs() * p.exponent.max(1.0) * at.powf(p.exponent - 1.0)
        };
        let mut smooth = self.viscous_nm_s_rad
            + self.asymmetric_nm_s_rad.abs()
            + self.powers.iter().map(power).sum::<f64>();
        let mut bristles = 0.0;
        match &self.presliding {
            // The law is c (z + T ż) + a z² with |z| ≤ 1 and |ż| ≤ 2 k |q̇|. The Stribeck part of c depends on the speed
            // for any z, with |q̇ dc/dq̇| ≤ d. `bristles` is the stiffness of the oscillator of joint and bristle, from which
            // the terms in T cancel.
            Some(presliding) => {
                let Presliding { stiffness_per_rad, damping_s, .. } = *presliding;
                bristles = (level + 2.0 * self.asymmetric_nm.abs()) * stiffness_per_rad;
                smooth += self.stribeck.iter().map(Stribeck::steepest_nm_s_rad).sum::<f64>()
                    + 2.0 * damping_s * stiffness_per_rad * (level + stribeck_nm);
            }
            None => smooth += (level + self.asymmetric_nm.abs()) / self.epsilon_rad_s,
        }
        let warm = self.warm(WARMEST).max(1.0);
        (smooth * warm, bristles * warm)
    }
}

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
    fn steepest_nm_s_rad(&self) -> f64 {
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

/// Dry friction that builds up over an angle instead of at once: τ = c (z + T ż), c without load in the damping, with ż = k (q̇ − |q̇| z), in place of
/// c tanh(q̇/ε). Without damping (T = 0) this is Dahl's model (1968), with it the bristles of LuGre's (Canudas de Wit et al.
/// 1995), whose σ₀ is c k, σ₁ is c k T and σ₂ the joint's viscous friction.
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
    fn damping(&self, qd_rad_s: f64, bristle: f64) -> f64 {
        self.damping_s * self.stiffness_per_rad * (qd_rad_s - qd_rad_s.abs() * bristle)
    }

    /// ż = k (q̇ − |q̇| z), 1/s, which is a decay towards ±1 at the rate k |q̇|. The rate is limited to
    /// `fastest_per_s`.
    #[inline]
    pub(super) fn bristle_rate(&self, qd_rad_s: f64, fastest_per_s: f64, bristle: f64) -> f64 {
        let decay_per_s = (self.stiffness_per_rad * qd_rad_s.abs()).min(fastest_per_s);
        decay_per_s * (qd_rad_s.signum() - bristle)
    }

    /// Fastest decay of the bristle that matters, 1/s, for a joint that starts at rest with an acceleration of at most
    /// a. When the joint has moved by d after a reversal, its speed is at most √(2 a d), and the deviation of the
    /// bristle has shrunk to e^(−k d). The bristle has therefore completed its reversal (k d = 18) before the decay
    /// rate k q̇ exceeds √(2 a k · 18). From then on it stays at ±1, where the rate has no effect.
    pub(super) fn fastest_turn_per_s(&self, acceleration_rad_s2: f64) -> f64 {
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

/// Dry friction that reverses over another range of speeds than the robot file says: tanh(q̇/w) in place of tanh(q̇/ε).
/// The controller feeds forward the friction of the file.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReversalWidth {
    /// Joint, from 1; if left out, all joints.
    pub joint: Option<usize>,
    /// Width w, rad/s.
    pub width_rad_s: f64,
}

impl Fault for ReversalWidth {
    fn joint(&self) -> Option<usize> {
        self.joint
    }

    fn check(&self) -> Result<(), Complaint> {
        positive("width_rad_s", self.width_rad_s)
    }

    fn install(&self, assembly: &mut Assembly) -> Result<(), Complaint> {
        for j in assembly.indices(self.joint) {
            assembly.joints[j].friction.epsilon_rad_s = self.width_rad_s;
        }
        Ok(())
    }
}

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

    /// Central differences of the law over all speeds and states of the bristle reach the bounds, which are sharp where
    /// the steepest parts coincide, but do not exceed them (with h = 1e-6, to 1e-6 of the bounds).
    #[test]
    fn slopes_beside_presliding_are_bounds() {
        let drive = crate::robot::Arm::built_in("ur5").unwrap().joints[0].drive;
        for (exponent, damping_s) in [(1, 0.0), (2, 0.0), (2, 0.01)] {
            let friction = Friction {
                stribeck: vec![Stribeck { joint: 1, extra_nm: 2.0, vs_rad_s: 0.01, exponent }],
                asymmetric_nm: 1.5,
                presliding: Some(Presliding { damping_s, ..Presliding::new(1, 1e3) }),
                ..Friction::nominal(&drive, 0.02)
            };
            let torque = |speed: f64, z: f64| friction.torque_nm(0.0, speed, Some(z), 0.0, 0.0);
            let h = 1e-6;
            let (mut by_speed, mut by_angle) = (0.0_f64, 0.0_f64);
            for (k, z) in (0..1000).flat_map(|k| [-1.0, 0.0, 1.0].map(|z| (k, z))) {
                let speed = 1e-4 * f64::from(k);
                let slope = (torque(speed + h, z) - torque(speed - h, z)) / (2.0 * h);
                by_speed = by_speed.max(slope.abs());
                let slope = (torque(speed, z + h) - torque(speed, z - h)) / (2.0 * h);
                by_angle = by_angle.max(1e3 * slope.abs());
            }
            let (smooth, bristles) = friction.slopes(1.0, 0.0);
            for (found, bound) in [(by_speed, smooth), (by_angle, bristles)] {
                let share = found / bound;
                // Damping and Stribeck's curve are steepest at different speeds.
                let sharp = if damping_s == 0.0 { 0.95 } else { 0.5 };
                assert!(share > sharp && share < 1.0 + 1e-6, "n = {exponent}: {found} {bound}");
            }
        }
    }
}
