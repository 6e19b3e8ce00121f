//! Gears that ripple, give way, or have play.

use serde::{Deserialize, Serialize};

use super::assembly::{Assembly, JointMechanics};
use super::effect::{Complaint, Fault, finite, not_negative, positive, require};

/// Torque ripple + A cos(n q + φ) on the motor's side: the mesh of a strain-wave gear (n = twice the
/// gear ratio for its two-lobed wave generator) or the cogging of the motor (n = gear ratio × poles).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Ripple {
    /// Joint, from 1.
    pub joint: usize,
    /// A, Nm at the joint.
    pub amplitude_nm: f64,
    /// n: periods per turn of the joint.
    pub order_per_turn: f64,
    /// φ, rad.
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
        // A ripple of no size must not shorten the integrator's steps either.
        if self.amplitude_nm != 0.0 {
            assembly.joint(self.joint).ripples.push(*self);
        }
        Ok(())
    }
}

/// Which side of a gear that gives way the encoder sits on.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum EncoderSide {
    /// On the motor, as in most arms: its angle over the gear ratio.
    #[default]
    Motor,
    /// On the link.
    Link,
}

/// Damping ratio of a gear against its rotor where none is given: the few percent of strain-wave gears.
const DAMPING_RATIO: f64 = 0.05;

fn default_damping_ratio() -> f64 {
    DAMPING_RATIO
}

/// What stands between rotor and link: with the deflection δ = q_motor − q_link,
///
/// ```text
/// Ia q̈_motor = τ_drive − τ_f − T;   the link feels T = k dead(δ) + d δ̇ while in contact
/// dead(δ) = δ ∓ gap/2 beyond the gap, 0 within;   d = 2 ζ √(k Ia)
/// ```
///
/// Flanks push and do not pull: across a gap, T keeps the sign of the contact.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Transmission {
    /// k, Nm/rad.
    pub(super) stiffness_nm_rad: f64,
    /// d, Nm s/rad.
    pub(super) damping_nm_s_rad: f64,
    /// Half of the play, rad.
    pub(super) half_gap_rad: f64,
    /// Whether k was asked for, by an elasticity.
    is_elastic: bool,
}

impl Transmission {
    fn new(stiffness_nm_rad: f64, damping_ratio: f64, joint: &JointMechanics) -> Self {
        let critical = 2.0 * (stiffness_nm_rad * joint.rotor_inertia_kg_m2).sqrt();
        let damping_nm_s_rad = damping_ratio * critical;
        Self { stiffness_nm_rad, damping_nm_s_rad, half_gap_rad: 0.0, is_elastic: true }
    }

    /// T, Nm, at deflection δ (rad) and its rate (rad/s).
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

/// Two inertias need a rotor.
fn require_rotor(joint: &JointMechanics) -> Result<(), Complaint> {
    let rotor = joint.rotor_inertia_kg_m2;
    require(rotor > 0.0, "rotor_inertia_kg_m2", rotor, "of the arm's joint must be positive")
}

/// A gear that gives way: rotor and link are two inertias with a spring between them (Spong 1987).
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
    /// With the usual damping.
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
        let half_gap_rad = joint.transmission.map_or(0.0, |t| t.half_gap_rad);
        let twice = joint.transmission.is_some_and(|t| t.is_elastic);
        require(!twice, "joint", self.joint as f64, "has an elasticity already")?;
        let spring = Transmission::new(self.stiffness_nm_rad, self.damping_ratio, joint);
        joint.transmission = Some(Transmission { half_gap_rad, ..spring });
        joint.encoder = self.encoder;
        Ok(())
    }
}

/// A gear with play: rotor and link are two inertias that touch at either end of a gap. The flanks
/// are as stiff as an elasticity on the same joint says, or as given here.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Backlash {
    /// Joint, from 1.
    pub joint: usize,
    /// Play from flank to flank at the joint, rad.
    pub gap_rad: f64,
    /// Stiffness of the flanks, Nm/rad. Default: what makes the rotor alone swing at 300 rad/s.
    pub stiffness_nm_rad: Option<f64>,
    /// ζ of the flanks against the rotor. Default 0.05.
    #[serde(default = "default_damping_ratio")]
    pub damping_ratio: f64,
    /// Where the encoder sits. Default: on the motor.
    #[serde(default)]
    pub encoder: EncoderSide,
}

impl Backlash {
    /// Frequency of the rotor against the flanks where no stiffness is given, rad/s.
    const FLANK_RAD_S: f64 = 300.0;

    /// With the usual flanks, the encoder on the motor.
    pub fn new(joint: usize, gap_rad: f64) -> Self {
        Self {
            joint,
            gap_rad,
            stiffness_nm_rad: None,
            damping_ratio: DAMPING_RATIO,
            encoder: EncoderSide::Motor,
        }
    }
}

impl Fault for Backlash {
    fn joint(&self) -> Option<usize> {
        Some(self.joint)
    }

    fn check(&self) -> Result<(), Complaint> {
        positive("gap_rad", self.gap_rad)?;
        self.stiffness_nm_rad.map_or(Ok(()), |k| positive("stiffness_nm_rad", k))?;
        not_negative("damping_ratio", self.damping_ratio)
    }

    fn install(&self, assembly: &mut Assembly) -> Result<(), Complaint> {
        let joint = assembly.joint(self.joint);
        require_rotor(joint)?;
        let twice = joint.transmission.is_some_and(|t| t.half_gap_rad > 0.0);
        require(!twice, "joint", self.joint as f64, "has a backlash already")?;
        let default = joint.rotor_inertia_kg_m2 * Self::FLANK_RAD_S.powi(2);
        let stiffness = self.stiffness_nm_rad.unwrap_or(default);
        let elastic = joint.transmission;
        if elastic.is_none() {
            joint.encoder = self.encoder;
        }
        let flanks = Transmission::new(stiffness, self.damping_ratio, joint);
        let spring = elastic.unwrap_or(Transmission { is_elastic: false, ..flanks });
        joint.transmission = Some(Transmission { half_gap_rad: 0.5 * self.gap_rad, ..spring });
        Ok(())
    }
}
