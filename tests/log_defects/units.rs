//! Other units, and decimal commas.

use super::*;

#[test]
fn decimal_commas() {
    let commas = |delimiter: &str| text(&valid(), delimiter, "\n").replace('.', ",");
    for delimiter in [";", "\t"] {
        let result = read(commas(delimiter));
        assert_says(result, &["run.csv", "row 2", "column 2", "decimal_comma = true"]);
    }
    assert_says(
        read(text(&valid(), ",", "\n").replace('.', ",")),
        &["run.csv", "row 2", "delimiter"],
    );
    let layout = include_str!("../../layouts/armid.toml").replacen(
        "header = true",
        "header = true\ndecimal_comma = true",
        1,
    );
    let layout = Layout::from_toml(&layout, "comma.toml").unwrap();
    let expected = edited(|_| {}).unwrap();
    for delimiter in [";", "\t", " "] {
        let log = read_log_from(commas(delimiter).as_bytes(), "run.csv", &layout, JOINTS).unwrap();
        assert_eq!(log.q_rad, expected.q_rad);
    }
}

#[test]
fn other_units_are_recognised_and_named() {
    let degrees = 180.0 / PI;
    for (factors, expected) in [
        ([1e3, 1.0, 1.0], ("time", "ms")),
        ([1e6, 1.0, 1.0], ("time", "us")),
        ([1e9, 1.0, 1.0], ("time", "ns")),
        ([1.0, degrees, 1.0], ("q", "deg")),
        ([1.0, 1.0, degrees], ("qd", "deg/s")),
        ([1.0, 1.0, 30.0 / PI], ("qd", "rpm")),
        ([1.0, degrees, degrees], ("both", "deg")),
        ([1e3, degrees, degrees], ("time", "ms")),
        ([1e3, degrees, 1.0], ("time", "ms")),
    ] {
        let result = edited(|rows| {
            scale(rows, 0..1, factors[0]);
            scale(rows, 1..7, factors[1]);
            scale(rows, 7..13, factors[2]);
        });
        assert_eq!(suspected(result), expected, "{factors:?}");
    }
}

#[test]
fn a_clock_in_milliseconds_is_recognised_at_rest() {
    let result = edited(|rows| {
        scale(rows, 0..1, 1e3);
        for row in &mut rows[1..] {
            row[1..13].fill("0".into());
        }
    });
    assert_eq!(suspected(result), ("clock", "ms"));
}

#[test]
fn the_remedy_that_is_named_works() {
    let layout = include_str!("../../layouts/armid.toml").replacen(
        "[columns]",
        "[units]\ntime = \"ms\"\nq = \"deg\"\nqd = \"deg/s\"\ncurrent = \"mA\"\n[columns]",
        1,
    );
    let layout = Layout::from_toml(&layout, "units.toml").unwrap();
    let mut rows = valid();
    scale(&mut rows, 0..1, 1e3);
    scale(&mut rows, 1..13, 180.0 / PI);
    scale(&mut rows, 13..19, 1e3);
    let log = read_log_from(text(&rows, ",", "\n").as_bytes(), "run.csv", &layout, JOINTS).unwrap();
    let expected = edited(|_| {}).unwrap();
    let worst = (0..JOINTS)
        .flat_map(|j| log.q_rad.joint(j).iter().zip(expected.q_rad.joint(j)))
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, f64::max);
    assert!(worst < 1e-14, "{worst}: two roundings of numbers below 2");
    // The same layout applied to numbers in SI units is recognised as wrong as well.
    let result = read_log_from(text(&valid(), ",", "\n").as_bytes(), "run.csv", &layout, JOINTS);
    assert_eq!(suspected(result), ("clock", "s"));
}

/// Velocities before the gear, in revolutions per minute, are 964.5 times those of the joint in rad/s. That is not far
/// from the thousand between s and ms, but this clock cannot be in ms. They exceed the velocity of any arm's joint, and
/// so do not belong to its motion; the log is refused all the same, not cut down to the rows in which the arm rests.
#[test]
fn velocities_of_motors() {
    let result = edited(|rows| scale(rows, 7..13, 101.0 * 30.0 / PI));
    assert_eq!(suspected(result), ("none", ""));
}

#[test]
fn velocities_that_belong_to_other_joints() {
    let swapped = edited(|rows| scale(rows, 7..13, -1.0));
    assert_eq!(suspected(swapped), ("none", ""));
    let one = edited(|rows| scale(rows, 9..10, -1.0)).unwrap();
    let warning = one.rows.warnings[0].to_string();
    assert!(warning.contains("joint 3") && warning.contains("-1.000"), "{warning}");
}
