//! From the chain of a URDF to an [`Arm`].

use std::f64::consts::{FRAC_PI_2, PI, TAU};
use std::path::Path;

use nalgebra::{Matrix3, Vector3};
use urdf_rs::{Geometry, Inertial, JointType, Link, Pose};

use super::chain::{Body, bodies};
use super::fault::UrdfFault;
use super::notice::UrdfNotice;
use super::unreadable;
use crate::robot::arm::{Arm, Clearance, Drive, Joint, Limits, LinkBounds, Placement};
use crate::robot::error::RobotError;
use crate::robot::file::default_epsilon;
use crate::robot::inertia::LinkInertia;

/// Speed limit where the file gives none: 180 °/s, usual for arms of this size.
const ASSUMED_VELOCITY_RAD_S: f64 = PI;
/// Acceleration limit where the file gives none; the built-in arms' as well.
const ASSUMED_ACCELERATION_RAD_S2: f64 = 10.0;
/// Half of the last of four decimals: files print 1.5708 and 3.1416.
const RIGHT_ANGLE_RAD: f64 = 5e-5;
/// Below this a right angle is only written with many digits: at the end of an arm of 2 m it is off by 2 nm.
const WORTH_SAYING_RAD: f64 = 1e-9;
/// Axes such as (0.577, 0.577, 0.577) have unit length to three digits.
const AXIS_LENGTH: f64 = 1e-3;

/// An arm read from a URDF.
#[derive(Debug, Clone, PartialEq)]
pub struct UrdfArm {
    /// The arm.
    pub arm: Arm,
    /// Named links without mass on the bodies: flange, tool0.
    pub frames: Frames,
    /// What was assumed, merged or left out, in words by `Display`.
    pub notices: Vec<UrdfNotice>,
}

/// Named frames of an arm.
#[derive(Debug, Clone, PartialEq)]
pub struct Frames {
    /// Name of the base frame: the root link.
    pub root: String,
    /// All others.
    pub fixed: Vec<FixedFrame>,
}

/// No frame but the base, "base_link".
impl Default for Frames {
    fn default() -> Self {
        Self { root: "base_link".into(), fixed: Vec::new() }
    }
}

/// A named frame fixed in a body.
#[derive(Debug, Clone, PartialEq)]
pub struct FixedFrame {
    /// The link's name.
    pub name: String,
    /// 0 = base, i = body of joint i (1-based).
    pub body: usize,
    /// Its pose in the body's joint frame (base frame for body 0).
    pub placement: Placement,
}

/// Reads the text of a URDF; `source` names it in messages.
///
/// What becomes of the file:
///
/// - **Base frame**: the root link. Links ahead of the first moving joint are folded into that
///   joint's placement; their inertia never moves and is left out.
/// - **Joints**: revolute and continuous, one chain. A continuous joint is given ±2π rad, the range
///   of an arm with cables in it. Prismatic, floating, planar, spherical and mimic joints, branches
///   with moving joints and closed chains are refused.
/// - **Fixed joints** merge the child link into the body in front of it: the inertia is added.
///   Links without mass on a body (flange, tool0) become named frames.
/// - **Joint frames**: origin at the URDF joint, z along its axis a. With a in the link frame, our
///   frame is the link frame turned by S, S ẑ = a: the smallest rotation from ẑ to a if a_z ≥ 0,
///   otherwise π about x followed by the smallest rotation from −ẑ to a. Axis z gives S = 1.
/// - **Friction**: `damping` is rv, `friction` is rc. **Limits**: `effort` is the torque limit,
///   `velocity` the speed limit.
/// - **Shapes** are not read; mesh files that are not there are named in the notices.
/// - **What URDF does not have**: rotor inertia is 0, gear ratio 1 and torque constant 1 (a current
///   column then reads as joint torque), gravity 9.81 m/s² along −z of the root link, acceleration
///   limit 10 rad/s² unless the file has one. Transmissions are not read.
/// - **Angles** within 5e-5 rad of a multiple of π/2 are that multiple: files print 1.5708 for π/2,
///   and parallel axes that are nearly parallel blur which parameters can be known.
///
/// # Errors
/// [`RobotError::Urdf`] where it is no URDF, [`RobotError::UrdfArm`] where it is one, but not of a
/// serial arm of physically possible bodies.
pub fn read_urdf(text: &str, source: &str) -> Result<UrdfArm, RobotError> {
    let robot = urdf_rs::read_from_string(text.trim_start_matches('\u{feff}')).map_err(|e| {
        RobotError::Urdf {
            file: source.to_owned(),
            message: unreadable::reason(text, &e.to_string()),
        }
    })?;
    let mut reader = Reader::default();
    let (root, joints) = bodies(&robot)
        .and_then(|chain| Ok((chain[0].links[0].0.name.clone(), reader.joints(&chain)?)))
        .map_err(|fault| RobotError::UrdfArm { file: source.to_owned(), fault })?;
    let files = missing_meshes(&robot, source);
    if !files.is_empty() {
        reader.notices.push(UrdfNotice::MissingMeshes { files });
    }
    Ok(UrdfArm {
        arm: Arm {
            name: if robot.name.is_empty() { source.to_owned() } else { robot.name },
            gravity_m_s2: Vector3::new(0.0, 0.0, -9.81),
            friction_epsilon_rad_s: default_epsilon(),
            torque_offsets: true,
            joints,
            clearance: Clearance::default(),
        },
        frames: Frames { root, fixed: reader.frames },
        notices: reader.notices,
    })
}

