//! Robot files (one TOML per arm) and the arms built into the program.

mod clearance;
mod loaded;
mod name;
mod write;

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use super::angles::RightAngles;
use super::arm::{Arm, Assumed, Clearance, Drive, Joint, Limits, Placement};
use super::error::RobotError;
use super::inertia::LinkInertia;
use super::place::Place;
use super::urdf::UrdfNotice;

pub(super) use clearance::{BoxEntry, CapsuleEntry, ClearanceKeys, pair};
pub use loaded::LoadedArm;
pub(crate) use loaded::{is_urdf, text_of};

/// Built-in arms, by the name given to `--robot`.
const BUILT_IN: [(&str, &str); 4] = [
    ("ur5", include_str!("../../robots/ur5.toml")),
    ("ur10e", include_str!("../../robots/ur10e.toml")),
    ("ur3e", include_str!("../../robots/ur3e.toml")),
    ("ur5e", include_str!("../../robots/ur5e.toml")),
];

/// Names of the built-in arms.
pub fn built_in_names() -> impl Iterator<Item = &'static str> {
    BUILT_IN.iter().map(|(name, _)| *name)
}

impl Arm {
    /// One of the built-in arms.
    pub fn built_in(name: &str) -> Result<Self, RobotError> {
        let (_, text) = BUILT_IN
            .iter()
            .find(|(known, _)| *known == name)
            .ok_or_else(|| RobotError::UnknownName { name: name.to_owned() })?;
        Self::from_toml(text, name)
    }

    /// Loads what `--robot` names: a built-in arm, a `.toml` robot file, a `.urdf` file or an MJCF (`.xml`, `.mjcf`),
    /// the latter two together with the drive file `NAME.drives.toml` where one lies beside them. `NAME.urdf#LINK` is
    /// the arm that ends with that link ([`read_urdf_up_to`](super::read_urdf_up_to)), `NAME.xml#BODY` the arm that
    /// ends with that body.
    pub fn load(name_or_path: &str) -> Result<Self, RobotError> {
        LoadedArm::load(name_or_path).map(|loaded| loaded.arm)
    }

    /// Reads the text of a robot file; `source` names it in messages.
    pub fn from_toml(text: &str, source: &str) -> Result<Self, RobotError> {
        read_toml(text, source).map(|(arm, _)| arm)
    }
}

