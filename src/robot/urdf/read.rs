//! Reading of a URDF into an [`Arm`].

use std::ffi::OsStr;
use std::path::Path;

use urdf_rs::{Pose, Robot};

use super::arm::{FixedFrame, Frames, UrdfArm, UrdfLink};
use super::chain::{Body, all_joints, bodies, joints_up_to};
use super::collision::shapes;
use super::fault::{UrdfFault, finite, plain_name, quoted};
use super::joint::{ASSUMED_ACCELERATION_RAD_S2, ASSUMED_VELOCITY_RAD_S, assumed, drive};
use super::locked::{LockedJoint, locked_joints};
use super::notice::UrdfNotice;
use super::remarks::Remarks;
use super::tree::Tree;
use super::unreadable;
use super::words::unless_empty;
use crate::input::without_mark;
use crate::robot::arm::{Arm, Clearance, Joint, LinkBounds, Placement};
use crate::robot::error::RobotError;
use crate::robot::file::{default_epsilon, usual_gravity};
use crate::robot::inertia::LinkInertia;

/// Reads the text of a URDF; `source` names it in messages.
///
/// The file is interpreted as follows:
///
/// - **Base frame**: the root link. Links ahead of the first moving joint are folded into the placement of that joint;
///   their inertia never moves and is left out.
/// - **Joints**: revolute and continuous, in one chain. A continuous joint is given the range ±2π rad, that of an arm
///   with internal cables. Prismatic, floating, planar, spherical and mimic joints and branches with moving joints are
///   refused here and locked by [`read_urdf_up_to`]; closed chains are always refused.
/// - **Fixed joints** merge the child link into the body in front of it, whose inertia grows by that of the link. Links
///   without mass on a body (flange, tool0) become named frames.
/// - **Joint frames**: the origin is that of the URDF joint, z lies along the joint axis a. With a given in the link
///   frame, the joint frame is the link frame turned by S with S ẑ = a: the smallest rotation from ẑ to a if a_z ≥ 0,
///   otherwise π about x followed by the smallest rotation from −ẑ to a. For the axis z, S = 1.
/// - **Name**: a robot without a name is called after the file, without folder and extension.
/// - **Friction**: `damping` is rv, `friction` is rc. **Limits**: `effort` is the torque limit (unknown from 1e9 Nm
///   on), `velocity` the speed limit. The soft limits of a `<safety_controller>` narrow the range.
/// - **Collision shapes** become capsules on the bodies, and pairs of capsules to keep apart; meshes (STL, OBJ) are
///   searched for from the folder of `source`. The notices name everything that is not watched. Visual geometry is not
///   read.
/// - **Not in a URDF**: the rotor inertia is taken as 0, the gear ratio as 1 and the torque constant as 1 Nm/A (a
///   current column then reads as joint torque), gravity as 9.81 m/s² along −z of the root link, ε of the friction law
///   as 0.02 rad/s, the acceleration limit as 10 rad/s² unless the file has one. Transmissions are not read.
/// - **Angles** within 5e-5 rad of a multiple of π/2 are taken as that multiple: files print 1.5708 for π/2, and axes
///   that are parallel only to the digits printed blur which parameters are identifiable.
///
/// # Errors
///
/// [`RobotError::Urdf`] if the text is not a URDF, [`RobotError::UrdfArm`] if it is a URDF, but not of a serial arm of
/// physically possible bodies.
pub fn read_urdf(text: &str, source: &str) -> Result<UrdfArm, RobotError> {
    read(text, source, None)
}

/// As [`read_urdf`], for an arm that ends with the link `last_link`, whatever else is on the robot.
///
/// The moving joints between the root link and `last_link` are those of the arm. All other joints are locked, and their
/// links belong to the body that carries them. A locked joint is at zero, or at the limit nearest to zero if its range
/// does not contain zero; a mimic joint is where the joint that it mimics puts it; a floating, planar or spherical
/// joint is at its origin.
///
/// # Errors
///
/// As [`read_urdf`]; also if there is no such link, or if a joint that moves it is not revolute or continuous, or
/// mimics another.
pub fn read_urdf_up_to(text: &str, source: &str, last_link: &str) -> Result<UrdfArm, RobotError> {
    read(text, source, Some(last_link))
}