/// Mesh files that cannot be found from the folder of `source`, each once.
fn missing_meshes(robot: &urdf_rs::Robot, source: &str) -> Vec<String> {
    let folder = Path::new(source).parent().unwrap_or(Path::new(""));
    let shapes = robot.links.iter().flat_map(|link| {
        let visual = link.visual.iter().map(|visual| &visual.geometry);
        visual.chain(link.collision.iter().map(|collision| &collision.geometry))
    });
    let mut missing: Vec<String> = shapes
        .filter_map(|shape| match shape {
            Geometry::Mesh { filename, .. } => Some(filename.clone()),
            _ => None,
        })
        .filter(|file| !folder.join(file.trim_start_matches("file://")).exists())
        .collect();
    missing.sort();
    missing.dedup();
    missing
}

/// What accumulates beside the joints.
#[derive(Default)]
struct Reader {
    frames: Vec<FixedFrame>,
    notices: Vec<UrdfNotice>,
}

impl Reader {
    fn joints(&mut self, chain: &[Body<'_>]) -> Result<Vec<Joint>, UrdfFault> {
        let root = chain[0].links[0].0.name.clone();
        self.notices.extend([
            UrdfNotice::Gravity { root },
            UrdfNotice::Drives,
            UrdfNotice::NoClearance,
        ]);
        let mut joints: Vec<Joint> = Vec::with_capacity(chain.len() - 1);
        // Pose, in the frame of the body at hand, of the link that the next joint hangs on.
        let mut parent = Placement::identity();
        for (number, body) in chain.iter().enumerate() {
            let turn = match body.joint {
                None => Placement::identity(),
                Some(joint) => {
                    let turn = self.axis_to_z(joint)?;
                    let origin = self.placement(&joint.origin, &quoted("joint", &joint.name))?;
                    joints.push(Joint {
                        name: joint.name.clone(),
                        placement: parent.compose(&origin).compose(&turn),
                        link: LinkInertia::zero(),
                        drive: drive(joint)?,
                        limits: self.limits(joint)?,
                        bounds: LinkBounds::default(),
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
        self.summarise(&joints, chain);
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
                    poses[*parent].compose(&origin)
                }
            };
            poses.push(pose);
        }
        Ok(poses)
    }

    /// Sum of the links of a moving body about its joint frame.
    fn inertia(
        &mut self,
        body: &Body<'_>,
        joint: &urdf_rs::Joint,
        number: usize,
        poses: &[Placement],
    ) -> Result<LinkInertia, UrdfFault> {
        let mut sum = LinkInertia::zero();
        for ((link, held), pose) in body.links.iter().zip(poses) {
            match self.link_inertia(link)? {
                Some(part) => {
                    sum = sum.plus(&part.transformed(pose));
                    if held.is_some() {
                        self.notices.push(UrdfNotice::Merged {
                            link: link.name.clone(),
                            joint: joint.name.clone(),
                            mass_kg: part.mass_kg(),
                        });
                    }
                }
                None if held.is_some() => self.frames.push(FixedFrame {
                    name: link.name.clone(),
                    body: number,
                    placement: *pose,
                }),
                None => {}
            }
        }
        if sum.mass_kg() > 0.0 {
            return Ok(sum);
        }
        let link = body.links[0].0.name.clone();
        Err(UrdfFault::NoMass { link, joint: joint.name.clone() })
    }

    /// Links that never move: only their frames and a remark on their mass remain.
    fn standing(&mut self, body: &Body<'_>, poses: &[Placement]) {
        for ((link, held), pose) in body.links.iter().zip(poses) {
            let mass_kg = link.inertial.mass.value;
            if mass_kg != 0.0 {
                self.notices.push(UrdfNotice::StandingMass { link: link.name.clone(), mass_kg });
            }
            if held.is_some() {
                self.frames.push(FixedFrame { name: link.name.clone(), body: 0, placement: *pose });
            }
        }
    }

    /// A link's inertia about its own frame; `None` for one without mass.
    fn link_inertia(&mut self, link: &Link) -> Result<Option<LinkInertia>, UrdfFault> {
        let Inertial { origin, mass, inertia: i } = &link.inertial;
        let place = quoted("link", &link.name);
        let tensor = [
            ("ixx", i.ixx),
            ("ixy", i.ixy),
            ("ixz", i.ixz),
            ("iyy", i.iyy),
            ("iyz", i.iyz),
            ("izz", i.izz),
        ];
        finite(&place, "mass", mass.value)?;
        for (quantity, value) in tensor {
            finite(&place, quantity, value)?;
        }
        if mass.value < 0.0 {
            return Err(UrdfFault::Negative { place, quantity: "mass", value: mass.value });
        }
        if mass.value == 0.0 {
            let empty = tensor.iter().all(|(_, value)| *value == 0.0);
            let fault = UrdfFault::InertiaWithoutMass { link: link.name.clone() };
            return if empty { Ok(None) } else { Err(fault) };
        }
        let central = Matrix3::new(i.ixx, i.ixy, i.ixz, i.ixy, i.iyy, i.iyz, i.ixz, i.iyz, i.izz);
        possible(&link.name, &central)?;
        let frame = self.placement(origin, &place)?;
        let turned = frame.rotation * central * frame.rotation.transpose();
        Ok(Some(LinkInertia::from_com(mass.value, frame.translation_m, turned)))
    }

    /// S of [`read_urdf`]: takes ẑ to the joint's axis.
    fn axis_to_z(&mut self, joint: &urdf_rs::Joint) -> Result<Placement, UrdfFault> {
        let written = *joint.axis.xyz;
        for value in written {
            finite(&quoted("joint", &joint.name), "axis", value)?;
        }
        let length = Vector3::from(written).norm();
        if (length - 1.0).abs() > AXIS_LENGTH {
            let joint = joint.name.clone();
            return Err(UrdfFault::Axis { joint, axis: written, length });
        }
        if (length - 1.0).abs() > 4.0 * f64::EPSILON {
            self.notices.push(UrdfNotice::AxisNormalised { joint: joint.name.clone(), length });
        }
        let axis = Vector3::from(written) / length;
        let rotation = rotation_from_z(axis);
        if rotation != Matrix3::identity() {
            let joint = joint.name.clone();
            self.notices.push(UrdfNotice::Reoriented { joint, axis: written });
        }
        Ok(Placement { rotation, translation_m: Vector3::zeros() })
    }

    /// A pose of the file, its angles freed from the rounding of right angles.
    fn placement(&mut self, pose: &Pose, place: &str) -> Result<Placement, UrdfFault> {
        for value in *pose.xyz {
            finite(place, "xyz", value)?;
        }
        let mut rpy_rad = *pose.rpy;
        for angle in &mut rpy_rad {
            finite(place, "rpy", *angle)?;
            let used_rad = (*angle / FRAC_PI_2).round() * FRAC_PI_2;
            let off = (*angle - used_rad).abs();
            if off < RIGHT_ANGLE_RAD {
                if off > WORTH_SAYING_RAD {
                    self.notices.push(UrdfNotice::RightAngle {
                        place: place.to_owned(),
                        written_rad: *angle,
                        used_rad,
                    });
                }
                *angle = used_rad;
            }
        }
        Ok(Placement::from_xyz_rpy(*pose.xyz, rpy_rad))
    }

    fn limits(&mut self, joint: &urdf_rs::Joint) -> Result<Limits, UrdfFault> {
        let name = || joint.name.clone();
        let limit = &joint.limit;
        for (quantity, value) in [
            ("lower", limit.lower),
            ("upper", limit.upper),
            ("effort", limit.effort),
            ("velocity", limit.velocity),
            ("acceleration", limit.acceleration),
        ] {
            let place = quoted("joint", &joint.name);
            if value.is_nan() {
                return Err(UrdfFault::NotFinite { place, quantity, value });
            }
            if value < 0.0 && quantity != "lower" && quantity != "upper" {
                return Err(UrdfFault::Negative { place, quantity, value });
            }
        }
        let unlimited = limit.lower == f64::NEG_INFINITY && limit.upper == f64::INFINITY;
        let position_rad = if joint.joint_type == JointType::Continuous || unlimited {
            self.notices.push(UrdfNotice::Continuous { joint: name() });
            [-TAU, TAU]
        } else if limit.lower < limit.upper && (limit.upper - limit.lower).is_finite() {
            [limit.lower, limit.upper]
        } else {
            let (lower_rad, upper_rad) = (limit.lower, limit.upper);
            return Err(UrdfFault::Range { joint: name(), lower_rad, upper_rad });
        };
        // Zero is how files without the number come out, and how many write "unknown".
        let given = |value: f64| (value > 0.0 && value.is_finite()).then_some(value);
        let velocity_rad_s = given(limit.velocity).unwrap_or_else(|| {
            let velocity_rad_s = ASSUMED_VELOCITY_RAD_S;
            self.notices.push(UrdfNotice::AssumedVelocity { joint: name(), velocity_rad_s });
            velocity_rad_s
        });
        let torque_nm = given(limit.effort).unwrap_or_else(|| {
            self.notices.push(UrdfNotice::NoTorqueLimit { joint: name() });
            f64::INFINITY
        });
        let acceleration_rad_s2 = given(limit.acceleration).unwrap_or(ASSUMED_ACCELERATION_RAD_S2);
        Ok(Limits { position_rad, velocity_rad_s, acceleration_rad_s2, torque_nm })
    }

    /// The remarks that concern several joints at once.
    fn summarise(&mut self, joints: &[Joint], chain: &[Body<'_>]) {
        let no_friction: Vec<String> = joints
            .iter()
            .filter(|j| j.drive.viscous_nm_s_rad == 0.0 && j.drive.coulomb_nm == 0.0)
            .map(|j| j.name.clone())
            .collect();
        if !no_friction.is_empty() {
            self.notices.push(UrdfNotice::NoFriction { joints: no_friction });
        }
        let no_acceleration: Vec<String> = chain
            .iter()
            .filter_map(|body| body.joint)
            .filter(|j| !(j.limit.acceleration > 0.0 && j.limit.acceleration.is_finite()))
            .map(|j| j.name.clone())
            .collect();
        if !no_acceleration.is_empty() {
            self.notices.push(UrdfNotice::AssumedAcceleration {
                joints: no_acceleration,
                acceleration_rad_s2: ASSUMED_ACCELERATION_RAD_S2,
            });
        }
    }
}

fn drive(joint: &urdf_rs::Joint) -> Result<Drive, UrdfFault> {
    let (damping, friction) =
        joint.dynamics.as_ref().map_or((0.0, 0.0), |d| (d.damping, d.friction));
    for (quantity, value) in [("damping", damping), ("friction", friction)] {
        let place = quoted("joint", &joint.name);
        finite(&place, quantity, value)?;
        if value < 0.0 {
            return Err(UrdfFault::Negative { place, quantity, value });
        }
    }
    Ok(Drive {
        rotor_inertia_kg_m2: 0.0,
        viscous_nm_s_rad: damping,
        coulomb_nm: friction,
        gear_ratio: 1.0,
        torque_constant_nm_a: 1.0,
    })
}

/// Positive principal moments that obey the triangle inequality, or what is wrong with them.
fn possible(link: &str, central: &Matrix3<f64>) -> Result<(), UrdfFault> {
    let mut principal_kg_m2: [f64; 3] = central.symmetric_eigenvalues().into();
    principal_kg_m2.sort_by(f64::total_cmp);
    let [small, middle, large] = principal_kg_m2;
    let link = link.to_owned();
    if small <= 0.0 {
        Err(UrdfFault::NotPositiveDefinite { link, principal_kg_m2 })
    } else if small + middle <= large {
        Err(UrdfFault::Triangle { link, principal_kg_m2 })
    } else {
        Ok(())
    }
}

/// The rotation that takes ẑ to the unit vector `axis`, exact for the coordinate axes.
///
/// For a_z ≥ 0 the smallest one, 1 + [v] + [v]²/(1 + a_z) with v = ẑ × a (Rodrigues); below the
/// xy plane π about x comes first, so that the denominator never vanishes.
fn rotation_from_z(axis: Vector3<f64>) -> Matrix3<f64> {
    let smallest = |a: Vector3<f64>| {
        let v = Vector3::z().cross(&a).cross_matrix();
        Matrix3::identity() + v + v * v / (1.0 + a.z)
    };
    if axis.z >= 0.0 {
        smallest(axis)
    } else {
        smallest(-axis) * Matrix3::from_diagonal(&Vector3::new(1.0, -1.0, -1.0))
    }
}

fn finite(place: &str, quantity: &'static str, value: f64) -> Result<(), UrdfFault> {
    if value.is_finite() {
        return Ok(());
    }
    Err(UrdfFault::NotFinite { place: place.to_owned(), quantity, value })
}

fn quoted(kind: &str, name: &str) -> String {
    format!("{kind} \"{name}\"")
}
