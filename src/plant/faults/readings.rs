//! Faults of single readings, which occur after the sensors have added their noise.

use rand::RngExt;
use serde::{Deserialize, Serialize};

use super::assembly::Assembly;
use super::effect::{Complaint, Fault, positive, require};
use crate::plant::Measured;
use crate::plant::sensors::quantised;
use crate::random::{Channel, TrialStreams};
use crate::robot::JointSignals;

/// A fault of single readings.
#[derive(Debug, Clone, Copy)]
pub(super) enum ReadingFault {
    Coarse(Quantisation),
    Nonsense(Outliers),
    Lost(DroppedSamples),
}

impl ReadingFault {
    /// Applies the fault, which is effect number `effect`, to the readings of one trial. `limit_nm[j]` is the largest
    /// torque of joint j's drive.
    pub(super) fn apply(
        &self,
        effect: u8,
        limit_nm: &[f64],
        streams: &TrialStreams,
        log: &mut Measured,
    ) {
        match self {
            Self::Coarse(fault) => fault.apply(log),
            Self::Nonsense(fault) => fault.apply(effect, limit_nm, streams, log),
            Self::Lost(fault) => fault.apply(effect, streams, log),
        }
    }
}

/// A channel of the log.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ReadingChannel {
    /// Drive torque, Nm.
    #[default]
    Torque,
    /// Joint angle, rad.
    Position,
    /// Joint velocity, rad/s.
    Velocity,
}

/// A coarse reading: the reading, including its noise, is rounded to the nearest multiple of a step.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Quantisation {
    /// Joint, from 1; if left out, all joints.
    pub joint: Option<usize>,
    /// Step, in the channel's unit.
    pub step: f64,
    /// Channel. Default: torque.
    #[serde(default)]
    pub channel: ReadingChannel,
}

impl Quantisation {
    fn apply(&self, log: &mut Measured) {
        let signals = match self.channel {
            ReadingChannel::Torque => &mut log.torque_nm,
            ReadingChannel::Position => &mut log.q_rad,
            ReadingChannel::Velocity => &mut log.qd_rad_s,
        };
        for j in joints(self.joint, signals.joints()) {
            for value in signals.joint_mut(j) {
                *value = quantised(*value, self.step);
            }
        }
    }
}

impl Fault for Quantisation {
    fn joint(&self) -> Option<usize> {
        self.joint
    }

    fn check(&self) -> Result<(), Complaint> {
        positive("step", self.step)
    }

    fn install(&self, assembly: &mut Assembly) -> Result<(), Complaint> {
        assembly.readings.push((assembly.number, ReadingFault::Coarse(*self)));
        Ok(())
    }
}

/// Torque readings that have lost their meaning (a bit error, a corrupted packet): with the given probability, a
/// reading is replaced by a number that is uniformly distributed between the torque limits of the drive.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Outliers {
    /// Joint, from 1; if left out, all joints, each independently.
    pub joint: Option<usize>,
    /// Probability with which a reading is replaced, 0…0.5.
    pub fraction: f64,
}

impl Outliers {
    fn apply(&self, effect: u8, limit_nm: &[f64], streams: &TrialStreams, log: &mut Measured) {
        for j in joints(self.joint, log.torque_nm.joints()) {
            let mut rng = streams.stream(Channel::Outlier { effect }, j);
            for value in log.torque_nm.joint_mut(j) {
                // Draw both numbers for every sample, so that a larger fraction hits the same samples and some more.
                let [chance, size]: [f64; 2] = rng.random();
                if chance < self.fraction {
                    *value = limit_nm[j] * (2.0 * size - 1.0);
                }
            }
        }
    }
}

impl Fault for Outliers {
    fn joint(&self) -> Option<usize> {
        self.joint
    }

    fn check(&self) -> Result<(), Complaint> {
        let ok = (0.0..=0.5).contains(&self.fraction);
        require(ok, "fraction", self.fraction, "must be between 0 and 0.5")
    }

    fn install(&self, assembly: &mut Assembly) -> Result<(), Complaint> {
        for j in joints(self.joint, assembly.joints.len()) {
            assembly.require_torque_limit(j)?;
        }
        assembly.readings.push((assembly.number, ReadingFault::Nonsense(*self)));
        Ok(())
    }
}

/// Lost rows: with the given probability, a row is missing from the log (including its time stamp) or, with `repeat`,
/// shows the readings of the row before. With a `joint`, only that joint's readings repeat. The first row is never
/// lost.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DroppedSamples {
    /// Joint, from 1; if left out, the whole row.
    pub joint: Option<usize>,
    /// Probability with which a row is lost, 0…0.9.
    pub fraction: f64,
    /// Whether a lost row repeats the row before instead of being missing. Default: no.
    #[serde(default)]
    pub repeat: bool,
}

impl DroppedSamples {
    fn apply(&self, effect: u8, streams: &TrialStreams, log: &mut Measured) {
        let stream = self.joint.unwrap_or(0);
        let mut rng = streams.stream(Channel::Dropped { effect }, stream);
        let lost: Vec<bool> =
            log.time_s.iter().map(|_| rng.random::<f64>() < self.fraction).collect();
        let joints = joints(self.joint, log.q_rad.joints());
        let signals = [&mut log.q_rad, &mut log.qd_rad_s, &mut log.torque_nm];
        if self.repeat {
            for signals in signals {
                for j in joints.clone() {
                    let series = signals.joint_mut(j);
                    for k in 1..series.len() {
                        if lost[k] {
                            series[k] = series[k - 1];
                        }
                    }
                }
            }
            return;
        }
        let kept: Vec<usize> = (0..lost.len()).filter(|&k| k == 0 || !lost[k]).collect();
        let keep = |y: &[f64]| kept.iter().map(|&k| y[k]).collect::<Vec<f64>>();
        for signals in signals {
            *signals = JointSignals::map_joints(signals, |_, y| keep(y));
        }
        log.time_s = keep(&log.time_s);
    }
}

impl Fault for DroppedSamples {
    fn joint(&self) -> Option<usize> {
        self.joint
    }

    fn check(&self) -> Result<(), Complaint> {
        let ok = (0.0..=0.9).contains(&self.fraction);
        require(ok, "fraction", self.fraction, "must be between 0 and 0.9")?;
        let joint = self.joint.map_or(0.0, |j| j as f64);
        let one_joint = "can only repeat samples (repeat = true): a row is missing at all joints";
        require(self.joint.is_none() || self.repeat, "joint", joint, one_joint)
    }

    fn install(&self, assembly: &mut Assembly) -> Result<(), Complaint> {
        assembly.readings.push((assembly.number, ReadingFault::Lost(*self)));
        Ok(())
    }
}

/// Indices of `joint` (from 1), or of all `count` joints.
fn joints(joint: Option<usize>, count: usize) -> std::ops::Range<usize> {
    joint.map_or(0..count, |j| j - 1..j)
}
