//! The linear problem: base regressor and torque, joint by joint.

use crate::base::ColumnPlan;
use crate::dynamics::{Lanes, Model, Motion, RegressorBlock, Workspace};
use crate::robot::JointSignals;

/// The domain over which the rows of a [`Problem`] run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Domain {
    /// One row per sample.
    Time,
    /// Row 0 is the mean of a period; rows 2k − 1 and 2k are √2 times the real and imaginary part of its k-th Fourier
    /// coefficient (unitary: white noise keeps its variance).
    Frequency,
}

/// y = X θ + e for every joint, sampled at `rate_hz`: the paper's (16), row-sorted by joint.
///
/// A motion that repeats P times has one X for all periods and P columns of torque; a single run
/// has P = 1. Memory is that of X: joints × their columns × samples.
#[derive(Debug, Clone)]
pub struct Problem {
    /// Which base parameters each joint's equation contains.
    pub plan: ColumnPlan,
    /// Rows of X per joint, n: samples of one period, or two per harmonic.
    pub samples: usize,
    /// Repetitions P.
    pub periods: usize,
    /// Samples per second.
    pub rate_hz: f64,
    /// Domain over which the rows run.
    pub domain: Domain,
    /// One per joint.
    pub panels: Vec<Panel>,
}

/// One joint's equation.
#[derive(Debug, Clone, Default)]
pub struct Panel {
    /// Columns of X one after the other: (columns of the joint) × n.
    pub x: Vec<f64>,
    /// Torque of period 1, 2, …, P, Nm: P × n.
    pub y: Vec<f64>,
}

/// Samples per regressor block: 128 × 228 columns × 8 B = 0.2 MB, well inside a level-2 cache.
const BLOCK: usize = 128;

/// Scratch for assembling problems of one model.
pub struct Assembler {
    block: RegressorBlock,
    workspace: Workspace<Lanes>,
    columns: Vec<f64>,
}

impl Assembler {
    /// Scratch for `model`.
    pub fn new(model: &Model) -> Self {
        Self {
            block: RegressorBlock::new(model, BLOCK),
            workspace: Workspace::new(model),
            columns: Vec::new(),
        }
    }

    /// Fills `problem` with Θ_B of `motion` (n samples) and `torque_nm` (P·n samples).
    pub fn assemble(
        &mut self,
        problem: &mut Problem,
        model: &Model,
        motion: &Motion,
        torque_nm: &JointSignals,
    ) {
        let n = motion.samples();
        problem.samples = n;
        problem.periods = torque_nm.samples() / n;
        for (joint, panel) in problem.panels.iter_mut().enumerate() {
            panel.x.resize(problem.plan.base_indices(joint).len() * n, 0.0);
            panel.y.clear();
            panel.y.extend_from_slice(torque_nm.joint(joint));
        }
        for start in (0..n).step_by(BLOCK) {
            let rows = BLOCK.min(n - start);
            self.block.fill(model, &mut self.workspace, motion, start..start + rows);
            for (joint, panel) in problem.panels.iter_mut().enumerate() {
                self.columns.resize(problem.plan.base_indices(joint).len() * rows, 0.0);
                problem.plan.copy_columns(&self.block, joint, &mut self.columns);
                let targets = panel.x.chunks_exact_mut(n);
                for (target, source) in targets.zip(self.columns.chunks_exact(rows)) {
                    target[start..start + rows].copy_from_slice(source);
                }
            }
        }
    }
}

impl Problem {
    /// An empty problem over `plan`'s columns.
    pub fn new(plan: ColumnPlan, rate_hz: f64) -> Self {
        let panels = vec![Panel::default(); plan.joints()];
        Self { plan, samples: 0, periods: 0, rate_hz, domain: Domain::Time, panels }
    }

    /// Number of joints.
    pub fn joints(&self) -> usize {
        self.panels.len()
    }

    /// Number of base parameters.
    pub fn parameters(&self) -> usize {
        self.plan.base_count()
    }

    /// Number of equations of joint `joint`: rows of all periods, except those with weight zero.
    pub fn equations(&self, joint: usize) -> usize {
        let Panel { x, y } = &self.panels[joint];
        let n = self.samples;
        let is_zero = |values: &[f64], k: usize| values[k..].iter().step_by(n).all(|v| *v == 0.0);
        (0..n).filter(|&k| !(is_zero(y, k) && is_zero(x, k))).count() * self.periods
    }

    /// Turns P periods with one X into one run with X repeated P times.
    pub fn unfold(&mut self) {
        let (n, periods) = (self.samples, self.periods);
        for panel in &mut self.panels {
            panel.x = panel.x.chunks_exact(n).flat_map(|column| column.repeat(periods)).collect();
        }
        self.samples = n * periods;
        self.periods = 1;
    }

    /// Keeps every `factor`-th row of a single run.
    pub fn thin(&mut self, factor: usize) {
        for panel in &mut self.panels {
            let columns = panel.x.chunks_exact(self.samples);
            panel.x = columns.flat_map(|column| column.iter().step_by(factor).copied()).collect();
            panel.y = panel.y.iter().step_by(factor).copied().collect();
        }
        self.samples = self.samples.div_ceil(factor);
        self.rate_hz /= factor as f64;
    }

    /// Puts the rows of `others` below this problem's, one after the other; all of them single runs over the same
    /// columns.
    pub fn append(&mut self, others: &[Self]) {
        let samples = self.samples + others.iter().map(|other| other.samples).sum::<usize>();
        for (j, panel) in self.panels.iter_mut().enumerate() {
            let columns = self.plan.base_indices(j).len();
            let mut x = Vec::with_capacity(columns * samples);
            for c in 0..columns {
                x.extend_from_slice(&panel.x[c * self.samples..][..self.samples]);
                for other in others {
                    x.extend_from_slice(&other.panels[j].x[c * other.samples..][..other.samples]);
                }
            }
            panel.x = x;
            others.iter().for_each(|other| panel.y.extend_from_slice(&other.panels[j].y));
        }
        self.samples = samples;
    }

    /// X θ of joint `joint`, Nm, written into `out` (n values).
    pub fn predict(&self, joint: usize, theta: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        let columns = self.panels[joint].x.chunks_exact(self.samples);
        for (base, column) in self.plan.base_indices(joint).zip(columns) {
            let value = theta[base];
            out.iter_mut().zip(column).for_each(|(o, x)| *o += value * x);
        }
    }

    /// ‖y − X θ‖² of every joint over all periods, Nm².
    pub fn residual_squares(&self, theta: &[f64]) -> Vec<f64> {
        let mut predicted = vec![0.0; self.samples];
        (0..self.joints())
            .map(|joint| {
                self.predict(joint, theta, &mut predicted);
                let periods = self.panels[joint].y.chunks_exact(self.samples);
                periods.flat_map(|y| y.iter().zip(&predicted)).map(|(y, p)| (y - p).powi(2)).sum()
            })
            .collect()
    }

    /// y − X θ of all joints and periods, Nm: joints × P·n.
    pub fn residuals(&self, theta: &[f64]) -> JointSignals {
        let mut residual = JointSignals::zeros(self.joints(), self.samples * self.periods);
        let mut predicted = vec![0.0; self.samples];
        for joint in 0..self.joints() {
            self.predict(joint, theta, &mut predicted);
            let out = residual.joint_mut(joint);
            out.copy_from_slice(&self.panels[joint].y);
            for period in out.chunks_exact_mut(self.samples) {
                period.iter_mut().zip(&predicted).for_each(|(r, p)| *r -= p);
            }
        }
        residual
    }
}
