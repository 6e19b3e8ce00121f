//! Source of all random numbers.
//!
//! A number is a pure function of (seed, scenario, trial, channel, joint, position in its stream): any trial can be
//! replayed alone, and the results are the same bits for any number of threads and any split into shards. The generator
//! is ChaCha8, which is counter-based: its 256-bit key is SHA-256("armid/random/1" ‖ seed ‖ trial ‖ scenario) and its
//! 64-bit stream number holds the channel and the joint. No other generator influences what a trial contains: the
//! generators that choose starting points or test motions draw the same numbers every time.

use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use sha2::{Digest, Sha256};

/// Separates these keys from any other use of the hash, and each version of this scheme from the next.
const DOMAIN: &[u8] = b"armid/random/1";

/// The purpose of a stream of random numbers.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Channel {
    /// Error of the position reading.
    Position,
    /// Error of the velocity reading.
    Velocity,
    /// One component of the torque error, the part that is independent for each joint.
    Torque {
        /// Which component of the noise model.
        component: u8,
    },
    /// One component of the torque error, the part that is common to all joints.
    TorqueShared {
        /// Which component of the noise model.
        component: u8,
    },
    /// Readings that a fault replaces by arbitrary values.
    Outlier {
        /// Which of the scenario's effects, from 0.
        effect: u8,
    },
    /// Rows that a fault loses or repeats.
    Dropped {
        /// Which of the scenario's effects, from 0.
        effect: u8,
    },
    /// Which blocks of a record are drawn in resampling.
    Resampling,
    /// The hidden truth of a trial of the blind benchmark.
    Case,
}

impl Channel {
    /// Kind and component as one number. The codes are part of every pinned result and must not change.
    fn code(self) -> u64 {
        let (kind, component) = match self {
            Self::Position => (1, 0),
            Self::Velocity => (2, 0),
            Self::Torque { component } => (3, component),
            Self::TorqueShared { component } => (4, component),
            Self::Outlier { effect } => (5, effect),
            Self::Dropped { effect } => (6, effect),
            Self::Resampling => (7, 0),
            Self::Case => (8, 0),
        };
        kind << 8 | u64::from(component)
    }
}

/// All streams of one trial of one scenario.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct TrialStreams {
    key: [u8; 32],
}

impl TrialStreams {
    /// The streams of trial `trial` (from 0) of the scenario whose text or digest is `scenario`.
    pub fn new(seed: u64, scenario: &[u8], trial: u64) -> Self {
        let digest = Sha256::new()
            .chain_update(DOMAIN)
            .chain_update(seed.to_le_bytes())
            .chain_update(trial.to_le_bytes())
            .chain_update(scenario)
            .finalize();
        Self { key: digest.into() }
    }

    /// The stream of `channel` at joint `joint` (from 0), from its beginning.
    pub fn stream(&self, channel: Channel, joint: usize) -> ChaCha8Rng {
        let mut rng = ChaCha8Rng::from_seed(self.key);
        rng.set_stream(channel.code() << 32 | joint as u64);
        rng
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::Rng;
    use std::collections::HashSet;

    #[test]
    fn every_argument_makes_another_stream() {
        let mut first_words = HashSet::new();
        for seed in 0..3 {
            for scenario in [&b"a"[..], b"b", b""] {
                for trial in 0..3 {
                    let streams = TrialStreams::new(seed, scenario, trial);
                    for channel in [
                        Channel::Position,
                        Channel::Velocity,
                        Channel::Torque { component: 0 },
                        Channel::Torque { component: 1 },
                        Channel::TorqueShared { component: 0 },
                        Channel::Outlier { effect: 0 },
                        Channel::Dropped { effect: 0 },
                        Channel::Resampling,
                        Channel::Case,
                    ] {
                        for joint in 0..7 {
                            first_words.insert(streams.stream(channel, joint).next_u64());
                        }
                    }
                }
            }
        }
        assert_eq!(first_words.len(), 3 * 3 * 3 * 9 * 7);
    }

    /// The scheme is part of every published result: a change must not go unnoticed.
    #[test]
    fn the_scheme_is_pinned() {
        let mut rng = TrialStreams::new(7, b"scenario", 3).stream(Channel::Velocity, 2);
        assert_eq!(rng.next_u64(), 13_552_150_083_332_878_878);
    }
}
