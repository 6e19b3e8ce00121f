//! Blocks: groups of columns with one meaning.

use serde::Deserialize;

/// A group of columns with one meaning.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(in crate::log) enum Block {
    Time,
    TimeNanoseconds,
    Q,
    Qd,
    Current,
    Torque,
    TargetQ,
    TargetQd,
    TargetQdd,
    TargetCurrent,
    TargetMoment,
    Temperature,
}

impl Block {
    pub(in crate::log) const ALL: [Self; 12] = [
        Self::Time,
        Self::TimeNanoseconds,
        Self::Q,
        Self::Qd,
        Self::Current,
        Self::Torque,
        Self::TargetQ,
        Self::TargetQd,
        Self::TargetQdd,
        Self::TargetCurrent,
        Self::TargetMoment,
        Self::Temperature,
    ];

    /// The blocks that a log need not have.
    pub(in crate::log) fn optional() -> impl Iterator<Item = Self> {
        Self::ALL.into_iter().filter(|block| block.is_optional())
    }

    /// Whether the block is optional in a file. `qd` is not counted as optional, although a layout may omit it.
    pub(in crate::log) fn is_optional(self) -> bool {
        let is_of_motion = matches!(self, Self::Q | Self::Qd | Self::Current | Self::Torque);
        !self.is_of_time() && !is_of_motion
    }

    /// Whether the block is a single column rather than one column per joint.
    pub(in crate::log) fn is_of_time(self) -> bool {
        matches!(self, Self::Time | Self::TimeNanoseconds)
    }

    /// The key of the block in a layout file.
    pub(in crate::log) fn key(self) -> &'static str {
        match self {
            Self::Time => "time",
            Self::TimeNanoseconds => "time_nanoseconds",
            Self::Q => "q",
            Self::Qd => "qd",
            Self::Current => "current",
            Self::Torque => "torque",
            Self::TargetQ => "target_q",
            Self::TargetQd => "target_qd",
            Self::TargetQdd => "target_qdd",
            Self::TargetCurrent => "target_current",
            Self::TargetMoment => "target_moment",
            Self::Temperature => "temperature",
        }
    }

    /// Largest magnitude that a measurement can have, in the SI unit (°C for temperatures). Anything larger is an
    /// uninitialised number. Angles and velocities are held to a tighter bound once their unit is known.
    pub(in crate::log) fn bound(self) -> f64 {
        match self {
            // Nanoseconds since 1970 stay below this until the year 2286.
            Self::Time => 1e19,
            // Nanoseconds are a fraction of one second.
            Self::TimeNanoseconds => 1.0,
            // A thousand turns recorded in degrees by a layout that does not say so.
            Self::Q | Self::Qd | Self::TargetQ | Self::TargetQd => 3.6e5,
            // 30 000 rad/s² is 3000 times the acceleration of real arms; as a number in degrees, it is still 60 times.
            Self::TargetQdd => 3e4,
            // The drives of the largest arms draw about 100 A and deliver about 10 kNm.
            Self::Current | Self::TargetCurrent => 500.0,
            Self::Torque | Self::TargetMoment => 5e4,
            Self::Temperature => 1e3,
        }
    }
}
