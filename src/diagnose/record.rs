//! A log's record with its faults taken back, as far as they can be.

use super::kind::Kind;
use super::verdict::Cause;
use crate::identify::Measurement;
use crate::robot::JointSignals;

/// See the module.
pub struct Record {
    /// Time, s.
    pub time_s: Vec<f64>,
    /// Angles, rad.
    pub q_rad: JointSignals,
    /// Velocities, rad/s.
    pub qd_rad_s: JointSignals,
    /// Torques, Nm.
    pub torque_nm: JointSignals,
}

impl Record {
    /// Of `m` without the rows `left_out`, which are in rising order.
    pub fn without_rows(m: &Measurement, left_out: &[usize]) -> Self {
        let rows: Vec<usize> =
            (0..m.time_s.len()).filter(|k| left_out.binary_search(k).is_err()).collect();
        let of = |signals: &JointSignals| {
            JointSignals::from_fn(signals.joints(), rows.len(), |j, k| signals.joint(j)[rows[k]])
        };
        Self {
            time_s: rows.iter().map(|&k| m.time_s[k]).collect(),
            q_rad: of(m.q_rad),
            qd_rad_s: of(m.qd_rad_s),
            torque_nm: of(m.torque_nm),
        }
    }

    /// As a measurement.
    pub fn measurement<'a>(&'a self, source: &'a str) -> Measurement<'a> {
        Measurement {
            source,
            time_s: &self.time_s,
            q_rad: &self.q_rad,
            qd_rad_s: &self.qd_rad_s,
            torque_nm: &self.torque_nm,
        }
    }

    /// `lost_s` passed behind each of `rows` without the clock showing it.
    pub fn give_back_time(&mut self, rows: &[usize], lost_s: f64) {
        for (k, time) in self.time_s.iter_mut().enumerate() {
            *time += lost_s * rows.partition_point(|row| *row < k) as f64;
        }
    }

    /// Takes back the lags among `causes`.
    pub fn undo_lags(&mut self, causes: &[Cause]) {
        for lag in causes.iter().filter(|cause| cause.kind == Kind::VelocityLag) {
            self.undo_lag(lag.joint.map(|j| j - 1), lag.parameters["delay_s"].value);
        }
    }

    /// The velocity of `joint` (of all: `None`) came `lag_s` late: straight lines between samples give what
    /// it was.
    fn undo_lag(&mut self, joint: Option<usize>, lag_s: f64) {
        let t = &self.time_s;
        for j in joint.map_or(0..self.qd_rad_s.joints(), |j| j..j + 1) {
            let late = self.qd_rad_s.joint(j).to_vec();
            for (value, now) in self.qd_rad_s.joint_mut(j).iter_mut().zip(t) {
                let at = now + lag_s;
                let right = t.partition_point(|s| *s < at).clamp(1, t.len() - 1);
                let u = ((at - t[right - 1]) / (t[right] - t[right - 1])).clamp(0.0, 1.0);
                *value = late[right - 1] * (1.0 - u) + late[right] * u;
            }
        }
    }

    /// Puts other torques in place of single samples of joint `j`.
    pub fn replace_torque(&mut self, j: usize, samples: &[(usize, f64)]) {
        for &(k, value) in samples {
            self.torque_nm.joint_mut(j)[k] = value;
        }
    }
}
