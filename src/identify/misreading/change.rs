//! Ways in which a log can have been recorded otherwise than it is read.

use std::f64::consts::FRAC_PI_2;
use std::fmt;

use nalgebra::Vector3;
use serde::Serialize;

use crate::robot::Arm;

/// One difference between how a log is read and how it was recorded; joints are 0-based.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Change {
    /// Angle, velocity and torque of one joint stand in the columns of the other: ROS sorts joints by name.
    JointsExchanged {
        /// Both.
        #[serde(serialize_with = "from_one")]
        joints: [usize; 2],
    },
    /// The torques alone do.
    TorquesExchanged {
        /// Both.
        #[serde(serialize_with = "from_one")]
        joints: [usize; 2],
    },
    /// Angles and velocities alone do.
    MotionsExchanged {
        /// Both.
        #[serde(serialize_with = "from_one")]
        joints: [usize; 2],
    },
    /// Angle, velocity and torque stand in another order.
    JointsOrdered {
        /// Of each joint, where it stands.
        #[serde(serialize_with = "from_one")]
        order: Vec<usize>,
    },
    /// The torques alone do.
    TorquesOrdered {
        /// Of each joint, where it stands.
        #[serde(serialize_with = "from_one")]
        order: Vec<usize>,
    },
    /// Angles and velocities alone do.
    MotionsOrdered {
        /// Of each joint, where it stands.
        #[serde(serialize_with = "from_one")]
        order: Vec<usize>,
    },
    /// The torque drives against positive velocity.
    TorqueReversed {
        /// Whose.
        #[serde(serialize_with = "from_one")]
        joints: [usize; 1],
    },
    /// All torques do: they are what the load does to the drives.
    AllTorquesReversed,
    /// Angle, velocity and torque count the other way than the description's axis.
    JointReversed {
        /// Whose.
        #[serde(serialize_with = "from_one")]
        joints: [usize; 1],
    },
    /// Angle and velocity do, the torque does not.
    MotionReversed {
        /// Whose.
        #[serde(serialize_with = "from_one")]
        joints: [usize; 1],
    },
    /// The angle is counted from a zero that is quarter turns away from the description's.
    ZeroTurned {
        /// Whose.
        #[serde(serialize_with = "from_one")]
        joints: [usize; 1],
        /// What has to be added to the angles, rad.
        add_rad: f64,
    },
    /// The arm hangs, stands on a wall, or leans by half a right angle.
    Mounted {
        /// Gravity in the base frame, m/s².
        gravity_m_s2: [f64; 3],
    },
}

fn from_one<S: serde::Serializer>(
    joints: &impl AsRef<[usize]>,
    serializer: S,
) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(joints.as_ref().iter().map(|j| j + 1))
}

/// What it costs more to have encoders read otherwise than torques, in steps.
const ENCODERS: f64 = 0.1;
/// Gravity that is within this of the description's direction is the description's.
const SAME_DIRECTION: f64 = 0.99;

