//! The `[joints]` table of a layout: order, signs and zeros of the joints.

use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;

use serde::{Deserialize, Serialize};

use super::fault::LayoutFault;
use super::units::Angle;
use crate::log::counting::{Counting, Place};

/// Where the joints of a recorder differ in order, sign or zero from the description of the robot; joints count from 1.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Joints {
    /// For each joint of the arm, the number of that joint in the recording.
    #[serde(skip_serializing_if = "Option::is_none")]
    order: Option<Vec<usize>>,
    /// The same for currents and torques, if they are recorded in another order.
    #[serde(skip_serializing_if = "Option::is_none")]
    torque_order: Option<Vec<usize>>,
    /// Joints of the arm whose angle and velocity are recorded with the opposite sign.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    motion_reversed: Vec<usize>,
    /// Joints of the arm whose current or torque is recorded with the opposite sign.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    torque_reversed: Vec<usize>,
    /// Offsets added to the angles of the arm's joints after their sign is applied, in the file's unit of angle.
    #[serde(skip_serializing_if = "Option::is_none")]
    zero: Option<Vec<f64>>,
}

impl Joints {
    /// Checks everything that does not depend on the number of joints.
    pub(super) fn check(&self, unit: Angle) -> Result<(), LayoutFault> {
        for (key, joints) in self.lists() {
            for (k, &joint) in joints.iter().enumerate() {
                if joint == 0 {
                    return Err(LayoutFault::JointFromOne { key });
                }
                if joints[..k].contains(&joint) {
                    return Err(LayoutFault::JointTwice { key, joint });
                }
            }
        }
        for (j, &value) in self.zero.iter().flatten().enumerate() {
            if !value.is_finite() {
                return Err(LayoutFault::Zero { joint: j + 1, value });
            }
            if unit == Angle::Rad && value.abs() > TAU {
                return Err(LayoutFault::ZeroInDegrees { joint: j + 1, value });
            }
        }
        Ok(())
    }

    /// Checks that the table fits an arm with this many joints.
    pub(super) fn check_for(&self, joints: usize) -> Result<(), LayoutFault> {
        for (key, list) in self.lists() {
            if let Some(&joint) = list.iter().find(|joint| **joint > joints) {
                return Err(LayoutFault::NoSuchJoint { key, joint, joints });
            }
        }
        let of_all = [("order", &self.order), ("torque_order", &self.torque_order)];
        let lengths = of_all.map(|(key, order)| (key, order.as_ref().map(Vec::len)));
        let zero = ("zero", self.zero.as_ref().map(Vec::len));
        match lengths.into_iter().chain([zero]).find(|(_, n)| n.is_some_and(|n| n != joints)) {
            Some((key, Some(found))) => Err(LayoutFault::NotAllJoints { key, found, joints }),
            _ => Ok(()),
        }
    }

