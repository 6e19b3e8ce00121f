//! Arms from URDF files.
//!
//! Enters: the text of a URDF (parsed by the `urdf-rs` library). Leaves: a [`UrdfArm`]: the
//! [`Arm`](super::Arm), the named frames on its bodies (flange, tool), and a list of everything that was
//! assumed or left out on the way; or a [`UrdfFault`] that says what is wrong, where, and what to
//! do.

mod chain;
mod fault;
mod notice;
mod read;
#[cfg(test)]
mod tests;
mod unreadable;

pub use fault::UrdfFault;
pub use notice::UrdfNotice;
pub use read::{FixedFrame, Frames, UrdfArm, read_urdf};
