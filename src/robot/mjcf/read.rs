//! Reading of an MJCF into an [`Arm`].

use std::collections::HashMap;
use std::path::PathBuf;

use nalgebra::Vector3;

use super::actuator::actuated;
use super::body::{Bodies, joint_names};
use super::collision::meshes;
use super::compiler::Compiler;
use super::defaults::Defaults;
use super::document::document;
use super::equality::{couple, loops};
use super::fault::MjcfFault;
use super::notice::{LeftOut, MjcfNotice};
use super::option::Options;
use super::pull::Pulls;
use crate::robot::arm::Arm;
use crate::robot::error::RobotError;
use crate::robot::urdf::{
    Frames, UrdfArm, UrdfLink, UrdfNotice, arm_of, moving_links, unless_empty,
};

/// An arm read from an MJCF.
#[derive(Debug, Clone, PartialEq)]
pub struct MjcfArm {
    /// The arm.
    pub arm: Arm,
    /// Named frames: bodies without mass, and named sites.
    pub frames: Frames,
    /// The bodies and sites with a name: those that stand still, then those of body 1, and so on.
    pub links: Vec<UrdfLink>,
    /// Everything that was assumed, merged or left out; `Display` puts each into words.
    pub notices: Vec<UrdfNotice>,
    /// Included files.
    pub included: Vec<PathBuf>,
    /// Mesh files of collision shapes that were read.
    pub meshes: Vec<PathBuf>,
}

/// Reads the text of an MJCF; `source` names it in messages, and included files are searched for from its folder.
///
/// The file is interpreted like a URDF ([`read_urdf`](crate::robot::read_urdf)), with these differences:
///
/// - **Base frame**: the world. Gravity is that of `<option>`. Gravity, damping and dry friction are 0 if a `<flag>`
///   disables them.
/// - **Joints**: hinges; free joints are locked where the file has them. `ref` is the position of a joint in the pose
///   of the file. The frame of a joint has its origin at `pos`, so that the axis need not go through the origin of the
///   body. Joints without a name are called after their body (`BODY_joint`, with a number if another joint has that
///   name). A joint that an `<equality>` makes follow another is treated like a mimic joint of a URDF.
/// - **Bodies** are links. Their inertia is that of `<inertial>` or of geoms that are primitive solids, as `<compiler>`
///   says. Named sites become frames, as bodies without mass do.
/// - **Drives**: `armature` is the rotor inertia, `damping` is rv, `frictionloss` is rc. The torque limit is the
///   smaller of the joint's `actuatorfrcrange` and the limit of its actuators: `gear` times the `forcerange`, or for a
///   motor times the `ctrlrange` if that is smaller; from 1e9 Nm on it is unknown. `armature` and `damping` of
///   actuators are added, times `gear`².
/// - **Default classes**, `childclass`, `<include>`, `<frame>` and the ways to give orientations are as in MuJoCo.
///   Copies (`<replicate>`), attached models, deformable bodies and the mass of meshes on moving bodies are refused.
/// - **Collision shapes** are the geoms with a `contype` or `conaffinity`, including those of the world, except planes
///   and height fields.
/// - Contacts, drag of the medium, tendons, sensors, keyframes and visual geometry are not read.
///
/// # Errors
///
/// [`RobotError::Mjcf`] if the text is not an MJCF, or not one of a serial arm of physically possible bodies.
pub fn read_mjcf(text: &str, source: &str) -> Result<MjcfArm, RobotError> {
    read(text, source, None).map_err(|fault| RobotError::Mjcf { file: source.to_owned(), fault })
}

/// As [`read_mjcf`], for an arm that ends with the body (or site) `last_body`, whatever else is in the file, as
/// [`read_urdf_up_to`](crate::robot::read_urdf_up_to) does.
///
/// # Errors
///
/// As [`read_mjcf`]; also if there is no such body, or if a joint that moves it is not a hinge, or follows another.
pub fn read_mjcf_up_to(text: &str, source: &str, last_body: &str) -> Result<MjcfArm, RobotError> {
    read(text, source, Some(last_body))
        .map_err(|fault| RobotError::Mjcf { file: source.to_owned(), fault })
}

