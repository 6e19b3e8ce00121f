//! Names of the families of effects, in the JSON output and in the blind benchmark.

use serde::{Deserialize, Serialize};

/// One family of effects.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// Friction that falls with speed near rest.
    Stribeck,
    /// Friction that is not a straight line in speed.
    NonlinearViscous,
    /// Friction of different size in the two directions.
    AsymmetricFriction,
    /// Friction that grows with the torque on the gear.
    LoadFriction,
    /// Friction that builds up over a small angle behind a reversal.
    Presliding,
    /// Friction whose sign turns round over another range of speeds than in the model.
    ReversalWidth,
    /// Friction that depends on the angle.
    PositionFriction,
    /// Friction that changes while the arm warms up.
    ThermalDrift,
    /// Torque that repeats many times per turn.
    Ripple,
    /// A gear that gives way under torque.
    Elasticity,
    /// A gear with play.
    Backlash,
    /// A wrong torque constant.
    TorqueGain,
    /// A constant error of the current sensor.
    CurrentOffset,
    /// A drive at its limit.
    Saturation,
    /// A drive that feeds another share of its friction forward than the others.
    FeedForward,
    /// Torque and motion recorded at different times.
    TimeSkew,
    /// A velocity that lags behind the angle.
    VelocityLag,
    /// An angle with a constant error.
    EncoderOffset,
    /// A base that does not stand level.
    BaseTilt,
    /// A wrong constant of gravity.
    Gravity,
    /// A body on the flange.
    Payload,
    /// A link that is longer or shorter than drawn.
    LinkLength,
    /// A cable or hose that pulls like a spring.
    Spring,
    /// Something touched the arm.
    Contact,
    /// A clock that stops without the time stamps showing it.
    ClockFault,
    /// Samples missing or repeated.
    DroppedSamples,
    /// Torque recorded in coarse steps.
    Quantisation,
    /// Single values far off.
    Outliers,
    /// Friction that differs from that of the simulation.
    FrictionChange,
}

impl Kind {
    /// The name in scenarios and JSON.
    pub fn name(self) -> &'static str {
        match self {
            Self::Stribeck => "stribeck",
            Self::NonlinearViscous => "nonlinear_viscous",
            Self::AsymmetricFriction => "asymmetric_friction",
            Self::LoadFriction => "load_friction",
            Self::Presliding => "presliding",
            Self::ReversalWidth => "reversal_width",
            Self::PositionFriction => "position_friction",
            Self::ThermalDrift => "thermal_drift",
            Self::Ripple => "ripple",
            Self::Elasticity => "elasticity",
            Self::Backlash => "backlash",
            Self::TorqueGain => "torque_gain",
            Self::CurrentOffset => "current_offset",
            Self::Saturation => "saturation",
            Self::FeedForward => "feed_forward",
            Self::TimeSkew => "time_skew",
            Self::VelocityLag => "velocity_lag",
            Self::EncoderOffset => "encoder_offset",
            Self::BaseTilt => "base_tilt",
            Self::Gravity => "gravity",
            Self::Payload => "payload",
            Self::LinkLength => "link_length",
            Self::Spring => "spring",
            Self::Contact => "contact",
            Self::ClockFault => "clock_fault",
            Self::DroppedSamples => "dropped_samples",
            Self::Quantisation => "quantisation",
            Self::Outliers => "outliers",
            Self::FrictionChange => "friction_change",
        }
    }
}

impl Kind {
    /// Whether the effect depends on the direction of motion, which leaves it undetermined at standstill.
    pub fn is_friction(self) -> bool {
        matches!(
            self,
            Self::Stribeck
                | Self::NonlinearViscous
                | Self::AsymmetricFriction
                | Self::LoadFriction
                | Self::Presliding
                | Self::ReversalWidth
                | Self::PositionFriction
                | Self::ThermalDrift
                | Self::FeedForward
                | Self::FrictionChange
        )
    }

    /// Whether the law adds to the friction of its joint.
    pub fn adds_friction(self) -> bool {
        let others = matches!(self, Self::FeedForward | Self::FrictionChange);
        self.is_friction() && !self.changes_friction() && !others
    }

    /// Whether the law changes all friction of its joint, that of other laws as well.
    pub fn changes_friction(self) -> bool {
        matches!(self, Self::ThermalDrift | Self::ReversalWidth)
    }

    /// Whether only a joint that moves can show it.
    pub fn needs_motion(self) -> bool {
        self.is_friction() || matches!(self, Self::Elasticity | Self::Backlash | Self::Ripple)
    }

    /// Whether it is a law of the arm: neither a fault of the recording nor something that happened once.
    pub fn is_a_law(self) -> bool {
        !self.is_of_the_record() && self != Self::Contact
    }

    /// Whether it is a fault of the recording, not of the arm.
    pub fn is_of_the_record(self) -> bool {
        matches!(
            self,
            Self::VelocityLag
                | Self::ClockFault
                | Self::DroppedSamples
                | Self::Outliers
                | Self::Quantisation
        )
    }
}

impl std::fmt::Display for Kind {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(self.name())
    }
}
