//! What a drive file leaves of the notices about the model beside it.

use super::DriveFile;
use super::entry::DriveEntry;
use crate::robot::urdf::unless_empty;
use crate::robot::{MjcfNotice, ShapeNotice, UrdfNotice};

/// What a drive file leaves of a notice.
#[derive(Debug, PartialEq)]
pub(in crate::robot) enum Rest {
    /// The file has no say in it.
    Untouched(UrdfNotice),
    /// Neither the file nor the model beside it says this.
    Open(UrdfNotice),
    /// The file settles it.
    Nothing,
}

impl Rest {
    fn open_if(is_open: bool, notice: UrdfNotice) -> Self {
        if is_open { Self::Open(notice) } else { Self::Nothing }
    }

    /// What is left of a notice about the joints or the like that the file does not settle.
    fn about<T>(left: Vec<T>, notice: impl FnOnce(Vec<T>) -> UrdfNotice) -> Self {
        unless_empty(left, notice).map_or(Self::Nothing, Self::Open)
    }
}

impl DriveFile {
    /// What this file leaves of a `notice` about the model beside it.
    pub(in crate::robot) fn rest_of(&self, notice: UrdfNotice) -> Rest {
        match notice {
            UrdfNotice::Gravity { .. } | UrdfNotice::Mjcf(MjcfNotice::Weightless) => {
                Rest::open_if(self.gravity_m_s2.is_none(), notice)
            }
            UrdfNotice::FrictionEpsilon { .. } => {
                Rest::open_if(self.friction_epsilon_rad_s.is_none(), notice)
            }
            UrdfNotice::Drives { rotor_inertia, gear_ratio, torque_constant } => {
                let rotor_inertia = self.without(rotor_inertia, |e| e.rotor_inertia_kg_m2);
                let gear_ratio = self.without(gear_ratio, |e| e.gear_ratio);
                let torque_constant = self.without(torque_constant, |e| e.torque_constant_nm_a);
                let lists = [&rotor_inertia, &gear_ratio, &torque_constant];
                let is_open = lists.iter().any(|joints| !joints.is_empty());
                let notice = UrdfNotice::Drives { rotor_inertia, gear_ratio, torque_constant };
                Rest::open_if(is_open, notice)
            }
            UrdfNotice::NoFriction { joints } => {
                let joints = self.without(joints, |e| e.viscous_nm_s_rad.or(e.coulomb_nm));
                Rest::about(joints, |joints| UrdfNotice::NoFriction { joints })
            }
            UrdfNotice::ServoDamping { mut joints } => {
                joints.retain(|(joint, ..)| !self.says(joint, |e| e.viscous_nm_s_rad));
                Rest::about(joints, |joints| UrdfNotice::ServoDamping { joints })
            }
            UrdfNotice::AssumedVelocity { joints, velocity_rad_s } => {
                let joints = self.without(joints, |e| e.velocity_rad_s);
                Rest::about(joints, |joints| UrdfNotice::AssumedVelocity { joints, velocity_rad_s })
            }
            UrdfNotice::NoTorqueLimit { joints } => {
                let joints = self.without(joints, |e| e.torque_nm);
                Rest::about(joints, |joints| UrdfNotice::NoTorqueLimit { joints })
            }
            UrdfNotice::AssumedAcceleration { joints, acceleration_rad_s2 } => {
                let joints = self.without(joints, |e| e.acceleration_rad_s2);
                Rest::about(joints, |joints| UrdfNotice::AssumedAcceleration {
                    joints,
                    acceleration_rad_s2,
                })
            }
            UrdfNotice::Shapes(_) if self.sets_shapes_aside() => Rest::Nothing,
            UrdfNotice::Shapes(ShapeNotice::Nothing) if !self.capsules.is_empty() => Rest::Nothing,
            other => Rest::Untouched(other),
        }
    }

    /// Those of `joints` for which the file does not give a quantity.
    fn without(
        &self,
        joints: Vec<String>,
        quantity: impl Fn(&DriveEntry) -> Option<f64>,
    ) -> Vec<String> {
        joints.into_iter().filter(|joint| !self.says(joint, &quantity)).collect()
    }

    /// Whether the file gives a quantity of a joint.
    fn says(&self, joint: &str, quantity: impl Fn(&DriveEntry) -> Option<f64>) -> bool {
        self.entry(joint).and_then(quantity).is_some()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::Arm;
    use crate::robot::export::drive_file;

    #[test]
    fn only_what_a_drive_file_says_is_not_assumed_any_more() {
        let all = || ["a", "b"].map(str::to_owned).to_vec();
        let b = || vec!["b".to_owned()];
        let gravity = || UrdfNotice::Gravity { root: "base".into() };
        let drives = |rotor_inertia, gear_ratio, torque_constant| UrdfNotice::Drives {
            rotor_inertia,
            gear_ratio,
            torque_constant,
        };
        let no_friction = |joints| UrdfNotice::NoFriction { joints };
        let servo = |joint: &str| (joint.to_owned(), 200.0, 150.0);
        let dampings = |joints| UrdfNotice::ServoDamping { joints };
        let accelerations =
            |joints| UrdfNotice::AssumedAcceleration { joints, acceleration_rad_s2: 10.0 };
        let notices = || {
            let both = dampings(vec![servo("a"), servo("b")]);
            let accelerations = accelerations(all());
            [gravity(), drives(all(), all(), all()), no_friction(all()), both, accelerations]
        };
        let left = |text: &str| -> Vec<UrdfNotice> {
            let file = DriveFile::read(text, "x.drives.toml").unwrap();
            let rest = |notice| match file.rest_of(notice) {
                Rest::Open(notice) => Some(notice),
                Rest::Nothing => None,
                Rest::Untouched(other) => panic!("{other}"),
            };
            notices().into_iter().filter_map(rest).collect()
        };
        assert_eq!(left("friction_epsilon_rad_s = 0.01"), notices());
        let one = "[[joint]]\nname = \"a\"\n";
        let said = left(&format!("{one}viscous_nm_s_rad = 0.0\ntorque_constant_nm_a = 0.1\n"));
        let of_b = dampings(vec![servo("b")]);
        let expected =
            [gravity(), drives(all(), all(), b()), no_friction(b()), of_b, accelerations(all())];
        assert_eq!(said, expected);
        let open = said[1].to_string();
        let of_both = "no rotor inertia and no gear ratio given, taken as 0 and 1: a, b; ";
        assert!(open.contains(of_both), "{open}");
        assert!(open.contains("no torque constant given, taken as 1 Nm/A: b"), "{open}");
        let mut arm = Arm::built_in("ur5").unwrap();
        arm.joints.truncate(2);
        let (first, second) = (&arm.joints[0].name, &arm.joints[1].name);
        let text = drive_file(&arm, &[0.0; 2]).replace(first, "a").replace(second, "b");
        assert!(left(&text).is_empty(), "{text}");
    }
}