fn read(text: &str, source: &str, last_body: Option<&str>) -> Result<MjcfArm, MjcfFault> {
    let (root, included) = document(text, source)?;
    let compiler = Compiler::of(&root)?;
    let options = Options::of(&root)?;
    let defaults = Defaults::of(&root)?;
    let named = joint_names(&root);
    let actuated = actuated(&root, &compiler, &defaults, &named)?;
    let pulls = Pulls::of(&root, &compiler, &defaults)?;
    let meshes = meshes(&root, &compiler, &defaults);
    let mut bodies = Bodies::of(&root, &compiler, &defaults, &actuated, &meshes, named.clone())?;
    let coupled = couple(&root, &defaults, &named, &mut bodies.robot, &bodies.references)?;
    bodies.left_out.extend(coupled);
    bodies.left_out.extend(options.switch_off(&mut bodies.robot));
    bodies.loops = loops(&root, &defaults)?;
    give_inertias(&mut bodies, source, last_body)?;
    let mut read = arm_of(&bodies.robot, source, last_body).map_err(MjcfFault::Arm)?;
    read.watch(&bodies.shapes, source);
    let UrdfArm { mut arm, frames, mut links, mut notices, meshes } = read;
    arm.gravity_m_s2 = options.gravity_m_s2;
    arm.gravity_assumed = false;
    for joint in &mut arm.joints {
        joint.drive.rotor_inertia_kg_m2 =
            bodies.armature_kg_m2.get(&joint.name).copied().unwrap_or(0.0);
    }
    if compiler.angle_rad != 1.0 {
        // What was written in degrees is not mistaken for radians.
        notices.retain(|notice| !matches!(notice, UrdfNotice::WideRanges { .. }));
    }
    let mut notices = told(notices, &arm, &links, &bodies, &options);
    let is_joint = |name: &str| arm.joints.iter().any(|joint| joint.name == name);
    let moves = |site: &str| {
        let link = bodies.links_of_sites.get(site);
        link.is_some_and(|link| links.iter().any(|one| one.body > 0 && one.name == *link))
    };
    notices.extend(pulls.notices(is_joint, moves).into_iter().map(UrdfNotice::Mjcf));
    links.retain(|link| !bodies.unnamed.contains(&link.name));
    Ok(MjcfArm { arm, frames, links, notices, included, meshes })
}

/// Gives the links their inertia. Links that never move need none, so that a fault in their inertia does not matter.
fn give_inertias(
    bodies: &mut Bodies<'_>,
    source: &str,
    last_body: Option<&str>,
) -> Result<(), MjcfFault> {
    let mut faults = HashMap::new();
    let inertias = std::mem::take(&mut bodies.inertias);
    for (link, inertia) in bodies.robot.links.iter_mut().zip(inertias) {
        match inertia {
            Ok(inertial) => link.inertial = inertial,
            Err(fault) => {
                faults.insert(link.name.clone(), fault);
            }
        }
    }
    // The links need their inertia before this call, which tries the arms that end with links to be proposed.
    let moving = moving_links(&bodies.robot, source, last_body).map_err(MjcfFault::Arm)?;
    moving.iter().find_map(|link| faults.remove(link)).map_or(Ok(()), Err)
}

/// The notices about an MJCF: those `noticed` while it was read like a URDF that also hold for an MJCF, and its own.
fn told(
    noticed: Vec<UrdfNotice>,
    arm: &Arm,
    links: &[UrdfLink],
    bodies: &Bodies<'_>,
    options: &Options,
) -> Vec<UrdfNotice> {
    let mut notices = Vec::new();
    let mut own = Vec::new();
    if arm.gravity_m_s2 == Vector3::zeros() {
        own.push(MjcfNotice::Weightless);
    }
    if options.has_medium {
        own.push(MjcfNotice::Medium);
    }
    if bodies.loops > 0 {
        own.push(MjcfNotice::Loops { count: bodies.loops });
    }
    own.extend(unless_empty(bodies.free.clone(), |joints| MjcfNotice::FreeJoints { joints }));
    own.extend(unless_empty(bodies.namesakes.clone(), |sites| MjcfNotice::Namesakes { sites }));
    for notice in noticed {
        match notice {
            UrdfNotice::Gravity { .. } => {}
            UrdfNotice::Drives { mut rotor_inertia, gear_ratio, torque_constant } => {
                let has_none = |joint: &String| bodies.armature_kg_m2.get(joint) == Some(&0.0);
                rotor_inertia.retain(has_none);
                notices.push(UrdfNotice::Drives { rotor_inertia, gear_ratio, torque_constant });
            }
            other => notices.push(other),
        }
    }
    let mut said: Vec<LeftOut> = Vec::new();
    for &(what, _) in &bodies.left_out {
        if said.contains(&what) {
            continue;
        }
        said.push(what);
        let having = bodies.left_out.iter().filter(|(one, _)| *one == what);
        let joints: Vec<String> = having
            .map(|(_, joint)| joint.clone())
            .filter(|name| what == LeftOut::Curve || arm.joints.iter().any(|j| j.name == *name))
            .collect();
        own.extend(unless_empty(joints, |joints| MjcfNotice::LeftOut { what, joints }));
    }
    let moving = links.iter().filter(|link| link.body > 0).map(|link| &link.name);
    let compensated: Vec<String> =
        moving.filter(|name| bodies.weightless.contains(*name)).cloned().collect();
    let compensation = |bodies| MjcfNotice::GravityCompensation { bodies };
    own.extend(unless_empty(compensated, compensation));
    notices.extend(own.into_iter().map(UrdfNotice::Mjcf));
    notices
}
