//! Equation (30) of the paper, entry by entry, and the ranks of the full model.

use std::collections::BTreeMap;

use armid::base::{BaseSet, Parameterisation};
use armid::robot::Arm;

/// The paper's (30) as printed: 33 combinations, coefficients to four significant digits.
const EQUATION_30: [&str; 21] = [
    "Ia1 + C1 + C2 + C3 + C4 + 0.01285 m2 + 0.01191 m5 + 0.01191 m6",
    "mz2",
    "A2 - C2",
    "Ia2 + B2",
    "m3 + m4 + m5 + m6",
    "mz3 + 0.3922 m4 + 0.3922 m5 + 0.3922 m6",
    "A3 - C3 + 0.1539 m4 + 0.1539 m5 + 0.1539 m6",
    "B3 + 0.1539 m4 + 0.1539 m5 + 0.1539 m6",
    "my4 + 0.1092 m5 + 0.1092 m6",
    "A4 + B5 - C4 + 0.008959 m6",
    "B4 + B5 + 0.008959 m6",
    "mz5 + 0.09465 m6",
    "A5 - B5 + C6",
    "C5 + C6",
    "my6",
    "A6 - C6",
    "B6",
    "Ia3",
    "Ia4",
    "Ia5",
    "Ia6",
];

/// A printed coefficient: its value, and half a unit of its last digit.
struct Printed {
    value: f64,
    half_unit: f64,
}

/// `name → coefficient as printed`.
fn parse(formula: &str) -> BTreeMap<String, Printed> {
    let parse_term = |term: &str| {
        let (sign, body) = term.strip_prefix('-').map_or((1.0, term), |rest| (-1.0, rest));
        let (digits, name) = body.split_once(' ').unwrap_or(("1", body));
        let decimals = digits.split_once('.').map_or(9, |(_, fraction)| fraction.len() as i32);
        let value = sign * digits.parse::<f64>().unwrap();
        (name.to_owned(), Printed { value, half_unit: 0.5 * 10f64.powi(-decimals) })
    };
    formula.replace(" - ", " + -").split(" + ").map(parse_term).collect()
}

#[test]
fn equation_30_is_reproduced_entry_by_entry_to_its_printed_digits() {
    let arm = Arm::built_in("ur5").unwrap();
    let set = BaseSet::find(&arm, Parameterisation::paper(&arm).unwrap()).unwrap();
    assert_eq!(set.parameterisation.count(), 44);
    assert_eq!(set.rank(), 33);
    let friction = (1..=6).flat_map(|j| [format!("rv{j}"), format!("rc{j}")]);
    let printed = EQUATION_30.iter().map(|s| s.to_string()).chain(friction);
    let name = |index: usize| set.parameterisation.names[index].clone();
    for formula in printed {
        let wanted = parse(&formula);
        let matches = |combination: &armid::base::Terms| {
            combination.len() == wanted.len()
                && combination.iter().all(|&(index, coefficient)| {
                    wanted.get(&name(index)).is_some_and(|printed| {
                        // 1e-9: 0.39225 and 0.10915 lie exactly between two printed values.
                        (coefficient - printed.value).abs() <= printed.half_unit + 1e-9
                    })
                })
        };
        assert!(
            set.combinations.iter().filter(|combination| matches(combination)).count() == 1,
            "{formula} is not among\n{}",
            (0..33).map(|k| set.formula(k)).collect::<Vec<_>>().join("\n")
        );
    }
}

#[test]
fn the_full_ur5_has_36_40_52_and_58_base_parameters() {
    let arm = Arm::built_in("ur5").unwrap();
    let full = Parameterisation::full(6, true);
    let rank_of_first = |columns: usize| {
        let mut part = full.clone();
        part.names.truncate(columns);
        part.units.truncate(columns);
        part.to_standard.truncate(columns);
        part.from_standard.truncate(columns);
        let set = BaseSet::find(&arm, part).unwrap();
        // Rounding errors and independent columns are at least five decades apart.
        assert!(set.gap.smallest_independent > 1e5 * set.gap.largest_dependent, "{:?}", set.gap);
        set.rank()
    };
    assert_eq!(rank_of_first(60), 36);
    assert_eq!(rank_of_first(66), 40);
    assert_eq!(rank_of_first(78), 52);
    assert_eq!(rank_of_first(84), 58);
}

#[test]
fn base_values_predict_the_torque_of_the_whole_arm() {
    use armid::dynamics::{Model, Workspace, inverse_dynamics, regressor};
    let arm = Arm::built_in("ur10e").unwrap();
    let model = Model::new(&arm);
    let set = BaseSet::find(&arm, Parameterisation::full(6, false)).unwrap();
    let values = set.values(&model.standard_parameters());
    let mut ws = Workspace::new(&model);
    let (q, qd, qdd) =
        ([0.3, -1.2, 0.8, 2.0, -0.7, 1.1], [1.0, -0.5, 0.7, 0.2, -1.4, 2.0], [2.0; 6]);
    let theta = regressor(&model, &mut ws, &q, &qd, &qdd);
    let mut torque = [0.0; 6];
    inverse_dynamics(&model, &mut ws, &q, &qd, &qdd, &mut torque);
    for j in 0..6 {
        let predicted: f64 = (0..set.rank())
            .map(|k| {
                let column: f64 = set.column(k).iter().map(|&(c, f)| f * theta[(j, c)]).sum();
                column * values[k]
            })
            .sum();
        // 52 products of terms up to 300 Nm; coefficients below 1e-9 are dropped.
        assert!((predicted - torque[j]).abs() < 1e-6, "joint {j}: {predicted} {}", torque[j]);
    }
}
