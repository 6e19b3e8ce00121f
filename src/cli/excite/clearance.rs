//! Clearance options, and messages about what the motion keeps clear of.

use nalgebra::Vector3;

use super::BadOption;
use crate::excitation::ClearanceModel;
use crate::excitation::design::DesignError;
use crate::report::excitation::NO_CLEARANCE;
use crate::robot::{Arm, CellBox, ShapeNotice, UrdfNotice};

/// Tells the user which parts of the arm named by `robot`, about which there are these `notices`, are watched and which
/// not. Refuses `boxes` for an arm without capsules, because there is nothing to keep clear of them.
pub(super) fn say_what_is_watched(
    robot: &str,
    arm: &Arm,
    notices: &[UrdfNotice],
    boxes: &[String],
) -> Result<(), BadOption> {
    for notice in notices.iter().filter(|notice| matches!(notice, UrdfNotice::Shapes(_))) {
        eprintln!("note: {robot}: {notice}");
    }
    if ClearanceModel::new(arm).is_empty() {
        if !boxes.is_empty() {
            let message = "the robot has no capsules whose distance could be watched: describe them in its .toml, or in the \
                           drives.toml beside its file";
            return Err(BadOption::new("box", boxes.join(" "), message));
        }
        eprintln!("note: {robot}: {NO_CLEARANCE}");
    } else if arm.clearance.floor_z_m.is_none() {
        let place = "floor_z_m in its .toml, or in the drives.toml beside its file";
        eprintln!("note: {robot}: no floor is given and none watched ({place})");
    }
    for name in arm.clearance.unpaired() {
        let why = "it is in no collision_pairs";
        eprintln!("note: {robot}: the arm is not kept clear of capsule \"{name}\": {why}");
    }
    Ok(())
}

/// Tells the user what to do when the clearance model of the arm named by `robot` leaves no feasible motion.
pub(super) fn say_what_helps(robot: &str, notices: &[UrdfNotice], fault: &DesignError) {
    let has_own =
        |notice: &UrdfNotice| matches!(notice, UrdfNotice::Shapes(ShapeNotice::Capsules { .. }));
    if fault.is_about_clearance() && notices.iter().any(has_own) {
        eprintln!(
            "note: {robot}: its capsules hold the collision shapes of its links and are larger than these. In the drives.toml beside \
             its file, unwatched_pairs = [[\"one\", \"other\"]] takes out a pair of links that cannot collide, a [[capsule]] of the same \
             name takes the place of one, and clearance = \"none\" sets all of them aside"
        );
    }
}

/// Parses a box from two opposite corners, in any order.
pub(super) fn cell_box(corners: &str) -> Result<CellBox, BadOption> {
    let numbers: Option<Vec<f64>> = corners
        .split(',')
        .map(|word| word.trim().parse().ok().filter(|x: &f64| x.is_finite()))
        .collect();
    match numbers.as_deref() {
        Some(&[x0, y0, z0, x1, y1, z1]) => {
            let (a, b) = (Vector3::new(x0, y0, z0), Vector3::new(x1, y1, z1));
            Ok(CellBox { low_m: a.inf(&b), high_m: a.sup(&b) })
        }
        _ => Err(BadOption::new("box", corners, "six numbers X0,Y0,Z0,X1,Y1,Z1 are expected")),
    }
}
