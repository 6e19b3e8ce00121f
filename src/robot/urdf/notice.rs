//! Notices about what was assumed or left out in reading a file that describes an arm.

use std::fmt;

use super::locked::LockedJoint;
use super::words::listed;
use crate::robot::mjcf::MjcfNotice;
use crate::robot::shapes::ShapeNotice;

/// Something that a URDF does not say, or says in a way that had to be interpreted.
#[derive(Debug, Clone, PartialEq)]
pub enum UrdfNotice {
    /// A URDF has no gravity: 9.81 m/s² along −z of the root link is assumed.
    Gravity {
        /// The root link, which is the base frame.
        root: String,
    },
    /// A URDF has no drives: rotor inertia 0, gear ratio 1 and torque constant 1 Nm/A are assumed.
    Drives {
        /// The joints without rotor inertia.
        rotor_inertia: Vec<String>,
        /// The joints without gear ratio.
        gear_ratio: Vec<String>,
        /// The joints without torque constant.
        torque_constant: Vec<String>,
    },
    /// The friction law is `rc tanh(q̇/ε)` with an ε that neither a URDF nor an MJCF has.
    FrictionEpsilon {
        /// The assumed ε, rad/s.
        epsilon_rad_s: f64,
    },
    /// Joints that are not on the way to the arm's last link are locked.
    Locked {
        /// The joints, and where they are locked.
        joints: Vec<LockedJoint>,
        /// The last link.
        last: String,
    },
    /// Neither damping nor friction is given.
    NoFriction {
        /// The joints without.
        joints: Vec<String>,
    },
    /// Damping so high that the joint's torque limit does not suffice for its speed limit: the drive would spend all of
    /// its torque on its own friction. Simulations use such values to stabilise a stiff servo.
    ServoDamping {
        /// The joints, each with its damping, Nm s/rad, and torque limit, Nm.
        joints: Vec<(String, f64, f64)>,
    },
    /// A notice about collision shapes.
    Shapes(ShapeNotice),
    /// The drive file beside the URDF was read.
    DriveFile {
        /// The file.
        file: String,
        /// Assumptions that remain, because neither file says otherwise.
        open: Vec<UrdfNotice>,
    },
    /// Continuous (or unlimited) joints were given the range ±2π rad.
    Continuous {
        /// The joints.
        joints: Vec<String>,
    },
    /// Soft limits, at which the controller stops a joint, narrow its range.
    SoftLimits {
        /// The joints, each with the range that is left, rad.
        joints: Vec<(String, [f64; 2])>,
    },
    /// Ranges of more than two turns to one side, as angles in degrees are when they are read as radians.
    WideRanges {
        /// The joints, each with its range, rad.
        joints: Vec<(String, [f64; 2])>,
    },
    /// The file has no speed limit.
    AssumedVelocity {
        /// The joints without.
        joints: Vec<String>,
        /// The assumed limit, rad/s.
        velocity_rad_s: f64,
    },
    /// The file has no acceleration limit.
    AssumedAcceleration {
        /// The joints without.
        joints: Vec<String>,
        /// The assumed limit, rad/s².
        acceleration_rad_s2: f64,
    },
    /// The file has no torque limit: unlimited torque is assumed.
    NoTorqueLimit {
        /// The joints without.
        joints: Vec<String>,
    },
    /// Links fixed to a moving body were added to it.
    Merged {
        /// The joint that moves it.
        joint: String,
        /// The links, each with the mass that it added, kg.
        links: Vec<(String, f64)>,
    },
    /// Links that no joint of the arm moves; their inertia is left out.
    StandingMass {
        /// The links, and the mass of each, kg.
        links: Vec<(String, f64)>,
    },
    /// Joint frames that differ from the frames of the links, because z was turned onto the axis.
    Reoriented {
        /// The joints, each with its axis in the link's frame, which is the z axis of the joint frame.
        joints: Vec<(String, [f64; 3])>,
    },
    /// Axes that were unit vectors only to the digits printed.
    AxisNormalised {
        /// The joints, and the length of each axis as written.
        joints: Vec<(String, f64)>,
    },
    /// Angles printed to a few digits were taken as the multiples of π/2 that they represent.
    RightAngles {
        /// The joints and links.
        places: Vec<String>,
        /// The largest deviation from such a multiple, rad.
        off_rad: f64,
    },
    /// Angles near multiples of π/2 that were taken literally: they may be right angles, printed with too few digits.
    NearRightAngles {
        /// The joints and links, each with the angle as written and the multiple of π/2 beside it, rad.
        angles: Vec<(String, f64, f64)>,
    },
    /// A notice about something in an MJCF that has no equivalent in a URDF.
    Mjcf(MjcfNotice),
}

