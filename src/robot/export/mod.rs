//! Export of arms to other programs.
//!
//! Input: an [`Arm`] whose bodies can exist, and named frames on them. Output: a URDF (a new one, or the one that the
//! arm came from with other numbers) or an MJCF, and the drive file with everything that these have no place for. All
//! numbers are written so that they read back as the same bits.

mod drives;
mod mjcf;
mod own_urdf;
mod urdf;
mod xml;

use std::collections::HashSet;

use thiserror::Error;

use super::arm::Arm;
use super::urdf::{FixedFrame, Frames, UrdfLink};

pub(super) use drives::{DriveFile, Rest};
pub use drives::{apply_drive_file, drive_file, drive_file_of_mjcf, drive_file_of_urdf};
pub use mjcf::{mjcf, mjcf_with_links};
pub use own_urdf::{OwnUrdf, OwnUrdfError, Rescaling, Unfit, own_urdf};
pub use urdf::{urdf, urdf_with_links};

/// The arm is not one that a simulator accepts.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum ExportError {
    /// No mass distribution has the ten parameters of a body.
    #[error(
        "the body of joint \"{joint}\" cannot exist (smallest eigenvalue of its pseudo-inertia \
         {smallest:.3e}, must be positive): no simulator runs it; identify with --physical"
    )]
    Impossible {
        /// Name of the joint that moves it.
        joint: String,
        /// Smallest eigenvalue.
        smallest: f64,
    },
    /// A negative parameter of a drive, which would generate energy.
    #[error("joint \"{joint}\": {quantity} = {value} is negative; identify with --physical")]
    Negative {
        /// Name of the joint.
        joint: String,
        /// Which quantity.
        quantity: &'static str,
        /// Its value.
        value: f64,
    },
    /// A number that no file format can represent.
    #[error("joint \"{joint}\": {quantity} = {value} is not a finite number")]
    NotFinite {
        /// Name of the joint.
        joint: String,
        /// Which quantity.
        quantity: &'static str,
        /// Its value.
        value: f64,
    },
    /// Two links or frames with the same name.
    #[error("the name \"{name}\" is used twice; rename the joint or the frame")]
    DuplicateName {
        /// The name.
        name: String,
    },
}

/// Refuses an arm that could not run, and names that would collide; `bodies` are the names of the moving bodies.
fn check(arm: &Arm, frames: &Frames, bodies: &[String]) -> Result<(), ExportError> {
    check_numbers(arm)?;
    let mut seen = HashSet::from([frames.root.as_str()]);
    let fixed = frames.fixed.iter().map(|frame| &frame.name);
    for name in bodies.iter().chain(fixed) {
        if !seen.insert(name) {
            return Err(ExportError::DuplicateName { name: name.clone() });
        }
    }
    Ok(())
}

/// Refuses an arm that could not run.
fn check_numbers(arm: &Arm) -> Result<(), ExportError> {
    for joint in &arm.joints {
        let drive = [
            ("rotor inertia", joint.drive.rotor_inertia_kg_m2),
            ("viscous friction", joint.drive.viscous_nm_s_rad),
            ("Coulomb friction", joint.drive.coulomb_nm),
        ];
        let name = || joint.name.clone();
        for (quantity, value) in drive {
            if !value.is_finite() {
                return Err(ExportError::NotFinite { joint: name(), quantity, value });
            }
            if value < 0.0 {
                return Err(ExportError::Negative { joint: name(), quantity, value });
            }
        }
        if let Some(&value) = joint.link.parameters.iter().find(|p| !p.is_finite()) {
            let quantity = "an inertial parameter";
            return Err(ExportError::NotFinite { joint: name(), quantity, value });
        }
        let smallest = joint.link.consistency_margin();
        if smallest <= 0.0 {
            return Err(ExportError::Impossible { joint: name(), smallest });
        }
    }
    Ok(())
}