fn read(text: &str, source: &str, last_link: Option<&str>) -> Result<UrdfArm, RobotError> {
    let text = without_mark(text);
    let robot = robot(text).map_err(|message| RobotError::Urdf {
        file: source.to_owned(),
        message: unreadable::reason(text, &message),
    })?;
    let mut read = arm_of(&robot, source, last_link)
        .map_err(|fault| RobotError::UrdfArm { file: source.to_owned(), fault })?;
    read.watch(&shapes(&robot), source);
    Ok(read)
}

/// The links and joints of a text, or the parser's message. Speed limits may be missing, unlike for the parser.
fn robot(text: &str) -> Result<Robot, String> {
    let read = |text: &str| urdf_rs::read_from_string(text).map_err(|e| e.to_string());
    read(text).or_else(|message| match unreadable::with_velocities(text) {
        Some(completed) => read(&completed),
        None => Err(message),
    })
}

/// The arm of a robot without its clearance, from a file of any format; `source` names the file in messages and begins
/// a proposed `FILE#LINK`.
pub(in crate::robot) fn arm_of(
    robot: &Robot,
    source: &str,
    last_link: Option<&str>,
) -> Result<UrdfArm, UrdfFault> {
    plain_name("robot", &robot.name)?;
    let mut reader = Reader::default();
    let (root, joints) = reader.arm(robot, source, last_link)?;
    Ok(UrdfArm {
        arm: Arm {
            name: if robot.name.is_empty() { stem(source) } else { robot.name.clone() },
            gravity_m_s2: usual_gravity().into(),
            gravity_assumed: true,
            friction_epsilon_rad_s: default_epsilon(),
            torque_offsets: true,
            // A gain that the file does not give has a notice of its own.
            drive_gains_assumed: false,
            joints,
            clearance: Clearance::default(),
        },
        frames: Frames { root, fixed: reader.frames },
        links: reader.links,
        notices: reader.notices,
        meshes: Vec::new(),
    })
}

/// Name of a robot whose file does not give one: it must not depend on the folder from which the file is named.
fn stem(source: &str) -> String {
    let stem = Path::new(source).file_stem().unwrap_or(OsStr::new(source));
    stem.to_string_lossy().into_owned()
}

/// Names of the links that move with the arm.
pub(in crate::robot) fn moving_links(
    robot: &Robot,
    source: &str,
    last_link: Option<&str>,
) -> Result<Vec<String>, UrdfFault> {
    let tree = Tree::of(robot)?;
    let chain = bodies(&tree, &moving_joints(robot, &tree, source, last_link)?);
    let links = chain.iter().skip(1).flat_map(|body| &body.links);
    Ok(links.map(|(link, _)| link.name.clone()).collect())
}

/// The joints of the arm that ends with `last_link`; without it, all moving joints.
fn moving_joints<'a>(
    robot: &Robot,
    tree: &Tree<'a>,
    source: &str,
    last_link: Option<&str>,
) -> Result<Vec<&'a urdf_rs::Joint>, UrdfFault> {
    match last_link {
        Some(last) => joints_up_to(tree, last, |link| {
            Reader::default().arm(robot, source, Some(link)).is_ok()
        }),
        None => all_joints(tree, source),
    }
}

/// Everything that accumulates beside the joints while an arm is read.
#[derive(Default)]
pub(super) struct Reader {
    /// Joints that are not part of the arm.
    pub(super) locked: Vec<LockedJoint>,
    frames: Vec<FixedFrame>,
    links: Vec<UrdfLink>,
    notices: Vec<UrdfNotice>,
    pub(super) remarks: Remarks,
}

