//! Description of an arm: joints, frames, links, drives, limits and clearance.
//!
//! Input: a built-in name, a robot file (TOML), a URDF or an MJCF. Output: an immutable [`Arm`], and [`JointSignals`],
//! the layout in which all other modules hold one number per joint and sample.

pub mod export;

mod angles;
mod arm;
mod error;
mod file;
mod inertia;
mod kinematics;
mod mjcf;
pub(crate) mod nearest;
mod place;
mod shapes;
mod signals;
mod urdf;

pub(crate) use arm::ON_AXIS;
pub use arm::{
    Arm, Assumed, Capsule, CellBox, Clearance, Drive, Joint, Limits, LinkBounds, Placement,
};
pub use error::RobotError;
pub use file::{LoadedArm, built_in_names};
pub(crate) use file::{is_urdf, text_of};
pub use inertia::LinkInertia;
pub use kinematics::{Kinematics, KinematicsDifference};
pub use mjcf::{LeftOut, MjcfArm, MjcfFault, MjcfNotice, read_mjcf, read_mjcf_up_to};
pub use shapes::ShapeNotice;
pub use signals::JointSignals;
pub use urdf::{
    FixedFrame, Frames, LockedJoint, Obstacle, Stand, UrdfArm, UrdfFault, UrdfLink, UrdfNotice,
    read_urdf, read_urdf_up_to,
};
