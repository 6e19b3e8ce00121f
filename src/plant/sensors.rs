//! The arm's sensors: how readings differ from the truth.

use rand::rngs::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::error::PlantError;
use super::noise::{NoiseModel, normal};
use super::recording::Recording;
use crate::random::{Channel, TrialStreams};
use crate::robot::{Arm, JointSignals};

/// One number for all joints, or one for each joint.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(untagged, expecting = "a number for all joints, or a list with one for each")]
pub enum PerJoint {
    /// The same at every joint.
    All(f64),
    /// One value for each joint.
    Each(Vec<f64>),
}

impl PerJoint {
    /// One value for each of `joints` joints. Refuses negative values and lists of another length.
    fn resolve(&self, key: &'static str, joints: usize) -> Result<Vec<f64>, PlantError> {
        let values = match self {
            Self::All(value) => vec![*value; joints],
            Self::Each(values) if values.len() == joints => values.clone(),
            Self::Each(values) => {
                return Err(PlantError::Joints {
                    what: key,
                    found: values.len(),
                    expected: joints,
                });
            }
        };
        match values.iter().find(|v| !(**v >= 0.0 && v.is_finite())) {
            Some(&value) => {
                let requirement = "must be a number that is not negative";
                Err(PlantError::Setting { key, value, requirement })
            }
            None => Ok(values),
        }
    }
}

/// Quantity that the drives report.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Effort {
    /// Joint torque, Nm.
    #[default]
    Torque,
    /// Motor current, A: torque / (i_G k).
    Current,
}

/// Sensor errors: the `[sensors]` table of a scenario. The default has no errors.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SensorConfig {
    /// Standard deviation of the position reading, rad; white.
    pub q_sd_rad: PerJoint,
    /// Standard deviation of the velocity reading, rad/s; white.
    pub qd_sd_rad_s: PerJoint,
    /// Standard deviation of the torque reading, Nm. If current is read, it is that of the current times i_G k.
    pub torque_sd_nm: PerJoint,
    /// Colour of the torque noise.
    pub torque_noise: NoiseModel,
    /// Resolution of the position reading, rad; 0: no rounding.
    pub q_step_rad: f64,
    /// Resolution of the velocity reading, rad/s; 0: no rounding.
    pub qd_step_rad_s: f64,
    /// Resolution of the effort reading, in its own unit (Nm or A); 0: no rounding.
    pub effort_step: f64,
    /// Quantity that the drives report.
    pub effort: Effort,
}

impl Default for SensorConfig {
    fn default() -> Self {
        Self {
            q_sd_rad: PerJoint::All(0.0),
            qd_sd_rad_s: PerJoint::All(0.0),
            torque_sd_nm: PerJoint::All(0.0),
            torque_noise: NoiseModel::white(),
            q_step_rad: 0.0,
            qd_step_rad_s: 0.0,
            effort_step: 0.0,
            effort: Effort::Torque,
        }
    }
}

impl SensorConfig {
    /// Standard deviation of the torque reading for each of `joints` joints, Nm.
    pub fn torque_sd_per_joint_nm(&self, joints: usize) -> Result<Vec<f64>, PlantError> {
        self.torque_sd_nm.resolve("torque_sd_nm", joints)
    }

    /// Standard deviation of the position reading for each of `joints` joints, rad.
    pub fn q_sd_per_joint_rad(&self, joints: usize) -> Result<Vec<f64>, PlantError> {
        self.q_sd_rad.resolve("q_sd_rad", joints)
    }

    /// Standard deviation of the velocity reading for each of `joints` joints, rad/s.
    pub fn qd_sd_per_joint_rad_s(&self, joints: usize) -> Result<Vec<f64>, PlantError> {
        self.qd_sd_rad_s.resolve("qd_sd_rad_s", joints)
    }
}

/// The sensors of one arm.
#[derive(Debug, Clone)]
pub struct Sensors {
    q_sd_rad: Vec<f64>,
    qd_sd_rad_s: Vec<f64>,
    torque_sd_nm: Vec<f64>,
    torque_noise: NoiseModel,
    q_step_rad: f64,
    qd_step_rad_s: f64,
    /// Resolution of the torque that follows from that of the effort, Nm; 0: no rounding.
    torque_step_nm: Vec<f64>,
    rate_hz: f64,
}

/// The channels of a log as the sensors report them, at the same samples as the recording.
#[derive(Debug, Clone, PartialEq)]
pub struct Measured {
    /// Time stamps, s.
    pub time_s: Vec<f64>,
    /// Joint angles, rad.
    pub q_rad: JointSignals,
    /// Joint velocities, rad/s.
    pub qd_rad_s: JointSignals,
    /// Drive torque at the joint, Nm.
    pub torque_nm: JointSignals,
    /// Working memory for the part of the noise that all joints share.
    shared: Vec<f64>,
}

impl Measured {
    /// A log with the noise-free signals of `recording`, as memory for its measurements.
    pub fn like(recording: &Recording) -> Self {
        Self {
            time_s: recording.time_s.clone(),
            q_rad: recording.q_rad.clone(),
            qd_rad_s: recording.qd_rad_s.clone(),
            torque_nm: recording.torque_nm.clone(),
            shared: Vec::new(),
        }
    }
}

