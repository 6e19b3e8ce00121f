//! The arm: a serial chain of revolute joints, each with a link, a drive and limits.

use nalgebra::{Matrix3, Rotation3, Vector3};

use super::inertia::LinkInertia;

/// A serial arm. Joint `i` (0-based) connects body `i − 1` (the base for `i = 0`) to body `i`.
///
/// Frame `i` is fixed in body `i`, with its origin on joint axis `i` and its z axis along that axis, so that
/// `R_i(q) = placement.rotation · Rot_z(q)` maps coordinates of frame `i` into those of its parent. Immutable once
/// built: algorithms take `&Arm` and a workspace.
#[derive(Debug, Clone, PartialEq)]
pub struct Arm {
    /// Name as given to `--robot`.
    pub name: String,
    /// Gravity in the base frame, m/s².
    pub gravity_m_s2: Vector3<f64>,
    /// Whether no file says so, and gravity was assumed.
    pub gravity_assumed: bool,
    /// ε of the regularised sign tanh(q̇/ε) of the paper's (3), rad/s.
    pub friction_epsilon_rad_s: f64,
    /// Whether identification fits a constant torque per joint, for the offset of the current sensor and for friction
    /// that differs between the two directions: yes for real arms, no for the simulated null model.
    pub torque_offsets: bool,
    /// Whether the drive gains (Nm/A) are a guess, about which users of logs in ampere are warned.
    pub drive_gains_assumed: bool,
    /// Joints from base to flange.
    pub joints: Vec<Joint>,
    /// What the arm must not touch: itself, the floor, boxes in the cell.
    pub clearance: Clearance,
}

/// One revolute joint with the body it carries and the drive that moves it.
#[derive(Debug, Clone, PartialEq)]
pub struct Joint {
    /// Name of the joint.
    pub name: String,
    /// Pose of the joint frame at q = 0 in the parent's joint frame.
    pub placement: Placement,
    /// Inertial parameters of the moved body about the joint frame.
    pub link: LinkInertia,
    /// Motor, gear and friction.
    pub drive: Drive,
    /// Limits of motion and torque.
    pub limits: Limits,
    /// What is known about the moved body before identification.
    pub bounds: LinkBounds,
    /// Which of these numbers no file states.
    pub assumed: Assumed,
}

/// Numbers of a joint that no file states, so that they were assumed. An export leaves them open again: written down,
/// they would look known to whoever reads them. (A URDF has to have a speed limit, and has the assumed one.)
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Assumed {
    /// The range of positions: the joint has no end stops.
    pub position: bool,
    /// The gear ratio.
    pub gear_ratio: bool,
    /// The torque constant.
    pub torque_constant: bool,
    /// The speed limit.
    pub velocity: bool,
    /// The acceleration limit.
    pub acceleration: bool,
}

/// Known bounds that a physically consistent estimate of a body must respect.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct LinkBounds {
    /// Smallest and largest mass, kg.
    pub mass_kg: Option<[f64; 2]>,
    /// Box that contains the centre of mass, in the joint frame: [low, high] of x, y, z, m.
    pub com_m: Option<[[f64; 2]; 3]>,
}

/// A rigid transform: `p_parent = rotation · p_child + translation_m`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// Child axes in parent coordinates.
    pub rotation: Matrix3<f64>,
    /// Child origin in parent coordinates, m.
    pub translation_m: Vector3<f64>,
}

impl Placement {
    /// From URDF-style fixed-axis roll, pitch, yaw (rad) and a translation (m).
    pub fn from_xyz_rpy(xyz_m: [f64; 3], rpy_rad: [f64; 3]) -> Self {
        let [r, p, y] = rpy_rad;
        Self {
            rotation: Rotation3::from_euler_angles(r, p, y).into_inner().map(snap),
            translation_m: Vector3::from(xyz_m),
        }
    }

