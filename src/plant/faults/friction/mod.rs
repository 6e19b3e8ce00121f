//! Friction of a joint, and all effects by which it can deviate from its nominal model: one file per law.

mod asymmetric_friction;
mod friction_change;
mod load_friction;
mod nonlinear_viscous;
mod position_friction;
mod presliding;
mod reversal_width;
mod stribeck;
mod thermal_drift;

pub use asymmetric_friction::AsymmetricFriction;
pub use friction_change::FrictionChange;
pub use load_friction::LoadFriction;
pub use nonlinear_viscous::NonlinearViscous;
pub use position_friction::PositionFriction;
pub use presliding::Presliding;
use presliding::fastest_turn_per_s;
pub use reversal_width::ReversalWidth;
pub use stribeck::{Fall, Stribeck};
pub use thermal_drift::ThermalDrift;

use super::effect::{Complaint, require};
use crate::robot::Drive;

/// Largest warmth Θ for which friction is checked and steps are chosen. Θ is the power lost over its mean along the
/// motion, averaged over the memory T: about 1 once warm, and above 2 only where the motion pauses for longer than T.
const WARMEST: f64 = 2.0;
/// Largest load-dependent friction of a warm gear: the factor by which errors of the load fall in an iteration.
const MOST_WARM_MU: f64 = 0.65;