/// The arm in the text of a robot file, and how its angles were understood.
fn read_toml(text: &str, source: &str) -> Result<(Arm, Vec<UrdfNotice>), RobotError> {
    let file: RobotFile = toml::from_str(text)
        .map_err(|e| RobotError::Toml { file: source.to_owned(), message: e.to_string() })?;
    file.into_arm(source)
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct RobotFile {
    name: String,
    #[serde(default = "usual_gravity")]
    gravity_m_s2: [f64; 3],
    #[serde(default = "default_epsilon")]
    friction_epsilon_rad_s: f64,
    #[serde(default = "fits_offsets")]
    torque_offsets: bool,
    #[serde(default)]
    drive_gains_assumed: bool,
    floor_z_m: Option<f64>,
    #[serde(default)]
    collision_pairs: Vec<[String; 2]>,
    #[serde(rename = "joint")]
    joints: Vec<JointEntry>,
    #[serde(default, rename = "capsule")]
    capsules: Vec<CapsuleEntry>,
    #[serde(default, rename = "box")]
    boxes: Vec<BoxEntry>,
}

fn fits_offsets() -> bool {
    true
}

/// Acceleration of gravity where a file does not give it, m/s².
pub(super) fn usual_gravity() -> [f64; 3] {
    [0.0, 0.0, -9.81]
}

pub(super) fn default_epsilon() -> f64 {
    0.02
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct JointEntry {
    name: String,
    xyz_m: [f64; 3],
    rpy_rad: [f64; 3],
    mass_kg: f64,
    com_m: [f64; 3],
    inertia_com_kg_m2: Tensor,
    rotor_inertia_kg_m2: f64,
    viscous_nm_s_rad: f64,
    coulomb_nm: f64,
    gear_ratio: f64,
    torque_constant_nm_a: f64,
    position_rad: [f64; 2],
    velocity_rad_s: f64,
    acceleration_rad_s2: f64,
    torque_nm: f64,
    /// Known bounds of the mass, [low, high].
    mass_bounds_kg: Option<[f64; 2]>,
    /// Known box around the centre of mass: [low, high] of x, y and z.
    com_bounds_m: Option<[[f64; 2]; 3]>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Tensor {
    xx: f64,
    xy: f64,
    xz: f64,
    yy: f64,
    yz: f64,
    zz: f64,
}

impl RobotFile {
    fn into_arm(self, source: &str) -> Result<(Arm, Vec<UrdfNotice>), RobotError> {
        let place = Place::of_arm(source);
        if self.joints.is_empty() {
            return Err(place.fault("it has no [[joint]]"));
        }
        if self.name.is_empty() {
            return Err(place.fault("name is empty; results and other files know the robot by it"));
        }
        place.plain_name("robot", &self.name)?;
        for joint in &self.joints {
            place.plain_name("joint", &joint.name)?;
        }
        place.finite("gravity_m_s2", &self.gravity_m_s2)?;
        place.positive("friction_epsilon_rad_s", self.friction_epsilon_rad_s)?;
        place.unique("joint", self.joints.iter().map(|joint| joint.name.as_str()))?;
        let keys = ClearanceKeys {
            floor_z_m: self.floor_z_m,
            capsules: &self.capsules,
            pairs: &self.collision_pairs,
            boxes: &self.boxes,
            bodies_behind: 0,
        };
        let clearance = keys.added_to(Clearance::default(), self.joints.len(), &place)?;
        let mut angles = RightAngles::default();
        let joints = self
            .joints
            .into_iter()
            .map(|entry| entry.into_joint(&place, &mut angles))
            .collect::<Result<Vec<_>, _>>()?;
        let arm = Arm {
            name: self.name,
            gravity_m_s2: Vector3::from(self.gravity_m_s2),
            gravity_assumed: false,
            friction_epsilon_rad_s: self.friction_epsilon_rad_s,
            torque_offsets: self.torque_offsets,
            drive_gains_assumed: self.drive_gains_assumed,
            joints,
            clearance,
        };
        Ok((arm, angles.notices().collect()))
    }
}

impl JointEntry {
    fn into_joint(self, of_arm: &Place, angles: &mut RightAngles) -> Result<Joint, RobotError> {
        let place = of_arm.table("joint", &self.name);
        let t = &self.inertia_com_kg_m2;
        place.finite("xyz_m", &self.xyz_m)?;
        place.finite("rpy_rad", &self.rpy_rad)?;
        place.finite("mass_kg", &[self.mass_kg])?;
        place.finite("com_m", &self.com_m)?;
        place.finite("inertia_com_kg_m2", &[t.xx, t.xy, t.xz, t.yy, t.yz, t.zz])?;
        let inertia = Matrix3::new(t.xx, t.xy, t.xz, t.xy, t.yy, t.yz, t.xz, t.yz, t.zz);
        let link = LinkInertia::from_com(self.mass_kg, Vector3::from(self.com_m), inertia);
        let margin = link.consistency_margin();
        if margin.is_nan() || margin <= 0.0 {
            return Err(place.fault(format!(
                "no body has this mass, centre of mass and inertia tensor (smallest eigenvalue of \
                 the pseudo-inertia {margin:.3e}, must be positive)"
            )));
        }
        place.not_negative("rotor_inertia_kg_m2", self.rotor_inertia_kg_m2)?;
        place.not_negative("viscous_nm_s_rad", self.viscous_nm_s_rad)?;
        place.not_negative("coulomb_nm", self.coulomb_nm)?;
        place.positive("gear_ratio", self.gear_ratio)?;
        place.positive("torque_constant_nm_a", self.torque_constant_nm_a)?;
        place.positive("velocity_rad_s", self.velocity_rad_s)?;
        place.positive("acceleration_rad_s2", self.acceleration_rad_s2)?;
        // Infinity is allowed: a URDF need not give a torque limit, and a robot file written from it must be readable.
        place.limit("torque_nm", self.torque_nm)?;
        let [low, high] = self.position_rad;
        if !(low < high && low.is_finite() && high.is_finite()) {
            return Err(place.fault(format!(
                "position_rad = [{low}, {high}] must be [low, high]; of a joint without stops write a full turn either way, \
                 [-6.2832, 6.2832]"
            )));
        }
        let at = format!("joint \"{}\"", self.name);
        let rpy_rad = self.rpy_rad.map(|angle_rad| angles.read(angle_rad, &at));
        Ok(Joint {
            placement: Placement::from_xyz_rpy(self.xyz_m, rpy_rad),
            link,
            drive: Drive {
                rotor_inertia_kg_m2: self.rotor_inertia_kg_m2,
                viscous_nm_s_rad: self.viscous_nm_s_rad,
                coulomb_nm: self.coulomb_nm,
                gear_ratio: self.gear_ratio,
                torque_constant_nm_a: self.torque_constant_nm_a,
            },
            limits: Limits {
                position_rad: self.position_rad,
                velocity_rad_s: self.velocity_rad_s,
                acceleration_rad_s2: self.acceleration_rad_s2,
                torque_nm: self.torque_nm,
            },
            bounds: place.bounds(self.mass_bounds_kg, self.com_bounds_m)?,
            assumed: Assumed::default(),
            name: self.name,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_built_in_arm_is_physically_consistent() {
        for name in built_in_names() {
            let arm = Arm::built_in(name).unwrap();
            assert_eq!(arm.dof(), 6, "{name}");
            assert_eq!(arm.name, name);
            for joint in &arm.joints {
                assert!(joint.link.consistency_margin() > 0.0, "{name} {}", joint.name);
                let r = joint.placement.rotation;
                assert!((r.transpose() * r - Matrix3::identity()).norm() < 1e-12, "{name}");
                assert!((r.determinant() - 1.0).abs() < 1e-12, "{name}");
            }
        }
    }

    #[test]
    fn an_unknown_key_is_an_error_that_names_it() {
        let text = include_str!("../../robots/ur5.toml").replace("gear_ratio", "gear_ration");
        let message = Arm::from_toml(&text, "x.toml").unwrap_err().to_string();
        assert!(message.contains("gear_ration"), "{message}");
    }

    /// File systems that ignore case may show extensions in capitals.
    #[test]
    fn an_extension_in_capitals_is_one() {
        let file = tempfile::Builder::new().suffix(".TOML").tempfile().unwrap();
        std::fs::write(file.path(), include_str!("../../robots/ur5.toml")).unwrap();
        let arm = Arm::load(file.path().to_str().unwrap()).unwrap();
        assert_eq!(arm, Arm::built_in("ur5").unwrap());
    }

    /// As in a URDF, so that an arm exported from one file to the other has the same frames.
    #[test]
    fn angles_printed_short_are_right_angles() {
        let with = |right_angle: &str, zero: &str| {
            let text = include_str!("../../robots/ur5.toml")
                .replace("1.5707963267948966", right_angle)
                .replacen("rpy_rad = [0.0,", &format!("rpy_rad = [{zero},"), 1);
            let (arm, notices) = read_toml(&text, "x.toml").unwrap();
            (arm, notices.iter().map(ToString::to_string).collect::<Vec<_>>())
        };
        let built_in = Arm::built_in("ur5").unwrap();
        let (arm, told) = with("1.5708", "3e-5");
        assert_eq!(arm, built_in);
        assert!(told[0].contains("are taken as these: joint \"shoulder_pan\", joint"), "{told:?}");
        let (arm, told) = with("1.57", "0.0");
        assert_ne!(arm, built_in);
        let words = "joint \"wrist_2\" 1.57 (of a right angle write 1.5707963)";
        assert!(told[0].contains(words), "{told:?}");
        assert!(read_toml(BUILT_IN[0].1, "ur5").unwrap().1.is_empty());
    }

    #[test]
    fn what_is_no_number_is_refused_with_its_key() {
        let text = include_str!("../../robots/ur5.toml");
        let message = |key: &str, value: &str| {
            let line = format!("\n{key} = ");
            assert!(text.contains(&line), "{key}");
            let changed = text.replacen(&line, &format!("{line}{value} # "), 1);
            Arm::from_toml(&changed, "x.toml").unwrap_err().to_string()
        };
        let vectors = ["gravity_m_s2", "xyz_m", "rpy_rad", "com_m"];
        for (key, bad) in vectors.iter().flat_map(|key| [(key, "nan"), (key, "inf")]) {
            let refused = message(key, &format!("[0.0, {bad}, 0.0]"));
            assert!(refused.contains(key) && refused.contains("finite number"), "{refused}");
        }
        let mass = message("mass_kg", "inf");
        assert!(mass.contains("joint \"shoulder_pan\": mass_kg: inf"), "{mass}");
        let tensor = message(
            "inertia_com_kg_m2",
            "{ xx = 1.0, xy = nan, xz = 0.0, yy = 1.0, yz = 0.0, zz = 1.0 }",
        );
        assert!(tensor.contains("inertia_com_kg_m2: NaN"), "{tensor}");
    }

    #[test]
    fn bounds_of_a_mass_that_none_has_are_refused() {
        let message = |bounds: &str| {
            let text = include_str!("../../robots/ur5.toml");
            let added = format!("mass_bounds_kg = {bounds}\nmass_kg = ");
            let text = text.replacen("mass_kg = ", &added, 1);
            Arm::from_toml(&text, "x.toml").map_err(|e| e.to_string())
        };
        assert_eq!(message("[3.0, 4.0]").unwrap().joints[0].bounds.mass_kg, Some([3.0, 4.0]));
        let negative = message("[-2.0, -1.0]").unwrap_err();
        assert!(negative.contains("mass_bounds_kg = -2 must not be negative"), "{negative}");
        assert!(message("[4.0, 3.0]").unwrap_err().contains("must be [low, high]"));
    }

    #[test]
    fn names_that_no_other_file_can_hold_are_refused() {
        let message = |from: &str, to: &str| {
            let text = include_str!("../../robots/ur5.toml");
            assert!(text.contains(from), "{from}");
            Arm::from_toml(&text.replacen(from, to, 1), "x.toml").unwrap_err().to_string()
        };
        let nameless = message("name = \"ur5\"", "name = \"\"");
        assert!(nameless.starts_with("x.toml: name is empty"), "{nameless}");
        let robot = message("name = \"ur5\"", "name = \"ur\\t5\"");
        assert!(robot.contains("x.toml: the name of the robot \"ur\\t5\" has a"), "{robot}");
        let joint = message("name = \"elbow\"", "name = \"el\\u0001\\nbow\"");
        assert!(joint.contains("joint \"el\\u{1}\\nbow\" has a control character"), "{joint}");
        let capsule = message("name = \"wrist 3\"", "name = \"wrist\\n3\"");
        assert!(capsule.contains("capsule \"wrist\\n3\" has a control"), "{capsule}");
    }

    #[test]
    fn two_joints_of_one_name_are_refused() {
        let text = include_str!("../../robots/ur5.toml").replace("wrist_2", "wrist_1");
        let message = Arm::from_toml(&text, "x.toml").unwrap_err().to_string();
        assert!(message.contains("the joint \"wrist_1\" is there twice"), "{message}");
    }

    #[test]
    fn a_tensor_no_body_can_have_is_refused() {
        let text = include_str!("../../robots/ur5.toml").replacen("xx = ", "xx = 9", 1);
        let message = Arm::from_toml(&text, "x.toml").unwrap_err().to_string();
        assert!(
            message.contains("shoulder_pan") && message.contains("pseudo-inertia"),
            "{message}"
        );
    }
}
