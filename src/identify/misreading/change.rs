//! Ways in which the recording of a log can differ from how the log is read.

use std::f64::consts::FRAC_PI_2;
use std::fmt;

use nalgebra::Vector3;
use serde::ser::{Serialize, SerializeMap, Serializer};

use crate::robot::Arm;

/// The channels of a joint that a change affects.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Channels {
    /// Angle, velocity and torque.
    All,
    /// Angle and velocity.
    Motion,
    /// The torque, or the current.
    Torque,
}

impl Channels {
    /// Whether angle and velocity are among the channels.
    pub(super) fn have_motion(self) -> bool {
        self != Self::Torque
    }

    /// Whether the torque is among the channels.
    pub(super) fn have_torque(self) -> bool {
        self != Self::Motion
    }

    /// Names of the channels: as part of a `kind` in results, for one joint, and for several joints.
    fn words(self) -> [&'static str; 3] {
        match self {
            Self::All => ["joint", "angle, velocity and torque", "the columns"],
            Self::Motion => ["motion", "angle and velocity", "angles and velocities"],
            Self::Torque => ["torque", "the torque", "the torques"],
        }
    }
}

/// One difference between how a log is read and how it was recorded; joints are 0-based.
#[derive(Debug, Clone, PartialEq)]
pub enum Change {
    /// Channels of some joints are in the columns of other joints: ROS sorts joints by name.
    Ordered {
        /// Which channels.
        what: Channels,
        /// For each joint, the joint in whose columns its channels are.
        order: Vec<usize>,
    },
    /// Channels of a joint count the other way than the description's axis.
    Reversed {
        /// Which channels.
        what: Channels,
        /// Joint whose channels count the other way.
        joint: usize,
    },
    /// All torques count the other way: they are what the load exerts on the drives.
    AllTorquesReversed,
    /// The angle is counted from a zero that is quarter turns away from the described one.
    ZeroTurned {
        /// Joint whose zero is turned.
        joint: usize,
        /// Angle to be added to the recorded angles, rad.
        add_rad: f64,
    },
    /// The arm hangs, is mounted on a wall, or is inclined by 45°.
    Mounted {
        /// Gravity in the base frame, m/s².
        gravity_m_s2: [f64; 3],
    },
}

/// An exchange of two joints has a `kind` of its own; joints count from 1.
impl Serialize for Change {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let key = |what: &Channels| what.words()[0];
        let from_one = |joints: &[usize]| joints.iter().map(|j| j + 1).collect::<Vec<_>>();
        let mut map = serializer.serialize_map(None)?;
        match self {
            Self::Ordered { what, order } => match pair(order) {
                Some(joints) => {
                    map.serialize_entry("kind", &format!("{}s_exchanged", key(what)))?;
                    map.serialize_entry("joints", &from_one(&joints))?;
                }
                None => {
                    map.serialize_entry("kind", &format!("{}s_ordered", key(what)))?;
                    map.serialize_entry("order", &from_one(order))?;
                }
            },
            Self::Reversed { what, joint } => {
                map.serialize_entry("kind", &format!("{}_reversed", key(what)))?;
                map.serialize_entry("joints", &[joint + 1])?;
            }
            Self::AllTorquesReversed => map.serialize_entry("kind", "all_torques_reversed")?,
            Self::ZeroTurned { joint, add_rad } => {
                map.serialize_entry("kind", "zero_turned")?;
                map.serialize_entry("joints", &[joint + 1])?;
                map.serialize_entry("add_rad", add_rad)?;
            }
            Self::Mounted { gravity_m_s2 } => {
                map.serialize_entry("kind", "mounted")?;
                map.serialize_entry("gravity_m_s2", gravity_m_s2)?;
            }
        }
        map.end()
    }
}

/// The two joints that have exchanged places, if all others are in their own.
fn pair(order: &[usize]) -> Option<[usize; 2]> {
    let moved: Vec<usize> = (0..order.len()).filter(|k| order[*k] != *k).collect();
    moved.try_into().ok()
}

/// Additional cost, in steps, of changing the reading of encoders rather than of torques.
const ENCODERS: f64 = 0.1;
/// Additional cost, in steps, of another mounting. Of equally many changes, those that leave the arm mounted as
/// described cost less, even if they are changes of encoders; one change more costs more still. Without this cost,
/// another mounting could replace the right changes: signs and zeros of joints turn an arm upside down as well.
const MOUNTED: f64 = 0.7;
/// Cosine of the angle to the described gravity above which a direction counts as the described one.
const SAME_DIRECTION: f64 = 0.99;

