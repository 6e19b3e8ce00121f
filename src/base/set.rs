//! Finds the base parameters, the combinations of parameters that can be identified.

use std::fmt;

use nalgebra::{DMatrix, DVector};
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use thiserror::Error;

use super::parameterisation::{Parameterisation, Terms, evaluate};
use crate::dynamics::{Model, Parameter, ParameterLayout, Workspace, regressor};
use crate::number::significant;
use crate::robot::Arm;

/// Columns of a parameterisation that are independent for almost every motion, and the corresponding combinations of
/// parameters: the paper's (15).
#[derive(Debug, Clone, PartialEq)]
pub struct BaseSet {
    /// The parameterisation from which the columns were selected.
    pub parameterisation: Parameterisation,
    /// Independent columns, left to right: indices into the parameterisation.
    pub independent: Vec<usize>,
    /// One base parameter per independent column, as terms over the parameterisation: first the kept parameter
    /// (coefficient 1), then the parameters of dependent columns.
    pub combinations: Vec<Terms>,
    /// How clearly the rank was determined.
    pub gap: RankGap,
}

/// Smallest distance of an independent column, and largest of a dependent one, from the span of the columns before
/// it, relative to the column's length.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RankGap {
    /// Smallest ratio that counted as independent.
    pub smallest_independent: f64,
    /// The column that has this ratio: an index into the parameterisation; 0 if there is no independent column.
    pub weakest: usize,
    /// Largest ratio that counted as dependent; 0 if every column is independent.
    pub largest_dependent: f64,
}

/// A column that is independent only because of digits that the description of the arm may lack.
#[derive(Debug, Clone, PartialEq)]
pub struct NearlyDependent {
    /// Name of the column.
    pub column: String,
    /// Its relative distance from the columns before it.
    pub ratio: f64,
}

impl fmt::Display for NearlyDependent {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { column, ratio } = self;
        write!(
            f,
            "axes are nearly parallel, or nearly meet, perhaps only by the digits printed: column {column} stands only {ratio:.1e} of its \
             length off the columns before it, and hardly any motion tells it from them; if they are parallel, write the angles in full \
             (1.5707963 for a right angle)"
        )
    }
}

/// The rank of the regressor cannot be determined, because a column may be dependent except for rounding errors.
#[derive(Debug, Clone, PartialEq, Error)]
#[error(
    "the rank is not clear: column {column} stands {ratio:.2e} of its length off the columns before \
     it, between rounding ({DEPENDENT_BELOW:.0e}) and independence ({INDEPENDENT_ABOVE:.0e}); look \
     for nearly parallel or nearly intersecting axes in the kinematics"
)]
pub struct AmbiguousRank {
    /// Name of the column.
    pub column: String,
    /// Its relative distance.
    pub ratio: f64,
}

/// Relative distance below which a column is dependent: rounding of 1200 rows at double precision stays under 1e-13.
const DEPENDENT_BELOW: f64 = 1e-10;
/// Relative distance above which a column is independent. Between the two thresholds the answer would be a guess.
const INDEPENDENT_ABOVE: f64 = 1e-7;
/// Relative distance below which an independent column hangs on digits: arms whose axes are neither parallel nor at
/// right angles have 0.1 and more, 1.57 in place of π/2 gives 1e-3.
const NEARLY_DEPENDENT_BELOW: f64 = 2e-3;
/// Number of random states, with one row per joint each: far more rows than columns.
const STATES: usize = 200;
/// Coefficients below this are rounding and are left out.
const NEGLIGIBLE: f64 = 1e-9;

