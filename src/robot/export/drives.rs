//! The drive file: everything about an arm that a URDF or an MJCF has no place for.

mod clearance;
mod entry;
mod rest;

use clearance::Source;
use entry::DriveEntry;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::robot::file::{BoxEntry, CapsuleEntry};
use crate::robot::place::Place;
use crate::robot::{Arm, RobotError};

pub(in crate::robot) use rest::Rest;

/// The drive file beside a URDF or an MJCF. A key that is left out keeps the value of that file, or the value that is
/// assumed without a drive file.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::robot) struct DriveFile {
    robot: Option<String>,
    gravity_m_s2: Option<[f64; 3]>,
    friction_epsilon_rad_s: Option<f64>,
    torque_offsets: Option<bool>,
    drive_gains_assumed: Option<bool>,
    clearance: Option<Source>,
    floor_z_m: Option<f64>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    collision_pairs: Vec<[String; 2]>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    unwatched_pairs: Vec<[String; 2]>,
    #[serde(default)]
    joint: Vec<DriveEntry>,
    #[serde(default, rename = "capsule", skip_serializing_if = "Vec::is_empty")]
    capsules: Vec<CapsuleEntry>,
    #[serde(default, rename = "box", skip_serializing_if = "Vec::is_empty")]
    boxes: Vec<BoxEntry>,
}

/// The drives and the clearance of `arm` as TOML, to lie beside a URDF that describes the bodies alone. The torque of a
/// joint is that of the bodies plus rotor inertia · q̈ + viscous · q̇ + coulomb · tanh(q̇/ε) + offset; `offsets_nm` has
/// one entry per joint. What was only assumed about the arm is left out.
pub fn drive_file(arm: &Arm, offsets_nm: &[f64]) -> String {
    DriveFile::of(arm, offsets_nm).text()
}

/// As [`drive_file`], for an `arm` that came from a URDF with shapes whose own drive file is `text`. The clearance keys
/// are kept from `text`. The joints of `text` that are not the arm's, such as those of a second arm, follow the joints
/// of the arm; `source` names the drive file in messages.
pub fn drive_file_of_urdf(
    arm: &Arm,
    offsets_nm: &[f64],
    text: &str,
    source: &str,
) -> Result<String, RobotError> {
    let own = DriveFile::read(text, source)?;
    let mut file = DriveFile::of(arm, offsets_nm);
    // Speed and torque limits are written only where the old drive file has them: others are in the URDF, which keeps
    // its own.
    for entry in &mut file.joint {
        let before = own.entry(&entry.name);
        entry.velocity_rad_s = before.and_then(|before| before.velocity_rad_s);
        entry.torque_nm = before.and_then(|before| before.torque_nm);
    }
    let of_arm = |entry: &DriveEntry| arm.joints.iter().any(|joint| joint.name == entry.name);
    file.joint.extend(own.joint.into_iter().filter(|entry| !of_arm(entry)));
    let file = DriveFile {
        clearance: own.clearance,
        floor_z_m: own.floor_z_m,
        collision_pairs: own.collision_pairs,
        unwatched_pairs: own.unwatched_pairs,
        capsules: own.capsules,
        boxes: own.boxes,
        ..file
    };
    Ok(file.text())
}

/// As [`drive_file`], to lie beside an MJCF that describes the bodies of `arm` alone and has no speed limits. It also
/// fits a URDF that the arm came from, together with its own drive file, whose text is `text`: the shapes of the URDF
/// are written out as they were understood. Joints of `text` that are not the arm's are left out, since an MJCF has
/// none of them; `source` names the drive file in messages.
pub fn drive_file_of_mjcf(
    arm: &Arm,
    offsets_nm: &[f64],
    text: &str,
    source: &str,
) -> Result<String, RobotError> {
    let own = DriveFile::read(text, source)?;
    let mut file = DriveFile::of(arm, offsets_nm);
    for (entry, joint) in file.joint.iter_mut().zip(&arm.joints) {
        let stated = !joint.assumed.velocity;
        entry.velocity_rad_s = stated.then_some(joint.limits.velocity_rad_s);
        entry.torque_nm = own.entry(&joint.name).and_then(|before| before.torque_nm);
    }
    let unwatched_pairs = own.unwatched_in(&arm.clearance);
    let file = DriveFile { clearance: own.clearance, unwatched_pairs, ..file };
    Ok(file.text())
}

/// Applies the text of a drive file to `arm`, which was read from a URDF; `source` names the file in messages. Torque
/// offsets are checked but not kept: an [`Arm`] has no place for them.
pub fn apply_drive_file(arm: &mut Arm, text: &str, source: &str) -> Result<(), RobotError> {
    DriveFile::read(text, source)?.apply(arm, &[], source)
}

