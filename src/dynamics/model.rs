//! Constants of an arm for the algorithms of this chapter.

use nalgebra::Matrix3;

use super::real::Real;
use super::vector::Vec3;
use crate::robot::Arm;

/// Constants of the equations of motion (1): kinematics, gravity and standard parameters.
///
/// Immutable; every algorithm is `f(&Model, &mut Workspace, …)`.
#[derive(Debug, Clone)]
pub struct Model {
    pub(super) gravity: [f64; 3],
    pub(super) inverse_epsilon: f64,
    pub(super) bodies: Vec<Body>,
}

/// Constants of one joint and the body behind it.
#[derive(Debug, Clone)]
pub(super) struct Body {
    /// Row-major child-to-parent rotation at q = 0.
    rotation: [[f64; 3]; 3],
    /// Child origin in the parent frame, m.
    pub(super) origin: [f64; 3],
    /// The ten inertial parameters of the paper's (7).
    pub(super) inertial: [f64; 10],
    pub(super) rotor_inertia: f64,
    pub(super) viscous: f64,
    pub(super) coulomb: f64,
}

impl Model {
    /// The model with the arm's own parameters.
    pub fn new(arm: &Arm) -> Self {
        let rows = |m: &Matrix3<f64>| std::array::from_fn(|r| std::array::from_fn(|c| m[(r, c)]));
        Self {
            gravity: arm.gravity_m_s2.into(),
            inverse_epsilon: 1.0 / arm.friction_epsilon_rad_s,
            bodies: arm
                .joints
                .iter()
                .map(|joint| Body {
                    rotation: rows(&joint.placement.rotation),
                    origin: joint.placement.translation_m.into(),
                    inertial: joint.link.parameters,
                    rotor_inertia: joint.drive.rotor_inertia_kg_m2,
                    viscous: joint.drive.viscous_nm_s_rad,
                    coulomb: joint.drive.coulomb_nm,
                })
                .collect(),
        }
    }

    /// Number of joints N.
    pub fn dof(&self) -> usize {
        self.bodies.len()
    }

    /// ε of the regularised sign, rad/s.
    pub fn friction_epsilon_rad_s(&self) -> f64 {
        1.0 / self.inverse_epsilon
    }

    /// The regularised sign tanh(q̇/ε) of the paper's (3).
    #[inline(always)]
    pub fn friction_sign<T: Real>(&self, qd_rad_s: T) -> T {
        (qd_rad_s * self.inverse_epsilon).tanh()
    }

    /// Friction torque rv q̇ + rc tanh(q̇/ε) of joint `j`, Nm: the paper's (2).
    #[inline(always)]
    pub fn friction<T: Real>(&self, j: usize, qd_rad_s: T) -> T {
        let body = &self.bodies[j];
        qd_rad_s * body.viscous + self.friction_sign(qd_rad_s) * body.coulomb
    }

    /// All standard parameters in the order of [`super::ParameterLayout`], offsets zero.
    pub fn standard_parameters(&self) -> Vec<f64> {
        let mut p: Vec<f64> = self.bodies.iter().flat_map(|b| b.inertial).collect();
        p.extend(self.bodies.iter().map(|b| b.rotor_inertia));
        p.extend(self.bodies.iter().map(|b| b.viscous));
        p.extend(self.bodies.iter().map(|b| b.coulomb));
        p.extend(self.bodies.iter().map(|_| 0.0));
        p
    }
}

impl Body {
    /// Transforms a vector from the parent's frame into the body's: `Rz(−q) R₀ᵀ v`.
    #[inline(always)]
    pub(super) fn to_child<T: Real>(&self, (sin, cos): (T, T), v: Vec3<T>) -> Vec3<T> {
        let r = &self.rotation;
        let x = v.x * r[0][0] + v.y * r[1][0] + v.z * r[2][0];
        let y = v.x * r[0][1] + v.y * r[1][1] + v.z * r[2][1];
        let z = v.x * r[0][2] + v.y * r[1][2] + v.z * r[2][2];
        Vec3::new(cos * x + sin * y, cos * y - sin * x, z)
    }

    /// Transforms a vector from the body's frame into the parent's: `R₀ Rz(q) v`.
    #[inline(always)]
    pub(super) fn to_parent<T: Real>(&self, (sin, cos): (T, T), v: Vec3<T>) -> Vec3<T> {
        let r = &self.rotation;
        let (x, y, z) = (cos * v.x - sin * v.y, sin * v.x + cos * v.y, v.z);
        Vec3::new(
            x * r[0][0] + y * r[0][1] + z * r[0][2],
            x * r[1][0] + y * r[1][1] + z * r[1][2],
            x * r[2][0] + y * r[2][1] + z * r[2][2],
        )
    }

    /// J·v with the paper's inertia matrix (8), about the joint frame's origin.
    #[inline(always)]
    pub(super) fn inertia_times<T: Real>(&self, v: Vec3<T>) -> Vec3<T> {
        let [_, _, _, _, a, b, c, d, e, f] = self.inertial;
        Vec3::new(
            v.x * a + v.y * -f + v.z * -e,
            v.x * -f + v.y * b + v.z * -d,
            v.x * -e + v.y * -d + v.z * c,
        )
    }

    /// First moment mρ, kg m.
    pub(super) fn first_moment(&self) -> [f64; 3] {
        [self.inertial[1], self.inertial[2], self.inertial[3]]
    }
}