impl BaseSet {
    /// Finds the independent columns of `parameterisation` from left to right.
    ///
    /// The regressor is stacked over random states (with a fixed seed, so that the answer is always the same). For
    /// each column in turn, Gram–Schmidt with reorthogonalisation computes the part outside the span of the columns
    /// kept so far. A column is kept when that part is more than rounding. Otherwise its coefficients β on the kept
    /// columns state to which base parameters its parameter contributes: p_B,k = p_k + Σ_d β_kd p_d.
    pub fn find(arm: &Arm, parameterisation: Parameterisation) -> Result<Self, AmbiguousRank> {
        let stacked = random_regressor(arm, &parameterisation);
        let mut directions: Vec<DVector<f64>> = Vec::new();
        let mut triangle: Vec<Vec<f64>> = Vec::new();
        let mut independent: Vec<usize> = Vec::new();
        let mut combinations: Vec<Terms> = Vec::new();
        let mut gap =
            RankGap { smallest_independent: f64::INFINITY, weakest: 0, largest_dependent: 0.0 };
        let longest = stacked.column_iter().map(|c| c.norm()).fold(0.0, f64::max);
        for (c, column) in stacked.column_iter().enumerate() {
            let length = column.norm();
            // A column of rounding errors (a structural zero) has no direction.
            if length < DEPENDENT_BELOW * longest {
                continue;
            }
            let mut rest = column.into_owned();
            let mut coordinates = vec![0.0; directions.len()];
            for _ in 0..2 {
                for (direction, coordinate) in directions.iter().zip(&mut coordinates) {
                    let along = direction.dot(&rest);
                    rest.axpy(-along, direction, 1.0);
                    *coordinate += along;
                }
            }
            let outside = rest.norm();
            let ratio = outside / length;
            if ratio > INDEPENDENT_ABOVE {
                if ratio < gap.smallest_independent {
                    (gap.smallest_independent, gap.weakest) = (ratio, c);
                }
                coordinates.push(outside);
                triangle.push(coordinates);
                directions.push(rest / outside);
                independent.push(c);
                combinations.push(vec![(c, 1.0)]);
            } else if ratio < DEPENDENT_BELOW {
                gap.largest_dependent = gap.largest_dependent.max(ratio);
                let beta = back_substitute(&triangle, coordinates);
                for (combination, beta) in combinations.iter_mut().zip(beta) {
                    if beta.abs() > NEGLIGIBLE {
                        combination.push((c, beta));
                    }
                }
            } else {
                return Err(AmbiguousRank { column: parameterisation.names[c].clone(), ratio });
            }
        }
        Ok(Self { parameterisation, independent, combinations, gap })
    }

    /// Number of base parameters.
    pub fn rank(&self) -> usize {
        self.independent.len()
    }

    /// The independent column that is nearest to the others, if it is nearly one of them.
    pub fn nearly_dependent(&self) -> Option<NearlyDependent> {
        let RankGap { smallest_independent: ratio, weakest, .. } = self.gap;
        (ratio < NEARLY_DEPENDENT_BELOW).then(|| NearlyDependent {
            column: self.parameterisation.names[weakest].clone(),
            ratio,
        })
    }

    /// Base parameters whose kept column is a first moment of a body of an arm with the `layout`.
    pub fn first_moments(&self, layout: &ParameterLayout) -> impl Iterator<Item = usize> {
        let is_first_moment =
            |&k: &usize| matches!(layout.parameter(self.column(k)[0].0), Parameter::Body(_, 1..=3));
        (0..self.rank()).filter(is_first_moment)
    }

    /// Name of base parameter `k`, which is that of its kept column.
    pub fn name(&self, k: usize) -> &str {
        &self.parameterisation.names[self.independent[k]]
    }

    /// The base parameter whose kept column is that of the standard parameter `parameter`; `None` if there is none. A
    /// parameter of a reduced set may have the same name and refer to another frame: that one is not meant.
    pub fn index_of(&self, parameter: Parameter) -> Option<usize> {
        let column = [(self.parameterisation.layout.index(parameter), 1.0)];
        (0..self.rank()).find(|&k| *self.column(k) == column)
    }

    /// SI unit of base parameter `k`.
    pub fn unit(&self, k: usize) -> &'static str {
        self.parameterisation.units[self.independent[k]]
    }

    /// The whole combination as text, such as `A3 - C3 + 0.1539 m4`.
    pub fn formula(&self, k: usize) -> String {
        let mut text = String::new();
        for (position, &(index, coefficient)) in self.combinations[k].iter().enumerate() {
            let sign = match (position, coefficient < 0.0) {
                (0, _) => "",
                (_, true) => " - ",
                (_, false) => " + ",
            };
            text.push_str(sign);
            if (coefficient.abs() - 1.0).abs() > NEGLIGIBLE {
                text.push_str(&in_words(coefficient.abs()));
                text.push(' ');
            }
            text.push_str(&self.parameterisation.names[index]);
        }
        text
    }

    /// Values of the base parameters for an arm with the given standard parameters.
    pub fn values(&self, standard: &[f64]) -> Vec<f64> {
        let parameters = self.parameterisation.values(standard);
        self.combinations.iter().map(|terms| evaluate(terms, &parameters)).collect()
    }

    /// Column `k` of the base regressor as terms over the standard regressor's columns.
    pub fn column(&self, k: usize) -> &Terms {
        &self.parameterisation.to_standard[self.independent[k]]
    }
}

