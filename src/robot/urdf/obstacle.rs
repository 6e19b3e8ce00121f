//! Reasons why the joints of a URDF are not those of one arm.

use std::fmt;

use urdf_rs::{Joint, JointType};

/// Something that a serial arm of revolute joints does not have.
#[derive(Debug, Clone, PartialEq)]
pub enum Obstacle {
    /// A moving joint that is not a single rotation.
    JointType {
        /// The joint.
        joint: String,
        /// Its type.
        kind: &'static str,
    },
    /// A joint that mimics another.
    Mimic {
        /// The joint.
        joint: String,
        /// The joint it follows.
        of: String,
    },
    /// Several rotating joints on one body.
    Branch {
        /// The first link of the body that carries them.
        body: String,
        /// The joints.
        joints: Vec<String>,
    },
}

impl Obstacle {
    /// The reason why a joint cannot be part of an arm; `None` for a fixed joint and for one that turns independently.
    pub(super) fn of(joint: &Joint) -> Option<Self> {
        let name = || joint.name.clone();
        let kind = match joint.joint_type {
            JointType::Fixed => return None,
            JointType::Revolute | JointType::Continuous => {
                let mimic = joint.mimic.as_ref();
                return mimic.map(|mimic| Self::Mimic { joint: name(), of: mimic.joint.clone() });
            }
            JointType::Prismatic => "prismatic",
            JointType::Floating => "floating",
            JointType::Planar => "planar",
            JointType::Spherical => "spherical",
        };
        Some(Self::JointType { joint: name(), kind })
    }
}

impl fmt::Display for Obstacle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::JointType { joint, kind } => write!(f, "joint \"{joint}\" is {kind}"),
            Self::Mimic { joint, of } => write!(f, "joint \"{joint}\" mimics \"{of}\""),
            Self::Branch { body, joints } => write!(
                f,
                "the chain branches behind \"{body}\" (joints \"{}\")",
                joints.join("\", \"")
            ),
        }
    }
}
