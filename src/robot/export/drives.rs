//! What a URDF has no place for.

use serde::Serialize;

use crate::robot::Arm;

#[derive(Serialize)]
struct DriveFile<'a> {
    robot: &'a str,
    gravity_m_s2: [f64; 3],
    friction_epsilon_rad_s: f64,
    joint: Vec<DriveEntry<'a>>,
}

#[derive(Serialize)]
struct DriveEntry<'a> {
    name: &'a str,
    rotor_inertia_kg_m2: f64,
    viscous_nm_s_rad: f64,
    coulomb_nm: f64,
    torque_offset_nm: f64,
    acceleration_rad_s2: f64,
    gear_ratio: f64,
    torque_constant_nm_a: f64,
}

/// The drives as TOML, to lie beside a URDF: joint torque is that of the bodies plus
/// rotor inertia · q̈ + viscous · q̇ + coulomb · tanh(q̇/ε) + offset. `offsets_nm` has one entry per
/// joint.
pub fn drive_file(arm: &Arm, offsets_nm: &[f64]) -> String {
    let joints = arm.joints.iter().zip(offsets_nm);
    let file = DriveFile {
        robot: &arm.name,
        gravity_m_s2: arm.gravity_m_s2.into(),
        friction_epsilon_rad_s: arm.friction_epsilon_rad_s,
        joint: joints
            .map(|(joint, &torque_offset_nm)| DriveEntry {
                name: &joint.name,
                rotor_inertia_kg_m2: joint.drive.rotor_inertia_kg_m2,
                viscous_nm_s_rad: joint.drive.viscous_nm_s_rad,
                coulomb_nm: joint.drive.coulomb_nm,
                torque_offset_nm,
                acceleration_rad_s2: joint.limits.acceleration_rad_s2,
                gear_ratio: joint.drive.gear_ratio,
                torque_constant_nm_a: joint.drive.torque_constant_nm_a,
            })
            .collect(),
    };
    // Strings and finite numbers in a table always serialise.
    toml::to_string(&file).unwrap_or_default()
}
