//! Order, sign and zero of the joints where a recorder's convention differs from the robot's description.

use std::f64::consts::{PI, TAU};

use super::record::{Effort, Log};
use crate::robot::JointSignals;

/// The position and the sign of a joint's signal in a recording.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Place {
    /// The joint (0-based) in the recorder's numbering.
    pub joint: usize,
    /// Whether the recorder uses the opposite sign.
    pub is_reversed: bool,
}

/// The convention of a recording: positions, signs and zeros of all joints of an arm.
///
/// q_j = ± q_recorded(m_j) + zero_j,   q̇_j = ± q̇_recorded(m_j),   τ_j = ± τ_recorded(t_j).
#[derive(Debug, Clone, PartialEq)]
pub struct Counting {
    motion: Vec<Place>,
    torque: Vec<Place>,
    zero_rad: Vec<f64>,
}

impl Counting {
    /// The convention of the robot's description, for an arm with this many joints.
    pub fn as_described(joints: usize) -> Self {
        let places = |joint| Place { joint, is_reversed: false };
        let motion: Vec<Place> = (0..joints).map(places).collect();
        Self { torque: motion.clone(), motion, zero_rad: vec![0.0; joints] }
    }

    /// Position and sign of angle and velocity of each joint.
    pub fn motion(&self) -> &[Place] {
        &self.motion
    }

    /// Position and sign of the current or torque of each joint.
    pub fn torque(&self) -> &[Place] {
        &self.torque
    }

    /// Offset added to each angle after its sign is applied, rad.
    pub fn zero_rad(&self) -> &[f64] {
        &self.zero_rad
    }

    /// Whether the recorder's convention is that of the robot's description.
    pub fn is_as_described(&self) -> bool {
        *self == Self::as_described(self.motion.len())
    }

    /// Assigns to joint `k` (0-based) the angle and velocity that joint `order[k]` has had so far.
    pub fn order_motions(&mut self, order: &[usize]) {
        self.motion = order.iter().map(|&k| self.motion[k]).collect();
        self.zero_rad = order.iter().map(|&k| self.zero_rad[k]).collect();
    }

    /// Assigns to joint `k` (0-based) the torque that joint `order[k]` has had so far.
    pub fn order_torques(&mut self, order: &[usize]) {
        self.torque = order.iter().map(|&k| self.torque[k]).collect();
    }

    /// Reverses the sign of angle and velocity of joint `j` (0-based), its offset included.
    pub fn reverse_motion(&mut self, j: usize) {
        self.motion[j].is_reversed = !self.motion[j].is_reversed;
        // 0 − x instead of −x: this keeps 0 from becoming −0.
        self.zero_rad[j] = 0.0 - self.zero_rad[j];
    }

    /// Reverses the sign of the torque of joint `j` (0-based).
    pub fn reverse_torque(&mut self, j: usize) {
        self.torque[j].is_reversed = !self.torque[j].is_reversed;
    }

    /// Adds `add_rad` to the offset of the angle of joint `j` (0-based).
    pub fn turn(&mut self, j: usize, add_rad: f64) {
        self.zero_rad[j] += add_rad;
    }

    /// Removes whole turns from the offsets, which brings them into the interval (−π, π].
    pub fn leave_out_whole_turns(&mut self) {
        for zero in &mut self.zero_rad {
            // With this tolerance half a turn becomes +π in spite of round-off.
            let turns = ((*zero - PI) / TAU - 1e-9).ceil();
            // Adding 0 turns −0 into 0.
            *zero = *zero - turns * TAU + 0.0;
        }
    }

    /// Composes two conventions: the result reads a recording as if `earlier` were applied first and `self` to its
    /// result.
    pub fn of_what_is_read_with(&self, earlier: &Self) -> Self {
        let place = |of: &[Place], place: &Place| Place {
            joint: of[place.joint].joint,
            is_reversed: of[place.joint].is_reversed != place.is_reversed,
        };
        let mut both = Self {
            motion: self.motion.iter().map(|p| place(&earlier.motion, p)).collect(),
            torque: self.torque.iter().map(|p| place(&earlier.torque, p)).collect(),
            zero_rad: self.zero_rad.clone(),
        };
        for (j, p) in self.motion.iter().enumerate() {
            let zero_rad = earlier.zero_rad[p.joint];
            both.turn(j, if p.is_reversed { -zero_rad } else { zero_rad });
        }
        both
    }

