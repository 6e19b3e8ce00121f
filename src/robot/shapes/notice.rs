//! Notices about collision shapes.

use std::fmt;

use crate::robot::urdf::listed;

/// How the collision shapes of a file were used.
#[derive(Debug, Clone, PartialEq)]
pub enum ShapeNotice {
    /// The file has no collision shape, or none that could be read.
    Nothing,
    /// The arm is kept clear of itself by capsules.
    Capsules {
        /// Number of capsules.
        count: usize,
        /// Number of boxes of the base that stay boxes.
        boxes: usize,
        /// Links whose shapes they enclose.
        links: Vec<String>,
        /// Links with mass but without shapes.
        bare: Vec<String>,
    },
    /// Shapes that could not be read.
    NotRead {
        /// Their links, each with the reason.
        shapes: Vec<(String, String)>,
    },
    /// Mesh files of collision shapes that could not be found.
    MissingMeshes {
        /// Their names as written in the file.
        files: Vec<String>,
        /// Links whose shapes they are.
        links: Vec<String>,
    },
    /// Capsules that are near to each other wherever the arm is, and hence not watched.
    NeverApart {
        /// Pairs of names of such capsules.
        pairs: Vec<[String; 2]>,
    },
}

impl fmt::Display for ShapeNotice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Nothing => write!(
                f,
                "no collision shapes: neither the arm's distance from itself nor the floor is watched"
            ),
            Self::Capsules { count, boxes, links, bare } => {
                let capsules = if *count == 1 { "capsule" } else { "capsules" };
                write!(f, "{count} {capsules} ")?;
                match boxes {
                    0 => {}
                    1 => write!(f, "and a box ")?,
                    _ => write!(f, "and {boxes} boxes ")?,
                }
                write!(f, "from the collision shapes of {}", listed(links))?;
                if !bare.is_empty() {
                    write!(f, "; without shapes and not watched: {}", listed(bare))?;
                }
                Ok(())
            }
            Self::NotRead { shapes } => {
                let shapes = shapes.iter().map(|(link, reason)| format!("{link} ({reason})"));
                write!(f, "collision shapes that are not read and not watched: {}", listed(shapes))
            }
            Self::MissingMeshes { files, links } => write!(
                f,
                "collision shapes whose mesh files are not there ({}) are not watched: {}",
                listed(files),
                listed(links)
            ),
            Self::NeverApart { pairs } => {
                let pairs = pairs.iter().map(|[one, other]| format!("{one} and {other}"));
                write!(
                    f,
                    "not kept apart, their capsules overlap or nearly do wherever the arm is: {}",
                    listed(pairs)
                )
            }
        }
    }
}