impl DriveFile {
    fn of(arm: &Arm, offsets_nm: &[f64]) -> Self {
        let joints = arm.joints.iter().zip(offsets_nm);
        let capsules = &arm.clearance.capsules;
        let named = |pair: &[usize; 2]| pair.map(|k| capsules[k].name.clone());
        Self {
            robot: Some(arm.name.clone()),
            gravity_m_s2: (!arm.gravity_assumed).then_some(arm.gravity_m_s2.into()),
            // Assumed or not: the friction that was identified belongs to this ε.
            friction_epsilon_rad_s: Some(arm.friction_epsilon_rad_s),
            torque_offsets: Some(arm.torque_offsets),
            drive_gains_assumed: arm.drive_gains_assumed.then_some(true),
            clearance: None,
            floor_z_m: arm.clearance.floor_z_m,
            collision_pairs: arm.clearance.pairs.iter().map(named).collect(),
            unwatched_pairs: Vec::new(),
            joint: joints.map(|(joint, &offset_nm)| DriveEntry::of(joint, offset_nm)).collect(),
            capsules: capsules.iter().map(CapsuleEntry::of).collect(),
            boxes: arm.clearance.boxes.iter().map(BoxEntry::of).collect(),
        }
    }

    fn text(&self) -> String {
        // Strings and finite numbers in a table always serialise.
        toml::to_string(self).unwrap_or_default()
    }

    /// Reads the text of a drive file; `source` names it in messages.
    pub(in crate::robot) fn read(text: &str, source: &str) -> Result<Self, RobotError> {
        toml::from_str(text)
            .map_err(|e| RobotError::Toml { file: source.to_owned(), message: e.to_string() })
    }

    /// Applies the drive file to `arm`. It may also contain `locked` joints of the same URDF: for a robot with two
    /// arms, one file has the drives of both.
    pub(in crate::robot) fn apply(
        &self,
        arm: &mut Arm,
        locked: &[&str],
        source: &str,
    ) -> Result<(), RobotError> {
        let place = Place::of_arm(source);
        self.check_names(arm, locked, &place)?;
        take(&mut arm.friction_epsilon_rad_s, self.friction_epsilon_rad_s, |value| {
            place.positive("friction_epsilon_rad_s", value)
        })?;
        if let Some(gravity_m_s2) = self.gravity_m_s2 {
            place.finite("gravity_m_s2", &gravity_m_s2)?;
            arm.gravity_m_s2 = Vector3::from(gravity_m_s2);
            arm.gravity_assumed = false;
        }
        arm.torque_offsets = self.torque_offsets.unwrap_or(arm.torque_offsets);
        arm.drive_gains_assumed = self.drive_gains_assumed.unwrap_or(arm.drive_gains_assumed);
        self.add_clearance(arm, locked.len(), &place)?;
        for joint in &mut arm.joints {
            if let Some(entry) = self.entry(&joint.name) {
                entry.apply(joint, &place.table("joint", &entry.name))?;
            }
        }
        Ok(())
    }

    /// Refuses a file about another robot, and joints that the URDF does not have.
    fn check_names(&self, arm: &Arm, locked: &[&str], place: &Place) -> Result<(), RobotError> {
        if let Some(robot) = self.robot.as_ref().filter(|robot| **robot != arm.name) {
            return Err(place.fault(format!(
                "it is about \"{robot}\", not \"{}\": move it away or give the robot that it belongs to",
                arm.name
            )));
        }
        let known: Vec<&str> = arm.joints.iter().map(|joint| joint.name.as_str()).collect();
        let given: Vec<&str> = self.joint.iter().map(|entry| entry.name.as_str()).collect();
        let unknown: Vec<&str> = given
            .iter()
            .copied()
            .filter(|name| !known.contains(name) && !locked.contains(name))
            .collect();
        if !unknown.is_empty() {
            return Err(place.fault(format!(
                "its joints \"{}\" are none of the robot's, which are {}: correct the names, or export both again",
                unknown.join("\", \""),
                known.join(", ")
            )));
        }
        let repeated = (0..given.len()).find(|&k| given[..k].contains(&given[k]));
        match repeated {
            Some(k) => Err(place.fault(format!(
                "its joint \"{}\" is there twice; the robot's joints are {}, each has one [[joint]] or none",
                given[k],
                known.join(", ")
            ))),
            None => Ok(()),
        }
    }

    /// What the file says about a joint.
    fn entry(&self, joint: &str) -> Option<&DriveEntry> {
        self.joint.iter().find(|entry| entry.name == joint)
    }
}