impl UrdfNotice {
    /// Names of the joints that this notice reports as locked.
    pub(in crate::robot) fn locked(&self) -> impl Iterator<Item = &str> {
        let joints = match self {
            Self::Locked { joints, .. } => joints.as_slice(),
            _ => &[],
        };
        joints.iter().map(|joint| joint.name.as_str())
    }
}

impl fmt::Display for UrdfNotice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Gravity { root } => {
                write!(f, "gravity is taken as 9.81 m/s2 along -z of the root link \"{root}\"")
            }
            Self::Drives { rotor_inertia, gear_ratio, torque_constant } => {
                f.write_str(&no_drives([rotor_inertia, gear_ratio, torque_constant]))
            }
            Self::FrictionEpsilon { epsilon_rad_s } => write!(
                f,
                "the speed at which Coulomb friction sets in is taken as {epsilon_rad_s} rad/s (friction_epsilon_rad_s in NAME.drives.toml)"
            ),
            Self::Locked { joints, last } => f.write_str(&locked(joints, last)),
            Self::NoFriction { joints } => {
                write!(f, "no damping and no friction given, taken as 0: {}", joints.join(", "))
            }
            Self::ServoDamping { joints } => f.write_str(&of_servos(joints)),
            Self::Shapes(notice) => write!(f, "{notice}"),
            Self::DriveFile { file, open } if open.is_empty() => {
                write!(f, "drives and gravity are those of {file}")
            }
            Self::DriveFile { file, open } => {
                let open: Vec<String> = open.iter().map(ToString::to_string).collect();
                write!(f, "{file} leaves open: {}", open.join("; "))
            }
            Self::Continuous { joints } => {
                write!(f, "no end stops, taken as -2 pi to 2 pi: {}", listed(joints))
            }
            Self::SoftLimits { joints } => write!(
                f,
                "soft limits (<safety_controller>) narrow the ranges: {}",
                listed(joints.iter().map(with_range))
            ),
            Self::WideRanges { joints } => write!(
                f,
                "ranges of more than two turns, are they in degrees? The file's unit is rad: {}",
                listed(joints.iter().map(with_range))
            ),
            Self::AssumedVelocity { joints, velocity_rad_s } => write!(
                f,
                "no speed limit, taken as {velocity_rad_s:.4} rad/s (velocity_rad_s in NAME.drives.toml): {}",
                joints.join(", ")
            ),
            Self::AssumedAcceleration { joints, acceleration_rad_s2 } => write!(
                f,
                "no acceleration limit, taken as {acceleration_rad_s2} rad/s2: {}",
                joints.join(", ")
            ),
            Self::NoTorqueLimit { joints } => write!(
                f,
                "no torque limit, taken as unlimited (torque_nm in NAME.drives.toml): {}",
                joints.join(", ")
            ),
            Self::Merged { joint, links } => {
                let subject = with_masses(links, "is", "are");
                write!(f, "{subject} fixed to the body of joint \"{joint}\" and counted in it")
            }
            Self::StandingMass { links } => {
                write!(f, "{} still: inertia left out", with_masses(links, "stands", "stand"))
            }
            Self::Reoriented { joints } => f.write_str(&turned(joints)),
            Self::AxisNormalised { joints } => {
                let lengths = joints.iter().map(|(joint, length)| format!("{joint} ({length})"));
                write!(f, "axes that are not of length 1 were made so: {}", listed(lengths))
            }
            Self::RightAngles { places, off_rad } => write!(
                f,
                "angles that are off multiples of pi/2 by {off_rad:.1e} rad or less are taken as these: {}",
                listed(places)
            ),
            Self::NearRightAngles { angles } => f.write_str(&nearly_right(angles)),
            Self::Mjcf(notice) => write!(f, "{notice}"),
        }
    }
}

