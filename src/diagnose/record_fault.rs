//! Faults of the record, by what they did to its readings.

use super::channel::Channel;
use super::kind::Kind;

/// What a fault of the record did to the readings of a joint or of the arm as a whole. The name of the fault, the words
/// about it and what is done with it follow from this.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum RecordFault {
    /// The velocity lags behind the angle, or is ahead of it.
    LateVelocity,
    /// Time passed without the time stamps showing it.
    LostTime,
    /// Rows are missing.
    MissingRows,
    /// Rows, or all readings of the joint in them, repeat those of the row before.
    RepeatedRows,
    /// Rows are missing or repeat the one before.
    MissingOrRepeatedRows,
    /// Readings of these channels, but not whole rows, repeat the one before.
    RepeatedReadings(Vec<Channel>),
    /// Single readings of these channels are far off those around.
    WildReadings(Vec<Channel>),
    /// The torque is in coarse steps.
    CoarseTorque,
}

impl RecordFault {
    /// The kind of cause that it is.
    pub(super) fn kind(&self) -> Kind {
        match self {
            Self::LateVelocity => Kind::VelocityLag,
            Self::LostTime => Kind::ClockFault,
            Self::MissingRows
            | Self::RepeatedRows
            | Self::MissingOrRepeatedRows
            | Self::RepeatedReadings(_) => Kind::DroppedSamples,
            Self::WildReadings(_) => Kind::Outliers,
            Self::CoarseTorque => Kind::Quantisation,
        }
    }

    /// The fault in words.
    pub(super) fn in_words(&self) -> String {
        let names = |channels: &[Channel]| {
            let names: Vec<&str> = channels.iter().map(|channel| channel.name()).collect();
            names.join(" and ")
        };
        match self {
            Self::LateVelocity => "a velocity that lags behind the angle".to_owned(),
            Self::LostTime => "time that passed without the time stamps showing it".to_owned(),
            Self::MissingRows => "samples that are missing".to_owned(),
            Self::RepeatedRows => "samples that repeat the one before".to_owned(),
            Self::MissingOrRepeatedRows => {
                "samples that are missing or repeat the one before".to_owned()
            }
            Self::RepeatedReadings(channels) => {
                format!("readings of the {} that repeat the one before", names(channels))
            }
            Self::WildReadings(channels) => {
                format!("single values of {} that are far off", names(channels))
            }
            Self::CoarseTorque => "torque in coarse steps".to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_words_name_all_channels() {
        let two = vec![Channel::Angle, Channel::Torque];
        let repeated = RecordFault::RepeatedReadings(two.clone());
        assert_eq!(
            repeated.in_words(),
            "readings of the angle and torque that repeat the one before"
        );
        let wild = RecordFault::WildReadings(two);
        assert_eq!(wild.in_words(), "single values of angle and torque that are far off");
    }
}
