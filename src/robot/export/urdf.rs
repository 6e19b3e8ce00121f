//! Export as URDF: kinematics, inertias, limits and friction.

use std::collections::HashSet;
use std::fmt::Write;

use super::xml::{about_com, escaped, frames_of, numbers, tensor};
use super::{ExportError, body_names, check, with_merged};
use crate::robot::arm::UNKNOWN_TORQUE_NM;
use crate::robot::{Arm, FixedFrame, Frames, Joint, Placement, UrdfLink};

/// The arm as URDF, with `frames` as links without mass.
///
/// - One link per body, named `<joint>_link`, on the root link. Its frame is the joint frame of the [`Arm`], so that
///   every axis is `0 0 1`; its inertia is about the centre of mass, in the link's axes.
/// - `damping` is rv in Nm s/rad, `friction` is rc in Nm (multiplying tanh(q̇/ε) in this library, a sign or a
///   constraint in other programs).
/// - A joint whose range was only assumed is continuous.
/// - Rotor inertia, acceleration limit, gear ratio, torque constant, ε, torque offsets, gravity and clearance have no
///   place in a URDF; they are in the [`drive_file`](super::drive_file).
pub fn urdf(arm: &Arm, frames: &Frames) -> Result<String, ExportError> {
    urdf_with_links(arm, frames, &[])
}

/// As [`urdf`], for an arm that consists of `links`: each body has the name of the link directly behind its joint, and
/// links that are fixed to it are links without mass.
pub fn urdf_with_links(
    arm: &Arm,
    frames: &Frames,
    links: &[UrdfLink],
) -> Result<String, ExportError> {
    let links_of_bodies = body_names(arm, links);
    let frames = with_merged(frames, links);
    check(arm, &frames, &links_of_bodies)?;
    let Frames { root, fixed: frames } = &frames;
    let mut joint_names: HashSet<String> =
        arm.joints.iter().map(|joint| joint.name.clone()).collect();
    let mut out = String::from("<?xml version=\"1.0\"?>\n");
    // Writing to a String cannot fail, so the results carry no information.
    let _ = writeln!(out, "<robot name=\"{}\">", escaped(&arm.name));
    let _ = writeln!(out, "  <link name=\"{}\"/>", escaped(root));
    write_frames(&mut out, frames, 0, root, &mut joint_names);
    let mut parent = root;
    for (body, (joint, child)) in (1..).zip(arm.joints.iter().zip(&links_of_bodies)) {
        write_link(&mut out, joint, child);
        write_joint(&mut out, joint, parent, child);
        write_frames(&mut out, frames, body, child, &mut joint_names);
        parent = child;
    }
    out.push_str("</robot>\n");
    Ok(out)
}

fn write_link(out: &mut String, joint: &Joint, name: &str) {
    let (mass_kg, com, central) = about_com(&joint.link);
    let _ = write!(
        out,
        "  <link name=\"{name}\">\n    <inertial>\n      <origin xyz=\"{com}\" rpy=\"0 0 0\"/>\n      \
         <mass value=\"{mass_kg}\"/>\n      <inertia {}/>\n    </inertial>\n  </link>\n",
        tensor(&central),
        name = escaped(name),
        com = numbers(com.iter()),
    );
}

fn write_joint(out: &mut String, joint: &Joint, parent: &str, child: &str) {
    let (kind, range) = match joint.assumed.position {
        true => ("continuous", String::new()),
        false => {
            let [lower, upper] = joint.limits.position_rad;
            ("revolute", format!("lower=\"{lower}\" upper=\"{upper}\" "))
        }
    };
    let _ = write!(
        out,
        "  <joint name=\"{name}\" type=\"{kind}\">\n    {origin}\n    <parent link=\"{parent}\"/>\n    \
         <child link=\"{child}\"/>\n    <axis xyz=\"0 0 1\"/>\n    <limit {range}\
         effort=\"{effort}\" velocity=\"{velocity}\"/>\n    <dynamics damping=\"{damping}\" \
         friction=\"{friction}\"/>\n  </joint>\n",
        name = escaped(&joint.name),
        origin = origin(&joint.placement),
        parent = escaped(parent),
        child = escaped(child),
        effort = joint.limits.torque_nm.min(UNKNOWN_TORQUE_NM),
        velocity = joint.limits.velocity_rad_s,
        damping = joint.drive.viscous_nm_s_rad,
        friction = joint.drive.coulomb_nm,
    );
}

fn write_frames(
    out: &mut String,
    frames: &[FixedFrame],
    body: usize,
    parent: &str,
    joint_names: &mut HashSet<String>,
) {
    for frame in frames_of(frames, body) {
        let name = escaped(&frame.name);
        let _ = write!(
            out,
            "  <link name=\"{name}\"/>\n  <joint name=\"{}\" type=\"fixed\">\n    {}\n    \
             <parent link=\"{}\"/>\n    <child link=\"{name}\"/>\n  </joint>\n",
            escaped(&free_name(&format!("{}_fixed", frame.name), joint_names)),
            origin(&frame.placement),
            escaped(parent),
        );
    }
}

/// A name that is not among those `taken`, with a number behind it if necessary; it is taken from now on.
fn free_name(wanted: &str, taken: &mut HashSet<String>) -> String {
    let numbered = (2..).map(|number| format!("{wanted}_{number}"));
    let mut names = std::iter::once(wanted.to_owned()).chain(numbered);
    // The iterator is endless.
    let name = names.find(|name| !taken.contains(name)).unwrap_or_default();
    taken.insert(name.clone());
    name
}

/// Translation and fixed-axis roll, pitch, yaw.
fn origin(placement: &Placement) -> String {
    let xyz = numbers(placement.translation_m.iter());
    format!("<origin xyz=\"{xyz}\" rpy=\"{}\"/>", numbers(&placement.rpy_rad()))
}
