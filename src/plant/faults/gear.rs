//! Effects of the gears: ripple, elasticity and play.

use serde::{Deserialize, Serialize};

use super::assembly::{Assembly, JointMechanics};
use super::effect::{Complaint, Fault, finite, not_negative, positive, require};

/// Torque ripple A cos(n q + φ) on the motor side, from the mesh of a strain-wave gear (n = twice the gear ratio for
/// its two-lobed wave generator) or the cogging of the motor (n = gear ratio × poles).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ripple {
    /// Joint, from 1.
    pub joint: usize,
    /// Amplitude A, Nm at the joint.
    pub amplitude_nm: f64,
    /// n: number of periods per turn of the joint.
    pub order_per_turn: f64,
    /// Phase φ, rad.
    pub phase_rad: f64,
}

impl Fault for Ripple {
    fn joint(&self) -> Option<usize> {
        Some(self.joint)
    }

    fn check(&self) -> Result<(), Complaint> {
        finite("amplitude_nm", self.amplitude_nm)?;
        positive("order_per_turn", self.order_per_turn)?;
        finite("phase_rad", self.phase_rad)
    }

    fn install(&self, assembly: &mut Assembly) -> Result<(), Complaint> {
        // A ripple of zero amplitude is left out, because it would needlessly shorten the integrator's steps.
        if self.amplitude_nm != 0.0 {
            assembly.joint(self.joint).ripples.push(*self);
        }
        Ok(())
    }
}

/// Side of an elastic gear, or of one with play, on which the encoder sits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EncoderSide {
    /// On the motor, as in most arms: the encoder reads the motor's angle over the gear ratio.
    #[default]
    Motor,
    /// On the link.
    Link,
}

/// Default damping ratio of a gear against its rotor: a few percent, as in strain-wave gears.
const DAMPING_RATIO: f64 = 0.05;

fn default_damping_ratio() -> f64 {
    DAMPING_RATIO
}

/// Compliant transmission between rotor and link. With the deflection δ = q_motor − q_link,
///
/// ```text
/// Ia q̈_motor = τ_drive − τ_f − T;   the link feels T = k dead(δ) + d δ̇ while in contact
/// dead(δ) = δ ∓ gap/2 beyond the gap, 0 within;   d = 2 ζ √(k Ia)
/// ```
///
/// Flanks push but do not pull: with a gap, T is zero where its sign would be opposite to that of the contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Transmission {
    /// k, Nm/rad.
    pub(super) stiffness_nm_rad: f64,
    /// d, Nm s/rad.
    pub(super) damping_nm_s_rad: f64,
    /// Half of the gap, rad.
    pub(super) half_gap_rad: f64,
}

impl Transmission {
    /// The transmission with the given `spring`, between a link and a rotor with the given inertia, across a gap (rad).
    fn new(spring: &Elasticity, rotor_inertia_kg_m2: f64, gap_rad: f64) -> Self {
        let stiffness_nm_rad = spring.stiffness_nm_rad;
        let critical = 2.0 * (stiffness_nm_rad * rotor_inertia_kg_m2).sqrt();
        let damping_nm_s_rad = spring.damping_ratio * critical;
        Self { stiffness_nm_rad, damping_nm_s_rad, half_gap_rad: 0.5 * gap_rad }
    }

    /// T, Nm, for the deflection δ (rad) and its rate (rad/s).
    #[inline]
    pub(super) fn torque_nm(&self, deflection_rad: f64, rate_rad_s: f64) -> f64 {
        let gap = self.half_gap_rad;
        let pressed = deflection_rad - deflection_rad.clamp(-gap, gap);
        let torque = self.stiffness_nm_rad * pressed + self.damping_nm_s_rad * rate_rad_s;
        if gap > 0.0 && torque * pressed <= 0.0 { 0.0 } else { torque }
    }

    /// The deflection at rest under `torque_nm`, rad.
    pub(super) fn deflection_rad(&self, torque_nm: f64) -> f64 {
        torque_nm / self.stiffness_nm_rad + self.half_gap_rad.copysign(torque_nm)
    }
}

