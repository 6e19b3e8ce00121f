//! Derivation of the clearance of an arm from the shapes of its links.

use std::path::{Path, PathBuf};

use nalgebra::Vector3;

use super::enclosure::Enclosure;
use super::group::{Group, merged};
use super::mesh::{MeshFault, Meshes};
use super::notice::ShapeNotice;
use super::poses::Poses;
use super::shape::{LinkShape, Shape, ShapeFault};
use crate::robot::arm::{Arm, Capsule, CellBox, Clearance, Placement};
use crate::robot::urdf::UrdfLink;

/// Largest number of capsules of a moving body, and of the base, which may be a whole robot with another arm. Each
/// additional capsule costs the design of a motion one distance for every capsule on other bodies.
const MOST_OF_BODY: usize = 3;
const MOST_OF_BASE: usize = 8;
/// Farther than this from the origin of the body, m, coordinates are too coarse for the sizes of capsules.
const OUT_OF_SIGHT_M: f64 = 1e6;
/// Smallest radius of a capsule, m.
const THINNEST_M: f64 = 1e-4;
/// Entries of a rotation matrix that are this near to 0 or ±1 are taken as such: files print 1.5708 for π/2.
const ALIGNED: f64 = 1e-4;

/// Result of the conversion of shapes.
pub(in crate::robot) struct Watched {
    pub clearance: Clearance,
    pub notices: Vec<ShapeNotice>,
    /// Mesh files that were read.
    pub meshes: Vec<PathBuf>,
}

/// A box-shaped collision shape of the base whose edges lie along the axes of the base.
struct BaseBox {
    link: String,
    cell_box: CellBox,
    /// The same box as a shape for a capsule, unless it is too large for one.
    group: Result<Group, ShapeFault>,
}

/// Encloses the `shapes` of `links`, which belong to `arm`, in capsules, and selects the pairs of capsules to keep
/// apart; meshes are searched for from `folder`.
///
/// - Shapes of a body share a capsule where it is hardly larger than their separate ones, and where there are too many.
/// - Boxes of the base that lie along its axes, such as tables, stay boxes, unless the arm could never leave them.
/// - A pair of capsules is watched if their bodies are not neighbours in the chain, unless the two are near in nearly
///   all of some hundred poses over the whole range of the joints: then it is the capsules that overlap, not the links.
pub(in crate::robot) fn watched(
    arm: &Arm,
    links: &[UrdfLink],
    shapes: &[LinkShape],
    folder: &Path,
) -> Watched {
    let mut reader = Reader::new(arm.dof(), folder);
    for link in links {
        for shape in shapes.iter().filter(|shape| shape.link == link.name) {
            if let Err(fault) = reader.read(link, shape) {
                reader.faults.push((link.name.clone(), fault));
            }
        }
    }
    let poses = Poses::of(arm);
    let Reader { mut groups, boxes, links: shaped, mut faults, meshes } = reader;
    let mut moving = Vec::new();
    for (body, groups) in groups.iter().enumerate().skip(1) {
        let groups = merged(groups.clone(), MOST_OF_BODY);
        moving.extend(groups.iter().map(|group| capsule(body, group)));
    }
    let mut kept = Vec::new();
    for BaseBox { link, cell_box, group } in boxes {
        let never_leaves = |capsule: &Capsule| {
            !arm.turns_over(capsule, &cell_box) && poses.is_always_in(capsule, &cell_box)
        };
        match group {
            _ if !moving.iter().any(never_leaves) => kept.push(cell_box),
            Ok(group) => groups[0].push(group),
            Err(fault) => faults.push((link, fault)),
        }
    }
    let base = merged(std::mem::take(&mut groups[0]), MOST_OF_BASE);
    let base = base.iter().map(|group| capsule(0, group));
    let capsules = with_own_names(base.chain(moving).collect());
    let (pairs, never) = pairs(&capsules, &poses);
    let mut notices = Vec::new();
    if capsules.is_empty() && kept.is_empty() {
        notices.push(ShapeNotice::Nothing);
    } else {
        let has_shapes = |link: &UrdfLink| shapes.iter().any(|shape| shape.link == link.name);
        let bare = links.iter().filter(|link| link.inertia.is_some() && !has_shapes(link));
        notices.push(ShapeNotice::Capsules {
            count: capsules.len(),
            boxes: kept.len(),
            links: shaped,
            bare: bare.map(|link| link.name.clone()).collect(),
        });
    }
    notices.extend(told(faults));
    if !never.is_empty() {
        let name = |k: usize| capsules[k].name.clone();
        let pairs = never.into_iter().map(|pair| pair.map(name)).collect();
        notices.push(ShapeNotice::NeverApart { pairs });
    }
    let clearance = Clearance { capsules, pairs, floor_z_m: None, boxes: kept };
    Watched { clearance, notices, meshes: meshes.into_files() }
}

