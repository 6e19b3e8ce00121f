//! The equations of two logs that share an arm, and the gains of its drives.

use nalgebra::{DMatrix, DVector};

use super::super::clustered::{Equations, solve};
use super::super::error::DiagnoseError;
use super::super::extension::Extension;
use super::super::image::Column;
use super::super::scene::Scene;
use super::super::setup::Setup;
use super::super::verdict::Estimate;
use super::super::whitening::{RunWhitening, Whitening};
use super::Shared;
use super::body::BODY;
use crate::base::BaseSet;
use crate::dynamics::Parameter;
use crate::identify::Regression;

/// Length of the blocks of time for the covariance, s.
const BLOCK_S: f64 = 2.0;
/// Most rows kept per joint and log.
const MOST_ROWS: usize = 8000;
/// Gauss–Newton steps for the gains and the body's other parameters together.
const STEPS: usize = 4;

/// Positions of the unknowns in the columns of the least-squares problem.
pub(super) struct Layout {
    pub(super) base: usize,
    /// Position of the body's first parameter.
    pub(super) body: usize,
    /// Position of the first change of friction; each joint has three, of Coulomb friction, viscous friction and
    /// offset.
    pub(super) friction: usize,
    /// Per joint, the base parameters that these three change.
    friction_base: Vec<[Option<usize>; 3]>,
    pub(super) count: usize,
}

impl Layout {
    pub(super) fn new(set: &BaseSet, extension: &Extension, joints: usize) -> Self {
        let base = set.rank();
        let effects: usize = extension.effects.iter().map(|e| e.coefficients.len()).sum();
        let body = base + effects;
        let friction = body + BODY;
        let friction_base = (0..joints)
            .map(|j| {
                [Parameter::Coulomb(j), Parameter::Viscous(j), Parameter::Offset(j)]
                    .map(|own| set.index_of(own))
            })
            .collect();
        Self { base, body, friction, friction_base, count: friction + 3 * joints }
    }

    /// Adds the columns of a body whose parameters are these `terms` of base parameters.
    pub(super) fn add_body(&self, e: &mut Equations, terms: &[Vec<f64>]) {
        for (c, terms) in terms.iter().enumerate() {
            let column = combination(&e.columns, terms);
            e.columns.set_column(self.body + c, &column);
        }
    }

    /// Adds the columns of the changes of friction.
    pub(super) fn add_friction_change(&self, e: &mut Equations) {
        for (c, base) in self.friction_base[e.joint].iter().enumerate() {
            if let Some(base) = base {
                let column = e.columns.column(*base).into_owned();
                e.columns.set_column(self.friction + 3 * e.joint + c, &column);
            }
        }
    }
}

/// Σ_k terms_k column_k of the base parameters' columns.
fn combination(columns: &DMatrix<f64>, terms: &[f64]) -> DVector<f64> {
    let mut sum = DVector::zeros(columns.nrows());
    for (k, term) in terms.iter().enumerate().filter(|(_, t)| **t != 0.0) {
        sum.axpy(*term, &columns.column(k), 1.0);
    }
    sum
}

pub(super) fn blocks(equations: &[Equations]) -> usize {
    equations.iter().flat_map(|e| &e.block_of).max().map_or(0, |b| b + 1)
}

