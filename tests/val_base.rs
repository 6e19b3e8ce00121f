//! Base parameters against Pinocchio's regressor, SVD ranks and least squares (`golden/base.py`): every rank, every
//! combination and every coefficient for three arms.

use std::collections::BTreeMap;

use armid::base::{BaseSet, Parameterisation};
use armid::robot::Arm;
use serde::Deserialize;

#[derive(Deserialize)]
struct Golden {
    robot: String,
    /// Number of leading columns → rank.
    rank_of_first_columns: BTreeMap<usize, usize>,
    combinations: Vec<Combination>,
}

#[derive(Deserialize)]
struct Combination {
    name: String,
    terms: Vec<Term>,
}

#[derive(Deserialize)]
struct Term {
    parameter: String,
    coefficient: f64,
}

fn goldens() -> Vec<(Arm, Golden)> {
    let all: Vec<Golden> = serde_json::from_str(include_str!("golden/base.json")).unwrap();
    let arm_of = |name: &str| match name {
        "tilted" => crate::golden::tilted(),
        built_in => Arm::built_in(built_in).unwrap(),
    };
    all.into_iter().map(|golden| (arm_of(&golden.robot), golden)).collect()
}

/// The ranks of the UR arms are also the published ones: 36 inertial, 40 with rotors, 52 with friction, 58 with
/// offsets. Independent columns are selected from left to right, so that the rank of the leading columns is the number
/// of selected columns among them.
#[test]
fn the_ranks_of_all_leading_column_groups_are_those_of_the_singular_values() {
    for (arm, golden) in goldens() {
        let set = BaseSet::find(&arm, Parameterisation::full(arm.dof(), true)).unwrap();
        for (&columns, &rank) in &golden.rank_of_first_columns {
            let kept = set.independent.iter().filter(|&&c| c < columns).count();
            assert_eq!(kept, rank, "{}: first {columns} columns", arm.name);
        }
        if arm.name != "tilted" {
            let ranks: Vec<usize> = golden.rank_of_first_columns.values().copied().collect();
            assert_eq!(ranks, [36, 40, 52, 58], "{}", arm.name);
        }
    }
}

/// The tolerance of 2e-9 is twice the coefficient below which either program drops a term, and far above the rounding
/// errors of both (1e-13 for columns whose independent part is at least a sixth of them).
#[test]
fn every_combination_has_the_golden_terms_and_coefficients() {
    for (arm, golden) in goldens() {
        let set = BaseSet::find(&arm, Parameterisation::full(arm.dof(), true)).unwrap();
        assert_eq!(set.rank(), golden.combinations.len(), "{}", arm.name);
        for (k, expected) in golden.combinations.iter().enumerate() {
            assert_eq!(set.name(k), expected.name, "{} combination {k}", arm.name);
            let mut rest: BTreeMap<&str, f64> =
                expected.terms.iter().map(|t| (t.parameter.as_str(), t.coefficient)).collect();
            for &(index, coefficient) in &set.combinations[k] {
                let name = set.parameterisation.names[index].as_str();
                let golden = rest.remove(name).unwrap_or(0.0);
                assert!(
                    (coefficient - golden).abs() < 2e-9 * (1.0 + golden.abs()),
                    "{} {}: {name} {coefficient} instead of {golden}",
                    arm.name,
                    expected.name
                );
            }
            assert!(rest.values().all(|c| c.abs() < 2e-9), "{}: missing {rest:?}", expected.name);
        }
    }
}
