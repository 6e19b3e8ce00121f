//! Recording of a simulated run: the truth at the instants of the log.

use crate::robot::JointSignals;

/// The noise-free signals of a run, sampled at the log's rate.
#[derive(Debug, Clone, PartialEq)]
pub struct Recording {
    /// Time from the start of the reference, s.
    pub time_s: Vec<f64>,
    /// Angles at the encoders (those of the joints if the gears are rigid), rad.
    pub q_rad: JointSignals,
    /// Velocities at the encoders, rad/s.
    pub qd_rad_s: JointSignals,
    /// Drive torque i_G k I at the joint, before friction, Nm. At instants at which the controller decides, it is the
    /// mean of the torques held before and after the decision.
    pub torque_nm: JointSignals,
    /// Reference angles, rad.
    pub target_q_rad: JointSignals,
    /// Reference velocities, rad/s.
    pub target_qd_rad_s: JointSignals,
    /// Reference accelerations, rad/s².
    pub target_qdd_rad_s2: JointSignals,
    /// Readings of the controller at these instants; `None` if it read the truth.
    pub readings: Option<Readings>,
    /// Number of decisions of the controller, within the part of the run that was integrated, at which at least one
    /// drive was at its limit.
    pub saturated_decisions: usize,
}

/// Positions and velocities as the controller read them.
#[derive(Debug, Clone, PartialEq)]
pub struct Readings {
    /// Joint angles, rad.
    pub q_rad: JointSignals,
    /// Joint velocities, rad/s.
    pub qd_rad_s: JointSignals,
}

impl Recording {
    /// The same run continued to `samples` rows: each row after the first `known` ones is a copy of the row one period
    /// (`period` rows) earlier.
    pub fn repeated(&self, known: usize, period: usize, samples: usize, log_rate_hz: f64) -> Self {
        let signals = |s: &JointSignals| repeated(s, known, period, samples);
        Self {
            time_s: (0..samples)
                .map(|k| if k < known { self.time_s[k] } else { k as f64 / log_rate_hz })
                .collect(),
            q_rad: signals(&self.q_rad),
            qd_rad_s: signals(&self.qd_rad_s),
            torque_nm: signals(&self.torque_nm),
            target_q_rad: signals(&self.target_q_rad),
            target_qd_rad_s: signals(&self.target_qd_rad_s),
            target_qdd_rad_s2: signals(&self.target_qdd_rad_s2),
            readings: self.readings.as_ref().map(|read| Readings {
                q_rad: signals(&read.q_rad),
                qd_rad_s: signals(&read.qd_rad_s),
            }),
            saturated_decisions: self.saturated_decisions,
        }
    }

    /// A recording of zeros for `joints` × `samples`, with memory for readings if `with_readings`.
    pub(super) fn zeros(joints: usize, samples: usize, with_readings: bool) -> Self {
        let zeros = || JointSignals::zeros(joints, samples);
        Self {
            time_s: vec![0.0; samples],
            q_rad: zeros(),
            qd_rad_s: zeros(),
            torque_nm: zeros(),
            target_q_rad: zeros(),
            target_qd_rad_s: zeros(),
            target_qdd_rad_s2: zeros(),
            readings: with_readings.then(|| Readings { q_rad: zeros(), qd_rad_s: zeros() }),
            saturated_decisions: 0,
        }
    }
}

/// `signals` continued to `samples` samples: each one after the first `known` is a copy of the one `period` samples
/// earlier.
fn repeated(signals: &JointSignals, known: usize, period: usize, samples: usize) -> JointSignals {
    signals.map_joints(|_, y| {
        let back = |k: usize| k - (k + 1 - known).div_ceil(period) * period;
        (0..samples).map(|k| y[if k < known { k } else { back(k) }]).collect()
    })
}
