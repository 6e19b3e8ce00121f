//! Tests whether the unconstrained estimate could be an arm.

use nalgebra::{Cholesky, DMatrix, DVector};

use super::cone::{Cone, svec};
use super::error::PhysicalError;
use super::program::{ConeProgram, Constraint, ProgramError};
use super::structure::{Structure, Subject};

/// Curvature, relative to that of the prior, that makes the linear program strictly convex.
const CURVATURE: f64 = 1e-9;
/// Wanted accuracy of the answer, relative to the prior.
const ACCURACY: f64 = 1e-6;

/// The largest t such that links with base parameters exactly `theta` exist of which every pseudo-inertia is at least
/// t times the prior's and every drive parameter at least t times its prior's size.
///
/// maximise t over y = y₀ + N w, K y₀ = θ, K N = 0.
pub(super) fn realisability(
    structure: &Structure,
    theta: &DVector<f64>,
) -> Result<f64, PhysicalError> {
    let null_space = null_space(structure);
    let dimension = null_space.ncols();
    let n = structure.unknowns();
    let (mut pulls, mut pull) = (DMatrix::zeros(n, n), DVector::zeros(n));
    structure.add_pulls(1.0, &mut pulls, &mut pull);
    let curved = null_space.tr_mul(&(&pulls * &null_space));
    // y₀ is the point closest to the prior. t is then of the order of one, even where θ changes a light link's mass
    // by thousands of its own.
    let mut particular = structure.with_base(theta);
    let to_prior = null_space.tr_mul(&(pull - &pulls * &particular));
    let factor = Cholesky::new(curved.clone()).ok_or(ProgramError::NotConvex)?;
    particular += &null_space * factor.solve(&to_prior);
    let mut hessian = DMatrix::zeros(dimension + 1, dimension + 1);
    hessian.view_mut((0, 0), (dimension, dimension)).copy_from(&(CURVATURE * curved));
    hessian[(dimension, dimension)] = CURVATURE;
    let mut linear = DVector::zeros(dimension + 1);
    linear[dimension] = 1.0;
    // Bounds that a user gives say what links he has, not what links can be.
    let is_physics = |subject: &Subject| matches!(subject, Subject::Link(_) | Subject::Drive(_));
    let constraints = structure.constraints.iter().zip(&structure.subjects);
    let constraints: Vec<Constraint> = constraints
        .filter(|(_, subject)| is_physics(subject))
        .map(|(constraint, subject)| {
            let unit = match constraint.cone {
                Cone::NonNegative => DVector::from_element(1, 1.0),
                Cone::Semidefinite => {
                    DVector::from_column_slice(svec(&nalgebra::Matrix4::identity()).as_slice())
                }
            };
            along(constraint, &particular, &null_space, &unit, matches!(subject, Subject::Link(_)))
        })
        .collect();
    let mut start = DVector::zeros(dimension + 1);
    let worst = constraints.iter().map(|c| c.margin(&start)).fold(f64::INFINITY, f64::min);
    start[dimension] = worst - 1.0;
    let centre = DVector::zeros(dimension + 1);
    let program = ConeProgram { hessian, linear, centre, constraints };
    let solution = program.solve(start, 0.0, ACCURACY)?;
    Ok(solution.y[dimension])
}

/// A basis N of the null space of K.
fn null_space(structure: &Structure) -> DMatrix<f64> {
    let map = &structure.base_map;
    let kept = structure.kept();
    let free: Vec<usize> = (0..structure.unknowns()).filter(|k| !kept.contains(k)).collect();
    let mut null_space = DMatrix::zeros(structure.unknowns(), free.len());
    for (column, &d) in free.iter().enumerate() {
        null_space[(d, column)] = 1.0;
        for (row, &k) in kept.iter().enumerate() {
            null_space[(k, column)] = -map[(row, d)];
        }
    }
    null_space
}

/// The constraint in terms of (w, t): A (y₀ + N w) + b − t·unit ∈ K. The margin ε of a link is left out, because t
/// takes its place.
fn along(
    constraint: &Constraint,
    particular: &DVector<f64>,
    null_space: &DMatrix<f64>,
    unit: &DVector<f64>,
    is_link: bool,
) -> Constraint {
    let rows = |matrix: &DMatrix<f64>| matrix.select_rows(&constraint.columns);
    let inside = &constraint.map * rows(null_space);
    let columns: Vec<usize> =
        (0..null_space.ncols()).filter(|&c| inside.column(c).iter().any(|&a| a != 0.0)).collect();
    let mut map = inside.select_columns(&columns);
    let last = map.ncols();
    map = map.insert_column(last, 0.0);
    map.set_column(last, &-unit);
    let values = DVector::from_iterator(
        constraint.columns.len(),
        constraint.columns.iter().map(|&k| particular[k]),
    );
    let mut offset = &constraint.map * values;
    if !is_link {
        offset += &constraint.offset;
    }
    let columns = columns.into_iter().chain([null_space.ncols()]).collect();
    Constraint { cone: constraint.cone, columns, map, offset, barrier: 0.0 }
}
