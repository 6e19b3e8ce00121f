//! Collision shapes of an MJCF, and their meshes.

use std::collections::HashMap;
use std::path::Path;

use super::compiler::Compiler;
use super::defaults::Defaults;
use super::element::Element;
use super::fault::MjcfFault;
use super::geom::{Solid, solid};
use super::pose::pose;
use crate::robot::arm::Placement;
use crate::robot::shapes::Shape;

/// Meshes by name, or the reason why one is not read, which matters only if a collision shape uses it.
pub(super) type MeshAssets = HashMap<String, Result<Shape, MjcfFault>>;

/// The meshes of a file.
pub(super) fn meshes(root: &Element, compiler: &Compiler, defaults: &Defaults) -> MeshAssets {
    let mut meshes = MeshAssets::new();
    for asset in root.each("asset").flat_map(|asset| asset.each("mesh")) {
        let stem = asset.text("file").and_then(|file| Path::new(file).file_stem()?.to_str());
        if let Some(name) = asset.text("name").or(stem) {
            meshes.insert(name.to_owned(), mesh(asset, compiler, defaults));
        }
    }
    meshes
}

fn mesh(asset: &Element, compiler: &Compiler, defaults: &Defaults) -> Result<Shape, MjcfFault> {
    let asset = defaults.complete(asset, None)?;
    if asset.text("refpos").or(asset.text("refquat")).is_some() {
        return Err(asset.unread("meshes with refpos or refquat are"));
    }
    let file = Path::new(&compiler.mesh_folder).join(asset.required("file")?);
    let scale = asset.numbers::<3>("scale")?.unwrap_or([1.0; 3]);
    Ok(Shape::Mesh { file: file.display().to_string(), scale })
}

/// The shape of a geom that has the defaults of its class, and its pose in the frame of its parent; `None` for purely
/// visual geoms and for ground planes and height fields.
pub(super) fn shape(
    geom: &Element,
    compiler: &Compiler,
    meshes: &MeshAssets,
) -> Result<Option<(Placement, Shape)>, MjcfFault> {
    let kind = geom.text("type").unwrap_or("sphere");
    let collides = |side: &'static str| geom.number(side).map(|bits| bits != Some(0.0));
    if matches!(kind, "plane" | "hfield") || !(collides("contype")? || collides("conaffinity")?) {
        return Ok(None);
    }
    // A primitive with a mesh is fitted to the mesh: a capsule around the mesh encloses the primitive too, or nearly
    // so.
    if let Some(mesh) = geom.text("mesh") {
        let unknown = || MjcfFault::UnknownMesh { place: geom.place(), mesh: mesh.to_owned() };
        let shape = meshes.get(mesh).cloned().unwrap_or_else(|| Err(unknown()))?;
        return Ok(Some((pose(geom, compiler)?, shape)));
    }
    if matches!(kind, "mesh" | "sdf") {
        geom.required("mesh")?;
    }
    let (placement, solid) = solid(geom, kind, compiler)?;
    let shape = match solid {
        Solid::Ellipsoid(half_m) => Shape::Ellipsoid(half_m),
        Solid::Box(half_m) => Shape::Box(half_m),
        Solid::Cylinder { radius_m, half_m } => Shape::Cylinder { radius_m, half_m },
        Solid::Capsule { radius_m, half_m } => Shape::Capsule { radius_m, half_m },
    };
    Ok(Some((placement, shape)))
}
