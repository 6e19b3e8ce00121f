//! A way to read a log, and the changes by which it differs from how the log is read.

use super::change::{Change, Channels};
use crate::log::{Counting, Place};

/// How the joints are counted in the log, and how the arm is mounted.
#[derive(Debug, Clone, PartialEq)]
pub struct Reading {
    counting: Counting,
    /// Gravity in the base frame, m/s²; `None`: as described.
    gravity_m_s2: Option<[f64; 3]>,
}

/// Zeros that differ by less are the same, rad: sums of quarter turns have round-off.
const SAME_ZERO_RAD: f64 = 1e-6;

impl Reading {
    /// The log of an arm with `joints` joints as it is read, without changes.
    pub fn as_read(joints: usize) -> Self {
        Self { counting: Counting::as_described(joints), gravity_m_s2: None }
    }

    /// How the joints are counted in what is read.
    pub fn counting(&self) -> &Counting {
        &self.counting
    }

    /// Gravity in the base frame where the arm is mounted otherwise than described, m/s².
    pub fn gravity_m_s2(&self) -> Option<[f64; 3]> {
        self.gravity_m_s2
    }

    /// The same reading with the arm mounted as described; `None` where it is so already.
    pub fn mounted_as_described(&self) -> Option<Self> {
        self.gravity_m_s2.map(|_| Self { counting: self.counting.clone(), gravity_m_s2: None })
    }

    /// This reading with `change` in addition.
    pub fn with(&self, change: &Change) -> Self {
        let mut other = self.clone();
        let counting = &mut other.counting;
        let joints = counting.motion().len();
        match change {
            Change::Ordered { what, order } => {
                if what.have_motion() {
                    counting.order_motions(order);
                }
                if what.have_torque() {
                    counting.order_torques(order);
                }
            }
            Change::Reversed { what, joint } => {
                if what.have_motion() {
                    counting.reverse_motion(*joint);
                }
                if what.have_torque() {
                    counting.reverse_torque(*joint);
                }
            }
            Change::AllTorquesReversed => (0..joints).for_each(|j| counting.reverse_torque(j)),
            Change::ZeroTurned { joint, add_rad } => counting.turn(*joint, *add_rad),
            Change::Mounted { gravity_m_s2 } => other.gravity_m_s2 = Some(*gravity_m_s2),
        }
        other.counting.leave_out_whole_turns();
        other
    }

    /// Whether `other` is the same but for round-off.
    pub fn is(&self, other: &Self) -> bool {
        let (a, b) = (&self.counting, &other.counting);
        let mut zeros = a.zero_rad().iter().zip(b.zero_rad());
        self.gravity_m_s2 == other.gravity_m_s2
            && a.motion() == b.motion()
            && a.torque() == b.torque()
            && zeros.all(|(a, b)| (a - b).abs() < SAME_ZERO_RAD)
    }

    /// The fewest changes that lead to this reading: places, then signs, then zeros, then the mounting.
    pub fn changes(&self) -> Vec<Change> {
        let counting = &self.counting;
        let joints = |places: &[Place]| places.iter().map(|p| p.joint).collect::<Vec<_>>();
        let (motion, torque) = (joints(counting.motion()), joints(counting.torque()));
        let mut changes = Vec::new();
        if motion == torque {
            changes.extend(ordered(&motion, Channels::All));
        } else if is_in_order(&motion) || is_in_order(&torque) {
            changes.extend(ordered(&motion, Channels::Motion));
            changes.extend(ordered(&torque, Channels::Torque));
        } else {
            let place_of = |joint: &usize| motion.iter().position(|other| other == joint);
            let behind: Vec<usize> = torque.iter().filter_map(place_of).collect();
            changes.extend(ordered(&motion, Channels::All));
            changes.extend(ordered(&behind, Channels::Torque));
        }
        changes.extend(self.reversals());
        for (joint, &add_rad) in counting.zero_rad().iter().enumerate() {
            if add_rad.abs() > SAME_ZERO_RAD {
                changes.push(Change::ZeroTurned { joint, add_rad });
            }
        }
        changes.extend(self.gravity_m_s2.map(|gravity_m_s2| Change::Mounted { gravity_m_s2 }));
        changes
    }