    /// Angles in the arm's convention, rad.
    pub fn angles(&self, recorded: &JointSignals) -> JointSignals {
        let mut q_rad = placed(&self.motion, recorded);
        for (j, add) in self.zero_rad.iter().enumerate().filter(|(_, add)| **add != 0.0) {
            q_rad.joint_mut(j).iter_mut().for_each(|q| *q += add);
        }
        q_rad
    }

    /// Velocities or accelerations in the arm's convention.
    pub fn rates(&self, recorded: &JointSignals) -> JointSignals {
        placed(&self.motion, recorded)
    }

    /// Currents or torques in the arm's convention.
    pub fn torques(&self, recorded: &JointSignals) -> JointSignals {
        placed(&self.torque, recorded)
    }

    /// Converts a log from the recorder's convention to the arm's, in place.
    pub(super) fn apply(&self, log: &mut Log) {
        if self.is_as_described() {
            return;
        }
        log.q_rad = self.angles(&log.q_rad);
        log.qd_rad_s = self.rates(&log.qd_rad_s);
        log.target_q_rad = log.target_q_rad.as_ref().map(|y| self.angles(y));
        for rates in [&mut log.target_qd_rad_s, &mut log.target_qdd_rad_s2] {
            *rates = rates.as_ref().map(|y| self.rates(y));
        }
        let unsigned: Vec<Place> =
            self.motion.iter().map(|p| Place { is_reversed: false, ..*p }).collect();
        log.temperature_c = log.temperature_c.as_ref().map(|y| placed(&unsigned, y));
        for effort in [&mut log.effort].into_iter().chain(&mut log.target_effort) {
            let (Effort::Current { ampere: signals, .. } | Effort::Torque(signals)) = effort;
            *signals = self.torques(signals);
        }
    }
}

fn placed(places: &[Place], recorded: &JointSignals) -> JointSignals {
    JointSignals::from_fn(places.len(), recorded.samples(), |j, k| {
        let value = recorded.joint(places[j].joint)[k];
        if places[j].is_reversed { -value } else { value }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn signals() -> JointSignals {
        JointSignals::from_fn(3, 2, |j, k| 0.1 * (j + 1) as f64 + k as f64)
    }

    fn one() -> Counting {
        let mut one = Counting::as_described(3);
        one.order_motions(&[1, 2, 0]);
        one.reverse_motion(0);
        one.turn(0, 1.0);
        one.turn(2, -0.5);
        one.order_torques(&[0, 2, 1]);
        one.reverse_torque(2);
        one
    }

    fn assert_close(a: &JointSignals, b: &JointSignals) {
        for j in 0..a.joints() {
            let pairs = a.joint(j).iter().zip(b.joint(j));
            pairs.for_each(|(a, b)| assert!((a - b).abs() < 1e-14, "joint {j}: {a} {b}"));
        }
    }

    #[test]
    fn what_is_done_one_after_the_other_is_one_counting() {
        let mut other = Counting::as_described(3);
        other.order_motions(&[2, 1, 0]);
        other.order_torques(&[1, 2, 0]);
        other.reverse_motion(2);
        other.reverse_torque(1);
        other.turn(2, 0.25);
        let both = other.of_what_is_read_with(&one());
        let q = signals();
        assert_close(&both.angles(&q), &other.angles(&one().angles(&q)));
        assert_close(&both.rates(&q), &other.rates(&one().rates(&q)));
        assert_close(&both.torques(&q), &other.torques(&one().torques(&q)));
    }

    /// Changing a convention step by step reads the same values as applying the steps one after the other.
    #[test]
    fn steps_change_what_was_read_before() {
        let mut stepped = one();
        let mut step = Counting::as_described(3);
        for counting in [&mut stepped, &mut step] {
            counting.order_motions(&[0, 2, 1]);
            counting.reverse_motion(1);
            counting.turn(1, 0.125);
        }
        assert_close(&stepped.angles(&signals()), &step.angles(&one().angles(&signals())));
    }

    #[test]
    fn whole_turns_are_left_out() {
        let mut counting = Counting::as_described(1);
        for _ in 0..8 {
            counting.turn(0, PI / 2.0);
        }
        counting.leave_out_whole_turns();
        assert!(counting.is_as_described(), "{counting:?}");
        counting.turn(0, PI);
        let half = counting.zero_rad()[0];
        counting.reverse_motion(0);
        counting.leave_out_whole_turns();
        assert_eq!(counting.zero_rad()[0], half);
        assert!((half - PI).abs() < 1e-15);
    }
}
