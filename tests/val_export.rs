//! Exported arms in other programs: Pinocchio reads the URDF, MuJoCo the MJCF, and both reproduce the torque on 1000
//! random states of each of two arms.
//!
//! The chain: these tests write the arms and compare with the committed `exported_*.urdf` and `exported_*.xml`
//! (`ARMID_UPDATE=1` rewrites these); `tests/golden/export.py` loads the committed files and stores the torques from
//! Pinocchio and MuJoCo.
//!
//! Tolerance 1e-9 of the torque's norm: all programs sum the same products in double precision (1e-13); MuJoCo also
//! converts each tensor to principal axes and a quaternion and back. A wrong frame, sign or axis causes an error of
//! percents.

use std::path::PathBuf;

use armid::dynamics::{Model, ParameterLayout, Workspace, inverse_dynamics, mass_matrix};
use armid::robot::export::{mjcf, urdf};
use armid::robot::{Arm, FixedFrame, Frames, Placement, read_urdf};
use nalgebra::DMatrix;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use serde::Deserialize;

const DOF: usize = 6;
const STATES: usize = 1000;
const RELATIVE: f64 = 1e-9;

/// A random tilted arm, and a UR5 identified from noisy data whose bodies are at the boundary of physical consistency.
pub fn arms() -> [Arm; 2] {
    #[derive(Deserialize)]
    struct Case {
        name: String,
        standard: Vec<f64>,
    }
    let cases: Vec<Case> = serde_json::from_str(include_str!("golden/physical.json")).unwrap();
    let noisy = cases.iter().find(|case| case.name == "very noisy").unwrap();
    let mut identified =
        ParameterLayout::new(DOF).apply(&noisy.standard, &Arm::built_in("ur5").unwrap());
    identified.name = "identified".into();
    [crate::golden::tilted(), identified]
}

fn frames() -> Frames {
    let placement = Placement::from_xyz_rpy([0.01, 0.0, 0.1], [0.3, -0.2, 1.0]);
    let tool = FixedFrame { name: "tool0".into(), body: DOF, placement };
    Frames { fixed: vec![tool], ..Frames::default() }
}

struct Golden {
    q: [f64; DOF],
    qd: [f64; DOF],
    qdd: [f64; DOF],
    pinocchio: [f64; DOF],
    mujoco: [f64; DOF],
}

/// Layout: see `tests/golden/export.py`.
fn golden(arm: usize) -> Vec<Golden> {
    let bytes: &[u8] = include_bytes!("golden/export.bin");
    let inputs = 3 * DOF * STATES * 4;
    let block = DOF * STATES * 8;
    assert_eq!(bytes.len(), inputs + 4 * block);
    let input = |row: usize| -> [f64; DOF] {
        std::array::from_fn(|k| {
            let at = 4 * (row * DOF + k);
            f64::from(f32::from_le_bytes(bytes[at..at + 4].try_into().unwrap()))
        })
    };
    let torque = |program: usize, state: usize| -> [f64; DOF] {
        std::array::from_fn(|k| {
            let at = inputs + (2 * arm + program) * block + 8 * (state * DOF + k);
            f64::from_le_bytes(bytes[at..at + 8].try_into().unwrap())
        })
    };
    (0..STATES)
        .map(|s| Golden {
            q: input(3 * s),
            qd: input(3 * s + 1),
            qdd: input(3 * s + 2),
            pinocchio: torque(0, s),
            mujoco: torque(1, s),
        })
        .collect()
}

fn relative_error(actual: &[f64], expected: &[f64]) -> f64 {
    let norm = expected.iter().map(|e| e * e).sum::<f64>().sqrt();
    let apart: f64 = actual.iter().zip(expected).map(|(a, e)| (a - e).powi(2)).sum();
    apart.sqrt() / norm
}

#[test]
fn the_files_are_the_committed_ones() {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("tests/golden");
    for arm in arms() {
        let files = [("urdf", urdf(&arm, &frames())), ("xml", mjcf(&arm, &frames()))];
        for (extension, text) in files {
            let (path, text) =
                (folder.join(format!("exported_{}.{extension}", arm.name)), text.unwrap());
            if std::env::var_os("ARMID_UPDATE").is_some() {
                std::fs::write(&path, &text).unwrap();
            }
            let committed = std::fs::read_to_string(&path).unwrap();
            assert!(text == committed, "{}: run tests/golden/export.py anew", path.display());
        }
    }
}

/// Compared without friction, which `export.py` reads and compares: both formats store its coefficients but have
/// another law for it. The rotor inertia is the armature in the MJCF, and is added to Pinocchio's torque by hand.
#[test]
fn pinocchio_and_mujoco_give_our_torque() {
    for (number, mut arm) in arms().into_iter().enumerate() {
        let name = arm.name.clone();
        for joint in &mut arm.joints {
            joint.drive.viscous_nm_s_rad = 0.0;
            joint.drive.coulomb_nm = 0.0;
        }
        let model = Model::new(&arm);
        // A URDF has no gravity: Pinocchio ran with the gravity of the arm.
        let mut workspace = Workspace::new(&model);
        let mut worst = [0.0_f64; 2];
        for state in golden(number) {
            let mut torque = [0.0; DOF];
            let Golden { q, qd, qdd, pinocchio, mujoco } = &state;
            inverse_dynamics(&model, &mut workspace, q, qd, qdd, &mut torque);
            worst[0] = worst[0].max(relative_error(&torque, pinocchio));
            worst[1] = worst[1].max(relative_error(&torque, mujoco));
        }
        println!("{name}: Pinocchio {:.1e}, MuJoCo {:.1e}", worst[0], worst[1]);
        assert!(worst[0] < RELATIVE && worst[1] < RELATIVE, "{name}: {worst:?}");
    }
}

/// Written and read back: the arm that is read has the torque of the arm that was written.
#[test]
fn a_urdf_that_is_read_again_is_the_same_arm() {
    for mut arm in arms() {
        let read = read_urdf(&urdf(&arm, &frames()).unwrap(), "exported.urdf").unwrap();
        assert_eq!(read.frames.fixed.len(), 1);
        let mut back = read.arm;
        // A URDF does not store these.
        back.gravity_m_s2 = arm.gravity_m_s2;
        back.friction_epsilon_rad_s = arm.friction_epsilon_rad_s;
        for (written, read) in arm.joints.iter_mut().zip(&back.joints) {
            assert_eq!(read.drive.viscous_nm_s_rad, written.drive.viscous_nm_s_rad);
            written.drive.rotor_inertia_kg_m2 = 0.0;
        }
        let models = [Model::new(&arm), Model::new(&back)];
        let mut workspace = Workspace::new(&models[0]);
        for state in golden(0) {
            let torques = models.each_ref().map(|model| {
                let mut torque = [0.0; DOF];
                let Golden { q, qd, qdd, .. } = &state;
                inverse_dynamics(model, &mut workspace, q, qd, qdd, &mut torque);
                torque
            });
            assert!(relative_error(&torques[1], &torques[0]) < RELATIVE, "{}", arm.name);
        }
    }
}

#[test]
fn the_mass_matrix_is_positive_definite_everywhere() {
    for arm in arms() {
        let model = Model::new(&arm);
        let mut workspace = Workspace::new(&model);
        let mut mass = DMatrix::zeros(DOF, DOF);
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        for _ in 0..100_000 {
            let q: [f64; DOF] = std::array::from_fn(|_| rng.random_range(-3.2..3.2));
            mass_matrix(&model, &mut workspace, &q, &mut mass);
            assert!(mass.clone().cholesky().is_some(), "{} at {q:?}", arm.name);
        }
    }
}
