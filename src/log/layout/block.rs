//! What a group of columns means.

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

    /// Those that a log need not have.
    pub(in crate::log) fn optional() -> impl Iterator<Item = Self> {
        Self::ALL.into_iter().filter(|block| block.is_optional())
    }

    /// Whether a log need not have it.
    pub(in crate::log) fn is_optional(self) -> bool {
        let is_of_motion = matches!(self, Self::Q | Self::Qd | Self::Current | Self::Torque);
        !self.is_of_time() && !is_of_motion
    }

    /// Whether it is one column for all joints.
    pub(in crate::log) fn is_of_time(self) -> bool {
        matches!(self, Self::Time | Self::TimeNanoseconds)
    }

    /// Its key in a layout file.
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

    /// Largest magnitude that can be a measurement, in the SI unit (°C for temperatures). What lies beyond
    /// is an uninitialised number. Angles and velocities are held to a tighter bound once their unit is sure.
    pub(in crate::log) fn bound(self) -> f64 {
        match self {
            // Nanoseconds since 1970 stay below this until the year 2286.
            Self::Time => 1e19,
            // Of one second.
            Self::TimeNanoseconds => 1.0,
            // A thousand turns read in degrees without the layout saying so.
            Self::Q | Self::Qd | Self::TargetQ | Self::TargetQd => 3.6e5,
            // 30 000 rad/s² is 3000 times what arms do; in degrees 60 times.
            Self::TargetQdd => 3e4,
            // The drives of the largest arms take about 100 A and give about 10 kNm.
            Self::Current | Self::TargetCurrent => 500.0,
            Self::Torque | Self::TargetMoment => 5e4,
            Self::Temperature => 1e3,
        }
    }
}