    /// Roll, pitch and yaw of [`Self::from_xyz_rpy`], rad, from which the rotation is recovered to the last digits.
    ///
    /// At a pitch of ±π/2 only the sum or the difference of roll and yaw is determined: roll is computed from what
    /// remains of the rotation after yaw, whatever its value, is removed.
    pub fn rpy_rad(&self) -> [f64; 3] {
        let r = &self.rotation;
        let pitch = (-r[(2, 0)]).atan2(r[(0, 0)].hypot(r[(1, 0)]));
        let yaw = r[(1, 0)].atan2(r[(0, 0)]);
        let (sin, cos) = yaw.sin_cos();
        let roll = (sin * r[(0, 2)] - cos * r[(1, 2)]).atan2(cos * r[(1, 1)] - sin * r[(0, 1)]);
        [roll, pitch, yaw]
    }

    /// No rotation, no translation.
    pub fn identity() -> Self {
        Self { rotation: Matrix3::identity(), translation_m: Vector3::zeros() }
    }

    /// `self ∘ inner`: first `inner`, then `self`.
    pub fn compose(&self, inner: &Self) -> Self {
        Self {
            rotation: self.rotation * inner.rotation,
            translation_m: self.rotation * inner.translation_m + self.translation_m,
        }
    }

    /// This pose turned by `q_rad` about its own z axis: the pose of a joint frame at the joint angle `q_rad`.
    pub fn turned(&self, q_rad: f64) -> Self {
        let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), q_rad).into_inner();
        Self { rotation: self.rotation * turn, ..*self }
    }

    /// The transform that undoes this one.
    pub fn inverse(&self) -> Self {
        let rotation = self.rotation.transpose();
        Self { rotation, translation_m: -(rotation * self.translation_m) }
    }
}

/// Rotations by multiples of π/2 carry round-off of 6e-17 where a 0 or ±1 is meant. A structural
/// zero that is not exactly zero would blur the rank of the regressor, so such entries are snapped.
pub(super) fn snap(x: f64) -> f64 {
    if (x - x.round()).abs() < 4.0 * f64::EPSILON { x.round() } else { x }
}

/// Motor, gear and friction of one joint, all seen from the joint side.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Drive {
    /// Reflected rotor inertia i_G² C_M of the paper's (4), kg m².
    pub rotor_inertia_kg_m2: f64,
    /// Viscous friction rv of the paper's (2), Nm s/rad.
    pub viscous_nm_s_rad: f64,
    /// Coulomb friction rc of the paper's (2), Nm.
    pub coulomb_nm: f64,
    /// Gear ratio i_G.
    pub gear_ratio: f64,
    /// Motor torque constant k, Nm/A at the motor shaft.
    pub torque_constant_nm_a: f64,
}

impl Drive {
    /// i_G·k: joint torque per ampere, Nm/A.
    pub fn gain_nm_a(&self) -> f64 {
        self.gear_ratio * self.torque_constant_nm_a
    }
}

/// Limits of one joint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Limits {
    /// Lowest and highest angle, rad.
    pub position_rad: [f64; 2],
    /// Largest speed, rad/s.
    pub velocity_rad_s: f64,
    /// Largest acceleration, rad/s².
    pub acceleration_rad_s2: f64,
    /// Largest drive torque at the joint, Nm; infinite if it is unknown.
    pub torque_nm: f64,
}

/// A torque limit that stands for an unknown one in formats that require a number: simulators take 0 literally.
pub(super) const UNKNOWN_TORQUE_NM: f64 = 1e9;

/// Collision geometry: capsules on the bodies, the pairs to keep apart, and the floor.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Clearance {
    /// Capsules fixed in bodies.
    pub capsules: Vec<Capsule>,
    /// Pairs of indices into `capsules` whose distance is watched.
    pub pairs: Vec<[usize; 2]>,
    /// Height of the floor in the base frame, m; `None`: no floor.
    pub floor_z_m: Option<f64>,
    /// Boxes that stand in the cell.
    pub boxes: Vec<CellBox>,
}

/// A box in the cell with its edges along the axes of the base frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CellBox {
    /// Corner with the smallest coordinates, m.
    pub low_m: Vector3<f64>,
    /// Corner with the largest coordinates, m.
    pub high_m: Vector3<f64>,
}

