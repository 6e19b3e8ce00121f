//! Whitens noise that is correlated between joints.

use std::ops::Range;

use nalgebra::DMatrix;

use crate::identify::covariance::correlations;
use crate::identify::fit::Fit;
use crate::identify::problem::Problem;

/// Weights and mixes the joints' equations so that the residuals of `fit` are uncorrelated between joints at each
/// instant (Zellner 1962, seemingly unrelated regressions), and writes them into `out`, which has the cumulative
/// plan.
pub fn decorrelate(problem: &Problem, fit: &Fit, out: &mut Problem) {
    let residuals = problem.residuals(&fit.theta);
    let joints = problem.joints();
    let products = DMatrix::from_fn(joints, joints, |i, k| {
        residuals.joint(i).iter().zip(residuals.joint(k)).map(|(a, b)| a * b).sum()
    });
    let weights: Vec<Vec<f64>> = fit.weights.iter().map(|w| vec![*w; problem.samples]).collect();
    mix(problem, &weights, &correlations(&products), out);
}

/// Least standard deviation of the part of a joint's noise that the other joints do not predict, over that of all its
/// noise. Below it, rows would be weighted by 10⁴ for what may be the rounding of a copied channel.
const ALL_BUT_ALIKE: f64 = 1e-4;

/// U, upper triangular, with U C Uᵀ = 1 for a correlation matrix C: row j mixes joint j only with the joints after
/// it, so that wrist equations keep their few columns. The identity where the noise of one joint equals a combination
/// of the others' to within [`ALL_BUT_ALIKE`].
fn decorrelation(correlation: &DMatrix<f64>) -> DMatrix<f64> {
    let n = correlation.nrows();
    let reversed = DMatrix::from_fn(n, n, |i, k| correlation[(n - 1 - i, n - 1 - k)]);
    let inverse = nalgebra::Cholesky::new(reversed)
        .filter(|factor| factor.l_dirty().diagonal().min() > ALL_BUT_ALIKE)
        .and_then(|factor| factor.l().try_inverse());
    match inverse {
        Some(inverse) => DMatrix::from_fn(n, n, |i, k| inverse[(n - 1 - i, n - 1 - k)]),
        None => DMatrix::identity(n, n),
    }
}

/// Equation j of `out` = Σ_{i ≥ j} U_ji · weight_i · equation i of `problem`, row by row, with U from the `correlation`
/// of the joints whose weight is not zero in that row; a row without weight stays zero. `weights[i]` has one entry per
/// row. `out` has the cumulative plan of `problem`.
pub fn mix(problem: &Problem, weights: &[Vec<f64>], correlation: &DMatrix<f64>, out: &mut Problem) {
    let n = problem.samples;
    let stretches = stretches(weights, correlation);
    out.samples = n;
    out.periods = problem.periods;
    out.rate_hz = problem.rate_hz;
    out.domain = problem.domain;
    for (j, target) in out.panels.iter_mut().enumerate() {
        let bases: Vec<usize> = out.plan.base_indices(j).collect();
        target.x.clear();
        target.x.resize(bases.len() * n, 0.0);
        target.y.clear();
        target.y.resize(problem.periods * n, 0.0);
        for i in j..problem.joints() {
            let source = &problem.panels[i];
            let add = |values: &[f64], out: &mut [f64]| {
                for Stretch { rows, u } in &stretches {
                    let factor = u[(j, i)];
                    if factor == 0.0 {
                        continue;
                    }
                    for k in rows.clone() {
                        out[k] += factor * weights[i][k] * values[k];
                    }
                }
            };
            for (base, column) in problem.plan.base_indices(i).zip(source.x.chunks_exact(n)) {
                let at = bases.partition_point(|b| *b < base);
                add(column, &mut target.x[at * n..(at + 1) * n]);
            }
            for (y, out) in source.y.chunks_exact(n).zip(target.y.chunks_exact_mut(n)) {
                add(y, out);
            }
        }
    }
}

/// Rows in which the same joints have weight, with their U.
struct Stretch {
    rows: Range<usize>,
    u: DMatrix<f64>,
}

fn stretches(weights: &[Vec<f64>], correlation: &DMatrix<f64>) -> Vec<Stretch> {
    let joints = weights.len();
    let rows: Vec<usize> = (0..weights.iter().map(Vec::len).min().unwrap_or(0)).collect();
    let is_used = |joint: usize, row: usize| weights[joint][row] != 0.0;
    let are_alike = |a: &usize, b: &usize| (0..joints).all(|j| is_used(j, *a) == is_used(j, *b));
    let stretch = |rows: &[usize]| {
        let used = |joint: usize| is_used(joint, rows[0]);
        let own = DMatrix::from_fn(joints, joints, |i, j| match i == j {
            true => 1.0,
            false if used(i) && used(j) => correlation[(i, j)],
            false => 0.0,
        });
        let mut u = decorrelation(&own);
        (0..joints).filter(|j| !used(*j)).for_each(|j| u[(j, j)] = 0.0);
        Stretch { rows: rows[0]..rows[0] + rows.len(), u }
    };
    rows.chunk_by(are_alike).map(stretch).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn mixed_joints_are_uncorrelated() {
        let c = DMatrix::from_fn(6, 6, |i, k| if i == k { 1.0 } else { 0.3 / (1 + i + k) as f64 });
        let u = decorrelation(&c);
        let one = &u * &c * u.transpose();
        assert!((one - DMatrix::identity(6, 6)).amax() < 1e-14);
        assert_eq!(u, u.upper_triangle());
    }

    /// The first joint is cut off before the others: it takes part in no row behind that, and theirs are mixed as if it
    /// did not exist.
    #[test]
    fn joints_without_weight_are_not_mixed() {
        let c = DMatrix::from_fn(3, 3, |i, k| if i == k { 1.0 } else { 0.5 });
        let weights = [vec![2.0, 2.0, 0.0], vec![1.0; 3], vec![1.0; 3]];
        let found = stretches(&weights, &c);
        assert_eq!(found.iter().map(|s| s.rows.clone()).collect::<Vec<_>>(), [0..2, 2..3]);
        assert_eq!(found[0].u, decorrelation(&c));
        let of_two = decorrelation(&c.view((1, 1), (2, 2)).into_owned());
        assert_eq!(found[1].u.view((1, 1), (2, 2)), of_two);
        assert!(found[1].u.row(0).iter().chain(found[1].u.column(0).iter()).all(|u| *u == 0.0));
        // A later joint that is cut off leaves an earlier one with the noise that it has.
        let later = stretches(&[vec![1.0], vec![0.0], vec![1.0]], &c);
        let u = &later[0].u;
        let row = u.row(0) * &c * u.row(0).transpose();
        assert!((row[(0, 0)] - 1.0).abs() < 1e-14, "{row}");
    }

    #[test]
    fn a_copy_of_another_joint_is_left_as_it_is() {
        assert_eq!(decorrelation(&DMatrix::from_element(2, 2, 1.0)), DMatrix::identity(2, 2));
    }
}