/// The text about joints without rotor inertia, gear ratio and torque constant: one phrase for those that the same
/// joints lack.
fn no_drives([rotor_inertia, gear_ratio, torque_constant]: [&Vec<String>; 3]) -> String {
    if rotor_inertia == gear_ratio && gear_ratio == torque_constant {
        return format!(
            "the file has no drives: rotor inertia 0, gear ratio 1, torque constant 1 Nm/A (a current column reads as joint torque): {}",
            gear_ratio.join(", ")
        );
    }
    let open = [
        ("rotor inertia", "0", rotor_inertia),
        ("gear ratio", "1", gear_ratio),
        ("torque constant", "1 Nm/A", torque_constant),
    ];
    let mut words: Vec<String> = Vec::new();
    for (k, (_, _, joints)) in open.iter().enumerate() {
        let is_said = open[..k].iter().any(|(_, _, earlier)| earlier == joints);
        if joints.is_empty() || is_said {
            continue;
        }
        let of_same = || open.iter().filter(|(_, _, others)| others == joints);
        let whats: Vec<&str> = of_same().map(|(what, _, _)| *what).collect();
        let values: Vec<&str> = of_same().map(|(_, value, _)| *value).collect();
        words.push(format!(
            "no {} given, taken as {}: {}",
            whats.join(" and no "),
            values.join(" and "),
            joints.join(", ")
        ));
    }
    words.join("; ")
}

fn locked(joints: &[LockedJoint], last: &str) -> String {
    let (noun, verb) = if joints.len() == 1 { ("joint", "is") } else { ("joints", "are") };
    format!(
        "{noun} {} {verb} not on the way to link \"{last}\": taken as locked there, links behind count in the body that carries them",
        listed(joints)
    )
}

/// The text about joints with their damping, Nm s/rad, and torque limit, Nm.
fn of_servos(joints: &[(String, f64, f64)]) -> String {
    let joints = joints.iter().map(|(joint, damping, torque_nm)| {
        let speed_rad_s = torque_nm / damping;
        format!("{joint} ({damping} Nm s/rad: {torque_nm} Nm at {speed_rad_s:.2} rad/s)")
    });
    format!(
        "damping that takes the whole torque limit below the speed limit is a simulated servo's and not the arm's, but is read as its \
         friction (viscous_nm_s_rad in NAME.drives.toml says otherwise): {}",
        listed(joints)
    )
}

/// The text about joints with their axes in the link's frame.
fn turned(joints: &[(String, [f64; 3])]) -> String {
    let axes = joints.iter().map(|(joint, axis)| {
        let [x, y, z] = axis.map(|value| rounded(value, 4));
        format!("{joint} ({x}, {y}, {z})")
    });
    format!(
        "frames of joints are turned from those of their links to have z along the axis, parameters are about them: {}",
        listed(axes)
    )
}

/// The text about places with an angle as written and the right angle beside it, rad.
fn nearly_right(angles: &[(String, f64, f64)]) -> String {
    let angles = angles.iter().map(|(place, written_rad, right_rad)| {
        format!(
            "{place} {} (of a right angle write {})",
            rounded(*written_rad, 7),
            rounded(*right_rad, 7)
        )
    });
    format!(
        "angles near multiples of pi/2 are taken literally, so that axes are not quite parallel: {}",
        listed(angles)
    )
}

/// A number with so many decimals at most, zero without a sign.
fn rounded(value: f64, decimals: i32) -> f64 {
    let unit = 10_f64.powi(decimals);
    (value * unit).round() / unit + 0.0
}

/// A joint with its range, rad.
fn with_range((joint, [lower_rad, upper_rad]): &(String, [f64; 2])) -> String {
    format!("{joint} ({lower_rad} to {upper_rad} rad)")
}

/// The links with their masses, kg, followed by the verb in the singular or the plural.
fn with_masses(links: &[(String, f64)], one_does: &str, all_do: &str) -> String {
    let (noun, verb) = if links.len() == 1 { ("link", one_does) } else { ("links", all_do) };
    let links = links.iter().map(|(name, mass_kg)| format!("{name} ({mass_kg} kg)"));
    format!("{noun} {} {verb}", listed(links))
}