/// Complains if the rotor has no inertia: a transmission needs an inertia on either side.
fn require_rotor(joint: &JointMechanics) -> Result<(), Complaint> {
    let rotor = joint.rotor_inertia_kg_m2;
    require(rotor > 0.0, "rotor_inertia_kg_m2", rotor, "of the arm's joint must be positive")
}

/// Builds the transmission from the elasticity and the backlash of one joint; the result does not depend on which of
/// them was installed first.
fn fit_gear(joint: &mut JointMechanics) -> Result<(), Complaint> {
    let rotor = joint.rotor_inertia_kg_m2;
    let flanks = joint.backlash.map(|play| play.flanks(rotor));
    let Some(spring) = joint.elasticity.or(flanks) else { return Ok(()) };
    joint.backlash.map_or(Ok(()), |play| play.require_no_other(&spring))?;
    let gap_rad = joint.backlash.map_or(0.0, |play| play.gap_rad);
    joint.transmission = Some(Transmission::new(&spring, rotor, gap_rad));
    joint.encoder = spring.encoder;
    Ok(())
}

/// An elastic gear: rotor and link are two inertias with a spring between them (Spong 1987).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Elasticity {
    /// Joint, from 1.
    pub joint: usize,
    /// k, Nm/rad.
    pub stiffness_nm_rad: f64,
    /// ζ of d = 2 ζ √(k Ia). Default 0.05.
    #[serde(default = "default_damping_ratio")]
    pub damping_ratio: f64,
    /// Where the encoder sits. Default: on the motor.
    #[serde(default)]
    pub encoder: EncoderSide,
}

impl Elasticity {
    /// An elastic gear with the default damping.
    pub fn new(joint: usize, stiffness_nm_rad: f64, encoder: EncoderSide) -> Self {
        Self { joint, stiffness_nm_rad, damping_ratio: DAMPING_RATIO, encoder }
    }
}

impl Fault for Elasticity {
    fn joint(&self) -> Option<usize> {
        Some(self.joint)
    }

    fn check(&self) -> Result<(), Complaint> {
        positive("stiffness_nm_rad", self.stiffness_nm_rad)?;
        not_negative("damping_ratio", self.damping_ratio)
    }

    fn install(&self, assembly: &mut Assembly) -> Result<(), Complaint> {
        let joint = assembly.joint(self.joint);
        require_rotor(joint)?;
        let twice = joint.elasticity.replace(*self).is_some();
        require(!twice, "joint", self.joint as f64, "has an elasticity already")?;
        fit_gear(joint)
    }
}

/// A gear with play: rotor and link are two inertias that touch at either end of a gap. If the same joint also has an
/// elasticity, its spring acts as the flanks, and values given here must agree with those of the elasticity.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Backlash {
    /// Joint, from 1.
    pub joint: usize,
    /// Play from flank to flank at the joint, rad.
    pub gap_rad: f64,
    /// Stiffness of the flanks, Nm/rad. Default: the stiffness with which the rotor alone oscillates at 300 rad/s.
    pub stiffness_nm_rad: Option<f64>,
    /// ζ of the flanks against the rotor. Default 0.05.
    pub damping_ratio: Option<f64>,
    /// Where the encoder sits. Default: on the motor.
    pub encoder: Option<EncoderSide>,
}

impl Backlash {
    /// Frequency of the rotor against the flanks if no stiffness is given, rad/s.
    const FLANK_RAD_S: f64 = 300.0;

    /// A backlash with the flanks given by the joint's elasticity, or with the default flanks.
    pub fn new(joint: usize, gap_rad: f64) -> Self {
        Self { joint, gap_rad, stiffness_nm_rad: None, damping_ratio: None, encoder: None }
    }

    /// The flanks of the gap, if the joint has no elasticity.
    fn flanks(&self, rotor_inertia_kg_m2: f64) -> Elasticity {
        let usual = rotor_inertia_kg_m2 * Self::FLANK_RAD_S.powi(2);
        Elasticity {
            joint: self.joint,
            stiffness_nm_rad: self.stiffness_nm_rad.unwrap_or(usual),
            damping_ratio: self.damping_ratio.unwrap_or(DAMPING_RATIO),
            encoder: self.encoder.unwrap_or_default(),
        }
    }