/// Equations of the base parameters and effects along one log, restricted to samples in which the joint moves.
pub(super) fn equations(
    shared: &Shared,
    layout: &Layout,
    regression: &Regression,
    theta: &[f64],
    first_block: usize,
) -> Result<Vec<Equations>, DiagnoseError> {
    let Shared { setup: Setup { arm, set, options }, families, extension } = shared;
    let prepared = &regression.prepared;
    let problem = &regression.problem;
    let scene = extension.telling(families, Scene::new(arm, set, theta, prepared));
    let whitening = Whitening::filter_of(regression, options)?;
    let moving = RunWhitening::moving_rows(regression);
    let (n, periods) = (problem.samples, problem.periods);
    let thin = (n * periods).div_ceil(MOST_ROWS).max(1);
    let block_rows = ((BLOCK_S * problem.rate_hz) as usize).max(1);
    let effects = extension.effects.iter();
    let (laws, off): (Vec<_>, Vec<_>) = effects
        .map(|effect| (effect.columns(families, &scene), effect.off_columns(families, &scene)))
        .unzip();
    let on_joint = |j: usize, column: &Column| -> Vec<Vec<f64>> {
        let own = column.parts.iter().filter(|(joint, _)| *joint == j);
        let as_regressed = |y: &Vec<f64>| {
            whitening.as_ref().map_or_else(|| y.clone(), |whitening| whitening.as_regressed(y))
        };
        own.map(|(_, y)| as_regressed(y)).collect()
    };
    let mut out = Vec::with_capacity(problem.joints());
    for (j, panel) in problem.panels.iter().enumerate() {
        let rows: Vec<usize> =
            (0..n * periods).step_by(thin).filter(|row| moving[j][row % n]).collect();
        let mut columns = DMatrix::zeros(rows.len(), layout.count);
        for (base, x) in problem.plan.base_indices(j).zip(panel.x.chunks_exact(n)) {
            for (value, row) in columns.column_mut(base).iter_mut().zip(&rows) {
                *value = x[row % n];
            }
        }
        let mut first = layout.base;
        for (effect, law) in extension.effects.iter().zip(&laws) {
            // A single run has no columns of what a drive feeds forward.
            for (at, (column, _)) in (first..).zip(law) {
                for y in on_joint(j, column) {
                    for (value, row) in columns.column_mut(at).iter_mut().zip(&rows) {
                        *value = y[row % y.len()];
                    }
                }
            }
            first += effect.coefficients.len();
        }
        let mut torque_nm =
            DVector::from_iterator(rows.len(), rows.iter().map(|row| panel.y[*row]));
        for (column, b) in off.iter().flatten() {
            for y in on_joint(j, column) {
                for (value, row) in torque_nm.iter_mut().zip(&rows) {
                    *value -= b * y[row % y.len()];
                }
            }
        }
        out.push(Equations {
            joint: j,
            columns,
            torque_nm,
            block_of: rows.iter().map(|row| first_block + row / block_rows).collect(),
        });
    }
    Ok(out)
}

/// Scale 1/a_j of every joint's drive gain, where the body's mass is `known_kg`.
pub(super) fn joint_gains(
    all: &[Equations],
    layout: &Layout,
    joints: usize,
    body: &[f64],
    known_kg: f64,
    log: &str,
) -> Result<Vec<Estimate>, DiagnoseError> {
    let mut factors = vec![body[0] / known_kg; joints];
    // The body's other nine parameters, rescaled to what they are if the mass is the known one.
    let mut rest: Vec<f64> = body[1..].iter().map(|p| p * known_kg / body[0]).collect();
    let mut scales = Vec::new();
    for _ in 0..STEPS {
        let mut linear = all.to_vec();
        for (e, original) in linear.iter_mut().zip(all) {
            let columns = |c: usize| original.columns.column(layout.body + c);
            let mut torque = columns(0) * known_kg;
            for (c, value) in rest.iter().enumerate() {
                torque.axpy(*value, &columns(c + 1), 1.0);
                let scaled = columns(c + 1) * factors[e.joint];
                e.columns.set_column(layout.body + c + 1, &scaled);
            }
            e.columns.column_mut(layout.body).fill(0.0);
            let rows = e.columns.nrows();
            e.columns = std::mem::replace(&mut e.columns, DMatrix::zeros(0, 0)).resize(
                rows,
                layout.count + joints,
                0.0,
            );
            e.columns.set_column(layout.count + e.joint, &torque);
        }
        let solution = solve(&linear, joints, log)?;
        for (c, value) in rest.iter_mut().enumerate() {
            *value += solution.x[layout.body + c + 1];
        }
        scales.clear();
        for (j, factor) in factors.iter_mut().enumerate() {
            *factor = solution.x[layout.count + j];
            let slope = -factor.powi(-2);
            scales.push(solution.estimate(1.0 / *factor, layout.count + j, &[slope], ""));
        }
    }
    Ok(scales)
}
