//! Margins of a motion from every limit of the arm.

use std::fmt;

use super::clearance::ClearanceModel;
use super::error::{ExcitationError, positive};
use super::reference::Reference;
use crate::dynamics::{Model, Workspace, inverse_dynamics};
use crate::robot::Arm;

/// Requirements on a motion beyond the limits of the arm itself.
#[derive(Debug, Clone, PartialEq)]
pub struct Requirements {
    /// Smallest distance of the arm from itself, from the floor and from boxes, m.
    pub clearance_m: f64,
    /// Fraction of the largest torque of a joint that the nominal model may need.
    pub torque_share: f64,
    /// Rate at which a motion is checked, Hz.
    pub check_rate_hz: f64,
}

impl Default for Requirements {
    /// 2 cm, 90 % of the torque, 1 kHz.
    fn default() -> Self {
        Self { clearance_m: 0.02, torque_share: 0.9, check_rate_hz: 1000.0 }
    }
}

/// Identifies a limit. Joints are 0-based here and 1-based in print.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum LimitKind {
    /// Joint angle, rad.
    Position {
        /// The joint.
        joint: usize,
    },
    /// Joint speed, rad/s.
    Velocity {
        /// The joint.
        joint: usize,
    },
    /// Joint acceleration, rad/s².
    Acceleration {
        /// The joint.
        joint: usize,
    },
    /// Torque of the nominal model, Nm.
    Torque {
        /// The joint.
        joint: usize,
    },
    /// Distance between two capsules, m.
    Clearance {
        /// One capsule.
        one: String,
        /// The other.
        other: String,
    },
    /// Height of a capsule above the floor, m.
    Floor {
        /// The capsule.
        capsule: String,
    },
    /// Distance of a capsule from a box of the cell, m.
    Box {
        /// The capsule.
        capsule: String,
        /// Position of the box in the robot's list, from 0.
        which: usize,
    },
}

impl LimitKind {
    /// Whether the limit is a distance that the arm must keep.
    pub fn is_distance(&self) -> bool {
        matches!(self, Self::Clearance { .. } | Self::Floor { .. } | Self::Box { .. })
    }

    /// Unit of the margin.
    pub fn unit(&self) -> &'static str {
        match self {
            Self::Position { .. } => "rad",
            Self::Velocity { .. } => "rad/s",
            Self::Acceleration { .. } => "rad/s²",
            Self::Torque { .. } => "Nm",
            Self::Clearance { .. } | Self::Floor { .. } | Self::Box { .. } => "m",
        }
    }
}

impl fmt::Display for LimitKind {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Position { joint } => write!(f, "position of joint {}", joint + 1),
            Self::Velocity { joint } => write!(f, "velocity of joint {}", joint + 1),
            Self::Acceleration { joint } => write!(f, "acceleration of joint {}", joint + 1),
            Self::Torque { joint } => write!(f, "torque of joint {}", joint + 1),
            Self::Clearance { one, other } => write!(f, "clearance of {one} and {other}"),
            Self::Floor { capsule } => write!(f, "clearance of {capsule} and floor"),
            Self::Box { capsule, which } => {
                write!(f, "clearance of {capsule} and box {}", which + 1)
            }
        }
    }
}

/// The smallest margin of a motion from one limit.
#[derive(Debug, Clone, PartialEq)]
pub struct Margin {
    /// Which limit.
    pub limit: LimitKind,
    /// Margin in the unit of the limit; negative if the limit is exceeded.
    pub free: f64,
    /// `free` as a fraction of the bound: of half the range of a position, of the largest velocity,
    /// acceleration or torque, of 0.1 m for a distance.
    pub share: f64,
    /// Time at which the margin is smallest, s.
    pub time_s: f64,
}

impl Margin {
    /// `free` with its unit.
    pub fn in_words(&self) -> String {
        format!("{:.4} {}", self.free, self.limit.unit())
    }

    /// The amount by which a limit is exceeded, with its unit.
    pub fn shortfall_in_words(&self) -> String {
        format!("{:.4} {}", -self.free, self.limit.unit())
    }
}