/// Names of the moving bodies: of `links`, the one directly behind the joint, or `<joint>_link`.
fn body_names(arm: &Arm, links: &[UrdfLink]) -> Vec<String> {
    let names = (1..).zip(&arm.joints).map(|(body, joint)| {
        let link = links.iter().find(|link| link.is_first && link.body == body);
        link.map_or_else(|| format!("{}_link", joint.name), |link| link.name.clone())
    });
    names.collect()
}

/// The frames of an arm that consists of `links`: those with mass that are fixed to a moving body are a part of it, and
/// keep only their frames.
fn with_merged(frames: &Frames, links: &[UrdfLink]) -> Frames {
    let is_merged = |link: &&UrdfLink| link.body > 0 && !link.is_first && link.inertia.is_some();
    let merged = links.iter().filter(is_merged).map(|link| FixedFrame {
        name: link.name.clone(),
        body: link.body,
        placement: link.placement,
    });
    let fixed = frames.fixed.iter().cloned().chain(merged).collect();
    Frames { root: frames.root.clone(), fixed }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::{MjcfArm, Placement, UrdfArm, UrdfNotice, read_mjcf, read_urdf};

    /// A robot on a stand: its base is a frame of the root link.
    fn frames() -> Frames {
        let frame = |name: &str, body, xyz, rpy| FixedFrame {
            name: name.into(),
            body,
            placement: Placement::from_xyz_rpy(xyz, rpy),
        };
        Frames {
            root: "wor<l>d".into(),
            fixed: vec![
                frame("base_link", 0, [0.1, 0.0, -0.3], [0.0, 0.0, 0.3]),
                frame("tool & <tip>", 6, [0.0, 0.01, 0.1], [0.4, -1.2, 2.0]),
            ],
        }
    }

    /// Rotations are converted to three angles and back (a few roundings), moments to the centre of mass and back;
    /// everything else reads back as written.
    #[test]
    fn an_arm_written_as_urdf_reads_back_as_the_same_arm() {
        for name in crate::robot::built_in_names() {
            let arm = Arm::built_in(name).unwrap();
            let text = urdf(&arm, &frames()).unwrap();
            let UrdfArm { arm: read, frames: read_frames, notices, .. } =
                read_urdf(&text, "x.urdf").unwrap();
            assert_eq!((read.name.as_str(), read.dof()), (name, 6));
            for (a, b) in arm.joints.iter().zip(&read.joints) {
                assert_eq!(a.name, b.name);
                assert_eq!(a.limits, b.limits);
                assert_eq!(a.drive.viscous_nm_s_rad, b.drive.viscous_nm_s_rad);
                assert_eq!(a.drive.coulomb_nm, b.drive.coulomb_nm);
                assert_eq!(a.placement.translation_m, b.placement.translation_m);
                assert!((a.placement.rotation - b.placement.rotation).norm() < 1e-14);
                for (x, y) in a.link.parameters.iter().zip(&b.link.parameters) {
                    assert!((x - y).abs() < 1e-14, "{name} {}: {x} {y}", a.name);
                }
            }
            assert_eq!(frames().root, read_frames.root);
            for (a, b) in frames().fixed.iter().zip(&read_frames.fixed) {
                assert_eq!((&a.name, a.body), (&b.name, b.body));
                assert!((a.placement.rotation - b.placement.rotation).norm() < 1e-14);
                assert!((a.placement.translation_m - b.placement.translation_m).norm() < 1e-15);
            }
            for notice in notices {
                let harmless =
                    ["gravity", "rotor", "collision", "clear", "acceleration", "Coulomb"];
                let text = notice.to_string();
                assert!(harmless.iter().any(|word| text.contains(word)), "{text}");
            }
        }
    }

    #[test]
    fn what_no_simulator_runs_is_not_written() {
        let mut arm = Arm::built_in("ur5").unwrap();
        arm.joints[3].drive.rotor_inertia_kg_m2 = -0.1;
        let message = urdf(&arm, &Frames::default()).unwrap_err().to_string();
        assert!(message.contains("wrist_1") && message.contains("--physical"), "{message}");
        let mut arm = Arm::built_in("ur5").unwrap();
        arm.joints[5].link.parameters[4] = 1.0;
        let message = mjcf(&arm, &Frames::default()).unwrap_err().to_string();
        assert!(message.contains("wrist_3") && message.contains("cannot exist"), "{message}");
        let mut arm = Arm::built_in("ur5").unwrap();
        arm.joints[1].link.parameters[0] = f64::NAN;
        assert!(matches!(mjcf(&arm, &Frames::default()), Err(ExportError::NotFinite { .. })));
        let mut arm = Arm::built_in("ur5").unwrap();
        arm.joints[1].name = arm.joints[0].name.clone();
        assert!(matches!(urdf(&arm, &Frames::default()), Err(ExportError::DuplicateName { .. })));
    }

    #[test]
    fn an_unknown_torque_limit_reads_back_as_unknown() {
        let mut arm = Arm::built_in("ur5").unwrap();
        arm.joints[0].limits.torque_nm = f64::INFINITY;
        let model = urdf(&arm, &Frames::default()).unwrap();
        // A URDF requires a number.
        assert!(model.contains("effort=\"1000000000\""));
        let unknown = UrdfNotice::NoTorqueLimit { joints: vec!["shoulder_pan".to_owned()] };
        let read = read_urdf(&model, "x.urdf").unwrap();
        assert_eq!(read.arm.joints[0].limits.torque_nm, f64::INFINITY);
        assert!(read.notices.contains(&unknown));
        let model = mjcf(&arm, &Frames::default()).unwrap();
        assert!(model.contains("<motor name=\"shoulder_pan\" joint=\"shoulder_pan\"/>"), "{model}");
        // Files of older versions have the large number.
        let older = model.replacen(
            "joint=\"shoulder_pan\"/>",
            "joint=\"shoulder_pan\" ctrlrange=\"-1e9 1e9\"/>",
            1,
        );
        for text in [model, older] {
            let read = read_mjcf(&text, "x.xml").unwrap();
            assert_eq!(read.arm.joints[0].limits.torque_nm, f64::INFINITY);
            assert_eq!(read.arm.joints[1].limits.torque_nm, 150.0);
            assert!(read.notices.contains(&unknown));
        }
    }

    /// Written as limits, the assumed range would stop the joint in a simulator.
    #[test]
    fn a_joint_without_end_stops_is_written_without() {
        let known = urdf(&Arm::built_in("ur5").unwrap(), &Frames::default()).unwrap();
        let text = known.replacen("\"revolute\"", "\"continuous\"", 1);
        let arm = read_urdf(&text, "x.urdf").unwrap().arm;
        let is_endless = |arm: &Arm| -> Vec<bool> {
            arm.joints.iter().map(|joint| joint.assumed.position).collect()
        };
        assert_eq!(is_endless(&arm), [true, false, false, false, false, false]);
        let written = urdf(&arm, &Frames::default()).unwrap();
        assert!(written.contains("<joint name=\"shoulder_pan\" type=\"continuous\">"), "{written}");
        assert!(written.contains("<limit effort=\"150\" velocity=\"3.14"), "{written}");
        assert_eq!(written.matches("<limit lower=").count(), 5, "{written}");
        let model = mjcf(&arm, &Frames::default()).unwrap();
        assert!(model.contains("<joint name=\"shoulder_pan\" axis=\"0 0 1\" armature="), "{model}");
        assert_eq!(model.matches(" range=").count(), 5, "{model}");
        let of_urdf = read_urdf(&written, "x.urdf").unwrap().arm;
        let of_mjcf = read_mjcf(&model, "x.xml").unwrap().arm;
        for back in [of_urdf, of_mjcf] {
            assert_eq!(is_endless(&back), is_endless(&arm));
            for (a, b) in arm.joints.iter().zip(&back.joints) {
                assert_eq!(a.limits.position_rad, b.limits.position_rad);
            }
        }
    }

    /// The joints of frames must differ from those of the arm.
    #[test]
    fn a_frame_gets_a_joint_of_its_own() {
        let mut arm = Arm::built_in("ur5").unwrap();
        arm.joints[2].name = "base_link_fixed".into();
        arm.joints[3].name = "base_link_fixed_2".into();
        let text = urdf(&arm, &frames()).unwrap();
        assert!(text.contains("<joint name=\"base_link_fixed_3\" type=\"fixed\">"), "{text}");
        assert_eq!(read_urdf(&text, "x.urdf").unwrap().arm.dof(), 6);
    }

    /// A gripper without a drive is a part of the last body, where simulators still ask for its frame.
    #[test]
    fn a_merged_link_keeps_its_frame() {
        let body = "<inertial pos=\"0.1 0 0\" mass=\"2\" diaginertia=\"0.01 0.02 0.025\"/>";
        let inside =
            format!("<joint name=\"j\"/>{body}<body name=\"hand\" pos=\"0 0 1\">{body}</body>");
        let text =
            format!("<mujoco><worldbody><body name=\"arm\">{inside}</body></worldbody></mujoco>");
        let MjcfArm { arm, frames, links, .. } = read_mjcf(&text, "x.xml").unwrap();
        assert!(frames.fixed.is_empty());
        let written = mjcf_with_links(&arm, &frames, &links).unwrap();
        assert!(written.contains("<body name=\"arm\""), "{written}");
        assert!(written.contains("<site name=\"hand\" pos=\"0 0 1\""), "{written}");
        let written = urdf_with_links(&arm, &frames, &links).unwrap();
        let back = read_urdf(&written, "x.urdf").unwrap();
        let first = back.links.iter().find(|link| link.is_first && link.body == 1).unwrap();
        assert_eq!(first.name, "arm");
        assert_eq!(back.frames.fixed[0].name, "hand");
    }

    /// Simulators address bodies by the link names of the URDF, which need not resemble the names of the joints.
    #[test]
    fn bodies_of_an_mjcf_have_the_names_of_the_links() {
        let arm = Arm::built_in("ur5").unwrap();
        let text = urdf(&arm, &frames()).unwrap();
        let text = text.replace("\"elbow_link\"", "\"fore &amp; arm\"");
        let UrdfArm { arm, frames, links, .. } = read_urdf(&text, "x.urdf").unwrap();
        let named = mjcf_with_links(&arm, &frames, &links).unwrap();
        for words in [
            "<body name=\"shoulder_pan_link\"",
            "<body name=\"fore &amp; arm\"",
            "<joint name=\"elbow\"",
            "<site name=\"base_link\"",
        ] {
            assert!(named.contains(words), "{words}: {named}");
        }
        let unnamed = mjcf(&arm, &frames).unwrap();
        assert_eq!(unnamed, named.replace("fore &amp; arm", "elbow_link"));
    }

    #[test]
    fn the_drive_file_has_what_a_urdf_has_not() {
        let arm = Arm::built_in("ur5").unwrap();
        let file: toml::Table = toml::from_str(&drive_file(&arm, &[0.5; 6])).unwrap();
        let joints = file["joint"].as_array().unwrap();
        assert_eq!(joints[2]["rotor_inertia_kg_m2"].as_float(), Some(1.6));
        assert_eq!(joints[5]["torque_offset_nm"].as_float(), Some(0.5));
        assert_eq!(file["friction_epsilon_rad_s"].as_float(), Some(0.02));
    }

    /// URDF and drive file together contain the whole arm.
    #[test]
    fn the_drive_file_gives_a_urdf_its_drives_back() {
        let mut arm = Arm::built_in("ur5").unwrap();
        arm.joints[1].bounds.mass_kg = Some([7.0, 9.0]);
        arm.joints[2].bounds.com_m = Some([[-0.4, 0.0], [-0.1, 0.1], [-0.1, 0.2]]);
        // The URDF has a number for it that is read as unknown.
        arm.joints[3].limits.torque_nm = f64::INFINITY;
        let mut read = read_urdf(&urdf(&arm, &Frames::default()).unwrap(), "x.urdf").unwrap().arm;
        apply_drive_file(&mut read, &drive_file(&arm, &[0.0; 6]), "x.drives.toml").unwrap();
        assert_eq!(read.gravity_m_s2, arm.gravity_m_s2);
        assert_eq!(read.friction_epsilon_rad_s, arm.friction_epsilon_rad_s);
        assert_eq!(read.torque_offsets, arm.torque_offsets);
        assert_eq!(read.clearance, arm.clearance);
        for (a, b) in arm.joints.iter().zip(&read.joints) {
            assert_eq!((a.drive, a.limits, a.bounds), (b.drive, b.limits, b.bounds));
        }
    }

    /// An exported arm is no better known than the one that was read: what was assumed about it is assumed again, and
    /// its gains are the same guess.
    #[test]
    fn what_was_assumed_is_not_written_as_if_it_were_known() {
        let told = |text: &str, drives: &str| {
            let UrdfArm { mut arm, notices, .. } = read_urdf(text, "x.urdf").unwrap();
            let file = DriveFile::read(drives, "x.drives.toml").unwrap();
            file.apply(&mut arm, &[], "x.drives.toml").unwrap();
            let open = notices.into_iter().filter_map(|notice| match file.rest_of(notice) {
                Rest::Open(notice) => Some(notice.to_string()),
                _ => None,
            });
            (open.collect::<Vec<_>>().join("\n"), arm)
        };
        let text = urdf(&Arm::built_in("ur5e").unwrap(), &Frames::default()).unwrap();
        let (_, arm) = told(&text, "[[joint]]\nname = \"elbow\"\ngear_ratio = 50.0\n");
        for written in
            [drive_file(&arm, &[0.0; 6]), drive_file_of_mjcf(&arm, &[0.0; 6], "", "").unwrap()]
        {
            let (open, back) = told(&text, &written);
            assert_eq!(back, arm);
            for words in [
                "gravity is taken as 9.81",
                "no gear ratio given, taken as 1: shoulder_pan, shoulder_lift, wrist_1",
                "no torque constant given, taken as 1 Nm/A: shoulder_pan",
                "no acceleration limit",
            ] {
                assert!(open.contains(words), "{words}: {open}");
            }
            assert!(!open.contains("rotor") && !open.contains("Coulomb"), "{open}");
        }
        let guessed = Arm::built_in("ur5e").unwrap();
        let (_, back) = told(&text, &drive_file(&guessed, &[0.0; 6]));
        assert!(back.drive_gains_assumed);
        assert!(!told(&text, &drive_file(&arm, &[0.0; 6])).1.drive_gains_assumed);
    }

    /// MJCF and drive file together contain the whole arm, although an MJCF has neither ε nor gains nor speed limits.
    #[test]
    fn the_drive_file_gives_an_mjcf_its_drives_back() {
        let mut arm = Arm::built_in("ur5").unwrap();
        arm.friction_epsilon_rad_s = 0.2;
        arm.joints[1].limits.velocity_rad_s = 1.25;
        arm.joints[3].limits.torque_nm = f64::INFINITY;
        arm.joints[4].drive.coulomb_nm = 4.5;
        let mut read = read_mjcf(&mjcf(&arm, &Frames::default()).unwrap(), "x.xml").unwrap().arm;
        let drives = drive_file_of_mjcf(&arm, &[0.0; 6], "", "").unwrap();
        apply_drive_file(&mut read, &drives, "x.drives.toml").unwrap();
        assert_eq!(read.friction_epsilon_rad_s, arm.friction_epsilon_rad_s);
        assert_eq!(read.clearance, arm.clearance);
        for (a, b) in arm.joints.iter().zip(&read.joints) {
            assert_eq!((a.drive, a.limits, a.assumed), (b.drive, b.limits, b.assumed));
        }
    }

    /// The robot's own drive file replaces a capsule, takes a pair out and limits a torque. One new file beside its
    /// URDF and an MJCF says the same to both.
    #[test]
    fn one_drive_file_fits_a_urdf_and_an_mjcf() {
        let shapes = |text: String| {
            let ball =
                "<collision><geometry><sphere radius=\"0.05\"/></geometry></collision></link>";
            text.replace("</link>", ball)
        };
        let text = shapes(urdf(&Arm::built_in("ur5").unwrap(), &Frames::default()).unwrap());
        let own = "floor_z_m = -0.2\nunwatched_pairs = [[\"shoulder_pan_link\", \"wrist_3_link\"]]\n\
                   [[joint]]\nname = \"elbow\"\ntorque_nm = 87.0\n[[joint]]\nname = \"finger\"\n";
        let mut arm = read_urdf(&text, "x.urdf").unwrap().arm;
        let before = arm.clearance.pairs.len();
        let own_file = DriveFile::read(own, "own.drives.toml").unwrap();
        own_file.apply(&mut arm, &["finger"], "own.drives.toml").unwrap();
        assert_eq!(arm.clearance.pairs.len(), before - 1);
        let drives = drive_file_of_mjcf(&arm, &[0.0; 6], own, "own.drives.toml").unwrap();
        let mut of_urdf = read_urdf(&text, "x.urdf").unwrap().arm;
        let mut of_mjcf = read_mjcf(&mjcf(&arm, &Frames::default()).unwrap(), "x.xml").unwrap().arm;
        for back in [&mut of_urdf, &mut of_mjcf] {
            apply_drive_file(back, &drives, "x.drives.toml").unwrap();
            assert_eq!(back.clearance, arm.clearance);
            assert_eq!(back.joints[2].limits, arm.joints[2].limits);
        }
    }

    /// A drive file written before offsets and bounds were part of the format.
    #[test]
    fn an_older_drive_file_leaves_what_it_does_not_say() {
        let mut arm = Arm::built_in("ur5").unwrap();
        let text = drive_file(&arm, &[0.0; 6]);
        let older: String =
            text.lines().filter(|line| !line.contains("torque_offsets")).map(with_end).collect();
        assert_ne!(older, text);
        arm.torque_offsets = true;
        apply_drive_file(&mut arm, &older, "x.drives.toml").unwrap();
        assert!(arm.torque_offsets);
    }

    fn with_end(line: &str) -> String {
        format!("{line}\n")
    }

    #[test]
    fn a_drive_file_that_does_not_belong_to_the_urdf_is_refused() {
        let arm = Arm::built_in("ur5").unwrap();
        let text = drive_file(&arm, &[0.0; 6]);
        let message = |text: &str| {
            apply_drive_file(&mut arm.clone(), text, "x.drives.toml").unwrap_err().to_string()
        };
        let other = message(&text.replacen("ur5", "ur9", 1));
        assert!(other.contains("x.drives.toml") && other.contains("ur9"), "{other}");
        let joint = message(&text.replace("wrist_1", "wrist_9"));
        assert!(joint.contains("wrist_9") && joint.contains("export both again"), "{joint}");
        let negative = message(&text.replace("rotor_inertia_kg_m2 = ", "rotor_inertia_kg_m2 = -"));
        assert!(negative.contains("rotor_inertia_kg_m2 = -"), "{negative}");
        let unknown = message(&text.replace("coulomb_nm", "coulombs"));
        assert!(unknown.contains("coulombs"), "{unknown}");
        let heavy = message(&text.replacen("-9.81", "-inf", 1));
        assert!(heavy.contains("gravity_m_s2: -inf is not a finite number"), "{heavy}");
    }
}
