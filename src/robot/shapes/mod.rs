//! Collision shapes as capsules.
//!
//! Enters: an [`Arm`](super::Arm) that was read from a URDF or an MJCF, its links, and the collision shapes that the file has on
//! them; meshes are files that lie somewhere near. Leaves: the [`Clearance`](super::Clearance) of the arm, capsules that hold the
//! shapes and the pairs of them to keep apart, and a list of what is not watched and why ([`ShapeNotice`]).

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
