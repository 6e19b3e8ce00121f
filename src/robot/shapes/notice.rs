//! What is told of collision shapes.

use std::fmt;

use crate::robot::urdf::listed;

/// What became of the collision shapes of a file.
#[derive(Debug, Clone, PartialEq)]
pub enum ShapeNotice {
    /// None was there, or none that is read.
    Nothing,
    /// The arm is kept clear of itself.
    Capsules {
        /// How many there are.
        count: usize,
        /// Boxes of the base that are what they are.
        boxes: usize,
        /// Links whose shapes these are.
        links: Vec<String>,
        /// Links with mass and without shapes.
        bare: Vec<String>,
    },
    /// Shapes that are not read.
    NotRead {
        /// Their links, each with the reason.
        shapes: Vec<(String, String)>,
    },
    /// Mesh files of collision shapes that could not be found.
    MissingMeshes {
        /// As written.
        files: Vec<String>,
        /// Links whose shapes they are.
        links: Vec<String>,
    },
    /// Capsules that are near to each other wherever the arm is.
    NeverApart {
        /// Pairs of them.
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