/// Friction torque of one joint on the motor side of its gear:
///
/// ```text
/// τ_f = (1 + φ Θ) · [ rv q̇ + c(q, q̇, L) ζ + Σ A |q̇|ᵖ s + a ζ² + b |q̇| ]
/// c   = rc + Σ d(q̇) + Σ P cos(q + ψ) + μ |L|
/// s   = tanh(q̇/ε);   ζ = s, or z/γ with presliding, whose damping adds (c − μ |L|) T ż/γ
/// ```
///
/// z is the state of the bristle and γ = 1 + Σ d(q̇)/rc where it rests ([`Presliding`]).
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
        let (direction, damping) = match (&self.presliding, bristle) {
            (Some(presliding), Some(bristle)) => {
                let rest = self.bristle_rest(qd_rad_s);
                let direction = bristle / rest;
                (direction, presliding.damping(qd_rad_s, direction) / rest)
            }
            _ => (sign, 0.0),
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

    /// ż of the bristle, 1/s, at rates of up to `fastest_per_s`; 0 without presliding.
    #[inline]
    pub(super) fn bristle_rate(&self, qd_rad_s: f64, fastest_per_s: f64, bristle: f64) -> f64 {
        self.presliding.as_ref().map_or(0.0, |presliding| {
            let rest = self.bristle_rest(qd_rad_s);
            presliding.bristle_rate(qd_rad_s, rest, fastest_per_s, bristle)
        })
    }

    /// The fastest decays of the bristle that matter, 1/s: of its reversals, with accelerations of up to
    /// `acceleration_rad_s2`, and at the speed `largest_rad_s`; 0 without presliding.
    pub(super) fn bristle_decays_per_s(
        &self,
        acceleration_rad_s2: f64,
        largest_rad_s: f64,
    ) -> [f64; 2] {
        let Some(presliding) = &self.presliding else { return [0.0; 2] };
        let stiffest_per_rad = presliding.stiffness_per_rad / self.bristle_rests()[0];
        let turning = fastest_turn_per_s(stiffest_per_rad, acceleration_rad_s2);
        [turning, stiffest_per_rad * largest_rad_s]
    }

    /// γ: deflection at which the bristle rests while the joint moves at `qd_rad_s`.
    #[inline]
    fn bristle_rest(&self, qd_rad_s: f64) -> f64 {
        let held: f64 = self.stribeck.iter().map(|part| part.level_nm(qd_rad_s)).sum();
        // Without a curve to hold, Coulomb friction may be zero.
        if self.stribeck.is_empty() { 1.0 } else { 1.0 + held / self.coulomb_nm }
    }

    /// Bounds of γ: no more than the lower at any speed, no less than the upper.
    fn bristle_rests(&self) -> [f64; 2] {
        if self.stribeck.is_empty() {
            return [1.0; 2];
        }
        let bound = |of: fn(f64, f64) -> f64| {
            let parts = self.stribeck.iter().map(|part| of(part.extra_nm, 0.0));
            1.0 + parts.sum::<f64>() / self.coulomb_nm
        };
        [bound(f64::min), bound(f64::max)]
    }

    /// Where bristles have to hold a curve without Coulomb friction, or one that takes all of it away: the least
    /// friction, Nm, that would be left.
    pub(super) fn not_held_nm(&self) -> Option<f64> {
        let falls = self.stribeck.iter().map(|part| part.extra_nm.min(0.0));
        let least_nm = self.coulomb_nm + falls.sum::<f64>();
        let has_both = self.presliding.is_some() && !self.stribeck.is_empty();
        (has_both && least_nm <= 0.0).then_some(least_nm)
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
            level += part.level_nm(qd_rad_s);
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
            // With γ between g and G, |z| ≤ G and R = G/g, the law is rc (z + T ż) + p (z + T ż)/γ + a (z/γ)², where p
            // are the parts of c beside rc and d. At constant z, |d(z/γ)/dq̇| ≤ R γ'/g, with γ' ≤ steepest d/rc; and,
            // as |q̇ γ'| ≤ d/rc, |dż/dq̇| ≤ k (1 + R) (1 + d/(rc g)), to which 1/γ adds as much again for p. `bristles`
            // is the stiffness of the oscillator of joint and bristle, from which the terms in T cancel: dτ/dz times
            // dż/dq̇ of a bristle at rest, k, and more by as much as the curve can make of it.
            Some(presliding) => {
                let Presliding { stiffness_per_rad, damping_s, .. } = *presliding;
                let [least, most] = self.bristle_rests();
                let ratio = most / least;
                let parts = (level - stribeck_nm - self.coulomb_nm) / least;
                let asymmetric = 2.0 * ratio * self.asymmetric_nm.abs() / least;
                let (mut steepest, mut height) = (0.0, 0.0);
                if !self.stribeck.is_empty() {
                    let slopes = self.stribeck.iter().map(Stribeck::steepest_nm_s_rad);
                    steepest = slopes.sum::<f64>() / self.coulomb_nm;
                    height = stribeck_nm / (self.coulomb_nm * least);
                }
                let more = 0.5 * (1.0 + ratio) * (1.0 + height);
                bristles = more * (self.coulomb_nm + parts + asymmetric) * stiffness_per_rad;
                let damping_nm_s_rad = damping_s * stiffness_per_rad * (self.coulomb_nm + parts);
                smooth += ratio * steepest * (parts + asymmetric)
                    + (1.0 + ratio) * (1.0 + 2.0 * height) * damping_nm_s_rad;
            }
            None => smooth += (level + self.asymmetric_nm.abs()) / self.epsilon_rad_s,
        }
        let warm = self.warm(WARMEST).max(1.0);
        (smooth * warm, bristles * warm)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Central differences of the law over all speeds and states of the bristle do not exceed the bounds (with
    /// h = 1e-6, to 1e-6 of them). They take together what belongs to different speeds: the curve is steepest near
    /// rest, where γ = G, and a (z/γ)² is counted with z = G and γ = g there, which is too much by (G/g)³ for a curve
    /// with n = 1.
    #[test]
    fn slopes_beside_presliding_are_bounds() {
        let drive = crate::robot::Arm::built_in("ur5").unwrap().joints[0].drive;
        let (exp, rational) = (Fall::Exponential, Fall::Rational);
        let part = |extra_nm: f64, exponent: i32, fall: Fall| Stribeck {
            joint: 1,
            extra_nm,
            vs_rad_s: 0.01,
            exponent,
            fall,
        };
        let rise_and_fall = vec![part(4.0, 1, exp), part(-5.0, 2, rational)];
        let cases = [
            (vec![part(2.0, 1, exp)], 0.0, 0.0),
            (vec![part(2.0, 2, exp)], 0.0, 0.0),
            (vec![part(2.0, 2, exp)], 0.01, 0.0),
            (vec![part(2.0, 1, rational)], 0.0, 0.0),
            (vec![part(2.0, 2, rational)], 0.0, 0.0),
            (vec![part(2.0, 2, exp)], 0.01, 3.0),
            (vec![part(-5.0, 2, exp)], 0.01, 3.0),
            (rise_and_fall, 0.01, 3.0),
        ];
        for (stribeck, damping_s, wave_nm) in cases {
            let position = PositionFriction { joint: 1, amplitude_nm: wave_nm, phase_rad: 0.0 };
            let friction = Friction {
                stribeck: stribeck.clone(),
                positions: vec![position],
                asymmetric_nm: 1.5,
                presliding: Some(Presliding { damping_s, ..Presliding::new(1, 1e3) }),
                ..Friction::nominal(&drive, 0.02)
            };
            let torque = |speed: f64, z: f64| friction.torque_nm(0.0, speed, Some(z), 0.0, 0.0);
            let h = 1e-6;
            let [least, most] = friction.bristle_rests();
            let (mut by_speed, mut by_angle) = (0.0_f64, 0.0_f64);
            for (k, z) in (0..1000).flat_map(|k| [-1.0, 0.0, 1.0].map(|z| (k, most * z))) {
                let speed = 1e-4 * f64::from(k);
                let slope = (torque(speed + h, z) - torque(speed - h, z)) / (2.0 * h);
                by_speed = by_speed.max(slope.abs());
                let slope = (torque(speed, z + h) - torque(speed, z - h)) / (2.0 * h);
                by_angle = by_angle.max(1e3 * slope.abs());
            }
            let (smooth, bristles) = friction.slopes(1.0, 0.0);
            for (found, bound) in [(by_speed, smooth), (by_angle, bristles)] {
                assert!(found < bound * (1.0 + 1e-6), "{stribeck:?}: {found} {bound}");
                // Of deep falls the bounds are rough.
                let is_sharp = found > bound * most.powi(-3);
                assert!(is_sharp || least < 1.0 || wave_nm > 0.0, "{stribeck:?}: {found} {bound}");
            }
        }
    }
}