impl Change {
    /// Exchanges two joints of an arm with `joints` joints.
    pub fn exchanged(what: Channels, [a, b]: [usize; 2], joints: usize) -> Self {
        let mut order: Vec<usize> = (0..joints).collect();
        order.swap(a, b);
        Self::Ordered { what, order }
    }

    /// All single changes that the search tries.
    pub(super) fn all(arm: &Arm) -> Vec<Self> {
        let n = arm.dof();
        let pairs = (0..n).flat_map(|a| (a + 1..n).map(move |b| [a, b]));
        let of_pairs = pairs.flat_map(|pair| {
            let places = [Channels::All, Channels::Torque, Channels::Motion];
            places.map(|what| Self::exchanged(what, pair, n))
        });
        let of_joints = (0..n).flat_map(|joint| {
            let reversed = |what| Self::Reversed { what, joint };
            let turned = |add_rad| Self::ZeroTurned { joint, add_rad };
            [
                reversed(Channels::Torque),
                reversed(Channels::All),
                reversed(Channels::Motion),
                turned(FRAC_PI_2),
                turned(-FRAC_PI_2),
                turned(2.0 * FRAC_PI_2),
            ]
        });
        let mounted =
            other_gravity(arm).into_iter().map(|gravity_m_s2| Self::Mounted { gravity_m_s2 });
        let of_all = of_pairs.chain(of_joints).chain(mounted).chain([Self::AllTorquesReversed]);
        of_all.chain(Self::orders(arm)).collect()
    }

    /// All changes of the order of whole columns.
    fn orders(arm: &Arm) -> Vec<Self> {
        let apart = shifted(arm.dof()).flat_map(|order| {
            let ordered = |what| Self::Ordered { what, order: order.clone() };
            [Channels::Torque, Channels::Motion].map(ordered)
        });
        Self::orders_of_joints(arm).into_iter().chain(apart).collect()
    }

    /// All channels of the joints in the order of their names, from the last to the first, and shifted by one or more
    /// columns.
    pub(super) fn orders_of_joints(arm: &Arm) -> Vec<Self> {
        let n = arm.dof();
        let name = |j: usize| &arm.joints[j].name;
        let rank = |j: usize| (0..n).filter(|k| (name(*k), *k) < (name(j), j)).count();
        let orders = [(0..n).map(rank).collect(), (0..n).rev().collect()];
        let orders = orders.into_iter().chain(shifted(n));
        orders.map(|order| Self::Ordered { what: Channels::All, order }).collect()
    }

    /// Cost of the change in steps: one step exchanges two joints or changes one thing. It costs a little more to
    /// change the reading of encoders alone: the torque of a light wrist reveals hardly more than that some channel
    /// counts the other way, and that is far more often the current.
    pub(super) fn steps(&self) -> f64 {
        let (what, steps) = match self {
            Self::Ordered { what, order } => (*what, exchanges(order)),
            Self::Reversed { what, .. } => (*what, 1),
            Self::AllTorquesReversed | Self::ZeroTurned { .. } => return 1.0,
            Self::Mounted { .. } => return 1.0 + MOUNTED,
        };
        steps as f64 + if what == Channels::Motion { ENCODERS } else { 0.0 }
    }

    /// Whether the change affects a channel of joint `j`.
    pub(super) fn is_about(&self, j: usize) -> bool {
        match self {
            Self::Ordered { order, .. } => order[j] != j,
            Self::Reversed { joint, .. } | Self::ZeroTurned { joint, .. } => *joint == j,
            Self::AllTorquesReversed | Self::Mounted { .. } => true,
        }
    }

    /// Whether the torque of joint `j` is in another joint's column.
    pub(super) fn moves_torque_of(&self, j: usize) -> bool {
        matches!(self, Self::Ordered { what, order } if what.have_torque() && order[j] != j)
    }

    /// States what to do about the change, in a sentence.
    pub(super) fn remedy(&self) -> &'static str {
        match self {
            Self::Mounted { .. } => {
                "Say how the arm is mounted: gravity_m_s2 in its robot file, or in the drives.toml beside its URDF."
            }
            _ => {
                "Say so in a layout ([joints], --layout), or correct the description of the robot."
            }
        }
    }
}

