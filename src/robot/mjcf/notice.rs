//! Notices about what was assumed or left out in reading an MJCF, in addition to those that URDFs have too.

use std::fmt;

use crate::robot::urdf::listed;

/// Something that an MJCF says and an arm does not have, or the other way round.
#[derive(Debug, Clone, PartialEq)]
pub enum MjcfNotice {
    /// The file switches gravity off.
    Weightless,
    /// Bodies move in a medium that drags at them.
    Medium,
    /// Bodies that are connected by more than joints; the arm is read without these connections.
    Loops {
        /// Number of such connections.
        count: usize,
    },
    /// Something about joints that is no part of an [`Arm`](crate::robot::Arm).
    LeftOut {
        /// What is left out.
        what: LeftOut,
        /// The joints that have it.
        joints: Vec<String>,
    },
    /// Free joints are taken as locked.
    FreeJoints {
        /// The joints.
        joints: Vec<String>,
    },
    /// Sites with the same name as a body; the name then means the body.
    Namesakes {
        /// The sites.
        sites: Vec<String>,
    },
    /// Tendons that act on joints of the arm.
    Tendons {
        /// The tendons.
        tendons: Vec<String>,
    },
    /// Actuators that do not drive one joint, but pull or push at a site that moves with the arm.
    SiteActuators {
        /// The actuators.
        actuators: Vec<String>,
    },
    /// Bodies whose weight MuJoCo compensates.
    GravityCompensation {
        /// The bodies.
        bodies: Vec<String>,
    },
}

/// Properties that joints have in an MJCF, but not in an [`Arm`](crate::robot::Arm).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum LeftOut {
    /// A spring.
    Stiffness,
    /// A spring and a damper, given by their common time constant.
    SpringDamper,
    /// Damping that grows faster than the speed.
    HigherDamping,
    /// Friction that a `<flag>` disables.
    SwitchedOff,
    /// A joint that an `<equality>` holds in its place.
    Held,
    /// A joint that follows another along a curve.
    Curve,
}

impl fmt::Display for LeftOut {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Stiffness => "springs (stiffness) are no part of the arm",
            Self::SpringDamper => {
                "springs and dampers by their time constant (springdamper) are not read, damping there is taken as 0: MuJoCo works them out of the \
                 inertia, and writes them into the file when it saves the model (mj_saveLastXML)"
            }
            Self::HigherDamping => "of damping only the first number is read, which is in proportion to the speed",
            Self::SwitchedOff => "friction that the file switches off (<flag>) is taken as 0",
            Self::Held => "an <equality> that holds a joint in its place is not read",
            Self::Curve => "of polycoef only the first two numbers are read: a joint follows another in proportion",
        })
    }
}

impl fmt::Display for MjcfNotice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Weightless => write!(
                f,
                "the file switches gravity off; say gravity_m_s2 in NAME.drives.toml beside it if the arm has weight"
            ),
            Self::Medium => write!(
                f,
                "drag of the medium (density and viscosity of <option>) is not read, the arm moves without it"
            ),
            Self::Loops { count } => write!(
                f,
                "{count} <connect> or <weld> of <equality> are not read: where they close a loop of the arm's bodies, it is no serial arm and \
                 what is identified of it is not its own"
            ),
            Self::LeftOut { what, joints } => write!(f, "{what}: {}", listed(joints)),
            Self::FreeJoints { joints } => write!(
                f,
                "free joints are taken as locked where the file has them, so that what floats on them stands, also where it carries the arm: {}",
                listed(joints)
            ),
            Self::Namesakes { sites } => write!(
                f,
                "sites with the name of a body are no frames, the name means the body: {}",
                listed(sites)
            ),
            Self::Tendons { tendons } => write!(
                f,
                "tendons are not read, nor what they do to joints of the arm (drive, hold, couple, limit, slow down): {}",
                listed(tendons)
            ),
            Self::SiteActuators { actuators } => write!(
                f,
                "actuators at sites are not read, joints that they move have no torque limit of them: {}",
                listed(actuators)
            ),
            Self::GravityCompensation { bodies } => write!(
                f,
                "the file takes weight away (gravcomp), the arm has all of it, and its drives carry it: {}",
                listed(bodies)
            ),
        }
    }
}
