//! What a drive file says about one joint.

use serde::{Deserialize, Serialize};

use super::take;
use crate::robot::place::Place;
use crate::robot::{Joint, RobotError};

/// A `[[joint]]` table. A key that is left out keeps what the model beside the file says, or the value that is assumed.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct DriveEntry {
    pub(super) name: String,
    pub(super) rotor_inertia_kg_m2: Option<f64>,
    pub(super) viscous_nm_s_rad: Option<f64>,
    pub(super) coulomb_nm: Option<f64>,
    pub(super) torque_offset_nm: Option<f64>,
    pub(super) velocity_rad_s: Option<f64>,
    pub(super) acceleration_rad_s2: Option<f64>,
    pub(super) torque_nm: Option<f64>,
    pub(super) gear_ratio: Option<f64>,
    pub(super) torque_constant_nm_a: Option<f64>,
    pub(super) mass_bounds_kg: Option<[f64; 2]>,
    pub(super) com_bounds_m: Option<[[f64; 2]; 3]>,
}

impl DriveEntry {
    pub(super) fn of(joint: &Joint, torque_offset_nm: f64) -> Self {
        let Joint { name, drive, limits, bounds, assumed, .. } = joint;
        Self {
            name: name.clone(),
            rotor_inertia_kg_m2: Some(drive.rotor_inertia_kg_m2),
            viscous_nm_s_rad: Some(drive.viscous_nm_s_rad),
            coulomb_nm: Some(drive.coulomb_nm),
            torque_offset_nm: Some(torque_offset_nm),
            // The URDF beside the drive file has these limits.
            velocity_rad_s: None,
            torque_nm: None,
            acceleration_rad_s2: (!assumed.acceleration).then_some(limits.acceleration_rad_s2),
            gear_ratio: (!assumed.gear_ratio).then_some(drive.gear_ratio),
            torque_constant_nm_a: (!assumed.torque_constant).then_some(drive.torque_constant_nm_a),
            mass_bounds_kg: bounds.mass_kg,
            com_bounds_m: bounds.com_m,
        }
    }

    pub(super) fn apply(&self, joint: &mut Joint, place: &Place) -> Result<(), RobotError> {
        let Joint { drive, limits, bounds, assumed, .. } = joint;
        take(&mut drive.rotor_inertia_kg_m2, self.rotor_inertia_kg_m2, |value| {
            place.not_negative("rotor_inertia_kg_m2", value)
        })?;
        take(&mut drive.viscous_nm_s_rad, self.viscous_nm_s_rad, |value| {
            place.not_negative("viscous_nm_s_rad", value)
        })?;
        take(&mut drive.coulomb_nm, self.coulomb_nm, |value| {
            place.not_negative("coulomb_nm", value)
        })?;
        place.finite("torque_offset_nm", self.torque_offset_nm.as_slice())?;
        take(&mut drive.gear_ratio, self.gear_ratio, |value| place.positive("gear_ratio", value))?;
        take(&mut drive.torque_constant_nm_a, self.torque_constant_nm_a, |value| {
            place.positive("torque_constant_nm_a", value)
        })?;
        take(&mut limits.velocity_rad_s, self.velocity_rad_s, |value| {
            place.positive("velocity_rad_s", value)
        })?;
        take(&mut limits.torque_nm, self.torque_nm, |value| place.limit("torque_nm", value))?;
        take(&mut limits.acceleration_rad_s2, self.acceleration_rad_s2, |value| {
            place.positive("acceleration_rad_s2", value)
        })?;
        let given = place.bounds(self.mass_bounds_kg, self.com_bounds_m)?;
        bounds.mass_kg = given.mass_kg.or(bounds.mass_kg);
        bounds.com_m = given.com_m.or(bounds.com_m);
        assumed.gear_ratio &= self.gear_ratio.is_none();
        assumed.torque_constant &= self.torque_constant_nm_a.is_none();
        assumed.velocity &= self.velocity_rad_s.is_none();
        assumed.acceleration &= self.acceleration_rad_s2.is_none();
        Ok(())
    }
}
