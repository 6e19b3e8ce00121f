//! Units in which the quantities of a file are written.

use std::f64::consts::{PI, TAU};

use serde::Deserialize;

use super::block::Block;

/// Units of the quantities of a file.
#[derive(Debug, Clone, Copy, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(in crate::log) struct Units {
    pub(in crate::log) time: TimeUnit,
    pub(in crate::log) q: Angle,
    pub(in crate::log) qd: AngularVelocity,
    qdd: AngularAcceleration,
    current: Current,
    torque: Torque,
}

impl Units {
    /// Factor from the file's unit to the SI unit; `None` for a factor of one, so that numbers keep every bit.
    pub(in crate::log) fn factor(&self, block: Block) -> Option<f64> {
        let degrees = |yes: bool| yes.then_some(PI / 180.0);
        match block {
            Block::Time => Some(self.time.seconds()).filter(|&s| s != 1.0),
            Block::TimeNanoseconds => Some(TimeUnit::Ns.seconds()),
            Block::Q | Block::TargetQ => degrees(self.q == Angle::Deg),
            Block::Qd | Block::TargetQd => {
                Some(self.qd.rad_s()).filter(|_| self.qd != AngularVelocity::RadS)
            }
            Block::TargetQdd => degrees(self.qdd == AngularAcceleration::DegS2),
            Block::Current | Block::TargetCurrent => (self.current == Current::Ma).then_some(1e-3),
            Block::Torque | Block::TargetMoment => (self.torque == Torque::Mnm).then_some(1e-3),
            Block::Temperature => None,
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(in crate::log) enum TimeUnit {
    #[default]
    S,
    Ms,
    Us,
    Ns,
}

impl TimeUnit {
    pub(in crate::log) const ALL: [Self; 4] = [Self::S, Self::Ms, Self::Us, Self::Ns];

    pub(in crate::log) fn seconds(self) -> f64 {
        match self {
            Self::S => 1.0,
            Self::Ms => 1e-3,
            Self::Us => 1e-6,
            Self::Ns => 1e-9,
        }
    }

    pub(in crate::log) fn name(self) -> &'static str {
        match self {
            Self::S => "s",
            Self::Ms => "ms",
            Self::Us => "us",
            Self::Ns => "ns",
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
#[serde(rename_all = "lowercase")]
pub(in crate::log) enum Angle {
    #[default]
    Rad,
    Deg,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
pub(in crate::log) enum AngularVelocity {
    #[default]
    #[serde(rename = "rad/s")]
    RadS,
    #[serde(rename = "deg/s")]
    DegS,
    #[serde(rename = "rpm")]
    Rpm,
}

impl AngularVelocity {
    pub(in crate::log) const ALL: [Self; 3] = [Self::RadS, Self::DegS, Self::Rpm];

    /// The unit in rad/s.
    pub(in crate::log) fn rad_s(self) -> f64 {
        match self {
            Self::RadS => 1.0,
            Self::DegS => PI / 180.0,
            Self::Rpm => TAU / 60.0,
        }
    }

    pub(in crate::log) fn name(self) -> &'static str {
        match self {
            Self::RadS => "rad/s",
            Self::DegS => "deg/s",
            Self::Rpm => "rpm",
        }
    }
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
enum AngularAcceleration {
    #[default]
    #[serde(rename = "rad/s2")]
    RadS2,
    #[serde(rename = "deg/s2")]
    DegS2,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
enum Current {
    #[default]
    A,
    #[serde(rename = "mA")]
    Ma,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Deserialize)]
enum Torque {
    #[default]
    Nm,
    #[serde(rename = "mNm")]
    Mnm,
}
