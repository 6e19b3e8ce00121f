//! The result of reading a URDF.

use std::path::{Path, PathBuf};

use super::notice::UrdfNotice;
use crate::robot::arm::{Arm, Placement};
use crate::robot::inertia::LinkInertia;
use crate::robot::shapes::{LinkShape, Watched, watched};

/// An arm read from a URDF.
#[derive(Debug, Clone, PartialEq)]
pub struct UrdfArm {
    /// The arm.
    pub arm: Arm,
    /// Named frames, the links without mass on the bodies: flange, tool0.
    pub frames: Frames,
    /// All links of the file: those of the base, then those of body 1, and so on.
    pub links: Vec<UrdfLink>,
    /// Everything that was assumed, merged or left out; `Display` puts each into words.
    pub notices: Vec<UrdfNotice>,
    /// Mesh files of collision shapes that were read.
    pub meshes: Vec<PathBuf>,
}

impl UrdfArm {
    /// Gives the arm the clearance that follows from the `shapes` of its links; meshes are searched for from the folder
    /// of `source`.
    pub(in crate::robot) fn watch(&mut self, shapes: &[LinkShape], source: &str) {
        let folder = Path::new(source).parent().unwrap_or(Path::new(""));
        let Watched { clearance, notices, meshes } =
            watched(&self.arm, &self.links, shapes, folder);
        self.arm.clearance = clearance;
        self.notices.extend(notices.into_iter().map(UrdfNotice::Shapes));
        self.meshes = meshes;
    }
}

/// Named frames of an arm.
#[derive(Debug, Clone, PartialEq)]
pub struct Frames {
    /// Name of the base frame: the root link.
    pub root: String,
    /// The other frames.
    pub fixed: Vec<FixedFrame>,
}

/// No frames except the base, "base_link".
impl Default for Frames {
    fn default() -> Self {
        Self { root: "base_link".into(), fixed: Vec::new() }
    }
}

/// A named frame fixed in a body.
#[derive(Debug, Clone, PartialEq)]
pub struct FixedFrame {
    /// The link's name.
    pub name: String,
    /// 0 = base, i = body of joint i (1-based).
    pub body: usize,
    /// Its pose in the body's joint frame (base frame for body 0).
    pub placement: Placement,
}

/// A link of the file and the body that it is part of.
#[derive(Debug, Clone, PartialEq)]
pub struct UrdfLink {
    /// Its name.
    pub name: String,
    /// 0 = base, i = body of joint i (1-based).
    pub body: usize,
    /// Pose of its frame in the body's joint frame (base frame for body 0).
    pub placement: Placement,
    /// Its own inertial parameters about its own frame; `None` for a link without mass, and for a link of the base
    /// whose moments no body can have, which does not matter as it never moves.
    pub inertia: Option<LinkInertia>,
    /// Whether it is the link directly behind the moving joint (or the root link).
    pub is_first: bool,
}