/// State of reading the shapes.
struct Reader {
    /// Groups of shapes by body, the base first.
    groups: Vec<Vec<Group>>,
    boxes: Vec<BaseBox>,
    /// Links whose shapes were read.
    links: Vec<String>,
    /// Shapes that were not read, each with its link and the fault.
    faults: Vec<(String, ShapeFault)>,
    meshes: Meshes,
}

impl Reader {
    fn new(dof: usize, folder: &Path) -> Self {
        Self {
            groups: vec![Vec::new(); dof + 1],
            boxes: Vec::new(),
            links: Vec::new(),
            faults: Vec::new(),
            meshes: Meshes::named_in(folder),
        }
    }

    fn read(&mut self, link: &UrdfLink, shape: &LinkShape) -> Result<(), ShapeFault> {
        let placement = link.placement.compose(&shape.placement);
        let cell_box = match shape.understood()? {
            Shape::Box(half_m) if link.body == 0 => cell_box(&placement, *half_m),
            _ => None,
        };
        let group = shape.balls(&mut self.meshes).and_then(|mut balls| {
            for ball in &mut balls {
                ball.centre_m =
                    link.placement.rotation * ball.centre_m + link.placement.translation_m;
                let reach_m = ball.centre_m.norm();
                if reach_m.is_nan() || reach_m > OUT_OF_SIGHT_M {
                    return Err(ShapeFault::Far { reach_m });
                }
            }
            let axes = (0..3).map(|k| placement.rotation.column(k).into_owned()).collect();
            Group::of(link.name.clone(), balls, axes).ok_or(ShapeFault::Size { size_m: 0.0 })
        });
        match (cell_box, group) {
            (Some(cell_box), group @ (Ok(_) | Err(ShapeFault::Far { .. }))) => {
                self.boxes.push(BaseBox { link: link.name.clone(), cell_box, group });
            }
            (_, group) => self.groups[link.body].push(group?),
        }
        if !self.links.contains(&link.name) {
            self.links.push(link.name.clone());
        }
        Ok(())
    }
}

/// The box as a box of the cell, if its edges lie along the axes of the base.
fn cell_box(placement: &Placement, half_m: [f64; 3]) -> Option<CellBox> {
    let whole = placement.rotation.map(f64::round);
    if (placement.rotation - whole).amax() > ALIGNED {
        return None;
    }
    let half_m = whole.map(f64::abs) * Vector3::from(half_m);
    let centre_m = placement.translation_m;
    Some(CellBox { low_m: centre_m - half_m, high_m: centre_m + half_m })
}

fn capsule(body: usize, group: &Group) -> Capsule {
    let Enclosure { ends_m: [from_m, to_m], radius_m } = group.enclosure;
    let radius_m = radius_m.max(THINNEST_M);
    Capsule { name: group.link.clone(), body, from_m, to_m, radius_m }
}

/// Makes names unique: the second capsule of a link is called `LINK 2`.
fn with_own_names(capsules: Vec<Capsule>) -> Vec<Capsule> {
    let mut named: Vec<Capsule> = Vec::with_capacity(capsules.len());
    for mut capsule in capsules {
        let link = capsule.name.clone();
        let mut number = 1;
        while named.iter().any(|known| known.name == capsule.name) {
            number += 1;
            capsule.name = format!("{link} {number}");
        }
        named.push(capsule);
    }
    named
}

/// Pairs of capsules to keep apart, and pairs that are never apart.
fn pairs(capsules: &[Capsule], poses: &Poses) -> (Vec<[usize; 2]>, Vec<[usize; 2]>) {
    let numbers = 0..capsules.len();
    let all = numbers.flat_map(|j| (0..j).map(move |i| [i, j]));
    let apart = all.filter(|[i, j]| capsules[*i].body.abs_diff(capsules[*j].body) >= 2);
    apart.partition(|[i, j]| !poses.are_never_apart(&capsules[*i], &capsules[*j]))
}

/// One notice about missing mesh files, and one about all other shapes that were not read.
fn told(faults: Vec<(String, ShapeFault)>) -> Vec<ShapeNotice> {
    let (mut files, mut missed, mut shapes) = (Vec::new(), Vec::new(), Vec::new());
    for (link, fault) in faults {
        match fault {
            ShapeFault::Mesh(MeshFault::Missing { file }) => {
                files.push(file);
                missed.push(link);
            }
            other => shapes.push((link, other.to_string())),
        }
    }
    files.sort();
    files.dedup();
    missed.dedup();
    shapes.dedup();
    let missing = ShapeNotice::MissingMeshes { files, links: missed };
    let unread = ShapeNotice::NotRead { shapes };
    let is_empty = |notice: &ShapeNotice| match notice {
        ShapeNotice::MissingMeshes { files, .. } => files.is_empty(),
        ShapeNotice::NotRead { shapes } => shapes.is_empty(),
        _ => false,
    };
    [missing, unread].into_iter().filter(|notice| !is_empty(notice)).collect()
}
