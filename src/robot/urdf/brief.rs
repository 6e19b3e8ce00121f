//! What was assumed or interpreted in a few words, for commands whose subject is not the file of the arm.

use super::notice::UrdfNotice;

impl UrdfNotice {
    /// The notice in a few words. `None` for those about what may be a mistake in the file, which are told in full, and
    /// for those about shapes, which matter only to a motion that is planned.
    pub fn brief(&self) -> Option<String> {
        Some(match self {
            Self::Gravity { root } => format!("gravity 9.81 m/s2 along -z of \"{root}\""),
            Self::Drives { rotor_inertia, gear_ratio, torque_constant } => {
                let missing = [
                    (rotor_inertia, "rotor inertia 0"),
                    (gear_ratio, "gear ratio 1"),
                    (torque_constant, "torque constant 1 Nm/A"),
                ];
                let words = missing.into_iter().filter(|(joints, _)| !joints.is_empty());
                words.map(|(_, words)| words).collect::<Vec<_>>().join(", ")
            }
            Self::FrictionEpsilon { epsilon_rad_s } => {
                format!("Coulomb friction from {epsilon_rad_s} rad/s on")
            }
            Self::NoFriction { .. } => "no friction".to_owned(),
            Self::AssumedVelocity { velocity_rad_s, .. } => {
                format!("speed limit {velocity_rad_s:.4} rad/s")
            }
            Self::AssumedAcceleration { acceleration_rad_s2, .. } => {
                format!("acceleration limit {acceleration_rad_s2} rad/s2")
            }
            Self::NoTorqueLimit { .. } => "unlimited torque".to_owned(),
            Self::Continuous { .. } => "no end stops".to_owned(),
            Self::SoftLimits { .. } => "soft limits narrow ranges".to_owned(),
            Self::Locked { joints, .. } => match joints.len() {
                1 => "a locked joint".to_owned(),
                count => format!("{count} locked joints"),
            },
            Self::Merged { .. } => "fixed links counted in the bodies that carry them".to_owned(),
            Self::StandingMass { .. } => "links that stand still left out".to_owned(),
            Self::Reoriented { .. } => "joint frames turned to their axes".to_owned(),
            Self::AxisNormalised { .. } => "axes made of length 1".to_owned(),
            Self::DriveFile { file, open } if open.is_empty() => {
                format!("drives and gravity of {file}")
            }
            Self::DriveFile { file, open } => {
                let open: Vec<String> = open.iter().map(Self::brief).collect::<Option<_>>()?;
                format!("what {file} leaves open: {}", open.join(", "))
            }
            Self::ServoDamping { .. }
            | Self::Shapes(_)
            | Self::WideRanges { .. }
            | Self::RightAngles { .. }
            | Self::NearRightAngles { .. }
            | Self::Mjcf(_) => return None,
        })
    }
}
