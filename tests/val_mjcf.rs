//! Reading MJCFs: the meaning of a file with default classes, frames, geoms and rotated joints against MuJoCo itself,
//! and exported arms against the originals.

use armid::dynamics::{Model, Workspace, inverse_dynamics};
use armid::robot::{Arm, MjcfArm, read_mjcf, read_mjcf_up_to};
use nalgebra::Vector3;
use serde::Deserialize;

const DOF: usize = 5;

#[derive(Deserialize)]
struct Golden {
    gravity_m_s2: [f64; 3],
    joints: Vec<Joint>,
    states: Vec<State>,
}

#[derive(Deserialize)]
struct Joint {
    name: String,
    range_rad: Option<[f64; 2]>,
    rotor_inertia_kg_m2: f64,
    viscous_nm_s_rad: f64,
    coulomb_nm: f64,
}

#[derive(Deserialize)]
struct State {
    q_rad: [f64; DOF],
    qd_rad_s: [f64; DOF],
    qdd_rad_s2: [f64; DOF],
    torque_nm: [f64; DOF],
    tip_m: [f64; 3],
    tip_x: [f64; 3],
}

fn classes() -> (MjcfArm, Golden) {
    let text = include_str!("golden/classes.xml");
    let read = read_mjcf_up_to(text, "classes.xml", "tool").unwrap();
    (read, serde_json::from_str(include_str!("golden/classes.json")).unwrap())
}

/// `tests/golden/mjcf.py` writes the goldens. Tolerance 1e-10 of the torque's size: round-off of a few hundred
/// operations with four digits to spare; a misplaced frame, inertia or default causes an error of percents.
#[test]
fn an_interpreted_mjcf_has_mujocos_torque_and_tool_frame() {
    let (MjcfArm { mut arm, frames, .. }, golden) = classes();
    assert_eq!((arm.dof(), golden.states.len()), (DOF, 20));
    assert_eq!(arm.gravity_m_s2, Vector3::from(golden.gravity_m_s2));
    let tip = frames.fixed.iter().find(|frame| frame.name == "tip").unwrap();
    for joint in &mut arm.joints {
        joint.drive.viscous_nm_s_rad = 0.0;
        joint.drive.coulomb_nm = 0.0;
    }
    let model = Model::new(&arm);
    let mut workspace = Workspace::new(&model);
    for state in &golden.states {
        let mut torque = [0.0; DOF];
        let State { q_rad, qd_rad_s, qdd_rad_s2, .. } = state;
        inverse_dynamics(&model, &mut workspace, q_rad, qd_rad_s, qdd_rad_s2, &mut torque);
        let size = state.torque_nm.iter().map(|t| t * t).sum::<f64>().sqrt();
        for (actual, expected) in torque.iter().zip(&state.torque_nm) {
            assert!((actual - expected).abs() < 1e-10 * size, "{actual} {expected} Nm");
        }
        let pose = arm.frames(q_rad)[tip.body - 1].compose(&tip.placement);
        assert!((pose.translation_m - Vector3::from(state.tip_m)).norm() < 1e-12);
        assert!((pose.rotation * Vector3::x() - Vector3::from(state.tip_x)).norm() < 1e-12);
    }
}

#[test]
fn joints_have_the_ranges_rotors_and_friction_that_mujoco_compiles() {
    let (MjcfArm { arm, .. }, golden) = classes();
    let turns = std::f64::consts::TAU;
    for (actual, expected) in arm.joints.iter().zip(&golden.joints) {
        assert_eq!(actual.name, expected.name);
        let range_rad = expected.range_rad.unwrap_or([-turns, turns]);
        for (actual, expected) in actual.limits.position_rad.iter().zip(range_rad) {
            assert!((actual - expected).abs() < 1e-14, "{actual} {expected} rad");
        }
        let drive = actual.drive;
        assert_eq!(drive.rotor_inertia_kg_m2, expected.rotor_inertia_kg_m2);
        assert_eq!(drive.viscous_nm_s_rad, expected.viscous_nm_s_rad);
        assert_eq!(drive.coulomb_nm, expected.coulomb_nm);
    }
    // In order: an actuator's force range times its gear; the force range of the joint; a motor's control range times
    // its gear; an actuator's force range; no limit.
    let limits: Vec<f64> = arm.joints.iter().map(|joint| joint.limits.torque_nm).collect();
    assert_eq!(limits, [125.0, 80.0, 60.0, 7.0, f64::INFINITY]);
}

/// The files that MuJoCo reads with the correct torque (`val_export`) are read back: orientations pass through a
/// quaternion and three angles, moments are stored as they are. The second arm has bodies at the boundary of physical
/// consistency.
#[test]
fn an_exported_arm_comes_back() {
    for text in
        [include_str!("golden/exported_tilted.xml"), include_str!("golden/exported_identified.xml")]
    {
        let read = read_mjcf(text, "exported.xml").unwrap();
        let written = written(&read.arm.name);
        assert_eq!(read.arm.gravity_m_s2, written.gravity_m_s2);
        assert_eq!(read.frames.fixed.len(), 1);
        assert_eq!(read.arm.dof(), written.dof());
        for (a, b) in written.joints.iter().zip(&read.arm.joints) {
            assert_eq!(a.name, b.name);
            assert_eq!(a.limits.position_rad, b.limits.position_rad);
            assert_eq!(a.drive.rotor_inertia_kg_m2, b.drive.rotor_inertia_kg_m2);
            assert_eq!(a.drive.viscous_nm_s_rad, b.drive.viscous_nm_s_rad);
            assert_eq!(a.drive.coulomb_nm, b.drive.coulomb_nm);
            assert!((a.placement.rotation - b.placement.rotation).amax() < 1e-12);
            assert!((a.placement.translation_m - b.placement.translation_m).amax() < 1e-12);
            for (x, y) in a.link.parameters.iter().zip(&b.link.parameters) {
                assert!((x - y).abs() < 1e-12, "{}: {x} {y}", a.name);
            }
        }
    }
}

/// The arms that `val_export` writes, by name.
fn written(name: &str) -> Arm {
    let arms = crate::val_export::arms();
    arms.into_iter().find(|arm| arm.name == name).unwrap()
}
