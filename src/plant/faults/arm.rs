//! Effects of an arm that is not built or mounted as its model says.

use nalgebra::{Matrix3, Rotation3, Vector3};
use serde::{Deserialize, Serialize};

use super::assembly::Assembly;
use super::effect::{Complaint, Fault, finite, not_negative, positive, require};
use crate::robot::LinkInertia;

/// A body bolted to the flange: a solid steel ball with the given mass and centre of mass, which has the smallest
/// inertia that a body of that mass has in practice.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Payload {
    /// Mass, kg.
    pub mass_kg: f64,
    /// x of the centre of mass in the last joint's frame, m.
    pub com_x_m: f64,
    /// y of the centre of mass, m.
    pub com_y_m: f64,
    /// z of the centre of mass (along the last joint's axis), m.
    pub com_z_m: f64,
}

/// Density of steel, kg/m³.
const STEEL_KG_M3: f64 = 7850.0;

impl Fault for Payload {
    fn joint(&self) -> Option<usize> {
        None
    }

    fn check(&self) -> Result<(), Complaint> {
        not_negative("mass_kg", self.mass_kg)?;
        finite("com_x_m", self.com_x_m)?;
        finite("com_y_m", self.com_y_m)?;
        finite("com_z_m", self.com_z_m)
    }

    fn install(&self, assembly: &mut Assembly) -> Result<(), Complaint> {
        let volume_m3 = self.mass_kg / STEEL_KG_M3;
        let radius_m = (3.0 * volume_m3 / (4.0 * std::f64::consts::PI)).cbrt();
        let about_centre = 0.4 * self.mass_kg * radius_m * radius_m * Matrix3::identity();
        let com_m = Vector3::new(self.com_x_m, self.com_y_m, self.com_z_m);
        let body = LinkInertia::from_com(self.mass_kg, com_m, about_centre);
        if let Some(last) = assembly.arm.joints.last_mut() {
            last.link = last.link.plus(&body);
        }
        Ok(())
    }
}

/// A link of another length: the vector from the previous joint's frame to this joint's frame is longer by e in its own
/// direction. For joint 1 this vector is the height of the arm on its base, on which no torque depends.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LinkLength {
    /// Joint at the far end of the link, from 1.
    pub joint: usize,
    /// e, the error of the length, m.
    pub error_m: f64,
}

impl Fault for LinkLength {
    fn joint(&self) -> Option<usize> {
        Some(self.joint)
    }

    fn check(&self) -> Result<(), Complaint> {
        finite("error_m", self.error_m)
    }

    fn install(&self, assembly: &mut Assembly) -> Result<(), Complaint> {
        let way_m = &mut assembly.arm.joints[self.joint - 1].placement.translation_m;
        let length_m = way_m.norm();
        let has_length = "has no link before it: its frame lies on the previous joint's";
        require(length_m > 0.0, "joint", self.joint as f64, has_length)?;
        let shortened = self.error_m > -length_m;
        require(shortened, "error_m", self.error_m, "must leave some of the link's length")?;
        *way_m += *way_m * (self.error_m / length_m);
        Ok(())
    }
}

/// Gravity of another magnitude, in its nominal direction.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Gravity {
    /// g, m/s².
    pub g_m_s2: f64,
}

impl Fault for Gravity {
    fn joint(&self) -> Option<usize> {
        None
    }

    fn check(&self) -> Result<(), Complaint> {
        positive("g_m_s2", self.g_m_s2)
    }

    fn install(&self, assembly: &mut Assembly) -> Result<(), Complaint> {
        let gravity = &mut assembly.arm.gravity_m_s2;
        let nominal = gravity.norm();
        let has_direction = "needs a nominal gravity that has a direction";
        require(nominal > 0.0, "g_m_s2", self.g_m_s2, has_direction)?;
        *gravity *= self.g_m_s2 / nominal;
        Ok(())
    }
}

/// A base that is not level: it is rotated by the rotation vector (tilt_x, tilt_y, 0) in base axes, so that in the base
/// frame gravity appears rotated by the opposite angle.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BaseTilt {
    /// About the base's x axis, rad.
    pub tilt_x_rad: f64,
    /// About the base's y axis, rad.
    pub tilt_y_rad: f64,
}

impl Fault for BaseTilt {
    fn joint(&self) -> Option<usize> {
        None
    }

    fn check(&self) -> Result<(), Complaint> {
        finite("tilt_x_rad", self.tilt_x_rad)?;
        finite("tilt_y_rad", self.tilt_y_rad)
    }

    fn install(&self, assembly: &mut Assembly) -> Result<(), Complaint> {
        let tilt = Rotation3::new(Vector3::new(self.tilt_x_rad, self.tilt_y_rad, 0.0));
        let gravity = &mut assembly.arm.gravity_m_s2;
        *gravity = tilt.inverse() * *gravity;
        Ok(())
    }
}

/// An encoder with a zero offset: it reads q + o, and the controller uses this reading.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EncoderOffset {
    /// Joint, from 1.
    pub joint: usize,
    /// o: reading minus truth, rad.
    pub offset_rad: f64,
}

impl Fault for EncoderOffset {
    fn joint(&self) -> Option<usize> {
        Some(self.joint)
    }

    fn check(&self) -> Result<(), Complaint> {
        finite("offset_rad", self.offset_rad)
    }

    fn install(&self, assembly: &mut Assembly) -> Result<(), Complaint> {
        assembly.joint(self.joint).encoder_offset_rad += self.offset_rad;
        Ok(())
    }
}
