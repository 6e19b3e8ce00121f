//! What a URDF has no place for.

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::robot::place::Place;
use crate::robot::{Arm, Drive, RobotError};

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct DriveFile {
    robot: String,
    gravity_m_s2: [f64; 3],
    friction_epsilon_rad_s: f64,
    /// Files of older programs do not say it.
    torque_offsets: Option<bool>,
    joint: Vec<DriveEntry>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct DriveEntry {
    name: String,
    rotor_inertia_kg_m2: f64,
    viscous_nm_s_rad: f64,
    coulomb_nm: f64,
    torque_offset_nm: f64,
    acceleration_rad_s2: f64,
    gear_ratio: f64,
    torque_constant_nm_a: f64,
    mass_bounds_kg: Option<[f64; 2]>,
    com_bounds_m: Option<[[f64; 2]; 3]>,
}

/// The drives as TOML, to lie beside a URDF: joint torque is that of the bodies plus
/// rotor inertia · q̈ + viscous · q̇ + coulomb · tanh(q̇/ε) + offset. `offsets_nm` has one entry per
/// joint.
pub fn drive_file(arm: &Arm, offsets_nm: &[f64]) -> String {
    let joints = arm.joints.iter().zip(offsets_nm);
    let file = DriveFile {
        robot: arm.name.clone(),
        gravity_m_s2: arm.gravity_m_s2.into(),
        friction_epsilon_rad_s: arm.friction_epsilon_rad_s,
        torque_offsets: Some(arm.torque_offsets),
        joint: joints
            .map(|(joint, &torque_offset_nm)| DriveEntry {
                name: joint.name.clone(),
                rotor_inertia_kg_m2: joint.drive.rotor_inertia_kg_m2,
                viscous_nm_s_rad: joint.drive.viscous_nm_s_rad,
                coulomb_nm: joint.drive.coulomb_nm,
                torque_offset_nm,
                acceleration_rad_s2: joint.limits.acceleration_rad_s2,
                gear_ratio: joint.drive.gear_ratio,
                torque_constant_nm_a: joint.drive.torque_constant_nm_a,
                mass_bounds_kg: joint.bounds.mass_kg,
                com_bounds_m: joint.bounds.com_m,
            })
            .collect(),
    };
    // Strings and finite numbers in a table always serialise.
    toml::to_string(&file).unwrap_or_default()
}

/// Gives `arm`, which was read from a URDF, what is in the text of its drive file; `source` names it
/// in messages. An [`Arm`] has no place for the torque offsets themselves.
pub fn apply_drive_file(arm: &mut Arm, text: &str, source: &str) -> Result<(), RobotError> {
    let file: DriveFile = toml::from_str(text)
        .map_err(|e| RobotError::Toml { file: source.to_owned(), message: e.to_string() })?;
    let place = Place::of_arm(source);
    if file.robot != arm.name {
        return Err(place.fault(format!(
            "it is about \"{}\", not \"{}\": move it away or give the URDF that it belongs to",
            file.robot, arm.name
        )));
    }
    let names = |list: &[String]| list.join(", ");
    let given: Vec<String> = file.joint.iter().map(|entry| entry.name.clone()).collect();
    let wanted: Vec<String> = arm.joints.iter().map(|joint| joint.name.clone()).collect();
    if given != wanted {
        return Err(place.fault(format!(
            "its joints are {}, the URDF\'s are {}: export both again",
            names(&given),
            names(&wanted)
        )));
    }
    place.positive("friction_epsilon_rad_s", file.friction_epsilon_rad_s)?;
    place.finite("gravity_m_s2", &file.gravity_m_s2)?;
    arm.friction_epsilon_rad_s = file.friction_epsilon_rad_s;
    arm.gravity_m_s2 = Vector3::from(file.gravity_m_s2);
    arm.torque_offsets = file.torque_offsets.unwrap_or(arm.torque_offsets);
    for (joint, entry) in arm.joints.iter_mut().zip(file.joint) {
        let place = place.table("joint", &entry.name);
        place.not_negative("rotor_inertia_kg_m2", entry.rotor_inertia_kg_m2)?;
        place.not_negative("viscous_nm_s_rad", entry.viscous_nm_s_rad)?;
        place.not_negative("coulomb_nm", entry.coulomb_nm)?;
        place.finite("torque_offset_nm", &[entry.torque_offset_nm])?;
        place.positive("gear_ratio", entry.gear_ratio)?;
        place.positive("torque_constant_nm_a", entry.torque_constant_nm_a)?;
        place.positive("acceleration_rad_s2", entry.acceleration_rad_s2)?;
        joint.drive = Drive {
            rotor_inertia_kg_m2: entry.rotor_inertia_kg_m2,
            viscous_nm_s_rad: entry.viscous_nm_s_rad,
            coulomb_nm: entry.coulomb_nm,
            gear_ratio: entry.gear_ratio,
            torque_constant_nm_a: entry.torque_constant_nm_a,
        };
        joint.limits.acceleration_rad_s2 = entry.acceleration_rad_s2;
        joint.bounds = place.bounds(entry.mass_bounds_kg, entry.com_bounds_m)?;
    }
    Ok(())
}
