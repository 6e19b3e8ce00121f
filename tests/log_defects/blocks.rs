//! Optional quantities of a log.

use super::*;

/// Column of the first desired moment in [`with_optional_blocks`]; the temperatures follow the moments.
const MOMENT: usize = 19;

/// The log that results when `edit` changes the fields of the valid one with desired moments and temperatures.
fn with_optional_blocks(edit: impl FnOnce(&mut Vec<Vec<String>>)) -> Log {
    let log = edited(|rows| {
        for name in ["target_moment", "joint_temperatures"] {
            rows[0].extend((0..JOINTS).map(|j| format!("{name}_{j}")));
            for row in &mut rows[1..] {
                row.extend((0..JOINTS).map(|j| format!("{j}.5")));
            }
        }
        edit(rows);
    });
    log.unwrap()
}

#[test]
fn a_bad_field_that_nothing_needs_costs_its_block_and_no_row() {
    let log = with_optional_blocks(|_| {});
    assert!(log.rows.warnings.is_empty() && log.target_effort.is_some(), "{}", log.rows);
    for value in ["", "NaN", "n/a", "1e293"] {
        let log = with_optional_blocks(|rows| {
            rows[51][MOMENT + 2] = value.into();
            rows[71][MOMENT] = value.into();
        });
        assert_eq!((log.samples(), log.rows.set_aside.len()), (SAMPLES, 0), "{}", log.rows);
        assert!(log.target_effort.is_none() && log.temperature_c.is_some());
        let warning = log.rows.warnings[0].to_string();
        for part in ["2 fields", "target_moment", "row 52", "column 22 (target_moment_2)"] {
            assert!(warning.contains(part), "{warning}");
        }
    }
    let blank = with_optional_blocks(|rows| {
        rows[1..].iter_mut().for_each(|row| row[MOMENT + JOINTS..].fill(String::new()));
    });
    assert_eq!((blank.samples(), blank.rows.warnings.len()), (SAMPLES, 1), "{}", blank.rows);
    assert!(blank.target_effort.is_some() && blank.temperature_c.is_none());
    let warning = blank.rows.warnings[0].to_string();
    assert!(warning.contains(&format!("{} fields", SAMPLES * JOINTS)), "{warning}");
}

#[test]
fn a_bad_field_in_a_row_that_is_set_aside_costs_no_block() {
    let log = with_optional_blocks(|rows| rows[51][1..].fill("1e293".into()));
    assert_eq!(log.rows.count(Reason::Implausible), 1, "{}", log.rows);
    assert!(log.rows.warnings.is_empty(), "{}", log.rows);
    assert!(log.target_effort.is_some() && log.temperature_c.is_some());
}

/// A layout without torque columns does not ask for them.
#[test]
fn the_effort_that_a_layout_names_is_the_one_that_is_missing() {
    let layout = include_str!("../../layouts/armid.toml").lines();
    let layout: Vec<&str> = layout.filter(|line| !line.starts_with("torque =")).collect();
    let layout = Layout::from_toml(&layout.join("\n"), "ampere.toml").unwrap();
    let text = text(&valid(), ",", "\n").replace("actual_current", "ampere");
    let result = read_log_from(text.as_bytes(), "run.csv", &layout, JOINTS);
    assert_says(result, &["no column \"actual_current_0\"", "\"armid\""]);
}
