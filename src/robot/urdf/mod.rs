//! Arms from URDF files.
//!
//! Input: the text of a URDF (parsed by the `urdf-rs` library) and, where the arm is part of a larger robot, the name
//! of its last link. Output: a [`UrdfArm`], which holds the [`Arm`](super::Arm), the named frames on its bodies
//! (flange, tool), the links that the bodies consist of, and a list of everything that was assumed or left out; or a
//! [`UrdfFault`] that says what is wrong, where, and what to do about it.

mod arm;
mod brief;
mod chain;
mod collision;
mod fault;
mod joint;
mod link;
mod locked;
mod notice;
mod obstacle;
mod read;
mod remarks;
#[cfg(test)]
mod tests;
mod tree;
mod unreadable;
mod words;

pub use arm::{FixedFrame, Frames, UrdfArm, UrdfLink};
pub use fault::UrdfFault;
pub(super) use fault::{infinitely_thin, plain_name};
pub use locked::{LockedJoint, Stand};
pub use notice::UrdfNotice;
pub use obstacle::Obstacle;
pub(super) use read::{arm_of, moving_links};
pub use read::{read_urdf, read_urdf_up_to};
pub(super) use words::{listed, unless_empty};
