//! The channels of a record.

/// What is recorded of each joint.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Channel {
    /// The angle.
    Angle,
    /// The velocity.
    Velocity,
    /// The torque.
    Torque,
}

impl Channel {
    /// All channels; a channel cast to `usize` is its place here.
    pub(super) const ALL: [Self; 3] = [Self::Angle, Self::Velocity, Self::Torque];

    /// The name in sentences.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Angle => "angle",
            Self::Velocity => "velocity",
            Self::Torque => "torque",
        }
    }
}
