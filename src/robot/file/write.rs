//! Writing of robot files.

use super::{BoxEntry, CapsuleEntry, JointEntry, RobotFile, Tensor};
use crate::robot::{Arm, Joint};

impl Arm {
    /// The text of a robot file that reads back as this arm, up to round-off.
    pub fn to_toml(&self) -> String {
        let capsule = |k: usize| self.clearance.capsules[k].name.clone();
        let file = RobotFile {
            name: self.name.clone(),
            gravity_m_s2: self.gravity_m_s2.into(),
            friction_epsilon_rad_s: self.friction_epsilon_rad_s,
            torque_offsets: self.torque_offsets,
            drive_gains_assumed: self.drive_gains_assumed,
            floor_z_m: self.clearance.floor_z_m,
            collision_pairs: self.clearance.pairs.iter().map(|pair| pair.map(capsule)).collect(),
            joints: self.joints.iter().map(JointEntry::of).collect(),
            capsules: self.clearance.capsules.iter().map(CapsuleEntry::of).collect(),
            boxes: self.clearance.boxes.iter().map(BoxEntry::of).collect(),
        };
        // Strings and numbers in tables always serialise.
        toml::to_string(&file).unwrap_or_default()
    }
}

impl JointEntry {
    fn of(joint: &Joint) -> Self {
        let Joint { name, placement, link, drive, limits, bounds, .. } = joint;
        let t = link.inertia_com_kg_m2().unwrap_or_default();
        Self {
            name: name.clone(),
            xyz_m: placement.translation_m.into(),
            rpy_rad: placement.rpy_rad(),
            mass_kg: link.mass_kg(),
            com_m: link.com_m().unwrap_or_default().into(),
            inertia_com_kg_m2: Tensor {
                xx: t[(0, 0)],
                xy: t[(0, 1)],
                xz: t[(0, 2)],
                yy: t[(1, 1)],
                yz: t[(1, 2)],
                zz: t[(2, 2)],
            },
            rotor_inertia_kg_m2: drive.rotor_inertia_kg_m2,
            viscous_nm_s_rad: drive.viscous_nm_s_rad,
            coulomb_nm: drive.coulomb_nm,
            gear_ratio: drive.gear_ratio,
            torque_constant_nm_a: drive.torque_constant_nm_a,
            position_rad: limits.position_rad,
            velocity_rad_s: limits.velocity_rad_s,
            acceleration_rad_s2: limits.acceleration_rad_s2,
            torque_nm: limits.torque_nm,
            mass_bounds_kg: bounds.mass_kg,
            com_bounds_m: bounds.com_m,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::built_in_names;

    /// Angles, products of inertia and their shift to the joint frame add a few units of round-off each.
    #[test]
    fn every_built_in_arm_comes_back() {
        for name in built_in_names() {
            let mut arm = Arm::built_in(name).unwrap();
            // Torque limits are unknown where a URDF does not give them.
            arm.joints[0].limits.torque_nm = f64::INFINITY;
            let again = Arm::from_toml(&arm.to_toml(), "written").unwrap();
            assert_eq!(again.clearance, arm.clearance);
            assert_eq!(again.torque_offsets, arm.torque_offsets);
            assert_eq!(again.gravity_m_s2, arm.gravity_m_s2);
            for (a, b) in again.joints.iter().zip(&arm.joints) {
                assert_eq!(
                    (&a.name, a.drive, a.limits, a.bounds),
                    (&b.name, b.drive, b.limits, b.bounds)
                );
                assert!((a.placement.rotation - b.placement.rotation).amax() < 1e-14, "{name}");
                assert_eq!(a.placement.translation_m, b.placement.translation_m);
                for (x, y) in a.link.parameters.iter().zip(&b.link.parameters) {
                    assert!((x - y).abs() < 1e-14 * (1.0 + y.abs()), "{name}: {x} {y}");
                }
            }
        }
    }
}
