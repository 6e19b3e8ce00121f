//! The drive file: everything about an arm that a URDF or an MJCF has no place for.

mod clearance;

use clearance::Source;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

use crate::robot::file::{BoxEntry, CapsuleEntry};
use crate::robot::place::Place;
use crate::robot::urdf::unless_empty;
use crate::robot::{Arm, Joint, MjcfNotice, RobotError, ShapeNotice, UrdfNotice};

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

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct DriveEntry {
    name: String,
    rotor_inertia_kg_m2: Option<f64>,
    viscous_nm_s_rad: Option<f64>,
    coulomb_nm: Option<f64>,
    torque_offset_nm: Option<f64>,
    velocity_rad_s: Option<f64>,
    acceleration_rad_s2: Option<f64>,
    torque_nm: Option<f64>,
    gear_ratio: Option<f64>,
    torque_constant_nm_a: Option<f64>,
    mass_bounds_kg: Option<[f64; 2]>,
    com_bounds_m: Option<[[f64; 2]; 3]>,
}

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

    /// What the file says about a joint.
    fn entry(&self, joint: &str) -> Option<&DriveEntry> {
        self.joint.iter().find(|entry| entry.name == joint)
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

impl DriveEntry {
    fn of(joint: &Joint, torque_offset_nm: f64) -> Self {
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

    fn apply(&self, joint: &mut Joint, place: &Place) -> Result<(), RobotError> {
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
    use crate::robot::Clearance;

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
        let mut arm = ur5();
        let names = names(&arm);
        arm.joints.truncate(2);
        let text = drive_file(&arm, &[0.0; 2]).replace(&names[0], "a").replace(&names[1], "b");
        assert!(left(&text).is_empty(), "{text}");
    }
}
