//! Arms from MJCF files, MuJoCo's own format.
//!
//! Enters: the text of an MJCF, the folder in which the files lie that it includes, and where the arm is a part of a robot the
//! name of its last body. Leaves: a [`MjcfArm`]: the [`Arm`](super::Arm), the named frames on its bodies, and a list of what
//! was assumed or left out; or a [`MjcfFault`] that says what is wrong, where, and what to do.
//!
//! Bodies become the links, joints the joints of a robot as a URDF describes one: which of them are the arm's, which are locked
//! and what belongs to one moving body is decided where this is decided for URDFs.

mod actuator;
mod body;
mod collision;
mod compiler;
mod defaults;
mod document;
mod element;
mod equality;
mod fault;
mod geom;
mod inertia;
mod joint;
mod notice;
mod option;
mod pose;
mod pull;
mod read;
#[cfg(test)]
mod tests;
mod words;

pub(super) use document::is_urdf;
pub use fault::MjcfFault;
pub use notice::{LeftOut, MjcfNotice};
pub use read::{MjcfArm, read_mjcf, read_mjcf_up_to};