    /// Complains about values given here that differ from those of `spring`, which acts as the flanks.
    fn require_no_other(&self, spring: &Elasticity) -> Result<(), Complaint> {
        let requirement =
            "of the backlash is not that of the joint's elasticity: leave it out of the backlash";
        for (key, given, used) in [
            ("stiffness_nm_rad", self.stiffness_nm_rad, spring.stiffness_nm_rad),
            ("damping_ratio", self.damping_ratio, spring.damping_ratio),
        ] {
            let given = given.unwrap_or(used);
            require(given == used, key, given, requirement)?;
        }
        let same_side = self.encoder.is_none_or(|side| side == spring.encoder);
        let requirement = "has another encoder by its elasticity: leave it out of the backlash";
        require(same_side, "joint", self.joint as f64, requirement)
    }
}

impl Fault for Backlash {
    fn joint(&self) -> Option<usize> {
        Some(self.joint)
    }

    fn check(&self) -> Result<(), Complaint> {
        positive("gap_rad", self.gap_rad)?;
        self.stiffness_nm_rad.map_or(Ok(()), |k| positive("stiffness_nm_rad", k))?;
        self.damping_ratio.map_or(Ok(()), |ratio| not_negative("damping_ratio", ratio))
    }

    fn install(&self, assembly: &mut Assembly) -> Result<(), Complaint> {
        let joint = assembly.joint(self.joint);
        require_rotor(joint)?;
        let twice = joint.backlash.replace(*self).is_some();
        require(!twice, "joint", self.joint as f64, "has a backlash already")?;
        fit_gear(joint)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::Arm;

    /// Installs the elasticity `spring` and the backlash `play` of joint 2 in both orders.
    fn in_both_orders(
        spring: Elasticity,
        play: Backlash,
    ) -> [Result<(Option<Transmission>, EncoderSide), Complaint>; 2] {
        let orders: [[&dyn Fault; 2]; 2] = [[&spring, &play], [&play, &spring]];
        orders.map(|faults| {
            let mut assembly = Assembly::new(&Arm::built_in("ur5").unwrap(), 1.0);
            faults.iter().try_for_each(|fault| fault.install(&mut assembly))?;
            let joint = assembly.joint(2);
            Ok((joint.transmission, joint.encoder))
        })
    }

    #[test]
    fn the_flanks_of_a_soft_gear_are_its_spring() {
        let spring =
            Elasticity { damping_ratio: 0.1, ..Elasticity::new(2, 3e3, EncoderSide::Link) };
        let play = Backlash::new(2, 0.02);
        let repeated = Backlash {
            stiffness_nm_rad: Some(3e3),
            damping_ratio: Some(0.1),
            encoder: Some(EncoderSide::Link),
            ..play
        };
        for play in [play, repeated] {
            let [first, second] = in_both_orders(spring, play);
            let (gear, encoder) = first.unwrap();
            assert_eq!((gear, encoder), second.unwrap());
            let gear = gear.unwrap();
            assert_eq!((gear.stiffness_nm_rad, gear.half_gap_rad), (3e3, 0.01));
            let rotor = Arm::built_in("ur5").unwrap().joints[1].drive.rotor_inertia_kg_m2;
            assert_eq!(gear.damping_nm_s_rad, 0.1 * (2.0 * (3e3 * rotor).sqrt()));
            assert_eq!(encoder, EncoderSide::Link);
        }
    }

    #[test]
    fn flanks_that_contradict_the_spring_are_refused_in_both_orders() {
        let spring = Elasticity::new(2, 3e3, EncoderSide::Motor);
        let play = Backlash::new(2, 0.02);
        let contradictions = [
            ("stiffness_nm_rad", Backlash { stiffness_nm_rad: Some(4e3), ..play }),
            ("damping_ratio", Backlash { damping_ratio: Some(0.1), ..play }),
            ("joint", Backlash { encoder: Some(EncoderSide::Link), ..play }),
        ];
        for (key, play) in contradictions {
            for refused in in_both_orders(spring, play) {
                assert_eq!(refused.unwrap_err().key, key);
            }
        }
    }
}
