//! The log of one run.

use super::account::{LogWarning, RowAccount};
use super::error::LogError;
use crate::robot::{Arm, JointSignals};

/// One run of an arm: the measured signals, their times, and the account of the file's rows.
///
/// All signals have the same number of samples; times increase strictly. Angles follow the joint convention of the arm.
#[derive(Debug, Clone, PartialEq)]
pub struct Log {
    /// File or scenario that the log comes from.
    pub source: String,
    /// Time of every sample, s.
    pub time_s: Vec<f64>,
    /// Measured joint angles, rad.
    pub q_rad: JointSignals,
    /// Measured joint velocities, rad/s.
    pub qd_rad_s: JointSignals,
    /// Measured effort of the motors.
    pub effort: Effort,
    /// Angles the controller asked for, rad.
    pub target_q_rad: Option<JointSignals>,
    /// Velocities the controller asked for, rad/s.
    pub target_qd_rad_s: Option<JointSignals>,
    /// Accelerations the controller asked for, rad/s².
    pub target_qdd_rad_s2: Option<JointSignals>,
    /// The manufacturer's feed-forward: desired currents where logged, otherwise desired moments.
    pub target_effort: Option<Effort>,
    /// Joint temperatures, °C.
    pub temperature_c: Option<JointSignals>,
    /// Account of the file's rows: how many were used, and why others were not.
    pub rows: RowAccount,
    /// SHA-256 of the file's bytes in hexadecimal; empty for a log that was not read from a file.
    pub sha256: String,
}

/// Measured effort of the motors, in the quantity that was logged.
#[derive(Debug, Clone, PartialEq)]
pub enum Effort {
    /// Motor currents.
    Current {
        /// Motor current of every joint, A.
        ampere: JointSignals,
        /// Joint torque per ampere as stated by the layout, Nm/A; `None` stands for the arm's own i_G·k.
        gain_nm_a: Option<Vec<f64>>,
    },
    /// Motor torques at the joints, Nm.
    Torque(JointSignals),
}

impl Effort {
    /// The values in the unit that was logged (A or Nm).
    pub fn signals(&self) -> &JointSignals {
        match self {
            Self::Current { ampere, .. } => ampere,
            Self::Torque(nm) => nm,
        }
    }

    /// Joint torque per ampere, Nm/A: the value of the layout if it states one, otherwise the arm's i_G·k; `None` if
    /// torques were logged.
    fn gain_nm_a(&self, arm: &Arm) -> Option<Vec<f64>> {
        let own = || arm.joints.iter().map(|joint| joint.drive.gain_nm_a()).collect();
        match self {
            Self::Torque(_) => None,
            Self::Current { gain_nm_a, .. } => Some(gain_nm_a.clone().unwrap_or_else(own)),
        }
    }

    /// Motor torque at the joint, Nm: τ = gain · I; logged torques are returned unchanged.
    ///
    /// # Errors
    /// [`LogError::JointCount`] if signals, gains and arm differ in the number of joints; `file` is the name of the log
    /// in the message.
    fn torque_nm(&self, arm: &Arm, file: &str) -> Result<JointSignals, LogError> {
        let count = |what, found| {
            if found == arm.dof() {
                return Ok(());
            }
            Err(LogError::JointCount { file: file.to_owned(), what, found, expected: arm.dof() })
        };
        let signals = self.signals();
        count("the log", signals.joints())?;
        let Some(gain) = self.gain_nm_a(arm) else { return Ok(signals.clone()) };
        count("the layout's drive_gain_nm_a", gain.len())?;
        Ok(JointSignals::from_fn(signals.joints(), signals.samples(), |j, k| {
            gain[j] * signals.joint(j)[k]
        }))
    }
}

impl Log {
    /// Creates a log from signals, for example of a simulation or a test. Targets and temperatures may be set
    /// afterwards.
    ///
    /// # Errors
    /// [`LogError::Shape`] if the signals differ in joints or samples.
    pub fn new(
        source: impl Into<String>,
        time_s: Vec<f64>,
        q_rad: JointSignals,
        qd_rad_s: JointSignals,
        effort: Effort,
    ) -> Result<Self, LogError> {
        let log = Self {
            source: source.into(),
            rows: RowAccount::complete(time_s.len()),
            time_s,
            q_rad,
            qd_rad_s,
            effort,
            target_q_rad: None,
            target_qd_rad_s: None,
            target_qdd_rad_s2: None,
            target_effort: None,
            temperature_c: None,
            sha256: String::new(),
        };
        log.check_shape()?;
        Ok(log)
    }

    /// Number of joints.
    pub fn joints(&self) -> usize {
        self.q_rad.joints()
    }

    /// Number of samples.
    pub fn samples(&self) -> usize {
        self.time_s.len()
    }

    /// Measured motor torque at the joints, Nm: gain · current, or the torque that was logged.
    ///
    /// # Errors
    /// [`LogError::JointCount`] if the number of joints of the log, or of the layout's gains, differs from that of the
    /// arm.
    pub fn torque_nm(&self, arm: &Arm) -> Result<JointSignals, LogError> {
        self.effort.torque_nm(arm, &self.source)
    }

    /// Joint torque per ampere that [`Log::torque_nm`] multiplies currents with, Nm/A; `None` if torques were logged.
    pub fn drive_gain_nm_a(&self, arm: &Arm) -> Option<Vec<f64>> {
        self.effort.gain_nm_a(arm)
    }

    /// Warns if [`Log::torque_nm`] multiplies currents with gains of the `arm` that are a guess.
    pub fn warn_of_assumed_gains(&mut self, arm: &Arm) {
        if arm.drive_gains_assumed
            && let Effort::Current { gain_nm_a: None, .. } = self.effort
            && let Some(gain_nm_a) = self.drive_gain_nm_a(arm)
        {
            let robot = arm.name.clone();
            self.rows.warnings.push(LogWarning::AssumedGains { robot, gain_nm_a });
        }
    }

    /// The manufacturer's feed-forward as torque at the joints, Nm; `None` if it was not logged.
    ///
    /// # Errors
    /// As [`Log::torque_nm`].
    pub fn target_torque_nm(&self, arm: &Arm) -> Result<Option<JointSignals>, LogError> {
        self.target_effort.as_ref().map(|effort| effort.torque_nm(arm, &self.source)).transpose()
    }

    pub(super) fn check_shape(&self) -> Result<(), LogError> {
        let (joints, samples) = (self.joints(), self.samples());
        let signals = [
            ("q", Some(&self.q_rad)),
            ("qd", Some(&self.qd_rad_s)),
            ("effort", Some(self.effort.signals())),
            ("target q", self.target_q_rad.as_ref()),
            ("target qd", self.target_qd_rad_s.as_ref()),
            ("target qdd", self.target_qdd_rad_s2.as_ref()),
            ("target effort", self.target_effort.as_ref().map(Effort::signals)),
            ("temperature", self.temperature_c.as_ref()),
        ];
        for (signal, values) in signals {
            let Some(values) = values else { continue };
            if values.joints() != joints || values.samples() != samples {
                return Err(LogError::Shape {
                    file: self.source.clone(),
                    signal,
                    found_joints: values.joints(),
                    found_samples: values.samples(),
                    joints,
                    samples,
                });
            }
        }
        Ok(())
    }
}
