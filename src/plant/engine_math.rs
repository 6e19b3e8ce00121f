//! Conversions from the linear algebra of this crate (nalgebra) to that of the physics engine (glam).

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};
use rapier3d::math::{Pose, Rotation, Vector};

use crate::robot::Placement;

/// Converts a vector to the engine's type.
pub(super) fn vector(v: &Vector3<f64>) -> Vector {
    Vector::new(v.x, v.y, v.z)
}

/// Converts a rotation to the engine's type; `r` must be orthonormal with determinant 1.
pub(super) fn rotation(r: &Matrix3<f64>) -> Rotation {
    let q = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(*r));
    Rotation::from_xyzw(q.i, q.j, q.k, q.w)
}

/// Converts a placement to the engine's type.
pub(super) fn pose(p: &Placement) -> Pose {
    Pose::from_parts(vector(&p.translation_m), rotation(&p.rotation))
}
