//! Reading of a joint of an MJCF.

use nalgebra::{Matrix3, Vector3};
use urdf_rs::{Dynamics, JointLimit, JointType};

use super::compiler::Compiler;
use super::element::Element;
use super::fault::MjcfFault;
use super::notice::LeftOut;
use super::pose::{about, direction, shift};
use crate::robot::arm::{Placement, snap};

/// Largest number of values of `damping` and `stiffness`: the linear coefficient, then those of higher powers.
pub(super) const POWERS: usize = 8;

/// A joint in the frame of the body that it moves.
#[derive(Debug)]
pub(super) struct Joint {
    pub kind: JointType,
    /// A point on the axis, or the centre of rotation of a ball joint, m.
    pub anchor_m: Vector3<f64>,
    /// The axis, of length 1.
    pub axis: Vector3<f64>,
    /// Position of the joint in the pose of the file, rad or m.
    pub reference: f64,
    /// Its limits without the torque.
    pub limit: JointLimit,
    /// Largest torque, Nm, or force, N, of all its actuators together; infinite without a limit.
    pub effort: f64,
    pub dynamics: Dynamics,
    /// Rotor inertia at the joint, kg m².
    pub armature_kg_m2: f64,
    /// Properties that an arm does not have.
    pub left_out: Vec<LeftOut>,
}

impl Joint {
    /// Reads a joint element with the defaults of its class, in a `frame` of the body.
    pub(super) fn of(
        joint: &Element,
        frame: &Placement,
        compiler: &Compiler,
    ) -> Result<Self, MjcfFault> {
        let (kind, unit) = match joint.text("type") {
            _ if joint.tag == "freejoint" => (JointType::Floating, 1.0),
            None | Some("hinge") => (JointType::Revolute, compiler.angle_rad),
            Some("slide") => (JointType::Prismatic, 1.0),
            Some("ball") => (JointType::Spherical, 1.0),
            Some("free") => (JointType::Floating, 1.0),
            Some(other) => return Err(joint.keyword("type", other, "hinge, slide, ball, free")),
        };
        let is_single = matches!(kind, JointType::Revolute | JointType::Prismatic);
        let pos = joint.numbers::<3>("pos")?.unwrap_or_default();
        let anchor_m = match kind {
            // A free joint has no position of its own.
            JointType::Floating => Vector3::zeros(),
            _ => frame.rotation * Vector3::from(pos) + frame.translation_m,
        };
        let axis = joint.numbers::<3>("axis")?.unwrap_or([0.0, 0.0, 1.0]);
        let axis = if is_single {
            frame.rotation * direction(joint, "axis", axis.into())?
        } else {
            Vector3::z()
        };
        let range = if is_single { compiler.limit(joint, "limited", "range")? } else { None };
        let effort = compiler.limit(joint, "actuatorfrclimited", "actuatorfrcrange")?;
        let [lower, upper] = range.unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
        let damping = joint.up_to("damping", POWERS)?.unwrap_or_else(|| vec![0.0]);
        let stiffness = joint.up_to("stiffness", POWERS)?.unwrap_or_default();
        joint.refuse_negative("damping", damping[0])?;
        let tuned = joint.up_to("springdamper", 2)?.unwrap_or_default();
        let is_tuned = tuned.iter().any(|part| *part != 0.0);
        let mut left_out = Vec::new();
        if is_tuned {
            left_out.push(LeftOut::SpringDamper);
        }
        if damping.iter().skip(1).any(|higher| *higher != 0.0) {
            left_out.push(LeftOut::HigherDamping);
        }
        if stiffness.iter().any(|part| *part != 0.0) {
            left_out.push(LeftOut::Stiffness);
        }
        Ok(Self {
            anchor_m,
            axis,
            reference: joint.number("ref")?.unwrap_or(0.0) * unit,
            limit: JointLimit { lower: lower * unit, upper: upper * unit, ..JointLimit::default() },
            effort: effort.map_or(f64::INFINITY, smaller),
            dynamics: Dynamics {
                // MuJoCo replaces the written damping by what follows from the time constant.
                damping: if is_tuned { 0.0 } else { damping[0] },
                friction: joint.not_negative("frictionloss")?,
            },
            armature_kg_m2: joint.not_negative("armature")?,
            left_out,
            kind,
        })
    }

    /// Motion of the body, about the anchor of the joint, from the pose of the file to the zero position of the joint.
    pub(super) fn at_zero(&self) -> Placement {
        match self.kind {
            JointType::Revolute if self.reference != 0.0 => {
                let rotation = about(self.axis, -self.reference).map(snap);
                Placement { rotation, translation_m: Vector3::zeros() }
            }
            JointType::Prismatic => shift(-self.reference * self.axis),
            _ => Placement { rotation: Matrix3::identity(), translation_m: Vector3::zeros() },
        }
    }
}

/// The force that a range allows in both directions: the smaller absolute value of its ends, or the only one that is
/// not zero.
pub(super) fn smaller([lower, upper]: [f64; 2]) -> f64 {
    match (lower.abs(), upper.abs()) {
        (0.0, one) | (one, 0.0) => one,
        (one, other) => one.min(other),
    }
}
