//! Arms from MJCF files, MuJoCo's own format.
//!
//! Input: the text of an MJCF, the folder of the files that it includes, and, where the arm is part of a larger robot,
//! the name of its last body. Output: a [`MjcfArm`], which holds the [`Arm`](super::Arm), the named frames on its
//! bodies, and a list of what was assumed or left out; or a [`MjcfFault`] that says what is wrong, where, and what to
//! do about it.
//!
//! Bodies and joints of the MJCF are converted into links and joints of a URDF robot. The code for URDFs then decides
//! which joints are the arm's, which are locked, and what belongs to one moving body.

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
