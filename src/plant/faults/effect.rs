//! An effect as a scenario names it.

use serde::{Deserialize, Serialize};

use super::arm::{BaseTilt, EncoderOffset, Gravity, LinkLength, Payload};
use super::assembly::Assembly;
use super::drive::{CurrentOffset, FeedForward, Saturation, TorqueGain};
use super::friction::{
    AsymmetricFriction, FrictionChange, LoadFriction, NonlinearViscous, PositionFriction,
    Presliding, ReversalWidth, Stribeck, ThermalDrift,
};
use super::gear::{Backlash, Elasticity, Ripple};
use super::readings::{DroppedSamples, Outliers, Quantisation};
use super::surroundings::{Contact, Spring};
use super::timing::{ClockFault, TimeSkew, VelocityLag};

/// What every kind of effect can do: say where it sits, check its numbers, and take its place.
pub(super) trait Fault {
    /// The joint it sits at, from 1; `None` where it belongs to the whole arm.
    fn joint(&self) -> Option<usize>;
    /// Ranges of its own numbers.
    fn check(&self) -> Result<(), Complaint>;
    /// Puts it into the plant under construction. The joint exists.
    fn install(&self, assembly: &mut Assembly) -> Result<(), Complaint>;
}

/// A number that makes no sense.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Complaint {
    pub(super) key: &'static str,
    pub(super) value: f64,
    pub(super) requirement: &'static str,
}

/// Passes `ok`, or complains about `key`.
pub(super) fn require(
    ok: bool,
    key: &'static str,
    value: f64,
    requirement: &'static str,
) -> Result<(), Complaint> {
    if ok { Ok(()) } else { Err(Complaint { key, value, requirement }) }
}

/// Any number that is one.
pub(super) fn finite(key: &'static str, value: f64) -> Result<(), Complaint> {
    require(value.is_finite(), key, value, "must be a finite number")
}

/// Above zero.
pub(super) fn positive(key: &'static str, value: f64) -> Result<(), Complaint> {
    require(value > 0.0 && value.is_finite(), key, value, "must be positive")
}

/// Zero or above.
pub(super) fn not_negative(key: &'static str, value: f64) -> Result<(), Complaint> {
    require(value >= 0.0 && value.is_finite(), key, value, "must not be negative")
}

/// Declares the kinds: one line each, which is all that a new kind needs here.
macro_rules! effects {
    ($($(#[$doc:meta])* $variant:ident = $kind:literal,)*) => {
        /// One hidden effect: an `[[effect]]` table, told apart by its `kind`.
        ///
        /// ```toml
        /// [[effect]]
        /// kind = "stribeck"
        /// joint = 4
        /// extra_nm = 0.5
        /// vs_rad_s = 0.1
        /// ```
        #[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
        #[serde(tag = "kind")]
        pub enum Effect {
            $($(#[$doc])* #[serde(rename = $kind)] $variant($variant),)*
        }

        impl Effect {
            /// All kinds.
            pub const KINDS: &[&str] = &[$($kind),*];

            /// Its `kind`.
            pub fn kind(&self) -> &'static str {
                match self {
                    $(Self::$variant(_) => $kind,)*
                }
            }

            pub(super) fn as_fault(&self) -> &dyn Fault {
                match self {
                    $(Self::$variant(fault) => fault,)*
                }
            }
        }
    };
}

effects! {
    /// More friction near standstill.
    Stribeck = "stribeck",
    /// Viscous friction that is not proportional to speed.
    NonlinearViscous = "nonlinear_viscous",
    /// Friction that differs between the two directions.
    AsymmetricFriction = "asymmetric_friction",
    /// Friction that grows with the load of the gear.
    LoadFriction = "load_friction",
    /// Friction that builds up over a small angle.
    Presliding = "presliding",
    /// Friction that turns round over another range of speeds.
    ReversalWidth = "reversal_width",
    /// Friction that varies with the angle.
    PositionFriction = "position_friction",
    /// Friction that changes as the joint warms up.
    ThermalDrift = "thermal_drift",
    /// Friction of another size than nominal.
    FrictionChange = "friction_change",
    /// Torque ripple of gear or motor.
    Ripple = "ripple",
    /// A gear that gives way.
    Elasticity = "elasticity",
    /// A gear with play.
    Backlash = "backlash",
    /// A torque constant off its nominal value.
    TorqueGain = "torque_gain",
    /// A current sensor off zero.
    CurrentOffset = "current_offset",
    /// A current reading that ends at a limit.
    Saturation = "saturation",
    /// A drive that feeds another share of its friction forward.
    FeedForward = "feed_forward",
    /// A cable or dress pack that pulls.
    Spring = "spring",
    /// Something touched on the way.
    Contact = "contact",
    /// A body on the flange.
    Payload = "payload",
    /// A link of another length.
    LinkLength = "link_length",
    /// Another gravity.
    Gravity = "gravity",
    /// A base that does not stand level.
    BaseTilt = "base_tilt",
    /// An encoder off zero.
    EncoderOffset = "encoder_offset",
    /// Torque that is read late.
    TimeSkew = "time_skew",
    /// Velocity behind a low-pass.
    VelocityLag = "velocity_lag",
    /// Stalls that the time column hides.
    ClockFault = "clock_fault",
    /// A coarse reading.
    Quantisation = "quantisation",
    /// Readings that are nonsense.
    Outliers = "outliers",
    /// Rows lost or repeated.
    DroppedSamples = "dropped_samples",
}

impl Effect {
    /// The joint it sits at, from 1; `None` where it belongs to the whole arm or to all joints.
    pub fn joint(&self) -> Option<usize> {
        self.as_fault().joint()
    }

    /// Whether the noise-free log of a periodic motion repeats with it, once the start is forgotten.
    /// (Single readings that go wrong do so later, in each trial's log.)
    pub fn repeats(&self) -> bool {
        !matches!(self, Self::ThermalDrift(_) | Self::Contact(_) | Self::ClockFault(_))
    }

    /// Its numbers and choices, by their keys in a scenario.
    pub fn parameters(&self) -> serde_json::Map<String, serde_json::Value> {
        match serde_json::to_value(self) {
            Ok(serde_json::Value::Object(mut keys)) => {
                keys.retain(|key, _| key != "kind" && key != "joint");
                keys
            }
            // An enum of tables with text keys and finite numbers is an object.
            _ => serde_json::Map::new(),
        }
    }
}
