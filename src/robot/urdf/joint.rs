//! Reading of a moving joint: its axis, limits and friction.

use std::f64::consts::{PI, TAU};

use nalgebra::{Matrix3, Vector3};
use urdf_rs::{Joint, JointType};

use super::fault::{UrdfFault, finite, quoted};
use super::read::Reader;
use crate::robot::arm::{Assumed, Drive, Limits, Placement, UNKNOWN_TORQUE_NM};

/// Speed limit if the file gives none: 180 °/s, usual for arms of this size.
pub(super) const ASSUMED_VELOCITY_RAD_S: f64 = PI;
/// Acceleration limit if the file gives none; the same as that of the built-in arms.
pub(super) const ASSUMED_ACCELERATION_RAD_S2: f64 = 10.0;
/// Range of a joint without end stops: that of an arm with internal cables.
const ENDLESS_RAD: [f64; 2] = [-TAU, TAU];
/// No arm turns farther from zero: a range beyond is one in degrees.
const FARTHEST_RAD: f64 = 4.0 * PI;
/// Tolerance of the length of an axis: axes such as (0.577, 0.577, 0.577) have unit length to three digits.
const AXIS_LENGTH: f64 = 1e-3;

impl Reader {
    /// The rotation S of [`read_urdf`](super::read_urdf), which takes ẑ to the joint's axis.
    pub(super) fn axis_to_z(&mut self, joint: &Joint) -> Result<Placement, UrdfFault> {
        let rotation = rotation_from_z(self.unit_axis(joint)?);
        if rotation != Matrix3::identity() {
            self.remarks.turned.push((joint.name.clone(), *joint.axis.xyz));
        }
        Ok(Placement { rotation, translation_m: Vector3::zeros() })
    }

    /// The axis in the link's frame, scaled to length 1.
    pub(super) fn unit_axis(&mut self, joint: &Joint) -> Result<Vector3<f64>, UrdfFault> {
        let written = *joint.axis.xyz;
        for value in written {
            finite(&quoted("joint", &joint.name), "axis", value)?;
        }
        let length = Vector3::from(written).norm();
        if (length - 1.0).abs() > AXIS_LENGTH {
            let joint = joint.name.clone();
            return Err(UrdfFault::Axis { joint, axis: written, length });
        }
        if (length - 1.0).abs() > 4.0 * f64::EPSILON {
            self.remarks.normalised.push((joint.name.clone(), length));
        }
        Ok(Vector3::from(written) / length)
    }

    pub(super) fn limits(&mut self, joint: &Joint) -> Result<Limits, UrdfFault> {
        let name = || joint.name.clone();
        let limit = &joint.limit;
        for (quantity, value) in [
            ("lower", limit.lower),
            ("upper", limit.upper),
            ("effort", limit.effort),
            ("velocity", limit.velocity),
            ("acceleration", limit.acceleration),
        ] {
            let place = quoted("joint", &joint.name);
            if value.is_nan() {
                return Err(UrdfFault::NotFinite { place, quantity, value });
            }
            if value < 0.0 && quantity != "lower" && quantity != "upper" {
                return Err(UrdfFault::Negative { place, quantity, value });
            }
        }
        let position_rad = if is_endless(joint) {
            self.remarks.endless.push(name());
            ENDLESS_RAD
        } else if limit.lower < limit.upper && (limit.upper - limit.lower).is_finite() {
            [limit.lower, limit.upper]
        } else {
            let (lower_rad, upper_rad) = (limit.lower, limit.upper);
            return Err(UrdfFault::Range { joint: name(), lower_rad, upper_rad });
        };
        let position_rad = self.softened(joint, position_rad)?;
        if position_rad.iter().any(|end_rad| end_rad.abs() > FARTHEST_RAD) {
            self.remarks.wide.push((name(), position_rad));
        }
        let velocity_rad_s = given(limit.velocity).unwrap_or(ASSUMED_VELOCITY_RAD_S);
        let known = given(limit.effort).filter(|torque_nm| *torque_nm < UNKNOWN_TORQUE_NM);
        let torque_nm = known.unwrap_or(f64::INFINITY);
        let acceleration_rad_s2 = given(limit.acceleration).unwrap_or(ASSUMED_ACCELERATION_RAD_S2);
        Ok(Limits { position_rad, velocity_rad_s, acceleration_rad_s2, torque_nm })
    }

