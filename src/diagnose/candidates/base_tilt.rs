//! A base that does not stand level: gravity rotated by small angles about the base's x and y axes.

use nalgebra::{Rotation3, Vector3};

use super::*;

/// See the module.
pub struct BaseTilt;

/// Tilt at which the torque change is evaluated, rad: small enough for it to be linear.
const SMALL_RAD: f64 = 1e-5;

/// Torque per angle about each axis, for tilts by these angles, rad.
fn tilted(scene: &Scene, angles_rad: [f64; 2]) -> Vec<Column> {
    [Vector3::x_axis(), Vector3::y_axis()]
        .iter()
        .zip(angles_rad)
        .map(|(axis, angle_rad)| {
            // The base turns by +angle, so that gravity turns by −angle in the base frame.
            let turn = Rotation3::from_axis_angle(axis, -angle_rad);
            of_changed_arm(scene, angle_rad, |arm| arm.gravity_m_s2 = turn * arm.gravity_m_s2)
        })
        .collect()
}

impl Candidate for BaseTilt {
    fn kind(&self) -> Kind {
        Kind::BaseTilt
    }

    fn sites(&self, _: usize) -> Vec<Option<usize>> {
        vec![None]
    }

    fn columns(&self, scene: &Scene, _: Option<usize>, _: Shape) -> Vec<Column> {
        tilted(scene, [SMALL_RAD; 2])
    }

    fn secants(&self, scene: &Scene, _: Option<usize>, b: &[f64]) -> Option<Vec<Column>> {
        Some(tilted(scene, [0, 1].map(|axis| large(b[axis], SMALL_RAD))))
    }

    fn quantities(&self, _: &Scene, _: Option<usize>, _: Shape, b: &[f64]) -> Vec<Quantity> {
        // A direction of tilt that the null model absorbs is not determined, rather than zero.
        let axes = ["tilt_x_rad", "tilt_y_rad"].into_iter().zip(b);
        axes.map(|(name, angle)| quantity(name, *angle, "rad")).collect()
    }

    fn separating_experiment(&self) -> &'static str {
        "the same motion with joint 1 turned by 180°, or a spirit level on the base"
    }

    fn in_words(&self) -> &'static str {
        "a base that does not stand level"
    }
}