impl Reader {
    /// Name of the root link, and the joints of the arm.
    fn arm(
        &mut self,
        robot: &Robot,
        source: &str,
        last_link: Option<&str>,
    ) -> Result<(String, Vec<Joint>), UrdfFault> {
        let tree = Tree::of(robot)?;
        let moving = moving_joints(robot, &tree, source, last_link)?;
        self.locked = locked_joints(&tree, &moving)?;
        if let Some(last) = last_link
            && !self.locked.is_empty()
        {
            let (joints, last) = (self.locked.clone(), last.to_owned());
            self.notices.push(UrdfNotice::Locked { joints, last });
        }
        let joints = self.joints(&bodies(&tree, &moving))?;
        Ok((tree.root().name.clone(), joints))
    }

    fn joints(&mut self, chain: &[Body<'_>]) -> Result<Vec<Joint>, UrdfFault> {
        let root = chain[0].links[0].0.name.clone();
        let moving = chain.iter().filter_map(|body| body.joint);
        let names: Vec<String> = moving.map(|joint| joint.name.clone()).collect();
        self.notices.extend([
            UrdfNotice::Gravity { root },
            UrdfNotice::FrictionEpsilon { epsilon_rad_s: default_epsilon() },
            UrdfNotice::Drives {
                rotor_inertia: names.clone(),
                gear_ratio: names.clone(),
                torque_constant: names,
            },
        ]);
        let mut joints: Vec<Joint> = Vec::with_capacity(chain.len() - 1);
        // Pose of the link that carries the next joint, in the frame of the current body.
        let mut parent = Placement::identity();
        for (number, body) in chain.iter().enumerate() {
            let turn = match body.joint {
                None => Placement::identity(),
                Some(joint) => {
                    let turn = self.axis_to_z(joint)?;
                    let origin = self.placement(&joint.origin, &quoted("joint", &joint.name))?;
                    let drive = drive(joint)?;
                    let limits = self.limits(joint)?;
                    joints.push(Joint {
                        name: joint.name.clone(),
                        placement: parent.compose(&origin).compose(&turn),
                        link: LinkInertia::zero(),
                        drive,
                        limits,
                        bounds: LinkBounds::default(),
                        assumed: assumed(joint, &limits),
                    });
                    turn
                }
            };
            let poses = self.link_poses(body, turn.inverse())?;
            match (body.joint, joints.last_mut()) {
                (Some(joint), Some(moved)) => {
                    moved.link = self.inertia(body, joint, number, &poses)?;
                }
                _ => self.standing(body, &poses),
            }
            parent = poses[body.next_parent];
        }
        self.summarise(&joints);
        Ok(joints)
    }

    /// Pose of every link of a body in the body's joint frame.
    fn link_poses(
        &mut self,
        body: &Body<'_>,
        first: Placement,
    ) -> Result<Vec<Placement>, UrdfFault> {
        let mut poses: Vec<Placement> = Vec::with_capacity(body.links.len());
        for (_, held) in &body.links {
            let pose = match held {
                None => first,
                Some((joint, parent)) => {
                    let place = quoted("joint", &joint.name);
                    let origin = self.placement(&joint.origin, &place)?;
                    let pose = poses[*parent].compose(&origin);
                    match self.displacement(joint)? {
                        Some(displacement) => pose.compose(&displacement),
                        None => pose,
                    }
                }
            };
            poses.push(pose);
        }
        Ok(poses)
    }

    /// Inertia of a moving body about its joint frame: the sum over its links.
    fn inertia(
        &mut self,
        body: &Body<'_>,
        joint: &urdf_rs::Joint,
        number: usize,
        poses: &[Placement],
    ) -> Result<LinkInertia, UrdfFault> {
        let mut sum = LinkInertia::zero();
        let mut merged = Vec::new();
        for ((link, held), pose) in body.links.iter().zip(poses) {
            let own = self.link_inertia(link)?;
            match own {
                Some(part) => {
                    sum = sum.plus(&part.transformed(pose));
                    if held.is_some() {
                        merged.push((link.name.clone(), part.mass_kg()));
                    }
                }
                None if held.is_some() => self.frames.push(FixedFrame {
                    name: link.name.clone(),
                    body: number,
                    placement: *pose,
                }),
                None => {}
            }
            self.links.push(UrdfLink {
                name: link.name.clone(),
                body: number,
                placement: *pose,
                inertia: own,
                is_first: held.is_none(),
            });
        }
        let joint_name = || joint.name.clone();
        let merged =
            unless_empty(merged, |links| UrdfNotice::Merged { joint: joint_name(), links });
        self.notices.extend(merged);
        if sum.mass_kg() > 0.0 {
            return Ok(sum);
        }
        let link = body.links[0].0.name.clone();
        Err(UrdfFault::NoMass { link, joint: joint_name() })
    }

    /// Records the links that never move: only their frames and a notice of their mass remain.
    fn standing(&mut self, body: &Body<'_>, poses: &[Placement]) {
        let mut heavy = Vec::new();
        for ((link, held), pose) in body.links.iter().zip(poses) {
            // Errors and oddities in the moments of a standing link do not matter.
            let angles = std::mem::take(&mut self.remarks.right_angles);
            let inertia = self.link_inertia(link).ok().flatten();
            self.remarks.right_angles = angles;
            let mass_kg = link.inertial.mass.value;
            if mass_kg != 0.0 {
                heavy.push((link.name.clone(), mass_kg));
            }
            if held.is_some() {
                self.frames.push(FixedFrame { name: link.name.clone(), body: 0, placement: *pose });
            }
            self.links.push(UrdfLink {
                name: link.name.clone(),
                body: 0,
                placement: *pose,
                inertia,
                is_first: held.is_none(),
            });
        }
        self.notices.extend(unless_empty(heavy, |links| UrdfNotice::StandingMass { links }));
    }

    /// A pose of the file, with angles close to multiples of π/2 made exact.
    pub(super) fn placement(&mut self, pose: &Pose, place: &str) -> Result<Placement, UrdfFault> {
        for value in *pose.xyz {
            finite(place, "xyz", value)?;
        }
        let mut rpy_rad = *pose.rpy;
        for angle in &mut rpy_rad {
            finite(place, "rpy", *angle)?;
            *angle = self.remarks.right_angles.read(*angle, place);
        }
        Ok(Placement::from_xyz_rpy(*pose.xyz, rpy_rad))
    }

    /// Adds the notices that concern several joints at once.
    fn summarise(&mut self, joints: &[Joint]) {
        self.notices.extend(std::mem::take(&mut self.remarks).notices());
        let those = |has: fn(&Joint) -> bool| -> Vec<String> {
            joints.iter().filter(|joint| has(joint)).map(|joint| joint.name.clone()).collect()
        };
        let frictionless = those(|j| j.drive.viscous_nm_s_rad == 0.0 && j.drive.coulomb_nm == 0.0);
        let servos = joints.iter().filter(|joint| {
            joint.drive.viscous_nm_s_rad * joint.limits.velocity_rad_s > joint.limits.torque_nm
        });
        let servos: Vec<(String, f64, f64)> = servos
            .map(|j| (j.name.clone(), j.drive.viscous_nm_s_rad, j.limits.torque_nm))
            .collect();
        let slow = those(|joint| joint.assumed.velocity);
        let unlimited = those(|joint| joint.limits.torque_nm.is_infinite());
        let gentle = those(|joint| joint.assumed.acceleration);
        let notices = [
            unless_empty(frictionless, |joints| UrdfNotice::NoFriction { joints }),
            unless_empty(servos, |joints| UrdfNotice::ServoDamping { joints }),
            unless_empty(slow, |joints| UrdfNotice::AssumedVelocity {
                joints,
                velocity_rad_s: ASSUMED_VELOCITY_RAD_S,
            }),
            unless_empty(unlimited, |joints| UrdfNotice::NoTorqueLimit { joints }),
            unless_empty(gentle, |joints| UrdfNotice::AssumedAcceleration {
                joints,
                acceleration_rad_s2: ASSUMED_ACCELERATION_RAD_S2,
            }),
        ];
        self.notices.extend(notices.into_iter().flatten());
    }
}
