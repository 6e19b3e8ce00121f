//! How a recorder counts joints where the description of the robot counts otherwise.

use std::f64::consts::PI;

use serde::Deserialize;

use super::units::Angle;
use crate::log::error::LayoutFault;
use crate::log::record::{Effort, Log};
use crate::robot::JointSignals;

/// The `[joints]` table of a layout; joints count from 1.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub(in crate::log) struct Joints {
    /// Joints whose angle and velocity count the other way.
    motion_reversed: Vec<usize>,
    /// Joints whose current or torque counts the other way.
    torque_reversed: Vec<usize>,
    /// What is added to the angles, behind their reversal, in the file's unit of angle.
    zero: Option<Vec<f64>>,
}

impl Joints {
    /// Whether it can be said of an arm at all.
    pub(super) fn check(&self) -> Result<(), LayoutFault> {
        for (key, reversed) in self.reversed() {
            for (k, &joint) in reversed.iter().enumerate() {
                if joint == 0 {
                    return Err(LayoutFault::JointFromOne { key });
                }
                if reversed[..k].contains(&joint) {
                    return Err(LayoutFault::JointTwice { key, joint });
                }
            }
        }
        let zero = self.zero.iter().flatten().enumerate();
        match zero.into_iter().find(|(_, value)| !value.is_finite()) {
            Some((j, &value)) => Err(LayoutFault::Zero { joint: j + 1, value }),
            None => Ok(()),
        }
    }

    /// Whether it can be said of an arm with so many joints.
    pub(in crate::log) fn check_for(&self, joints: usize) -> Result<(), LayoutFault> {
        for (key, reversed) in self.reversed() {
            if let Some(&joint) = reversed.iter().find(|joint| **joint > joints) {
                return Err(LayoutFault::NoSuchJoint { key, joint, joints });
            }
        }
        match &self.zero {
            Some(zero) if zero.len() != joints => {
                Err(LayoutFault::Zeros { found: zero.len(), joints })
            }
            _ => Ok(()),
        }
    }

    fn reversed(&self) -> [(&'static str, &[usize]); 2] {
        [("motion_reversed", &self.motion_reversed), ("torque_reversed", &self.torque_reversed)]
    }

    /// Lets `log` count as the robot's description does.
    pub(in crate::log) fn apply(&self, log: &mut Log, unit: Angle) {
        let Log { q_rad, qd_rad_s, target_q_rad, target_qd_rad_s, target_qdd_rad_s2, .. } = log;
        let optional = [&mut *target_q_rad, target_qd_rad_s, target_qdd_rad_s2];
        let motion = [&mut *q_rad, qd_rad_s].into_iter().chain(optional.into_iter().flatten());
        motion.for_each(|signals| reverse(signals, &self.motion_reversed));
        let efforts = [&mut log.effort].into_iter().chain(&mut log.target_effort);
        for effort in efforts {
            let (Effort::Current { ampere: signals, .. } | Effort::Torque(signals)) = effort;
            reverse(signals, &self.torque_reversed);
        }
        let rad = if unit == Angle::Deg { PI / 180.0 } else { 1.0 };
        for (j, add) in self.zero.iter().flatten().enumerate().filter(|(_, add)| **add != 0.0) {
            for signals in [&mut *q_rad].into_iter().chain(&mut *target_q_rad) {
                signals.joint_mut(j).iter_mut().for_each(|q| *q += rad * add);
            }
        }
    }
}

fn reverse(signals: &mut JointSignals, joints: &[usize]) {
    joints.iter().for_each(|joint| signals.reverse(joint - 1));
}

#[cfg(test)]
mod tests {
    use crate::log::{Layout, Log, LogError, read_log_from};

    const FILE: &str = "t;q1;q2;w1;w2;m1;m2;g1;g2\n0.0;10;20;1;2;3;4;11;21\n0.1;10.1;20.2;1;2;3;4;11;21\n\
        0.2;10.2;20.4;1;2;3;4;11;21\n";

    fn read(joints: &str) -> Result<Log, LogError> {
        let text = format!(
            "name = \"mine\"\nheader = true\ndelimiter = \"semicolon\"\n{joints}\n[units]\nq = \"deg\"\nqd = \"deg/s\"\n[columns]\n\
             time = \"t\"\nq = \"q{{1}}\"\nqd = \"w{{1}}\"\ntorque = \"m{{1}}\"\ntarget_q = \"g{{1}}\"\n"
        );
        read_log_from(FILE.as_bytes(), "x.csv", &Layout::from_toml(&text, "mine.toml")?, 2)
    }

    #[test]
    fn joints_count_as_the_layout_says() {
        let as_written = read("").unwrap();
        let log = read("joints = { motion_reversed = [2], torque_reversed = [1], zero = [0, 90] }")
            .unwrap();
        let close =
            |a: f64, b_deg: f64| assert!((a.to_degrees() - b_deg).abs() < 1e-12, "{a} {b_deg}");
        close(log.q_rad.joint(1)[0], 70.0);
        close(log.qd_rad_s.joint(1)[0], -2.0);
        close(log.target_q_rad.as_ref().unwrap().joint(1)[0], 69.0);
        assert_eq!(log.effort.signals().joint(0)[0], -3.0);
        assert_eq!(log.effort.signals().joint(1), as_written.effort.signals().joint(1));
        assert_eq!(log.q_rad.joint(0), as_written.q_rad.joint(0));
        assert_eq!(log.qd_rad_s.joint(0), as_written.qd_rad_s.joint(0));
    }

    #[test]
    fn what_no_joint_can_be_is_refused() {
        for (joints, parts) in [
            ("joints = { motion_reversed = [0] }", ["motion_reversed", "from 1"]),
            ("joints = { torque_reversed = [2, 2] }", ["torque_reversed", "joint 2 twice"]),
            ("joints = { torque_reversed = [3] }", ["torque_reversed", "joint 3"]),
            ("joints = { zero = [0.0] }", ["zero", "1 number"]),
            ("joints = { zero = [0.0, nan] }", ["zero", "NaN"]),
            ("joints = { zeros = [0.0, 1.0] }", ["zeros", "unknown field"]),
        ] {
            let message = read(joints).unwrap_err().to_string();
            for part in parts {
                assert!(message.contains(part), "{joints}: {message}");
            }
        }
    }
}
