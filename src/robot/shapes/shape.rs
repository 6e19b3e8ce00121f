//! The solids used for collisions of links.

use std::f64::consts::PI;

use nalgebra::Vector3;
use thiserror::Error;

use super::enclosure::Ball;
use super::mesh::{MeshFault, Meshes};
use crate::robot::arm::Placement;

/// A solid about its centre, with its axis of symmetry along z. Sizes are half lengths and radii, m.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::robot) enum Shape {
    Ellipsoid([f64; 3]),
    Box([f64; 3]),
    Cylinder {
        radius_m: f64,
        half_m: f64,
    },
    /// The hemispheres lie beyond ±`half_m`.
    Capsule {
        radius_m: f64,
        half_m: f64,
    },
    /// The mesh of a file, scaled by `scale` along each axis.
    Mesh {
        file: String,
        scale: [f64; 3],
    },
}

/// A shape on a link.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::robot) struct LinkShape {
    /// The link's name.
    pub link: String,
    /// Pose in the link's frame.
    pub placement: Placement,
    /// The shape, or the reason why it could not be interpreted.
    pub shape: Result<Shape, String>,
}

/// Reason why a shape is not watched.
#[derive(Debug, Clone, PartialEq, Error)]
pub(super) enum ShapeFault {
    /// A size that is not positive.
    #[error("its size {size_m} m is not positive")]
    Size { size_m: f64 },
    /// A pose that is not finite.
    #[error("its pose has a number that is not finite")]
    Pose,
    /// A shape farther away than any arm reaches.
    #[error("it reaches {reach_m:.1} m from its link: is it in mm, and the scale missing?")]
    Far { reach_m: f64 },
    /// An unusable mesh file.
    #[error(transparent)]
    Mesh(#[from] MeshFault),
    /// A shape whose description could not be interpreted.
    #[error("{0}")]
    Unread(String),
}

/// No link of an arm extends farther from its frame, m.
const FARTHEST_M: f64 = 20.0;
/// Corners of the prism around a cylinder, which is 1/cos(π/48) = 1.002 times as wide.
const CORNERS: usize = 48;
/// Parallels and meridians of the polyhedron around an ellipsoid.
const PARALLELS: usize = 12;
const MERIDIANS: usize = 24;

impl LinkShape {
    /// Balls, in the frame of the link, whose convex hull contains the shape and is hardly larger.
    pub(super) fn balls(&self, meshes: &mut Meshes) -> Result<Vec<Ball>, ShapeFault> {
        let shape = self.understood()?;
        let Placement { rotation, translation_m } = &self.placement;
        let mut balls = shape.balls(meshes)?;
        let mut reach_m: f64 = 0.0;
        for ball in &mut balls {
            ball.centre_m = rotation * ball.centre_m + translation_m;
            reach_m = reach_m.max(ball.centre_m.norm() + ball.radius_m);
        }
        if reach_m > FARTHEST_M {
            return Err(ShapeFault::Far { reach_m });
        }
        Ok(balls)
    }

    /// The shape, if it was interpreted and has a finite pose.
    pub(super) fn understood(&self) -> Result<&Shape, ShapeFault> {
        let shape = self.shape.as_ref().map_err(|why| ShapeFault::Unread(why.clone()))?;
        let Placement { rotation, translation_m } = &self.placement;
        if rotation.iter().chain(translation_m.iter()).all(|number| number.is_finite()) {
            return Ok(shape);
        }
        Err(ShapeFault::Pose)
    }
}

impl Shape {
    fn balls(&self, meshes: &mut Meshes) -> Result<Vec<Ball>, ShapeFault> {
        let ends = |radius_m: f64, half_m: f64| {
            [-half_m, half_m]
                .map(|z| Ball { centre_m: Vector3::new(0.0, 0.0, z), radius_m })
                .to_vec()
        };
        Ok(match self {
            Self::Ellipsoid(half_m) => {
                let [a, b, c] = positive(*half_m)?;
                if a == b && b == c { ends(a, 0.0) } else { around_ellipsoid([a, b, c]) }
            }
            Self::Box(half_m) => {
                let half_m = Vector3::from(positive(*half_m)?);
                let sides = [-1.0, 1.0];
                let corner = |x, y, z| Ball::point(half_m.component_mul(&Vector3::new(x, y, z)));
                let of_edge = |x, y| sides.map(|z| corner(x, y, z));
                sides.iter().flat_map(|x| sides.map(|y| of_edge(*x, y))).flatten().collect()
            }
            Self::Cylinder { radius_m, half_m } => {
                let [radius_m, half_m] = positive([*radius_m, *half_m])?;
                let wide_m = radius_m / (PI / CORNERS as f64).cos();
                let edge = (0..CORNERS).map(|k| {
                    let (sin, cos) = (2.0 * PI * k as f64 / CORNERS as f64).sin_cos();
                    [-half_m, half_m].map(|z| Vector3::new(wide_m * cos, wide_m * sin, z))
                });
                edge.flatten().map(Ball::point).collect()
            }
            Self::Capsule { radius_m, half_m } => {
                let [radius_m, half_m] = positive([*radius_m, *half_m])?;
                ends(radius_m, half_m)
            }
            Self::Mesh { file, scale } => {
                let scale = Vector3::from(*scale);
                let points = meshes.points(file)?.into_iter();
                let points: Vec<Ball> =
                    points.map(|point| Ball::point(point.component_mul(&scale))).collect();
                // Refuses a single repeated point, and a scale of zero or infinity.
                let spread = points.iter().map(|ball| (ball.centre_m - points[0].centre_m).norm());
                let size_m = spread.fold(0.0, f64::max);
                positive([size_m])?;
                points
            }
        })
    }
}

/// The sizes, if all of them are positive and finite.
fn positive<const N: usize>(sizes_m: [f64; N]) -> Result<[f64; N], ShapeFault> {
    match sizes_m.iter().find(|size| !(**size > 0.0 && size.is_finite())) {
        Some(&size_m) => Err(ShapeFault::Size { size_m }),
        None => Ok(sizes_m),
    }
}

/// Corners of a polyhedron around an ellipsoid. The polyhedron with its corners on the unit sphere contains the ball of
/// radius cos(π/meridians) cos(π/(2 parallels)), hence it is scaled up by the inverse, 1.7 %.
fn around_ellipsoid(half_m: [f64; 3]) -> Vec<Ball> {
    let inner = (PI / MERIDIANS as f64).cos() * (PI / (2 * PARALLELS) as f64).cos();
    let half_m = Vector3::from(half_m) / inner;
    let corner = |parallel: usize, meridian: usize| {
        let (aside, z) = (PI * parallel as f64 / PARALLELS as f64).sin_cos();
        let (sin, cos) = (2.0 * PI * meridian as f64 / MERIDIANS as f64).sin_cos();
        Ball::point(half_m.component_mul(&Vector3::new(aside * cos, aside * sin, z)))
    };
    let of_parallel = |parallel| (0..MERIDIANS).map(move |meridian| corner(parallel, meridian));
    (0..=PARALLELS).flat_map(of_parallel).collect()
}
