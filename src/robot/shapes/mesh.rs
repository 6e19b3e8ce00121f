//! Reading of meshes: files with the corners of many triangles.

mod find;
mod obj;
mod stl;

use std::path::{Path, PathBuf};
use std::str::SplitWhitespace;

use nalgebra::Vector3;
use thiserror::Error;

use find::find;

/// Files with more bytes are refused: a collision mesh has a few hundred kilobytes.
const MOST_BYTES: u64 = 500_000_000;

/// A mesh that cannot be used.
#[derive(Debug, Clone, PartialEq, Error)]
pub(super) enum MeshFault {
    /// The file was not found.
    #[error("{file} is not there")]
    Missing { file: String },
    /// The file has an unsupported format.
    #[error("{file}: of meshes only .stl and .obj are read")]
    Format { file: String },
    /// The file cannot be read.
    #[error("{file}: {reason}")]
    Read { file: String, reason: String },
    /// The content of the file is not a mesh.
    #[error("{file}: {flaw}")]
    Flawed { file: String, flaw: MeshFlaw },
}

/// An error in the content of a mesh file.
#[derive(Debug, Clone, PartialEq, Error)]
pub(super) enum MeshFlaw {
    /// Neither text nor binary STL.
    #[error("it is no STL")]
    NoStl,
    /// A binary STL with fewer triangles than it announces.
    #[error("it announces {triangles} triangles and has room for {room}; is it cut off?")]
    CutOff { triangles: usize, room: usize },
    /// A text STL without its last line.
    #[error("it ends without endsolid; is it cut off?")]
    NoEnd,
    /// A word where a number should be.
    #[error("line {line}: \"{word}\" is no number")]
    NoNumber { line: usize, word: String },
    /// Fewer than three numbers.
    #[error("line {line}: a point has three numbers")]
    TooFew { line: usize },
    /// A number that is not finite.
    #[error("point {number} has a coordinate that is not finite")]
    NotFinite { number: usize },
    /// No point at all.
    #[error("no point is in it")]
    Empty,
}

/// Reader of the meshes that one robot file names.
pub(super) struct Meshes {
    folder: PathBuf,
    /// Mesh files that were read.
    files: Vec<PathBuf>,
}

impl Meshes {
    /// A reader of the meshes that a robot file in `folder` names.
    pub(super) fn named_in(folder: &Path) -> Self {
        Self { folder: folder.to_owned(), files: Vec::new() }
    }

    /// The corners of the mesh file `name`, each once.
    pub(super) fn points(&mut self, name: &str) -> Result<Vec<Vector3<f64>>, MeshFault> {
        let file = || name.to_owned();
        let end = Path::new(name).extension().and_then(|end| end.to_str()).map(str::to_lowercase);
        let read = match end.as_deref() {
            Some("stl") => stl::points,
            Some("obj") => obj::points,
            _ => return Err(MeshFault::Format { file: file() }),
        };
        let Some(path) = find(name, &self.folder) else {
            return Err(MeshFault::Missing { file: file() });
        };
        let bytes = bytes_of(&path).map_err(|reason| MeshFault::Read { file: file(), reason })?;
        let mut points = read(&bytes)
            .and_then(checked)
            .map_err(|flaw| MeshFault::Flawed { file: file(), flaw })?;
        if !self.files.contains(&path) {
            self.files.push(path);
        }
        points.sort_unstable_by(|a, b| {
            a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)).then(a.z.total_cmp(&b.z))
        });
        points.dedup();
        Ok(points)
    }

    /// The mesh files that were read.
    pub(super) fn into_files(self) -> Vec<PathBuf> {
        self.files
    }
}

fn bytes_of(path: &Path) -> Result<Vec<u8>, String> {
    let length = std::fs::metadata(path).map_err(|e| e.to_string())?.len();
    if length > MOST_BYTES {
        return Err(format!("{length} bytes are too many for the shape of a link"));
    }
    std::fs::read(path).map_err(|e| e.to_string())
}

/// Refuses points that are not finite, and the absence of any point.
fn checked(points: Vec<Vector3<f64>>) -> Result<Vec<Vector3<f64>>, MeshFlaw> {
    let is_finite = |point: &Vector3<f64>| point.iter().all(|number| number.is_finite());
    match points.iter().position(|point| !is_finite(point)) {
        Some(before) => Err(MeshFlaw::NotFinite { number: before + 1 }),
        None if points.is_empty() => Err(MeshFlaw::Empty),
        None => Ok(points),
    }
}

/// The next three numbers of a line of text.
fn point(words: &mut SplitWhitespace<'_>, line: usize) -> Result<Vector3<f64>, MeshFlaw> {
    let mut point = Vector3::zeros();
    for number in point.iter_mut() {
        let word = words.next().ok_or(MeshFlaw::TooFew { line })?;
        *number =
            word.parse::<f64>().map_err(|_| MeshFlaw::NoNumber { line, word: word.to_owned() })?;
    }
    Ok(point)
}