/// Number of exchanges of two places that lead to `order`.
fn exchanges(order: &[usize]) -> usize {
    let mut order = order.to_vec();
    let mut steps = 0;
    for k in 0..order.len() {
        while order[k] != k {
            let place = order[k];
            order.swap(k, place);
            steps += 1;
        }
    }
    steps
}

/// Orders of columns shifted by one or more places.
fn shifted(joints: usize) -> impl Iterator<Item = Vec<usize>> {
    (1..joints).map(move |by| (0..joints).map(|j| (j + by) % joints).collect())
}

/// Gravity along the axes of the base frame and halfway between any two of them, as strong as described, without the
/// described direction.
pub(super) fn other_gravity(arm: &Arm) -> Vec<[f64; 3]> {
    let described = arm.gravity_m_s2;
    let g = described.norm();
    let axes = [Vector3::x(), Vector3::y(), Vector3::z()];
    let along = axes.iter().flat_map(|axis| [*axis, -axis]);
    let between = [(0, 1), (0, 2), (1, 2)].into_iter().flat_map(|(a, b)| {
        let signs: [(f64, f64); 4] = [(1.0, 1.0), (1.0, -1.0), (-1.0, 1.0), (-1.0, -1.0)];
        signs.map(|(s, t)| (axes[a] * s + axes[b] * t).normalize())
    });
    let others = along.chain(between).filter(|d| g > 0.0 && d.dot(&described) < SAME_DIRECTION * g);
    // −0 + 0 = 0: a zero component has no minus sign.
    others.map(|direction| (direction * g).add_scalar(0.0).into()).collect()
}

impl fmt::Display for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Ordered { what, order } => {
                let [.., channels] = what.words();
                match pair(order) {
                    Some([a, b]) => {
                        write!(f, "{channels} of joints {} and {} exchanged", a + 1, b + 1)
                    }
                    None => {
                        let joints: Vec<String> =
                            order.iter().map(|joint| (joint + 1).to_string()).collect();
                        write!(f, "{channels} of the joints in the order {}", joints.join(", "))
                    }
                }
            }
            Self::Reversed { what, joint } => {
                let [_, channels, _] = what.words();
                write!(f, "{channels} of joint {} reversed", joint + 1)
            }
            Self::AllTorquesReversed => write!(f, "the torques of all joints reversed"),
            Self::ZeroTurned { joint, add_rad } => {
                write!(f, "{:+.0}° added to the angle of joint {}", add_rad.to_degrees(), joint + 1)
            }
            Self::Mounted { gravity_m_s2: [x, y, z] } => {
                write!(f, "gravity_m_s2 = [{x:.2}, {y:.2}, {z:.2}]")
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    /// The kinds as scripts read them.
    #[test]
    fn each_change_has_its_kind() {
        let of = |change: Change| serde_json::to_value(change).unwrap();
        for (what, key) in
            [(Channels::All, "joint"), (Channels::Motion, "motion"), (Channels::Torque, "torque")]
        {
            let exchanged = of(Change::exchanged(what, [0, 2], 3));
            let expected = json!({ "kind": format!("{key}s_exchanged"), "joints": [1, 3] });
            assert_eq!(exchanged, expected);
            let ordered = of(Change::Ordered { what, order: vec![1, 2, 0] });
            let expected = json!({ "kind": format!("{key}s_ordered"), "order": [2, 3, 1] });
            assert_eq!(ordered, expected);
            let reversed = of(Change::Reversed { what, joint: 1 });
            assert_eq!(reversed, json!({ "kind": format!("{key}_reversed"), "joints": [2] }));
        }
        assert_eq!(of(Change::AllTorquesReversed), json!({ "kind": "all_torques_reversed" }));
        let turned = of(Change::ZeroTurned { joint: 4, add_rad: 0.5 });
        assert_eq!(turned, json!({ "kind": "zero_turned", "joints": [5], "add_rad": 0.5 }));
        let mounted = of(Change::Mounted { gravity_m_s2: [0.0, 0.0, 9.5] });
        assert_eq!(mounted, json!({ "kind": "mounted", "gravity_m_s2": [0.0, 0.0, 9.5] }));
    }
}