    fn lists(&self) -> [(&'static str, &[usize]); 4] {
        [
            ("order", self.order.as_deref().unwrap_or_default()),
            ("torque_order", self.torque_order.as_deref().unwrap_or_default()),
            ("motion_reversed", &self.motion_reversed),
            ("torque_reversed", &self.torque_reversed),
        ]
    }

    /// The convention that the table states for an arm with this many joints; [`Self::check_for`] must have passed.
    pub(super) fn counting(&self, joints: usize, unit: Angle) -> Counting {
        let mut counting = Counting::as_described(joints);
        let from_zero = |order: &Vec<usize>| order.iter().map(|joint| joint - 1).collect();
        let order: Option<Vec<usize>> = self.order.as_ref().map(from_zero);
        let torque_order = self.torque_order.as_ref().map(from_zero);
        if let Some(order) = torque_order.as_ref().or(order.as_ref()) {
            counting.order_torques(order);
        }
        if let Some(order) = order {
            counting.order_motions(&order);
        }
        self.motion_reversed.iter().for_each(|joint| counting.reverse_motion(joint - 1));
        self.torque_reversed.iter().for_each(|joint| counting.reverse_torque(joint - 1));
        for (j, add) in self.zero.iter().flatten().enumerate() {
            counting.turn(j, add * unit.rad());
        }
        counting
    }

    /// The table that states the convention `counting`, for a file with angles in `unit`.
    pub(super) fn of(counting: &Counting, unit: Angle) -> Self {
        let joints = counting.motion().len();
        let order = |places: &[Place]| places.iter().map(|p| p.joint + 1).collect::<Vec<_>>();
        let unless = |order: Vec<usize>, plain: &[usize]| (order != plain).then_some(order);
        let reversed = |places: &[Place]| {
            (1..).zip(places).filter(|(_, p)| p.is_reversed).map(|(joint, _)| joint).collect()
        };
        let plain: Vec<usize> = (1..=joints).collect();
        let motion = order(counting.motion());
        let zero: Vec<f64> =
            counting.zero_rad().iter().map(|rad| rounded(rad / unit.rad())).collect();
        Self {
            torque_order: unless(order(counting.torque()), &motion),
            order: unless(motion, &plain),
            motion_reversed: reversed(counting.motion()),
            torque_reversed: reversed(counting.torque()),
            zero: zero.iter().any(|zero| *zero != 0.0).then_some(zero),
        }
    }

    /// The table as text of a layout file, starting with `[joints]`.
    pub(super) fn lines(&self) -> String {
        let mut lines = "[joints]".to_owned();
        for (key, joints) in self.lists().iter().filter(|(_, joints)| !joints.is_empty()) {
            let _ = write!(lines, "\n{key} = {joints:?}");
        }
        if let Some(zero) = &self.zero {
            let _ = write!(lines, "\nzero = {zero:?}");
        }
        lines
    }
}

/// Rounds to twelve decimals, so that 90.00000000000001 becomes 90: the conversion of units leaves no more digits than
/// that.
fn rounded(zero: f64) -> f64 {
    const DIGITS: f64 = 1e12;
    // Adding 0 turns −0 into 0.
    (zero * DIGITS).round() / DIGITS + 0.0
}

impl Angle {
    /// One unit of the angle, in rad.
    fn rad(self) -> f64 {
        match self {
            Self::Rad => 1.0,
            Self::Deg => PI / 180.0,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::log::{Layout, Log, LogError, read_log_from};

    const FILE: &str = "t;q1;q2;w1;w2;m1;m2;g1;g2\n0.0;10;20;1;2;3;4;11;21\n0.1;10.1;20.2;1;2;3;4;11;21\n\
        0.2;10.2;20.4;1;2;3;4;11;21\n";

    fn text(joints: &str) -> String {
        format!(
            "name = \"mine\"\nheader = true\ndelimiter = \"semicolon\"\n{joints}\n[units]\nq = \"deg\"\nqd = \"deg/s\"\n[columns]\n\
             time = \"t\"\nq = \"q{{1}}\"\nqd = \"w{{1}}\"\ntorque = \"m{{1}}\"\ntarget_q = \"g{{1}}\"\n"
        )
    }

    fn read(joints: &str) -> Result<Log, LogError> {
        let layout = Layout::from_toml(&text(joints), "mine.toml")?;
        read_log_from(FILE.as_bytes(), "x.csv", &layout, 2)
    }

    fn close(a: f64, b_deg: f64) {
        assert!((a.to_degrees() - b_deg).abs() < 1e-12, "{a} {b_deg}");
    }

    #[test]
    fn joints_count_as_the_layout_says() {
        let as_written = read("").unwrap();
        let log = read("joints = { motion_reversed = [2], torque_reversed = [1], zero = [0, 90] }")
            .unwrap();
        close(log.q_rad.joint(1)[0], 70.0);
        close(log.qd_rad_s.joint(1)[0], -2.0);
        close(log.target_q_rad.as_ref().unwrap().joint(1)[0], 69.0);
        assert_eq!(log.effort.signals().joint(0)[0], -3.0);
        assert_eq!(log.effort.signals().joint(1), as_written.effort.signals().joint(1));
        assert_eq!(log.q_rad.joint(0), as_written.q_rad.joint(0));
        assert_eq!(log.qd_rad_s.joint(0), as_written.qd_rad_s.joint(0));
    }

    #[test]
    fn joints_stand_where_the_layout_says() {
        let log = read("joints = { order = [2, 1], motion_reversed = [1] }").unwrap();
        close(log.q_rad.joint(0)[0], -20.0);
        close(log.q_rad.joint(1)[0], 10.0);
        close(log.qd_rad_s.joint(0)[0], -2.0);
        close(log.target_q_rad.as_ref().unwrap().joint(1)[0], 11.0);
        assert_eq!(log.effort.signals().joint(0)[0], 4.0);
        let log = read("joints = { order = [2, 1], torque_order = [1, 2] }").unwrap();
        close(log.q_rad.joint(0)[0], 20.0);
        assert_eq!(log.effort.signals().joint(0)[0], 3.0);
        let log = read("joints = { torque_order = [2, 1] }").unwrap();
        close(log.q_rad.joint(0)[0], 10.0);
        assert_eq!(log.effort.signals().joint(0)[0], 4.0);
    }

    /// The text printed for a convention reads back as the same convention.
    #[test]
    fn the_lines_say_what_they_were_made_of() {
        let said = "joints = { order = [2, 1], torque_order = [1, 2], motion_reversed = [2], torque_reversed = [1], zero = [0, -90] }";
        let layout = Layout::from_toml(&text(said), "mine.toml").unwrap();
        let counting = layout.counting(2);
        for unit in [Angle::Deg, Angle::Rad] {
            let lines = Joints::of(&counting, unit).lines();
            let again: toml::Table = toml::from_str(&lines).unwrap();
            let again: Joints = again["joints"].clone().try_into().unwrap();
            let again = again.counting(2, unit);
            assert_eq!(again.motion(), counting.motion(), "{lines}");
            assert_eq!(again.torque(), counting.torque(), "{lines}");
            assert!((again.zero_rad()[1] - counting.zero_rad()[1]).abs() < 1e-12, "{lines}");
        }
        assert!(Joints::of(&counting, Angle::Deg).lines().contains("zero = [0.0, -90.0]"));
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
            ("joints = { order = [1] }", ["order", "1 number"]),
            ("joints = { order = [1, 1] }", ["order", "joint 1 twice"]),
            ("joints = { torque_order = [1, 3] }", ["torque_order", "joint 3"]),
        ] {
            let message = read(joints).unwrap_err().to_string();
            for part in parts {
                assert!(message.contains(part), "{joints}: {message}");
            }
        }
    }

    #[test]
    fn degrees_among_radians_are_refused() {
        let text = text("joints = { zero = [0, 90] }").replace("q = \"deg\"", "q = \"rad\"");
        let message = Layout::from_toml(&text, "mine.toml").unwrap_err().to_string();
        for part in ["joint 2", "90", "degrees", "1.5708"] {
            assert!(message.contains(part), "{message}");
        }
    }
}
