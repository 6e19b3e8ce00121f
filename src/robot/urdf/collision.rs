//! Collision shapes of the links of a URDF.

use urdf_rs::{Geometry, Robot};

use crate::robot::arm::Placement;
use crate::robot::shapes::{LinkShape, Shape};

/// The shapes of all `<collision>` elements, link by link.
pub(super) fn shapes(robot: &Robot) -> Vec<LinkShape> {
    let of_link = |link: &urdf_rs::Link| {
        let shapes = link.collision.iter().map(|collision| LinkShape {
            link: link.name.clone(),
            placement: Placement::from_xyz_rpy(*collision.origin.xyz, *collision.origin.rpy),
            shape: Ok(shape(&collision.geometry)),
        });
        shapes.collect::<Vec<_>>()
    };
    robot.links.iter().flat_map(of_link).collect()
}

fn shape(geometry: &Geometry) -> Shape {
    match geometry {
        Geometry::Box { size } => Shape::Box(size.map(|side| side / 2.0)),
        Geometry::Cylinder { radius, length } => {
            Shape::Cylinder { radius_m: *radius, half_m: length / 2.0 }
        }
        Geometry::Capsule { radius, length } => {
            Shape::Capsule { radius_m: *radius, half_m: length / 2.0 }
        }
        Geometry::Sphere { radius } => Shape::Ellipsoid([*radius; 3]),
        Geometry::Mesh { filename, scale } => {
            Shape::Mesh { file: filename.clone(), scale: scale.map_or([1.0; 3], |scale| *scale) }
        }
    }
}
