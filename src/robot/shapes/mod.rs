//! Conversion of collision shapes into capsules.
//!
//! Input: an [`Arm`](super::Arm) that was read from a URDF or an MJCF, its links, and their collision shapes in the
//! file; mesh files are searched for near that file. Output: the [`Clearance`](super::Clearance) of the arm, which
//! consists of capsules that contain the shapes and the pairs of capsules to keep apart, and a list of everything that
//! is not watched and why ([`ShapeNotice`]).

mod clearance;
mod enclosure;
mod group;
mod mesh;
mod notice;
mod poses;
mod shape;
#[cfg(test)]
mod tests;

pub(super) use clearance::{Watched, watched};
pub use notice::ShapeNotice;
pub(super) use shape::{LinkShape, Shape};