impl Sensors {
    /// Sensors of `arm`, read at `rate_hz`.
    pub fn new(config: &SensorConfig, arm: &Arm, rate_hz: f64) -> Result<Self, PlantError> {
        let n = arm.dof();
        config.torque_noise.validate(rate_hz)?;
        let step = |key, value| PerJoint::All(value).resolve(key, n);
        step("q_step_rad", config.q_step_rad)?;
        step("qd_step_rad_s", config.qd_step_rad_s)?;
        let torque_step_nm = step("effort_step", config.effort_step)?
            .iter()
            .zip(&arm.joints)
            .map(|(step, joint)| match config.effort {
                Effort::Torque => *step,
                Effort::Current => step * joint.drive.gain_nm_a(),
            })
            .collect();
        Ok(Self {
            q_sd_rad: config.q_sd_per_joint_rad(n)?,
            qd_sd_rad_s: config.qd_sd_per_joint_rad_s(n)?,
            torque_sd_nm: config.torque_sd_per_joint_nm(n)?,
            torque_noise: config.torque_noise.clone(),
            q_step_rad: config.q_step_rad,
            qd_step_rad_s: config.qd_step_rad_s,
            torque_step_nm,
            rate_hz,
        })
    }

    /// Reads `recording` with the errors of one trial into `out`, which [`Measured::like`] has made.
    ///
    /// If the controller has already read positions and velocities, they are logged as it read them.
    pub fn measure(&self, recording: &Recording, streams: &TrialStreams, out: &mut Measured) {
        out.time_s.clone_from(&recording.time_s);
        match &recording.readings {
            Some(readings) => {
                out.q_rad.clone_from(&readings.q_rad);
                out.qd_rad_s.clone_from(&readings.qd_rad_s);
            }
            None => {
                out.q_rad.clone_from(&recording.q_rad);
                out.qd_rad_s.clone_from(&recording.qd_rad_s);
                for (j, mut encoder) in self.encoders(streams).joints.into_iter().enumerate() {
                    for q in out.q_rad.joint_mut(j) {
                        *q = encoder.q.read(*q);
                    }
                    for qd in out.qd_rad_s.joint_mut(j) {
                        *qd = encoder.qd.read(*qd);
                    }
                }
            }
        }
        let torque = &mut out.torque_nm;
        torque.clone_from(&recording.torque_nm);
        let sd = &self.torque_sd_nm;
        self.torque_noise.add_to(streams, self.rate_hz, sd, &mut out.shared, torque);
        for (j, &step) in self.torque_step_nm.iter().enumerate() {
            if step > 0.0 {
                torque.joint_mut(j).iter_mut().for_each(|value| *value = quantised(*value, step));
            }
        }
    }

    /// The law of the torque noise; `None` if the torque is also rounded.
    pub fn torque_noise(&self) -> Option<TorqueNoise<'_>> {
        let rounded = self.torque_step_nm.iter().any(|step| *step > 0.0);
        let noise = TorqueNoise { sd_nm: &self.torque_sd_nm, model: &self.torque_noise };
        (!rounded).then_some(noise)
    }

    /// The encoders of one trial, for the controller to read.
    pub fn encoders(&self, streams: &TrialStreams) -> Encoders {
        let channel = |channel, j, sd, step| Reader { rng: streams.stream(channel, j), sd, step };
        let joints = (0..self.q_sd_rad.len())
            .map(|j| Encoder {
                q: channel(Channel::Position, j, self.q_sd_rad[j], self.q_step_rad),
                qd: channel(Channel::Velocity, j, self.qd_sd_rad_s[j], self.qd_step_rad_s),
            })
            .collect();
        Encoders { joints }
    }
}

/// Standard deviation and colour of the torque noise.
#[derive(Debug, Clone, Copy)]
pub struct TorqueNoise<'a> {
    /// Standard deviation per joint, Nm.
    pub sd_nm: &'a [f64],
    /// Colour and correlation.
    pub model: &'a NoiseModel,
}

/// The encoders of all joints during one trial; each reading draws new errors.
#[derive(Debug)]
pub struct Encoders {
    joints: Vec<Encoder>,
}

#[derive(Debug)]
struct Encoder {
    q: Reader,
    qd: Reader,
}

#[derive(Debug)]
struct Reader {
    rng: ChaCha8Rng,
    sd: f64,
    step: f64,
}

impl Reader {
    #[inline]
    fn read(&mut self, value: f64) -> f64 {
        let noisy = value + self.sd * normal(&mut self.rng);
        if self.step > 0.0 { quantised(noisy, self.step) } else { noisy }
    }
}

impl Encoders {
    /// Replaces the true angles (rad) and speeds (rad/s) by readings.
    pub fn read(&mut self, q_rad: &mut [f64], qd_rad_s: &mut [f64]) {
        for (encoder, (q, qd)) in self.joints.iter_mut().zip(q_rad.iter_mut().zip(qd_rad_s)) {
            *q = encoder.q.read(*q);
            *qd = encoder.qd.read(*qd);
        }
    }
}

/// The multiple of `step` that is nearest to `value`.
pub(super) fn quantised(value: f64, step: f64) -> f64 {
    (value / step).round() * step
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_number_per_joint_is_told_what_it_must_be() {
        let error = toml::from_str::<SensorConfig>("q_sd_rad = \"2e-5\"").unwrap_err().to_string();
        assert!(error.contains("a number for all joints, or a list"), "{error}");
        let list = toml::from_str::<SensorConfig>("q_sd_rad = [1e-5, 2e-5]").unwrap();
        assert_eq!(list.q_sd_rad, PerJoint::Each(vec![1e-5, 2e-5]));
    }
}
