//! What a URDF is read as.

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
    /// Named links without mass on the bodies: flange, tool0.
    pub frames: Frames,
    /// All links of the file: those of the base, then those of body 1, and so on.
    pub links: Vec<UrdfLink>,
    /// What was assumed, merged or left out, in words by `Display`.
    pub notices: Vec<UrdfNotice>,
    /// Mesh files of collision shapes that were read.
    pub meshes: Vec<PathBuf>,
}

impl UrdfArm {
    /// Gives the arm the clearance that the `shapes` of its links have; meshes are looked for from the folder of `source`.
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
    /// All others.
    pub fixed: Vec<FixedFrame>,
}

/// No frame but the base, "base_link".
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

/// A link of the file in the body that it moves with.
#[derive(Debug, Clone, PartialEq)]
pub struct UrdfLink {
    /// Its name.
    pub name: String,
    /// 0 = base, i = body of joint i (1-based).
    pub body: usize,
    /// Its frame in the body's joint frame (base frame for body 0).
    pub placement: Placement,
    /// Its own inertial parameters about its own frame; `None` without mass, and of a link of the base whose moments no body
    /// has (it never moves).
    pub inertia: Option<LinkInertia>,
    /// The link right behind the moving joint (or the root link).
    pub is_first: bool,
}
