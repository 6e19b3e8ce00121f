//! Position and orientation of an element.

use nalgebra::{Matrix3, Vector3};

use super::compiler::Compiler;
use super::element::{Element, ORIENTATIONS};
use super::fault::MjcfFault;
use crate::robot::arm::{Placement, snap};

/// Vectors up to this length have no direction; MuJoCo's own bound.
const SHORTEST: f64 = 1e-15;

/// The pose from `pos` and the orientation attribute, in the frame of the parent element.
pub(super) fn pose(element: &Element, compiler: &Compiler) -> Result<Placement, MjcfFault> {
    let pos = element.numbers::<3>("pos")?.unwrap_or_default();
    Ok(Placement { rotation: rotation(element, compiler)?, translation_m: pos.into() })
}

/// A displacement without rotation.
pub(super) fn shift(translation_m: Vector3<f64>) -> Placement {
    Placement { translation_m, ..Placement::identity() }
}

/// The vector scaled to length 1.
pub(super) fn direction(
    element: &Element,
    attribute: &'static str,
    vector: Vector3<f64>,
) -> Result<Vector3<f64>, MjcfFault> {
    let length = vector.norm();
    if length > SHORTEST {
        return Ok(vector / length);
    }
    Err(MjcfFault::NoDirection { place: element.place(), attribute })
}

fn rotation(element: &Element, compiler: &Compiler) -> Result<Matrix3<f64>, MjcfFault> {
    let Some(way) = element.at_most_one(&ORIENTATIONS)? else { return Ok(Matrix3::identity()) };
    let unit = |vector: [f64; 3]| direction(element, way, vector.into());
    let rotation = match way {
        "quat" => {
            let quaternion = element.required_numbers::<4>(way)?;
            if quaternion.iter().all(|part| part.abs() <= SHORTEST) {
                return Err(MjcfFault::NoDirection { place: element.place(), attribute: way });
            }
            from_quaternion(quaternion)
        }
        "axisangle" => {
            let [x, y, z, angle] = element.required_numbers::<4>(way)?;
            about(unit([x, y, z])?, angle * compiler.angle_rad)
        }
        "euler" => {
            let angles = element.required_numbers::<3>(way)?;
            let turns = compiler.eulerseq.iter().zip(angles);
            turns.fold(Matrix3::identity(), |before, (axis, angle)| {
                let turn = about(coordinate_axis(*axis), angle * compiler.angle_rad);
                if axis.is_ascii_lowercase() { before * turn } else { turn * before }
            })
        }
        "xyaxes" => {
            let [a, b, c, d, e, f] = element.required_numbers::<6>(way)?;
            let x = unit([a, b, c])?;
            let y = Vector3::new(d, e, f);
            let y = unit((y - x * x.dot(&y)).into())?;
            Matrix3::from_columns(&[x, y, x.cross(&y)])
        }
        _ => from_z(unit(element.required_numbers::<3>(way)?)?),
    };
    Ok(rotation.map(snap))
}

fn coordinate_axis(name: char) -> Vector3<f64> {
    match name.to_ascii_lowercase() {
        'x' => Vector3::x(),
        'y' => Vector3::y(),
        _ => Vector3::z(),
    }
}

/// The rotation by `angle_rad` about a unit vector.
pub(super) fn about(axis: Vector3<f64>, angle_rad: f64) -> Matrix3<f64> {
    let (sin, cos) = angle_rad.sin_cos();
    Matrix3::identity() * cos + axis.cross_matrix() * sin + axis * axis.transpose() * (1.0 - cos)
}

/// The rotation of the quaternion w, x, y, z of any length: quaternions of whole numbers give exact matrices.
fn from_quaternion([w, x, y, z]: [f64; 4]) -> Matrix3<f64> {
    let length_squared = w * w + x * x + y * y + z * z;
    Matrix3::new(
        w * w + x * x - y * y - z * z,
        2.0 * (x * y - w * z),
        2.0 * (x * z + w * y),
        2.0 * (x * y + w * z),
        w * w - x * x + y * y - z * z,
        2.0 * (y * z - w * x),
        2.0 * (x * z - w * y),
        2.0 * (y * z + w * x),
        w * w - x * x - y * y + z * z,
    ) / length_squared
}

/// The smallest rotation that takes ẑ to a unit vector, and a half turn about x for −ẑ, as in MuJoCo.
pub(super) fn from_z(to: Vector3<f64>) -> Matrix3<f64> {
    if to.x.hypot(to.y) <= SHORTEST {
        return Matrix3::from_diagonal(&Vector3::new(1.0, to.z.signum(), to.z.signum()));
    }
    // The axis is ẑ × to; 1 + cos and sin of the angle have the ratio of cos and sin of half the angle.
    from_quaternion([1.0 + to.z, -to.y, to.x, 0.0])
}