/// Clearance that counts as a share of one, m.
const CLEARANCE_SCALE_M: f64 = 0.1;

/// The margin of every limit over one motion.
#[derive(Debug, Clone, PartialEq)]
pub struct Margins {
    all: Vec<Margin>,
}

impl Margins {
    /// All margins: position, velocity, acceleration and torque, each joint by joint, then the distances.
    pub fn all(&self) -> &[Margin] {
        &self.all
    }

    /// All margins, the smallest share first.
    pub fn least_first(&self) -> Vec<&Margin> {
        let mut sorted: Vec<&Margin> = self.all.iter().collect();
        sorted.sort_by(|a, b| a.share.total_cmp(&b.share));
        sorted
    }

    /// Whether no limit is exceeded.
    pub fn feasible(&self) -> bool {
        self.worst().free >= 0.0
    }

    /// The margin with the smallest share.
    pub fn worst(&self) -> &Margin {
        // An arm has at least one joint, so there are at least four margins.
        self.all.iter().min_by(|a, b| a.share.total_cmp(&b.share)).unwrap_or(&self.all[0])
    }

    /// The margins of the motion with more of the same inserted at the time `at_s`: what came after it comes `by_s`
    /// later.
    pub(super) fn prolonged(mut self, at_s: f64, by_s: f64) -> Self {
        for margin in self.all.iter_mut().filter(|margin| margin.time_s > at_s) {
            margin.time_s += by_s;
        }
        self
    }
}

