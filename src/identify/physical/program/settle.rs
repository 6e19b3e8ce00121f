//! Sets entries of the solution that are zero exactly to zero.

use nalgebra::{Cholesky, DVector, Dyn};

use super::{ConeProgram, Constraint, Point};
use crate::identify::physical::cone::Cone;

impl ConeProgram {
    /// Sets entries of y that a constraint presses onto zero to zero, one by one, where that does not widen the
    /// `gap`: the iteration leaves round-off in them, which would be reported as a number. The other entries follow
    /// according to `stiffness`.
    pub(super) fn settle(
        &self,
        point: &mut Point,
        hessian: &Cholesky<f64, Dyn>,
        stiffness: &Cholesky<f64, Dyn>,
        mut gap: f64,
    ) {
        let mut settled = Vec::new();
        for (k, constraint) in self.constraints.iter().enumerate() {
            let Some(column) = constraint.non_negative() else { continue };
            if point.z[k][0] <= point.s[k][0] {
                continue;
            }
            let before = point.y.clone();
            let mut way = DVector::zeros(before.len());
            way[column] = 1.0;
            stiffness.solve_mut(&mut way);
            point.y.axpy(-before[column] / way[column], &way, 1.0);
            settled.push(column);
            settled.iter().for_each(|&zero| point.y[zero] = 0.0);
            point.update_s(self);
            let found = self.gap(point, &self.dual_residual(point), hessian);
            if found <= gap && point.margins(self).iter().all(|margin| *margin >= 0.0) {
                gap = found;
            } else {
                settled.pop();
                point.y = before;
                point.update_s(self);
            }
        }
    }
}

impl Constraint {
    /// The entry of y that the constraint keeps from being negative, where this is all the constraint states.
    fn non_negative(&self) -> Option<usize> {
        match (self.cone, &self.columns[..]) {
            (Cone::NonNegative, &[column]) if self.barrier == 0.0 && self.offset[0] == 0.0 => {
                Some(column)
            }
            _ => None,
        }
    }
}