    /// What the soft limits of a joint, at which its controller stops it, leave of its range. Both are zero where they
    /// are missing; one alone is zero as well, as the format has it.
    fn softened(
        &mut self,
        joint: &Joint,
        [lower_rad, upper_rad]: [f64; 2],
    ) -> Result<[f64; 2], UrdfFault> {
        let soft = joint.safety_controller.as_ref();
        let soft = soft.map_or([0.0; 2], |soft| [soft.soft_lower_limit, soft.soft_upper_limit]);
        let [soft_lower_rad, soft_upper_rad] = soft;
        for (quantity, value) in
            [("soft_lower_limit", soft_lower_rad), ("soft_upper_limit", soft_upper_rad)]
        {
            if value.is_nan() {
                let place = quoted("joint", &joint.name);
                return Err(UrdfFault::NotFinite { place, quantity, value });
            }
        }
        if soft == [0.0; 2] {
            return Ok([lower_rad, upper_rad]);
        }
        let left_rad = [lower_rad.max(soft_lower_rad), upper_rad.min(soft_upper_rad)];
        if left_rad[0] >= left_rad[1] {
            let joint = joint.name.clone();
            return Err(UrdfFault::SoftRange { joint, range: [lower_rad, upper_rad], soft });
        }
        if left_rad != [lower_rad, upper_rad] {
            self.remarks.soft.push((joint.name.clone(), left_rad));
        }
        Ok(left_rad)
    }
}

/// Whether a joint has no end stops.
fn is_endless(joint: &Joint) -> bool {
    let unlimited = joint.limit.lower == f64::NEG_INFINITY && joint.limit.upper == f64::INFINITY;
    joint.joint_type == JointType::Continuous || unlimited
}

/// What a URDF does not say about a joint with these `limits`: it never has a drive, and often lacks limits.
pub(super) fn assumed(joint: &Joint, limits: &Limits) -> Assumed {
    Assumed {
        // Soft limits may give a joint without end stops a range.
        position: is_endless(joint) && limits.position_rad == ENDLESS_RAD,
        gear_ratio: true,
        torque_constant: true,
        velocity: given(joint.limit.velocity).is_none(),
        acceleration: given(joint.limit.acceleration).is_none(),
    }
}

/// A limit, if it was given: a missing number is read as zero, and many files write zero for "unknown".
fn given(limit: f64) -> Option<f64> {
    (limit > 0.0 && limit.is_finite()).then_some(limit)
}

/// Friction of the joint, with default values for the drive parameters that a URDF does not have.
pub(super) fn drive(joint: &Joint) -> Result<Drive, UrdfFault> {
    let (damping, friction) =
        joint.dynamics.as_ref().map_or((0.0, 0.0), |d| (d.damping, d.friction));
    for (quantity, value) in [("damping", damping), ("friction", friction)] {
        let place = quoted("joint", &joint.name);
        finite(&place, quantity, value)?;
        if value < 0.0 {
            return Err(UrdfFault::Negative { place, quantity, value });
        }
    }
    Ok(Drive {
        rotor_inertia_kg_m2: 0.0,
        viscous_nm_s_rad: damping,
        coulomb_nm: friction,
        gear_ratio: 1.0,
        torque_constant_nm_a: 1.0,
    })
}

/// The rotation that takes ẑ to the unit vector `axis`, exact for the coordinate axes.
///
/// For a_z ≥ 0 it is the smallest such rotation, 1 + [v] + [v]²/(1 + a_z) with v = ẑ × a (Rodrigues). Below the xy
/// plane, a half turn about x comes first, so that the denominator never vanishes.
fn rotation_from_z(axis: Vector3<f64>) -> Matrix3<f64> {
    let smallest = |a: Vector3<f64>| {
        let v = Vector3::z().cross(&a).cross_matrix();
        Matrix3::identity() + v + v * v / (1.0 + a.z)
    };
    if axis.z >= 0.0 {
        smallest(axis)
    } else {
        smallest(-axis) * Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0))
    }
}