/// A coefficient with four significant digits, without trailing zeros.
fn in_words(coefficient: f64) -> String {
    let text = significant(coefficient, 4);
    match text.contains('.') && !text.contains('e') {
        true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
        false => text,
    }
}

/// Θ L over random states: |q| ≤ π rad, |q̇| ≤ π rad/s, |q̈| ≤ 10 rad/s².
fn random_regressor(arm: &Arm, parameterisation: &Parameterisation) -> DMatrix<f64> {
    let model = Model::new(arm);
    let n = model.dof();
    let mut ws = Workspace::new(&model);
    let mut rng = ChaCha8Rng::seed_from_u64(0x00ba_5e5e);
    let mut uniform = |bound: f64| -> Vec<f64> {
        (0..n).map(|_| bound * (2.0 * rng.random::<f64>() - 1.0)).collect()
    };
    let mut stacked = DMatrix::zeros(STATES * n, parameterisation.count());
    for state in 0..STATES {
        let pi = std::f64::consts::PI;
        let (q, qd, qdd) = (uniform(pi), uniform(pi), uniform(10.0));
        let theta = regressor(&model, &mut ws, &q, &qd, &qdd);
        for (c, terms) in parameterisation.to_standard.iter().enumerate() {
            let mut column = stacked.column_mut(c);
            let mut rows = column.rows_mut(state * n, n);
            for &(standard, coefficient) in terms {
                rows.axpy(coefficient, &theta.column(standard), 1.0);
            }
        }
    }
    stacked
}

/// Solves R β = c for β, with R given by its columns.
fn back_substitute(columns: &[Vec<f64>], mut c: Vec<f64>) -> Vec<f64> {
    for k in (0..c.len()).rev() {
        c[k] /= columns[k][k];
        let beta = c[k];
        for (row, value) in c[..k].iter_mut().enumerate() {
            *value -= columns[k][row] * beta;
        }
    }
    c
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The UR5 has three parallel axes; with right angles of three digits they are nearly so.
    #[test]
    fn an_angle_with_few_digits_makes_a_column_nearly_dependent() {
        let of = |right_angle: &str| {
            let text = include_str!("../../robots/ur5.toml");
            let text = text.replace("1.5707963267948966", right_angle);
            let arm = Arm::from_toml(&text, "x.toml").unwrap();
            BaseSet::find(&arm, Parameterisation::full(arm.dof(), false)).unwrap()
        };
        for right_angle in ["1.5707963267948966", "1.5708"] {
            let set = of(right_angle);
            assert_eq!((set.rank(), set.nearly_dependent()), (52, None));
        }
        for right_angle in ["1.57", "1.5709"] {
            let set = of(right_angle);
            let found = set.nearly_dependent().unwrap();
            assert_eq!(set.rank(), 53);
            assert!((0..53).any(|k| set.name(k) == found.column), "{found}");
        }
    }

    /// The z axis of the paper's frame 2 is another one than that of the joint frame, so that its mz2 is another
    /// parameter. Drives have no frame.
    #[test]
    fn a_parameter_in_another_frame_is_not_found_by_its_name() {
        let arm = Arm::built_in("ur5").unwrap();
        let layout = ParameterLayout::new(6);
        let full = BaseSet::find(&arm, Parameterisation::full(6, false)).unwrap();
        for k in 0..full.rank() {
            let (standard, _) = full.column(k)[0];
            assert_eq!(full.index_of(layout.parameter(standard)), Some(k));
        }
        let paper = BaseSet::find(&arm, Parameterisation::paper(&arm).unwrap()).unwrap();
        assert!((0..paper.rank()).any(|k| paper.name(k) == "mz2"));
        assert_eq!(paper.index_of(Parameter::Body(1, 3)), None);
        let viscous = paper.index_of(Parameter::Viscous(5)).unwrap();
        assert_eq!(paper.name(viscous), "rv6");
    }

    #[test]
    fn coefficients_have_no_zeros_at_their_end() {
        let words = [0.425, 2.0, 0.999_96, 1234.56, 150.0, 0.000_012_345_6].map(in_words);
        assert_eq!(words, ["0.425", "2", "1", "1235", "150", "1.235e-5"]);
    }
}