impl Change {
    /// All that are looked for.
    pub(super) fn all(arm: &Arm) -> Vec<Self> {
        let joints = 0..arm.dof();
        let pairs = joints.clone().flat_map(|a| (a + 1..arm.dof()).map(move |b| [a, b]));
        let of_pairs = pairs.flat_map(|joints| {
            [
                Self::JointsExchanged { joints },
                Self::TorquesExchanged { joints },
                Self::MotionsExchanged { joints },
            ]
        });
        let of_joints = joints.flat_map(|j| {
            let joints = [j];
            let turned = |add_rad| Self::ZeroTurned { joints, add_rad };
            [
                Self::TorqueReversed { joints },
                Self::JointReversed { joints },
                Self::MotionReversed { joints },
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

    /// Whole columns in other orders.
    fn orders(arm: &Arm) -> Vec<Self> {
        let apart = shifted(arm.dof()).flat_map(|order| {
            [Self::TorquesOrdered { order: order.clone() }, Self::MotionsOrdered { order }]
        });
        Self::orders_of_joints(arm).into_iter().chain(apart).collect()
    }

    /// The joints in the order of their names, from the last to the first, and one or more columns away.
    pub(super) fn orders_of_joints(arm: &Arm) -> Vec<Self> {
        let n = arm.dof();
        let name = |j: usize| &arm.joints[j].name;
        let rank = |j: usize| (0..n).filter(|k| (name(*k), *k) < (name(j), j)).count();
        let orders = [(0..n).map(rank).collect(), (0..n).rev().collect()];
        let orders = orders.into_iter().chain(shifted(n));
        orders.map(|order| Self::JointsOrdered { order }).collect()
    }

    /// In how many steps two joints exchange their places, or one thing changes; a little more where encoders alone are read otherwise: of a
    /// light wrist the torque tells hardly more than that something counts the other way, and that is the current's sign far more often.
    pub(super) fn steps(&self) -> f64 {
        match self {
            Self::MotionReversed { .. }
            | Self::MotionsExchanged { .. }
            | Self::MotionsOrdered { .. } => ENCODERS + self.exchanges() as f64,
            _ => self.exchanges() as f64,
        }
    }

    fn exchanges(&self) -> usize {
        match self {
            Self::JointsOrdered { order }
            | Self::TorquesOrdered { order }
            | Self::MotionsOrdered { order } => {
                let mut order = order.clone();
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
            _ => 1,
        }
    }

    /// Whether a channel of joint `j` is read otherwise.
    pub(super) fn is_about(&self, j: usize) -> bool {
        match self {
            Self::JointsExchanged { joints }
            | Self::TorquesExchanged { joints }
            | Self::MotionsExchanged { joints } => joints.contains(&j),
            Self::JointsOrdered { order }
            | Self::TorquesOrdered { order }
            | Self::MotionsOrdered { order } => order[j] != j,
            Self::TorqueReversed { joints }
            | Self::JointReversed { joints }
            | Self::MotionReversed { joints }
            | Self::ZeroTurned { joints, .. } => joints.contains(&j),
            Self::AllTorquesReversed | Self::Mounted { .. } => true,
        }
    }

    /// Whether the torque of joint `j` stands in another joint's column.
    pub(super) fn moves_torque_of(&self, j: usize) -> bool {
        match self {
            Self::JointsExchanged { joints } | Self::TorquesExchanged { joints } => {
                joints.contains(&j)
            }
            Self::JointsOrdered { order } | Self::TorquesOrdered { order } => order[j] != j,
            _ => false,
        }
    }

    /// What to do, in a sentence.
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

/// Orders of columns that stand one or more places away.
fn shifted(joints: usize) -> impl Iterator<Item = Vec<usize>> {
    (1..joints).map(move |by| (0..joints).map(|j| (j + by) % joints).collect())
}

/// Gravity along the axes of the base frame and half way between two of them, as strong as described and elsewhere.
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
    // −0 + 0 = 0: no minus sign in front of nothing.
    others.map(|direction| (direction * g).add_scalar(0.0).into()).collect()
}

impl fmt::Display for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let listed = |order: &[usize]| {
            let joints: Vec<String> = order.iter().map(|joint| (joint + 1).to_string()).collect();
            joints.join(", ")
        };
        match self {
            Self::JointsOrdered { order } => {
                write!(f, "the columns of the joints in the order {}", listed(order))
            }
            Self::TorquesOrdered { order } => {
                write!(f, "the torques in the order {}", listed(order))
            }
            Self::MotionsOrdered { order } => {
                write!(f, "angles and velocities in the order {}", listed(order))
            }
            Self::JointsExchanged { joints: [a, b] } => {
                write!(f, "the columns of joints {} and {} exchanged", a + 1, b + 1)
            }
            Self::TorquesExchanged { joints: [a, b] } => {
                write!(f, "the torques of joints {} and {} exchanged", a + 1, b + 1)
            }
            Self::MotionsExchanged { joints: [a, b] } => {
                write!(f, "angles and velocities of joints {} and {} exchanged", a + 1, b + 1)
            }
            Self::TorqueReversed { joints: [j] } => {
                write!(f, "the torque of joint {} reversed", j + 1)
            }
            Self::AllTorquesReversed => write!(f, "the torques of all joints reversed"),
            Self::JointReversed { joints: [j] } => {
                write!(f, "angle, velocity and torque of joint {} reversed", j + 1)
            }
            Self::MotionReversed { joints: [j] } => {
                write!(f, "angle and velocity of joint {} reversed", j + 1)
            }
            Self::ZeroTurned { joints: [j], add_rad } => {
                write!(f, "{:+.0}° added to the angle of joint {}", add_rad.to_degrees(), j + 1)
            }
            Self::Mounted { gravity_m_s2: [x, y, z] } => {
                write!(f, "gravity_m_s2 = [{x:.2}, {y:.2}, {z:.2}]")
            }
        }
    }
}
