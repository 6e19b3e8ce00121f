//! Joint frames, gravity and friction law of an arm: what the meaning of its parameters depends on.

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::arm::{Arm, Placement};

/// Frames that differ by less count as the same, in m and rad; of ε, the relative difference. Files print as many
/// digits.
const SAME: f64 = 1e-6;

/// Joint frames, gravity and the friction ε of an arm, as stored in results.
///
/// The name of a robot does not determine them: two files can describe one robot with different joint frames, and
/// parameters about the frames of one file are wrong about those of the other. ε belongs to the friction parameters,
/// because Coulomb and viscous friction are the coefficients of tanh(q̇/ε) and q̇.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Kinematics {
    /// Gravity in the base frame, m/s².
    gravity_m_s2: [f64; 3],
    /// Poses of the joint frames, from base to flange.
    joint_frames: Vec<JointFrame>,
    /// ε of the regularised sign in the friction law, rad/s; absent from results of older programs.
    friction_epsilon_rad_s: Option<f64>,
}

/// Pose of a joint frame at q = 0 in its parent's frame: translation, and roll, pitch and yaw about fixed axes.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
struct JointFrame {
    xyz_m: [f64; 3],
    rpy_rad: [f64; 3],
}

/// Difference between an arm and the one that a result is about.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum KinematicsDifference {
    /// The number of joints differs.
    #[error("it has {found} joints, not {expected}")]
    Joints {
        /// In the result.
        found: usize,
        /// In the arm.
        expected: usize,
    },
    /// A joint frame differs.
    #[error("the frame of joint {joint} is {distance_m:.2e} m and {angle_rad:.2e} rad elsewhere")]
    Frame {
        /// Number of the joint, from 1.
        joint: usize,
        /// Distance between the origins, m.
        distance_m: f64,
        /// Angle of the rotation between the two frames, rad.
        angle_rad: f64,
    },
    /// The gravity vector differs.
    #[error("its gravity is {found:?} m/s², not {expected:?}")]
    Gravity {
        /// In the result, m/s².
        found: [f64; 3],
        /// In the arm, m/s².
        expected: [f64; 3],
    },
    /// The ε of the friction law differs.
    #[error("its friction_epsilon_rad_s is {found}, not {expected}")]
    FrictionEpsilon {
        /// In the result, rad/s.
        found: f64,
        /// In the arm, rad/s.
        expected: f64,
    },
}

impl Kinematics {
    /// The kinematics of `arm`.
    pub fn of(arm: &Arm) -> Self {
        let frame = |placement: &Placement| JointFrame {
            xyz_m: placement.translation_m.into(),
            rpy_rad: placement.rpy_rad(),
        };
        Self {
            gravity_m_s2: arm.gravity_m_s2.into(),
            joint_frames: arm.joints.iter().map(|joint| frame(&joint.placement)).collect(),
            friction_epsilon_rad_s: Some(arm.friction_epsilon_rad_s),
        }
    }

    /// The first difference between this and `arm`; `None` where parameters have the same meaning for both.
    pub fn difference(&self, arm: &Arm) -> Option<KinematicsDifference> {
        let (found, expected) = (self.joint_frames.len(), arm.dof());
        if found != expected {
            return Some(KinematicsDifference::Joints { found, expected });
        }
        for (j, (own, joint)) in self.joint_frames.iter().zip(&arm.joints).enumerate() {
            let own = Placement::from_xyz_rpy(own.xyz_m, own.rpy_rad);
            let distance_m = (own.translation_m - joint.placement.translation_m).norm();
            let angle_rad = angle_between(&own.rotation, &joint.placement.rotation);
            // The negated comparison counts NaN as a difference too.
            if !(distance_m < SAME && angle_rad < SAME) {
                return Some(KinematicsDifference::Frame { joint: j + 1, distance_m, angle_rad });
            }
        }
        let found = self.gravity_m_s2;
        let is_same = (Vector3::from(found) - arm.gravity_m_s2).norm() < SAME;
        if !is_same {
            let expected = arm.gravity_m_s2.into();
            return Some(KinematicsDifference::Gravity { found, expected });
        }
        let found = self.friction_epsilon_rad_s?;
        let expected = arm.friction_epsilon_rad_s;
        let is_same = (found - expected).abs() < SAME * expected;
        (!is_same).then_some(KinematicsDifference::FrictionEpsilon { found, expected })
    }
}

/// Angle between two rotations, rad, from |A − B| = 2 √2 sin(angle/2) (Frobenius norm). Its cosine, from the trace of
/// AᵀB, would lose all digits of a small angle, and rounding may carry it beyond 1.
fn angle_between(a: &Matrix3<f64>, b: &Matrix3<f64>) -> f64 {
    2.0 * ((a - b).norm() / 8f64.sqrt()).min(1.0).asin()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::built_in_names;

    #[test]
    fn an_arm_is_the_same_as_itself_and_no_other() {
        let arms = || built_in_names().map(|name| Arm::built_in(name).unwrap());
        for one in arms() {
            let written = serde_json::to_string(&Kinematics::of(&one)).unwrap();
            let own: Kinematics = serde_json::from_str(&written).unwrap();
            for other in arms() {
                assert_eq!(own.difference(&other).is_none(), one.name == other.name);
            }
        }
    }

    /// Rounding makes the trace of R Rᵀ a little smaller or larger than 3.
    #[test]
    fn a_frame_that_is_tilted_a_little_is_itself() {
        for k in 1..200 {
            let rpy_rad = [std::f64::consts::FRAC_PI_2, 5e-5 * f64::from(k), 0.0];
            let mut arm = Arm::built_in("ur5").unwrap();
            arm.joints[1].placement = Placement::from_xyz_rpy([0.0; 3], rpy_rad);
            assert_eq!(Kinematics::of(&arm).difference(&arm), None, "{rpy_rad:?}");
        }
    }

    #[test]
    fn what_differs_is_said() {
        let arm = Arm::built_in("ur5").unwrap();
        let own = Kinematics::of(&arm);
        let says = |change: &dyn Fn(&mut Arm)| {
            let mut other = arm.clone();
            change(&mut other);
            own.difference(&other).unwrap().to_string()
        };
        let shifted = says(&|arm| arm.joints[2].placement.translation_m.x += 1e-3);
        assert!(shifted.contains("joint 3") && shifted.contains("1.00e-3 m"), "{shifted}");
        let turn = Placement::from_xyz_rpy([0.0; 3], [0.0, 0.0, 0.5]);
        let turned = says(&|arm| arm.joints[4].placement = arm.joints[4].placement.compose(&turn));
        assert!(turned.contains("joint 5") && turned.contains("5.00e-1 rad"), "{turned}");
        assert!(says(&|arm| arm.gravity_m_s2.z = -9.7).contains("-9.81"));
        assert!(says(&|arm| arm.joints.truncate(5)).contains("6 joints, not 5"));
        let smoother = says(&|arm| arm.friction_epsilon_rad_s = 0.2);
        assert!(smoother.contains("friction_epsilon_rad_s is 0.02, not 0.2"), "{smoother}");
        // A result of an older program does not contain ε.
        let mut older = serde_json::to_value(&own).unwrap();
        older.as_object_mut().unwrap().remove("friction_epsilon_rad_s");
        let older: Kinematics = serde_json::from_value(older).unwrap();
        assert!(older.difference(&arm).is_none());
    }
}