/// Follows `motion` from start to end at `requirements.check_rate_hz` and returns its margins.
///
/// Between two samples h apart a quantity x can exceed its sampled extreme by at most max|ẍ| h²/8:
/// at 1 kHz 1e-6 m for a point moving with 10 m/s².
pub fn check(
    arm: &Arm,
    requirements: &Requirements,
    motion: &impl Reference,
) -> Result<Margins, ExcitationError> {
    let dof = arm.dof();
    if motion.joints() != dof {
        let (trajectory, arm) = (motion.joints(), arm.name.clone());
        return Err(ExcitationError::WrongArm { trajectory, arm, dof });
    }
    for (what, value) in
        [("clearance", requirements.clearance_m), ("torque share", requirements.torque_share)]
    {
        if !(value >= 0.0 && value.is_finite()) {
            let what = what.to_owned();
            return Err(ExcitationError::Value { what, value, must: "finite and not negative" });
        }
    }
    positive("check rate", requirements.check_rate_hz)?;
    let model = Model::new(arm);
    let mut dynamics = Workspace::new(&model);
    let clearance = ClearanceModel::new(arm);
    let mut ws = clearance.workspace();
    let mut distances_m = vec![0.0; clearance.len()];
    let joint_limits: [fn(usize) -> LimitKind; 4] = [
        |joint| LimitKind::Position { joint },
        |joint| LimitKind::Velocity { joint },
        |joint| LimitKind::Acceleration { joint },
        |joint| LimitKind::Torque { joint },
    ];
    let unseen = |limit| Margin { limit, free: f64::INFINITY, share: f64::INFINITY, time_s: 0.0 };
    let mut all: Vec<Margin> = joint_limits
        .iter()
        .flat_map(|limit| (0..dof).map(|joint| unseen(limit(joint))))
        .chain((0..clearance.len()).map(|k| unseen(clearance.limit(k))))
        .collect();

    let (mut q, mut qd, mut qdd) = (vec![0.0; dof], vec![0.0; dof], vec![0.0; dof]);
    let mut torque_nm = vec![0.0; dof];
    let steps = (motion.duration_s() * requirements.check_rate_hz).ceil().max(1.0) as usize;
    for k in 0..=steps {
        let t_s = motion.duration_s() * k as f64 / steps as f64;
        motion.sample(t_s, &mut q, &mut qd, &mut qdd);
        clearance.distances(&mut ws, &q, &mut distances_m);
        inverse_dynamics(&model, &mut dynamics, &q, &qd, &qdd, &mut torque_nm);
        let mut note = |index: usize, free: f64, full: f64| {
            let margin = &mut all[index];
            if free < margin.free {
                (margin.free, margin.share, margin.time_s) = (free, free / full, t_s);
            }
        };
        for (j, joint) in arm.joints.iter().enumerate() {
            let limits = &joint.limits;
            let [low, high] = limits.position_rad;
            note(j, (q[j] - low).min(high - q[j]), 0.5 * (high - low));
            let v = limits.velocity_rad_s;
            note(dof + j, v - qd[j].abs(), v);
            let a = limits.acceleration_rad_s2;
            note(2 * dof + j, a - qdd[j].abs(), a);
            let free = requirements.torque_share * limits.torque_nm - torque_nm[j].abs();
            note(3 * dof + j, free, limits.torque_nm);
        }
        for (c, d) in distances_m.iter().enumerate() {
            note(4 * dof + c, d - requirements.clearance_m, CLEARANCE_SCALE_M);
        }
    }
    Ok(Margins { all })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::excitation::{Excitation, FourierSeries, built_in_names};

    #[test]
    fn trajectories_built_in_keep_every_limit() {
        let arm = Arm::built_in("ur5").unwrap();
        let requirements = Requirements::default();
        for name in built_in_names() {
            let series = FourierSeries::built_in(name).unwrap();
            let e = Excitation::fitted(&arm, &requirements, series, 2, true).unwrap();
            let margins = check(&arm, &requirements, &e).unwrap();
            assert!(
                margins.feasible(),
                "{name}: {} {}",
                margins.worst().limit,
                margins.worst().in_words()
            );
        }
    }

    /// One joint oscillates with 1 rad/s at ω = 1 rad/s about 0: every margin is known.
    #[test]
    fn margins_of_a_known_motion() {
        let arm = Arm::built_in("ur5").unwrap();
        let mut a = vec![vec![0.0]; 6];
        a[2] = vec![1.0];
        let b = vec![vec![0.0]; 6];
        let q0 = vec![0.0, -1.2, 0.0, -1.5, 0.3, 0.0];
        let series = FourierSeries::new(std::f64::consts::TAU, q0, a, b).unwrap();
        let margins = check(&arm, &Requirements::default(), &series).unwrap();
        let free = |limit: LimitKind| margins.all().iter().find(|m| m.limit == limit).unwrap().free;
        use std::f64::consts::PI;
        assert!((free(LimitKind::Position { joint: 2 }) - (PI - 1.0)).abs() < 1e-6);
        assert!((free(LimitKind::Velocity { joint: 2 }) - (PI - 1.0)).abs() < 1e-6);
        assert!((free(LimitKind::Acceleration { joint: 2 }) - 9.0).abs() < 1e-6);
        assert!((free(LimitKind::Position { joint: 1 }) - (2.0 * PI - 1.2)).abs() < 1e-12);
        assert!(margins.feasible());
    }

    #[test]
    fn a_motion_that_is_too_fast_is_named() {
        let arm = Arm::built_in("ur5").unwrap();
        let mut series = FourierSeries::built_in("ur5_identification").unwrap();
        series.a_rad_s[3][0] += 10.0;
        let margins = check(&arm, &Requirements::default(), &series).unwrap();
        assert!(!margins.feasible());
        let refused = Excitation::fitted(&arm, &Requirements::default(), series, 1, false);
        assert!(refused.unwrap_err().to_string().contains("joint 4"));
    }

    #[test]
    fn a_motion_for_another_arm_is_refused() {
        let arm = Arm::built_in("ur5").unwrap();
        let series = FourierSeries::new(1.0, vec![0.0], vec![vec![0.1]], vec![vec![0.0]]).unwrap();
        let message = check(&arm, &Requirements::default(), &series).unwrap_err().to_string();
        assert!(message.contains("1 joints") && message.contains("6"), "{message}");
    }
}
