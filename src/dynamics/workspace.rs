//! Scratch memory of the algorithms, allocated once and reused for every sample.

use nalgebra::{DMatrix, DVector};

use super::model::Model;
use super::newton_euler::BodyMotion;
use super::real::Real;
use super::vector::Vec3;

/// Scratch for one arm and one scalar type. Its contents are meaningless between calls.
#[derive(Debug, Clone)]
pub struct Workspace<T> {
    pub(super) motion: Vec<BodyMotion<T>>,
    /// Force and moment about the frame's origin, in the body's frame.
    pub(super) wrench: Vec<(Vec3<T>, Vec3<T>)>,
    /// Jacobian of one body: per ancestor joint (angular, linear) velocity per unit joint speed.
    pub(super) jacobian: Vec<(Vec3<T>, Vec3<T>)>,
    pub(super) mass_matrix: DMatrix<f64>,
    pub(super) bias_nm: DVector<f64>,
    /// Zero accelerations, for the bias torque.
    pub(super) no_acceleration: Vec<T>,
}

impl<T: Real> Workspace<T> {
    /// Scratch for `model`.
    pub fn new(model: &Model) -> Self {
        let zero = T::constant(0.0);
        let v = Vec3::zero();
        let rest = BodyMotion { sin_cos: (zero, zero), omega: v, alpha: v, accel: v };
        let n = model.dof();
        Self {
            motion: vec![rest; n],
            wrench: vec![(v, v); n],
            jacobian: vec![(v, v); n],
            mass_matrix: DMatrix::zeros(n, n),
            bias_nm: DVector::zeros(n),
            no_acceleration: vec![zero; n],
        }
    }
}