/// Writes a given value into `place` after it has passed the check.
fn take(
    place: &mut f64,
    given: Option<f64>,
    check: impl Fn(f64) -> Result<(), RobotError>,
) -> Result<(), RobotError> {
    if let Some(value) = given {
        check(value)?;
        *place = value;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::{Clearance, UrdfNotice};

    fn ur5() -> Arm {
        Arm::built_in("ur5").unwrap()
    }

    fn names(arm: &Arm) -> Vec<String> {
        arm.joints.iter().map(|joint| joint.name.clone()).collect()
    }

    /// A few hand-written lines, about joints in another order.
    #[test]
    fn what_a_drive_file_leaves_out_stays_as_it_was() {
        let mut wanted = ur5();
        wanted.joints[4].drive.coulomb_nm = 2.5;
        wanted.joints[1].drive.rotor_inertia_kg_m2 = 0.7;
        wanted.joints[1].bounds.mass_kg = Some([7.0, 9.0]);
        let (first, second) = (&wanted.joints[4].name, &wanted.joints[1].name);
        let text = format!(
            "[[joint]]\nname = \"{first}\"\ncoulomb_nm = 2.5\n\
             [[joint]]\nname = \"{second}\"\nrotor_inertia_kg_m2 = 0.7\nmass_bounds_kg = [7.0, 9.0]\n"
        );
        let mut arm = ur5();
        apply_drive_file(&mut arm, &text, "x.drives.toml").unwrap();
        assert_eq!(arm, wanted);
        apply_drive_file(&mut arm, "", "x.drives.toml").unwrap();
        assert_eq!(arm, wanted);
        apply_drive_file(&mut arm, "gravity_m_s2 = [0.0, 9.81, 0.0]", "x.drives.toml").unwrap();
        wanted.gravity_m_s2 = Vector3::new(0.0, 9.81, 0.0);
        assert_eq!(arm, wanted);
    }

    /// Speed and torque limits have no place in an MJCF, and URDFs often leave them out.
    #[test]
    fn limits_by_hand_come_first() {
        let mut wanted = ur5();
        wanted.joints[1].limits.velocity_rad_s = 1.25;
        wanted.joints[1].limits.torque_nm = 87.0;
        let text =
            |limits: &str| format!("[[joint]]\nname = \"{}\"\n{limits}\n", ur5().joints[1].name);
        let limits = text("velocity_rad_s = 1.25\ntorque_nm = 87.0");
        let mut arm = ur5();
        apply_drive_file(&mut arm, &limits, "x.drives.toml").unwrap();
        assert_eq!(arm, wanted);
        let file = DriveFile::read(&limits, "x.drives.toml").unwrap();
        let notice = UrdfNotice::NoTorqueLimit { joints: names(&arm) };
        let Rest::Open(UrdfNotice::NoTorqueLimit { joints }) = file.rest_of(notice) else {
            panic!()
        };
        assert_eq!(joints, [&names(&arm)[..1], &names(&arm)[2..]].concat());
        let unknown = text("torque_nm = inf");
        apply_drive_file(&mut arm, &unknown, "x.drives.toml").unwrap();
        assert_eq!(arm.joints[1].limits.torque_nm, f64::INFINITY);
        for limit in ["torque_nm = 0.0", "velocity_rad_s = -1.0", "velocity_rad_s = inf"] {
            let refused = apply_drive_file(&mut ur5(), &text(limit), "x.drives.toml");
            assert!(refused.is_err(), "{limit}");
        }
    }

    #[test]
    fn a_joint_that_is_not_there_or_twice_is_refused_with_those_that_are() {
        let names = names(&ur5());
        let first = names[0].as_str();
        for (joints, said) in [
            (["elbow_9", "wrist_9"], "\"elbow_9\", \"wrist_9\" are none of the robot's"),
            ([first, first], "is there twice"),
        ] {
            let entries = joints.map(|name| format!("[[joint]]\nname = \"{name}\"\n"));
            let file = DriveFile::read(&entries.concat(), "x.drives.toml").unwrap();
            let message = file.apply(&mut ur5(), &[], "x.drives.toml").unwrap_err().to_string();
            assert!(message.contains(said), "{message}");
            assert!(message.contains(&names.join(", ")), "{message}");
        }
        let finger = DriveFile::read("[[joint]]\nname = \"finger\"\n", "x.drives.toml").unwrap();
        let mut arm = ur5();
        finger.apply(&mut arm, &["finger"], "x.drives.toml").unwrap();
        assert_eq!(arm, ur5());
    }

    /// One file has the drives of two arms: the entries of the other arm stay as their author wrote them.
    #[test]
    fn joints_of_another_arm_stay_in_the_drive_file() {
        let arm = ur5();
        let own = arm.joints[0].name.as_str();
        let text = format!(
            "[[joint]]\nname = \"other\"\ngear_ratio = 50.0\n[[joint]]\nname = \"{own}\"\ngear_ratio = 7.0\n"
        );
        let written = drive_file_of_urdf(&arm, &[0.5; 6], &text, "x.drives.toml").unwrap();
        // The clearance comes from the URDF.
        let without = Arm { clearance: Clearance::default(), ..arm.clone() };
        let alone = drive_file(&without, &[0.5; 6]);
        let behind = "\n[[joint]]\nname = \"other\"\ngear_ratio = 50.0\n";
        assert_eq!(written, format!("{alone}{behind}"));
        assert!(drive_file_of_urdf(&arm, &[0.5; 6], "joint = 1", "x.drives.toml").is_err());
    }
}