    /// The changes of signs: "all torques reversed" first, where that makes fewer changes.
    fn reversals(&self) -> Vec<Change> {
        let counting = &self.counting;
        let of_joints = |are_all_reversed: bool| {
            let places = counting.motion().iter().zip(counting.torque());
            let change = |(joint, (motion, torque)): (usize, (&Place, &Place))| {
                let what = match (motion.is_reversed, torque.is_reversed != are_all_reversed) {
                    (false, false) => return None,
                    (false, true) => Channels::Torque,
                    (true, false) => Channels::Motion,
                    (true, true) => Channels::All,
                };
                Some(Change::Reversed { what, joint })
            };
            places.enumerate().filter_map(change).collect::<Vec<_>>()
        };
        let (single, behind_all) = (of_joints(false), of_joints(true));
        match behind_all.len() + 1 < single.len() {
            true => [vec![Change::AllTorquesReversed], behind_all].concat(),
            false => single,
        }
    }
}

fn is_in_order(order: &[usize]) -> bool {
    order.iter().enumerate().all(|(k, place)| k == *place)
}

/// Exchanges of pairs, or the whole order where it is more than exchanges.
fn ordered(order: &[usize], what: Channels) -> Vec<Change> {
    let moved = || order.iter().enumerate().filter(|(k, place)| k != *place);
    if !moved().all(|(k, &place)| order[place] == k) {
        return vec![Change::Ordered { what, order: order.to_vec() }];
    }
    let pairs = moved().filter(|(k, place)| k < *place).map(|(k, &place)| [k, place]);
    pairs.map(|pair| Change::exchanged(what, pair, order.len())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::FRAC_PI_2;

    fn read_with(changes: &[Change]) -> Reading {
        changes.iter().fold(Reading::as_read(4), |reading, change| reading.with(change))
    }

    fn exchanged(what: Channels, a: usize, b: usize) -> Change {
        Change::exchanged(what, [a, b], 4)
    }

    #[test]
    fn what_is_done_twice_is_not_done() {
        let exchange = exchanged(Channels::All, 0, 2);
        let turn = Change::ZeroTurned { joint: 1, add_rad: 2.0 * FRAC_PI_2 };
        let reverse = Change::Reversed { what: Channels::Motion, joint: 3 };
        for change in [exchange, turn, reverse, Change::AllTorquesReversed] {
            let twice = read_with(&[change.clone(), change.clone()]);
            assert_eq!(twice.changes(), [], "{change:?}");
            assert!(twice.is(&Reading::as_read(4)), "{change:?}");
        }
    }

    #[test]
    fn many_steps_are_told_as_few_changes() {
        let torque = |joint| Change::Reversed { what: Channels::Torque, joint };
        let motion = |joint| Change::Reversed { what: Channels::Motion, joint };
        let joints = |a, b| exchanged(Channels::All, a, b);
        let torques = |a, b| exchanged(Channels::Torque, a, b);
        for (steps, changes) in [
            (vec![torque(0), torque(1), torque(2)], vec![Change::AllTorquesReversed, torque(3)]),
            (vec![torque(2), motion(2)], vec![Change::Reversed { what: Channels::All, joint: 2 }]),
            (vec![torque(0), joints(0, 3)], vec![joints(0, 3), torque(3)]),
            (
                vec![joints(0, 1), joints(1, 2)],
                vec![Change::Ordered { what: Channels::All, order: vec![1, 2, 0, 3] }],
            ),
            (vec![joints(0, 1), torques(0, 1)], vec![exchanged(Channels::Motion, 0, 1)]),
            (vec![joints(0, 1), torques(2, 3)], vec![joints(0, 1), torques(2, 3)]),
        ] {
            let reading = read_with(&steps);
            assert_eq!(reading.changes(), changes, "{steps:?}");
            assert!(read_with(&changes).is(&reading), "{changes:?}");
        }
    }
}
