//! The information matrix of a motion (the paper's (16)) and its derivative by the motion.

use faer::linalg::matmul::matmul;
use faer::{Accum, Mat, MatRef, Par};

use crate::base::{BaseSet, ColumnPlan};
use crate::dynamics::{
    AdjointWorkspace, Lanes, Model, Motion, Parameter, ParameterLayout, RegressorBlock, Workspace,
};

/// The information matrix Λ = Σ_t Θ_B(t)ᵀ W Θ_B(t), with one weight per joint, W = diag(w). w = 1 gives the paper's own
/// criterion; w_j = 1/σ_j² gives the information about the parameters in data with torque noise σ_j.
#[derive(Debug, Clone)]
pub struct Information {
    model: Model,
    plan: ColumnPlan,
    weights: Vec<f64>,
    /// Non-zero standard parameters of the nominal model, for its torque.
    nominal: Vec<(Parameter, f64)>,
}

/// Scratch for motions of one length.
#[derive(Debug, Clone)]
pub struct InformationWorkspace {
    forward: Workspace<Lanes>,
    backward: AdjointWorkspace<Lanes>,
    regressor: RegressorBlock,
    adjoint: RegressorBlock,
    /// For every joint, its visible base columns, samples × columns.
    columns: Vec<Mat<f64>>,
}

impl Information {
    /// Information about the parameters of `base` with the weights `weights` (one per joint).
    pub fn new(model: &Model, base: &BaseSet, weights: Vec<f64>) -> Self {
        let layout = ParameterLayout::new(model.dof());
        let nominal = model
            .standard_parameters()
            .into_iter()
            .enumerate()
            .filter(|&(_, value)| value != 0.0)
            .map(|(index, value)| (layout.parameter(index), value))
            .collect();
        Self { model: model.clone(), plan: ColumnPlan::new(model, base), weights, nominal }
    }

    /// Scratch for motions of `samples` samples.
    pub fn workspace(&self, samples: usize) -> InformationWorkspace {
        InformationWorkspace {
            forward: Workspace::new(&self.model),
            backward: AdjointWorkspace::new(&self.model),
            regressor: RegressorBlock::new(&self.model, samples),
            adjoint: RegressorBlock::new(&self.model, samples),
            columns: (0..self.plan.joints())
                .map(|joint| Mat::zeros(samples, self.plan.columns(joint).len()))
                .collect(),
        }
    }

    /// Computes Λ per sample, Σ_t Θᵀ W Θ / N, a symmetric rank × rank matrix, and writes the torque of the nominal
    /// model into `torque_nm[joint · N + sample]`.
    pub fn evaluate(
        &self,
        ws: &mut InformationWorkspace,
        motion: &Motion,
        torque_nm: &mut [f64],
    ) -> Mat<f64> {
        let samples = motion.samples();
        ws.regressor.fill(&self.model, &mut ws.forward, motion, 0..samples);
        let mut information = Mat::<f64>::zeros(self.plan.base_count(), self.plan.base_count());
        for joint in 0..self.plan.joints() {
            let visible = self.plan.columns(joint);
            let torque = &mut torque_nm[joint * samples..(joint + 1) * samples];
            torque.fill(0.0);
            for &(parameter, value) in &self.nominal {
                add_column(torque, ws.regressor.column(joint, parameter), value);
            }
            let columns = &mut ws.columns[joint];
            for (c, column) in visible.iter().enumerate() {
                let target = columns.col_as_slice_mut(c);
                target.fill(0.0);
                for &(parameter, coefficient) in &column.terms {
                    add_column(target, ws.regressor.column(joint, parameter), coefficient);
                }
            }
            let mut gram = Mat::<f64>::zeros(visible.len(), visible.len());
            let weight = self.weights[joint] / samples as f64;
            let columns: MatRef<f64> = columns.as_ref();
            matmul(&mut gram, Accum::Replace, columns.transpose(), columns, weight, Par::Seq);
            for (c, column) in visible.iter().enumerate() {
                for (r, row) in visible.iter().enumerate() {
                    information[(row.base, column.base)] += gram[(r, c)];
                }
            }
        }
        information
    }

    /// Writes into `bar` the derivatives, by q, q̇ and q̈, of tr(G Λ) + Σ_jt `torque_weights`·τ_j(t) for a symmetric G.
    /// Λ and τ are those of the last [`evaluate`](Self::evaluate), which must have been of the same motion.
    ///
    /// tr(G dΛ) = Σ_j (2 w_j/N) ⟨Θ_j G, dΘ_j⟩, so the weights on the regressor are B_j = (2 w_j/N) Θ_j G.
    pub fn pull_back(
        &self,
        ws: &mut InformationWorkspace,
        motion: &Motion,
        g: &Mat<f64>,
        torque_weights: &[f64],
        bar: &mut Motion,
    ) {
        let samples = motion.samples();
        ws.adjoint.set_samples(samples);
        for joint in 0..self.plan.joints() {
            let visible = self.plan.columns(joint);
            let n = visible.len();
            let g_seen = Mat::from_fn(n, n, |r, c| g[(visible[r].base, visible[c].base)]);
            let mut weights = Mat::<f64>::zeros(samples, n);
            let factor = 2.0 * self.weights[joint] / samples as f64;
            matmul(&mut weights, Accum::Replace, &ws.columns[joint], &g_seen, factor, Par::Seq);
            for (c, column) in visible.iter().enumerate() {
                for &(parameter, coefficient) in &column.terms {
                    if let Some(target) = ws.adjoint.column_mut(joint, parameter) {
                        for (target, weight) in target.iter_mut().zip(weights.col_as_slice(c)) {
                            *target += coefficient * weight;
                        }
                    }
                }
            }
            let on_torque = &torque_weights[joint * samples..(joint + 1) * samples];
            for &(parameter, value) in &self.nominal {
                if let Some(target) = ws.adjoint.column_mut(joint, parameter) {
                    for (target, weight) in target.iter_mut().zip(on_torque) {
                        *target += value * weight;
                    }
                }
            }
        }
        ws.adjoint.pull_back(&self.model, &mut ws.backward, motion, 0..samples, bar);
    }
}

fn add_column(target: &mut [f64], column: Option<&[f64]>, factor: f64) {
    for (target, value) in target.iter_mut().zip(column.unwrap_or_default()) {
        *target += factor * value;
    }
}