/// A capsule fixed in a body: all points within a radius of a segment.
#[derive(Debug, Clone, PartialEq)]
pub struct Capsule {
    /// Name in messages and reports.
    pub name: String,
    /// 0 = base, i = body of joint i (counted from 1, so that 1…N are the moving bodies).
    pub body: usize,
    /// One end of the segment, in the body's joint frame (the base frame for body 0), m.
    pub from_m: Vector3<f64>,
    /// The other end, in the same frame, m.
    pub to_m: Vector3<f64>,
    /// Radius, m.
    pub radius_m: f64,
}

/// A point nearer to a joint axis than this, m, does not move as the joint turns; an axis tilted by less, rad, is
/// vertical.
pub(crate) const ON_AXIS: f64 = 1e-9;

impl Clearance {
    /// Names of the capsules that are in no pair: the arm is not kept clear of them.
    pub fn unpaired(&self) -> impl Iterator<Item = &str> {
        (0..self.capsules.len())
            .filter(move |k| !self.pairs.iter().any(|pair| pair.contains(k)))
            .map(move |k| self.capsules[k].name.as_str())
    }
}

impl Arm {
    /// Number of joints N.
    pub fn dof(&self) -> usize {
        self.joints.len()
    }

    /// The regularised sign tanh(q̇/ε) of dry friction at a velocity, rad/s: the paper's (3).
    pub fn friction_sign(&self, qd_rad_s: f64) -> f64 {
        (qd_rad_s / self.friction_epsilon_rad_s).tanh()
    }

    /// Whether the first joint turns about the vertical, so that its motion brings nothing nearer to the floor.
    pub fn is_upright(&self) -> bool {
        self.joints.first().is_some_and(|first| {
            let axis = first.placement.rotation.column(2);
            axis.x.hypot(axis.y) < ON_AXIS
        })
    }

    /// Whether the circle that a capsule of the base or the first body sweeps about a vertical first axis lies within
    /// the outline of a box seen from above. The box, such as a table under the arm, is then above or below the capsule
    /// at every angle.
    pub fn turns_over(&self, capsule: &Capsule, cell_box: &CellBox) -> bool {
        let Some(first) = self.joints.first().filter(|_| capsule.body <= 1 && self.is_upright())
        else {
            return false;
        };
        let axis_m = first.placement.translation_m;
        let ends = [capsule.from_m, capsule.to_m];
        let far = ends.iter().map(|end| end.x.hypot(end.y)).fold(0.0, f64::max);
        let reach_m = far + capsule.radius_m;
        let holds = |i: usize| {
            cell_box.low_m[i] <= axis_m[i] - reach_m && axis_m[i] + reach_m <= cell_box.high_m[i]
        };
        holds(0) && holds(1)
    }

    /// Pose of every joint frame in the base frame at configuration `q_rad` (length N).
    pub fn frames(&self, q_rad: &[f64]) -> Vec<Placement> {
        let mut pose = Placement::identity();
        self.joints
            .iter()
            .zip(q_rad)
            .map(|(joint, &q)| {
                pose = pose.compose(&joint.placement).turned(q);
                pose
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::{FRAC_PI_2, PI};

    use proptest::prelude::*;

    use super::*;

    proptest! {
        /// Also of placements that are composed to a pitch of π/2, to rounding, and close to it.
        #[test]
        fn angles_give_their_rotation_back(
            [roll, yaw] in [-PI..PI, -PI..PI],
            pitch in prop_oneof![-PI..PI, Just(FRAC_PI_2), Just(-FRAC_PI_2), Just(FRAC_PI_2 - 1e-9)],
            part in 0.0..1.0,
        ) {
            let of = |rpy_rad| Placement::from_xyz_rpy([0.0; 3], rpy_rad);
            let mount = of([0.0, part * pitch, yaw]);
            let rotation = mount.compose(&of([roll, (1.0 - part) * pitch, 0.0])).rotation;
            let back = of(Placement { rotation, translation_m: Vector3::zeros() }.rpy_rad()).rotation;
            // A few roundings, and entries snapped by 4 ε.
            prop_assert!((rotation - back).amax() < 1e-14, "{rotation} {back}");
        }
    }
}
