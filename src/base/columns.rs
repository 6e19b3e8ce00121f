//! Which base columns each joint's equation contains.

use super::parameterisation::Terms;
use super::set::BaseSet;
use crate::dynamics::{Model, Motion, Parameter, ParameterLayout, RegressorBlock, Workspace};

/// For every joint, the base columns that are structurally non-zero in its row of Θ_B.
///
/// Joint j's torque does not depend on bodies before it, so that the wrist's equations have few
/// columns: storing and eliminating only these saves three quarters of the work.
#[derive(Debug, Clone)]
pub struct ColumnPlan {
    joints: Vec<Vec<PlannedColumn>>,
    base_count: usize,
}

/// A base column as one joint sees it.
#[derive(Debug, Clone)]
pub struct PlannedColumn {
    /// Index of the base parameter.
    pub base: usize,
    /// Terms over the standard regressor's columns, non-zero for this joint only.
    pub terms: Vec<(Parameter, f64)>,
}

impl ColumnPlan {
    /// The plan of a base set for an arm of `model`'s shape.
    pub fn new(model: &Model, set: &BaseSet) -> Self {
        let layout = ParameterLayout::new(model.dof());
        let mut block = RegressorBlock::new(model, 1);
        let at_rest = Motion::at_rest(model.dof(), 1);
        block.fill(model, &mut Workspace::new(model), &at_rest, 0..1);
        let present = |joint: usize, terms: &Terms| -> Vec<(Parameter, f64)> {
            terms
                .iter()
                .map(|&(index, coefficient)| (layout.parameter(index), coefficient))
                .filter(|&(parameter, _)| block.column(joint, parameter).is_some())
                .collect()
        };
        let joints = (0..model.dof())
            .map(|joint| {
                (0..set.rank())
                    .map(|base| PlannedColumn { base, terms: present(joint, set.column(base)) })
                    .filter(|column| !column.terms.is_empty())
                    .collect()
            })
            .collect();
        Self { joints, base_count: set.rank() }
    }

    /// The plan of a problem whose columns come from elsewhere: the base indices of every joint,
    /// ascending, out of `base_count`.
    pub fn explicit(joints: &[Vec<usize>], base_count: usize) -> Self {
        let column = |&base: &usize| PlannedColumn { base, terms: Vec::new() };
        let joints = joints.iter().map(|bases| bases.iter().map(column).collect()).collect();
        Self { joints, base_count }
    }

    /// The plan of equations in which that of joint j is mixed with those of all later joints.
    pub fn cumulative(&self) -> Self {
        let joints: Vec<Vec<usize>> = (0..self.joints())
            .map(|j| {
                let mut bases: Vec<usize> =
                    (j..self.joints()).flat_map(|i| self.base_indices(i)).collect();
                bases.sort_unstable();
                bases.dedup();
                bases
            })
            .collect();
        Self::explicit(&joints, self.base_count)
    }

    /// The plan of equations with all columns at every joint.
    pub fn full(&self) -> Self {
        let all: Vec<usize> = (0..self.base_count).collect();
        Self::explicit(&vec![all; self.joints()], self.base_count)
    }

    /// Number of joints.
    pub fn joints(&self) -> usize {
        self.joints.len()
    }

    /// Number of base parameters.
    pub fn base_count(&self) -> usize {
        self.base_count
    }

    /// The columns of joint `joint`'s equation, by ascending base parameter.
    pub fn columns(&self, joint: usize) -> &[PlannedColumn] {
        &self.joints[joint]
    }

    /// Base parameters in joint `joint`'s equation, ascending.
    pub fn base_indices(&self, joint: usize) -> impl ExactSizeIterator<Item = usize> {
        self.joints[joint].iter().map(|column| column.base)
    }

    /// Writes joint `joint`'s columns of the block, one after the other, into `out`
    /// (columns × samples values).
    pub fn copy_columns(&self, block: &RegressorBlock, joint: usize, out: &mut [f64]) {
        let samples = block.samples();
        for (column, out) in self.joints[joint].iter().zip(out.chunks_exact_mut(samples)) {
            let mut first = true;
            for &(parameter, coefficient) in &column.terms {
                let Some(source) = block.column(joint, parameter) else { continue };
                if first && coefficient == 1.0 {
                    out.copy_from_slice(source);
                } else {
                    for (o, s) in out.iter_mut().zip(source) {
                        *o = coefficient * s + if first { 0.0 } else { *o };
                    }
                }
                first = false;
            }
        }
    }
}
