//! Hidden effects as a scenario describes them.

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

/// Interface of every kind of effect: it states its joint, checks its parameters, and installs itself in the plant.
pub(super) trait Fault {
    /// The joint of the effect, from 1; `None` if it belongs to the whole arm or to all joints.
    fn joint(&self) -> Option<usize>;
    /// Checks the ranges of the effect's parameters.
    fn check(&self) -> Result<(), Complaint>;
    /// Installs the effect in the plant under construction. The caller guarantees that the joint exists.
    fn install(&self, assembly: &mut Assembly) -> Result<(), Complaint>;
}

/// Complaint about a parameter whose value makes no sense.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Complaint {
    pub(super) key: &'static str,
    pub(super) value: f64,
    pub(super) requirement: &'static str,
}

/// Complains about `key` unless `ok` holds.
pub(super) fn require(
    ok: bool,
    key: &'static str,
    value: f64,
    requirement: &'static str,
) -> Result<(), Complaint> {
    if ok { Ok(()) } else { Err(Complaint { key, value, requirement }) }
}

/// Requires a finite number.
pub(super) fn finite(key: &'static str, value: f64) -> Result<(), Complaint> {
    require(value.is_finite(), key, value, "must be a finite number")
}

/// Requires a finite number above zero.
pub(super) fn positive(key: &'static str, value: f64) -> Result<(), Complaint> {
    require(value > 0.0 && value.is_finite(), key, value, "must be positive")
}

/// Requires a finite number that is zero or above.
pub(super) fn not_negative(key: &'static str, value: f64) -> Result<(), Complaint> {
    require(value >= 0.0 && value.is_finite(), key, value, "must not be negative")
}

/// Declares the kinds of effects. A new kind needs one line in the list below and nothing else in this file.
macro_rules! effects {
    ($($(#[$doc:meta])* $variant:ident = $kind:literal,)*) => {
        /// One hidden effect: an `[[effect]]` table, distinguished by its `kind`.
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

            /// The `kind` of the effect.
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
    /// Viscous friction that is not proportional to the speed.
    NonlinearViscous = "nonlinear_viscous",
    /// Friction that differs between the two directions.
    AsymmetricFriction = "asymmetric_friction",
    /// Friction that grows with the load of the gear.
    LoadFriction = "load_friction",
    /// Friction that builds up over a small angle.
    Presliding = "presliding",
    /// Friction that reverses over another range of speeds.
    ReversalWidth = "reversal_width",
    /// Friction that varies with the angle.
    PositionFriction = "position_friction",
    /// Friction that changes as the joint warms up.
    ThermalDrift = "thermal_drift",
    /// Coulomb and viscous friction that deviate from their nominal values.
    FrictionChange = "friction_change",
    /// Torque ripple of the gear or motor.
    Ripple = "ripple",
    /// An elastic gear.
    Elasticity = "elasticity",
    /// A gear with play.
    Backlash = "backlash",
    /// A torque constant that deviates from its nominal value.
    TorqueGain = "torque_gain",
    /// A current sensor with a zero offset.
    CurrentOffset = "current_offset",
    /// A current reading that saturates.
    Saturation = "saturation",
    /// A drive that feeds forward another share of its friction.
    FeedForward = "feed_forward",
    /// A cable or dress pack that pulls.
    Spring = "spring",
    /// A contact with something during the motion.
    Contact = "contact",
    /// A body on the flange.
    Payload = "payload",
    /// A link of another length.
    LinkLength = "link_length",
    /// Gravity of another magnitude.
    Gravity = "gravity",
    /// A base that is not level.
    BaseTilt = "base_tilt",
    /// An encoder with a zero offset.
    EncoderOffset = "encoder_offset",
    /// A torque that is read late.
    TimeSkew = "time_skew",
    /// A velocity that is low-pass filtered.
    VelocityLag = "velocity_lag",
    /// Stalls of the logger that the time column hides.
    ClockFault = "clock_fault",
    /// A coarse reading.
    Quantisation = "quantisation",
    /// Readings that have lost their meaning.
    Outliers = "outliers",
    /// Rows lost or repeated.
    DroppedSamples = "dropped_samples",
}

impl Effect {
    /// The joint of the effect, from 1; `None` if it belongs to the whole arm or to all joints.
    pub fn joint(&self) -> Option<usize> {
        self.as_fault().joint()
    }

    /// Whether the noise-free log of a periodic motion still repeats with this effect, once the start is forgotten.
    /// (Faults of single readings do not matter here: they are applied later, to the log of each trial.)
    pub fn repeats(&self) -> bool {
        !matches!(self, Self::ThermalDrift(_) | Self::Contact(_) | Self::ClockFault(_))
    }

    /// Parameters of the effect, by their keys in a scenario, except for `kind` and `joint`.
    pub fn parameters(&self) -> serde_json::Map<String, serde_json::Value> {
        match serde_json::to_value(self) {
            Ok(serde_json::Value::Object(mut keys)) => {
                keys.retain(|key, _| key != "kind" && key != "joint");
                keys
            }
            // Never reached: an enum of tables with text keys and finite numbers serialises to an object.
            _ => serde_json::Map::new(),
        }
    }
}
