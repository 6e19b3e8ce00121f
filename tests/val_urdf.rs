//! Reading URDFs: the dynamics of a merged and re-oriented chain against Pinocchio's own URDF
//! reader, and the kinematics of a published UR10e file against the built-in arm.

use std::path::Path;

use armid::dynamics::{Model, Workspace, rigid_torque};
use armid::robot::{Arm, LoadedArm, UrdfArm, UrdfNotice, read_urdf};
use nalgebra::{Rotation3, Vector3};
use serde::Deserialize;

#[derive(Deserialize)]
struct State {
    q_rad: Vec<f64>,
    qd_rad_s: Vec<f64>,
    qdd_rad_s2: Vec<f64>,
    torque_nm: Vec<f64>,
    tool0_m: [f64; 3],
    tool0_x: [f64; 3],
}

/// `tests/golden/urdf.py` writes the goldens. Tolerance 1e-10 of the torque's size: round-off of a few hundred
/// operations with four digits to spare; a misplaced frame or inertia causes an error of percents.
#[test]
fn a_merged_and_reoriented_chain_has_pinocchios_torque_and_tool_frame() {
    let text = include_str!("golden/interpreted.urdf");
    let UrdfArm { arm, frames, notices, .. } = read_urdf(text, "interpreted.urdf").unwrap();
    let states: Vec<State> = serde_json::from_str(include_str!("golden/interpreted.json")).unwrap();
    assert_eq!((arm.dof(), states.len()), (5, 20));
    let merged = notices.iter().flat_map(|notice| match notice {
        UrdfNotice::Merged { links, .. } => links.as_slice(),
        _ => &[],
    });
    assert_eq!(merged.count(), 5, "adapter2, plate2, adapter3, gripper, camera");
    let tool = frames.fixed.iter().find(|frame| frame.name == "tool0").unwrap();

    let model = Model::new(&arm);
    let mut ws = Workspace::new(&model);
    for s in &states {
        let mut torque = [0.0; 5];
        rigid_torque(&model, &mut ws, &s.q_rad, &s.qd_rad_s, &s.qdd_rad_s2, &mut torque);
        let size = s.torque_nm.iter().map(|t| t * t).sum::<f64>().sqrt();
        for (actual, expected) in torque.iter().zip(&s.torque_nm) {
            assert!((actual - expected).abs() < 1e-10 * size, "{actual} {expected} Nm");
        }
        let pose = arm.frames(&s.q_rad)[tool.body - 1].compose(&tool.placement);
        assert!((pose.translation_m - Vector3::from(s.tool0_m)).norm() < 1e-12);
        assert!((pose.rotation * Vector3::x() - Vector3::from(s.tool0_x)).norm() < 1e-12);
    }
}

/// The published file has other joint frames (axes y and z, base turned by π about z) and lengths rounded to
/// millimetres. The comparison therefore uses a quantity that does not depend on the choice of frames: the line of
/// every joint axis in space, for random angles. Six lengths lie between the first axis and the last, each rounded by
/// at most 0.5 mm: 3 mm. Directions depend only on right angles: 1e-12.
#[test]
fn the_published_ur10e_file_has_the_axes_of_the_built_in_arm() {
    let Some(data) = std::env::var_os("ARMID_DATA") else {
        println!("skipped: ARMID_DATA is not set; it names the folder with ur10e/ur10e.urdf");
        return;
    };
    let file = Path::new(&data).join("ur10e/ur10e.urdf");
    if !file.exists() {
        println!("skipped: {} is not there", file.display());
        return;
    }
    let LoadedArm { arm: published, notices, .. } =
        LoadedArm::load(file.to_str().unwrap()).unwrap();
    let built_in = Arm::built_in("ur10e").unwrap();
    for notice in &notices {
        println!("{notice}");
    }
    assert_eq!(published.dof(), 6);
    let half_turn = Rotation3::from_axis_angle(&Vector3::z_axis(), std::f64::consts::PI);
    let mut worst_m: f64 = 0.0;
    for k in 0..200 {
        let q: Vec<f64> = (0..6).map(|j| 3.0 * f64::sin(f64::from(k * 6 + j) * 1.7)).collect();
        for (ours, theirs) in built_in.frames(&q).iter().zip(published.frames(&q)) {
            let axis = ours.rotation * Vector3::z();
            assert!((half_turn * (theirs.rotation * Vector3::z()) - axis).norm() < 1e-12);
            let between = half_turn * theirs.translation_m - ours.translation_m;
            worst_m = worst_m.max((between - axis * axis.dot(&between)).norm());
        }
    }
    println!("axes are at most {:.2} mm apart", 1e3 * worst_m);
    assert!(worst_m < 3e-3, "{worst_m} m");
}
