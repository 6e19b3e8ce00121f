//! Export as MJCF, MuJoCo's own format.

use std::fmt::Write;

use nalgebra::{Rotation3, UnitQuaternion};

use super::xml::{about_com, escaped, frames_of, numbers};
use super::{ExportError, body_names, check, with_merged};
use crate::robot::{Arm, FixedFrame, Frames, Joint, Placement, UrdfLink};

/// The arm as MJCF, with `frames` as sites and one motor per joint.
///
/// `armature` is the rotor inertia, `damping` is rv, `frictionloss` is rc. MuJoCo's dry friction is a constraint that
/// holds at standstill, not tanh(q̇/ε), so the two differ at speeds below a few ε. Position limits and the motors'
/// torque limits are written, where these are known. Speed and acceleration limits, gears, ε, offsets and clearance
/// capsules have no place in an MJCF; they are in the [drive file](super::drive_file_of_mjcf). Bodies are named
/// `<joint>_link`.
pub fn mjcf(arm: &Arm, frames: &Frames) -> Result<String, ExportError> {
    mjcf_with_links(arm, frames, &[])
}

/// As [`mjcf`], for an arm that consists of `links`: each body has the name of the link directly behind its joint, and
/// links that are fixed to it are sites.
pub fn mjcf_with_links(
    arm: &Arm,
    frames: &Frames,
    links: &[UrdfLink],
) -> Result<String, ExportError> {
    let bodies = body_names(arm, links);
    let frames = with_merged(frames, links);
    check(arm, &frames, &bodies)?;
    let frames = &frames.fixed;
    let mut out = String::new();
    // Writing to a String cannot fail, so the results carry no information.
    let _ = write!(
        out,
        "<mujoco model=\"{}\">\n  <compiler angle=\"radian\" autolimits=\"true\"/>\n  \
         <option gravity=\"{}\" integrator=\"implicitfast\"/>\n  <worldbody>\n",
        escaped(&arm.name),
        numbers(arm.gravity_m_s2.iter()),
    );
    write_sites(&mut out, frames, 0);
    for (depth, (joint, name)) in (1..).zip(arm.joints.iter().zip(&bodies)) {
        write_body(&mut out, joint, name, depth);
        write_sites(&mut out, frames, depth);
    }
    for depth in (1..=arm.dof()).rev() {
        let _ = writeln!(out, "{}</body>", indent(depth));
    }
    out.push_str("  </worldbody>\n  <actuator>\n");
    for joint in &arm.joints {
        let limit = joint.limits.torque_nm;
        let range = match limit.is_finite() {
            true => format!(" ctrlrange=\"{}\"", numbers([&-limit, &limit])),
            false => String::new(),
        };
        let name = escaped(&joint.name);
        let _ = writeln!(out, "    <motor name=\"{name}\" joint=\"{name}\"{range}/>");
    }
    out.push_str("  </actuator>\n</mujoco>\n");
    Ok(out)
}

/// Opens the body `name` of a joint, at nesting depth `depth`.
fn write_body(out: &mut String, joint: &Joint, name: &str, depth: usize) {
    let (mass_kg, com, i) = about_com(&joint.link);
    let margin = indent(depth);
    let inertia = [i[(0, 0)], i[(1, 1)], i[(2, 2)], i[(0, 1)], i[(0, 2)], i[(1, 2)]];
    let range = match joint.assumed.position {
        true => String::new(),
        false => format!(" range=\"{}\"", numbers(&joint.limits.position_rad)),
    };
    let _ = write!(
        out,
        "{margin}<body name=\"{}\" {}>\n{margin}  <inertial pos=\"{}\" mass=\"{mass_kg}\" \
         fullinertia=\"{}\"/>\n{margin}  <joint name=\"{}\" axis=\"0 0 1\"{range} \
         armature=\"{}\" damping=\"{}\" frictionloss=\"{}\"/>\n",
        escaped(name),
        pose(&joint.placement),
        numbers(com.iter()),
        numbers(&inertia),
        escaped(&joint.name),
        joint.drive.rotor_inertia_kg_m2,
        joint.drive.viscous_nm_s_rad,
        joint.drive.coulomb_nm,
    );
}

fn write_sites(out: &mut String, frames: &[FixedFrame], body: usize) {
    for frame in frames_of(frames, body) {
        let margin = indent(body + 1);
        let name = escaped(&frame.name);
        let _ = writeln!(out, "{margin}<site name=\"{name}\" {}/>", pose(&frame.placement));
    }
}

fn indent(depth: usize) -> String {
    "  ".repeat(depth + 1)
}

/// Position and quaternion (scalar first).
fn pose(placement: &Placement) -> String {
    let rotation = Rotation3::from_matrix_unchecked(placement.rotation);
    let q = UnitQuaternion::from_rotation_matrix(&rotation);
    let pos = numbers(placement.translation_m.iter());
    format!("pos=\"{pos}\" quat=\"{}\"", numbers([&q.w, &q.i, &q.j, &q.k]))
}
