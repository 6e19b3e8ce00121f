//! Joints of a URDF that are not part of the arm and are locked at one position.

use std::fmt;

use nalgebra::{Matrix3, Rotation3, Unit, Vector3};
use urdf_rs::{Joint, JointType};

use super::fault::{UrdfFault, finite, quoted};
use super::read::Reader;
use super::tree::Tree;
use crate::robot::arm::Placement;

/// A joint that is not on the way to the arm's last link.
#[derive(Debug, Clone, PartialEq)]
pub struct LockedJoint {
    /// Its name.
    pub name: String,
    /// Where it is locked.
    pub stand: Stand,
}

/// Position of a joint that does not move.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Stand {
    /// A revolute joint, turned about its axis by this angle, rad.
    AngleRad(f64),
    /// A prismatic joint, displaced along its axis by this distance, m.
    DistanceM(f64),
    /// A joint of several degrees of freedom, at its origin.
    Origin,
}

impl fmt::Display for LockedJoint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, stand } = self;
        match stand {
            Stand::AngleRad(angle_rad) => write!(f, "{name} ({angle_rad} rad)"),
            Stand::DistanceM(distance_m) => write!(f, "{name} ({distance_m} m)"),
            Stand::Origin => write!(f, "{name} (at its origin)"),
        }
    }
}

/// All joints except the fixed ones and those of `moving`, in the file's order.
pub(super) fn locked_joints(
    tree: &Tree<'_>,
    moving: &[&Joint],
) -> Result<Vec<LockedJoint>, UrdfFault> {
    let mut locked = Vec::new();
    for joint in tree.joints() {
        let stand = match joint.joint_type {
            JointType::Fixed => continue,
            _ if is_one_of(moving, joint) => continue,
            JointType::Prismatic => Stand::DistanceM(value(tree, moving, joint)?),
            JointType::Revolute | JointType::Continuous => {
                Stand::AngleRad(value(tree, moving, joint)?)
            }
            JointType::Floating | JointType::Planar | JointType::Spherical => Stand::Origin,
        };
        locked.push(LockedJoint { name: joint.name.clone(), stand });
    }
    Ok(locked)
}

fn is_one_of(joints: &[&Joint], joint: &Joint) -> bool {
    joints.iter().any(|one| one.name == joint.name)
}

/// Position of a locked joint, rad or m. A mimic joint is where the joint that it mimics puts it; a mimicked joint of
/// the arm itself counts as being at zero.
fn value(tree: &Tree<'_>, moving: &[&Joint], joint: &Joint) -> Result<f64, UrdfFault> {
    // The position sought is factor · (position of the joint `at`) + offset.
    let (mut factor, mut offset) = (1.0, 0.0);
    let mut at = joint;
    for _ in 0..=tree.joints().len() {
        let Some(mimic) = &at.mimic else {
            let own = if is_one_of(moving, at) { 0.0 } else { nearest_to_zero(at)? };
            let value = factor * own + offset;
            finite(&quoted("joint", &joint.name), "position", value)?;
            return Ok(value);
        };
        offset += factor * mimic.offset.unwrap_or(0.0);
        factor *= mimic.multiplier.unwrap_or(1.0);
        let Some(followed) = tree.joint(&mimic.joint) else { break };
        at = followed;
    }
    let of = joint.mimic.as_ref().map(|mimic| mimic.joint.clone()).unwrap_or_default();
    Err(UrdfFault::MimicsNothing { joint: joint.name.clone(), of })
}

/// Zero, or the limit nearest to zero if the range of the joint does not contain zero, rad or m.
fn nearest_to_zero(joint: &Joint) -> Result<f64, UrdfFault> {
    if !matches!(joint.joint_type, JointType::Revolute | JointType::Prismatic) {
        return Ok(0.0);
    }
    let (lower, upper) = (joint.limit.lower, joint.limit.upper);
    for (quantity, value) in [("lower", lower), ("upper", upper)] {
        if value.is_nan() {
            let place = quoted("joint", &joint.name);
            return Err(UrdfFault::NotFinite { place, quantity, value });
        }
    }
    if (lower..=upper).contains(&0.0) {
        Ok(0.0)
    } else if lower.abs() <= upper.abs() {
        Ok(lower)
    } else {
        Ok(upper)
    }
}

impl Reader {
    /// Displacement of a locked joint from its origin; `None` if there is none.
    pub(super) fn displacement(&mut self, joint: &Joint) -> Result<Option<Placement>, UrdfFault> {
        let locked = self.locked.iter().find(|locked| locked.name == joint.name);
        Ok(match locked.map(|locked| locked.stand) {
            Some(Stand::AngleRad(angle_rad)) if angle_rad != 0.0 => {
                let axis = Unit::new_normalize(self.unit_axis(joint)?);
                let rotation = Rotation3::from_axis_angle(&axis, angle_rad).into_inner();
                Some(Placement { rotation, translation_m: Vector3::zeros() })
            }
            Some(Stand::DistanceM(distance_m)) if distance_m != 0.0 => {
                let translation_m = distance_m * self.unit_axis(joint)?;
                Some(Placement { rotation: Matrix3::identity(), translation_m })
            }
            _ => None,
        })
    }
}
