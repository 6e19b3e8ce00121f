//! One valid log, then one test per single defect: every message names file, row and value.

use std::f64::consts::{PI, TAU};
use std::fmt::Write as _;
use std::path::Path;

use armid::log::{
    Layout, Log, LogError, LogWarning, Reason, UnitSuspicion, read_log, read_log_from,
};

const JOINTS: usize = 6;
const SAMPLES: usize = 400;
const STEP_S: f64 = 0.008;
/// Row of the file that holds sample `k`: the header is row 1.
fn row(k: usize) -> usize {
    k + 2
}

fn angle_rad(j: usize, t: f64) -> f64 {
    (0.4 + 0.1 * j as f64) * (2.0 * t + j as f64).sin() - 1.0
}

fn velocity_rad_s(j: usize, t: f64) -> f64 {
    2.0 * (0.4 + 0.1 * j as f64) * (2.0 * t + j as f64).cos()
}

/// Header and rows of a log without defects, as fields.
fn valid() -> Vec<Vec<String>> {
    let mut header = vec!["timestamp".to_owned()];
    for name in ["actual_q", "actual_qd", "actual_current"] {
        header.extend((0..JOINTS).map(|j| format!("{name}_{j}")));
    }
    let mut rows = vec![header];
    for k in 0..SAMPLES {
        let t = 100.0 + STEP_S * k as f64;
        let mut fields = vec![t];
        fields.extend((0..JOINTS).map(|j| angle_rad(j, t)));
        fields.extend((0..JOINTS).map(|j| velocity_rad_s(j, t)));
        fields.extend((0..JOINTS).map(|j| 1.5 * (t + j as f64).sin()));
        rows.push(fields.iter().map(f64::to_string).collect());
    }
    rows
}

fn text(rows: &[Vec<String>], delimiter: &str, end: &str) -> String {
    rows.iter().fold(String::new(), |mut text, row| {
        let _ = write!(text, "{}{end}", row.join(delimiter));
        text
    })
}

fn read(bytes: impl AsRef<[u8]>) -> Result<Log, LogError> {
    read_log_from(bytes.as_ref(), "run.csv", &Layout::default(), JOINTS)
}

/// The log after `edit` was done to the fields of the valid one.
fn edited(edit: impl FnOnce(&mut Vec<Vec<String>>)) -> Result<Log, LogError> {
    let mut rows = valid();
    edit(&mut rows);
    read(text(&rows, ",", "\n"))
}

/// Multiplies column `c` of every row of data.
fn scale(rows: &mut [Vec<String>], columns: std::ops::Range<usize>, factor: f64) {
    for row in &mut rows[1..] {
        for field in &mut row[columns.clone()] {
            *field = (field.parse::<f64>().unwrap() * factor).to_string();
        }
    }
}

fn assert_says(result: Result<Log, LogError>, parts: &[&str]) {
    let message = result.expect_err("this log must be refused").to_string();
    for part in parts {
        assert!(message.contains(part), "\"{part}\" is not in: {message}");
    }
}

/// One row is set aside for `reason`, at `row`, and the example shows `value`.
fn assert_one_row_aside(result: Result<Log, LogError>, reason: Reason, row: usize, value: &str) {
    let log = result.unwrap();
    let entry = &log.rows.set_aside[0];
    assert_eq!((entry.reason, entry.count, entry.first_row), (reason, 1, row), "{}", log.rows);
    assert!(entry.example.contains(value), "\"{value}\" is not in: {}", entry.example);
    assert_eq!(log.rows.set_aside.len(), 1);
    assert_eq!(log.rows.read, log.rows.used + 1);
    assert_eq!(log.samples(), log.rows.used);
    let table = log.rows.to_string();
    assert!(table.contains(&row.to_string()) && table.contains(value), "{table}");
}

#[test]
fn the_valid_log_is_read_as_it_is() {
    let log = edited(|_| {}).unwrap();
    assert_eq!((log.rows.read, log.rows.used), (SAMPLES, SAMPLES));
    assert!(log.rows.set_aside.is_empty() && log.rows.warnings.is_empty(), "{}", log.rows);
    let t = log.time_s[7];
    assert_eq!(log.q_rad.joint(3)[7], angle_rad(3, t));
    assert_eq!(log.qd_rad_s.joint(3)[7], velocity_rad_s(3, t));
    assert_eq!(log.effort.signals().joint(3)[7], 1.5 * (t + 3.0).sin());
}

#[test]
fn byte_order_mark_line_ends_blank_lines_and_delimiters_change_nothing() {
    let rows = valid();
    let expected = read(text(&rows, ",", "\n")).unwrap();
    let quoted = text(&rows, ",", "\n").replacen("timestamp", "\"timestamp\"", 1);
    for variant in [
        format!("\u{feff}{}", text(&rows, ",", "\n")),
        text(&rows, ",", "\r\n"),
        text(&rows, " ", "\r\r\n"),
        text(&rows, ",", "\r"),
        text(&rows, ";", "\n"),
        text(&rows, "\t", "\n"),
        text(&rows, "  ", " \n"),
        text(&rows, ", ", "\n"),
        text(&rows, ",", ",\n"),
        text(&rows, ",", "\n") + "\n\n  \n",
        text(&rows, ",", "\n\n"),
        quoted,
    ] {
        let mut log = read(&variant).unwrap_or_else(|e| panic!("{e}: {:?}", &variant[..60]));
        log.sha256.clone_from(&expected.sha256);
        // Only the numbers of the rows differ with blank lines between them.
        assert_eq!(log, expected, "{:?}", &variant[..60]);
    }
}

#[test]
fn rows_are_numbered_as_in_the_file() {
    let mut lines = text(&valid(), ",", "\n");
    lines = format!("\n\n{lines}").replacen("\n100.016,", "\n\n100.016,NaN", 1);
    let log = read(lines).unwrap();
    // Two blank lines, the header, two samples, a blank line: the third sample is row 7.
    assert_eq!(log.rows.set_aside[0].first_row, 7, "{}", log.rows);
}

#[test]
fn a_missing_column() {
    let result = edited(|rows| rows[0][9] = "speed_2".into());
    assert_says(result, &["run.csv", "row 1", "actual_qd_2", "armid"]);
    let result = edited(|rows| rows[0][0] = "time".into());
    assert_says(result, &["run.csv", "row 1", "\"timestamp\"", "\"time\""]);
}

#[test]
fn a_duplicate_column() {
    let result = edited(|rows| rows[0][9] = "actual_qd_1".into());
    assert_says(result, &["run.csv", "row 1", "\"actual_qd_1\" twice", "9 and 10"]);
}

#[test]
fn neither_currents_nor_torques() {
    let result = edited(|rows| rows.iter_mut().for_each(|row| row.truncate(13)));
    assert_says(result, &["run.csv", "row 1", "actual_current_0", "actual_torque_0"]);
}

#[test]
fn a_log_of_another_arm() {
    let three = edited(|rows| {
        for row in rows {
            let fields: Vec<String> =
                [0, 1, 2, 3, 7, 8, 9, 13, 14, 15].iter().map(|&c| row[c].clone()).collect();
            *row = fields;
        }
    });
    assert_says(three, &["run.csv", "3 joints", "arm has 6"]);
    let result =
        read_log_from(text(&valid(), ",", "\n").as_bytes(), "run.csv", &Layout::default(), 3);
    assert_says(result, &["run.csv", "6 joints", "arm has 3"]);
    let layout = Layout::load("ur10e_innopolis").unwrap();
    let rows = text(&valid()[1..], ",", "\n");
    let result = read_log_from(rows.as_bytes(), "run.csv", &layout, 3);
    assert_says(result, &["run.csv", "layout has 6 joints", "arm has 3"]);
}

#[test]
fn a_wrong_layout() {
    assert_says(read(text(&valid()[1..], ",", "\n")), &["run.csv", "row 1", "100", "--layout"]);
    let layout = Layout::load("ur10e_innopolis").unwrap();
    let with_header = text(&valid(), ",", "\n");
    let result = read_log_from(with_header.as_bytes(), "run.csv", &layout, 6);
    assert_says(result, &["run.csv", "row 1", "\"timestamp\"", "header"]);
    let narrow: Vec<Vec<String>> = valid()[1..].iter().map(|row| row[..18].to_vec()).collect();
    let result = read_log_from(text(&narrow, ",", "\n").as_bytes(), "run.csv", &layout, 6);
    assert_says(result, &["run.csv", "row 1", "18 fields", "19, 25, 31"]);
}

#[test]
fn one_cut_row_at_the_top_does_not_decide_the_width() {
    let mut rows = valid()[1..].to_vec();
    rows[0].truncate(12);
    let layout = Layout::load("ur10e_innopolis").unwrap();
    let result = read_log_from(text(&rows, ",", "\n").as_bytes(), "run.csv", &layout, 6);
    assert_one_row_aside(result, Reason::TooFewFields, 1, "12 fields of 19");
}

#[test]
fn numbers_that_are_none() {
    for (value, reason) in [
        ("NaN", Reason::NotFinite),
        ("inf", Reason::NotFinite),
        ("-Infinity", Reason::NotFinite),
        ("1e999", Reason::NotFinite),
        ("", Reason::EmptyField),
        ("n/a", Reason::NotANumber),
        ("1e293", Reason::Implausible),
        ("-5.9e293", Reason::Implausible),
    ] {
        for column in [0, 3, 10, 18] {
            let result = edited(|rows| rows[51][column] = value.into());
            assert_one_row_aside(result, reason, 52, value);
        }
    }
}

#[test]
fn implausible_values_of_each_quantity() {
    for (column, value) in [(3, "1001"), (10, "-101"), (18, "501")] {
        let result = edited(|rows| rows[51][column] = value.into());
        assert_one_row_aside(result, Reason::Implausible, 52, value);
    }
}

/// Currents in milliamperes: only the rows near a zero of all joints could be currents in amperes.
#[test]
fn a_unit_in_which_most_rows_are_implausible() {
    let result = edited(|rows| scale(rows, 13..19, 1000.0));
    assert_says(result, &["run.csv", "implausible", "row 2", "actual_current_0", "units"]);
}

/// The line through 400 stamps that are off by 10 ms/√12 is known to 0.15 ms in the middle, and to twice that at its ends: five times
/// as much.
#[test]
fn stamps_that_are_coarser_than_the_rows() {
    let rounded = |rows: &mut Vec<Vec<String>>| {
        for row in &mut rows[1..] {
            let t: f64 = row[0].parse().unwrap();
            row[0] = format!("{:.2}", t);
        }
    };
    for lost in [None, Some(200)] {
        let log = edited(|rows| {
            rounded(rows);
            // A row that is set aside keeps its place.
            lost.into_iter().for_each(|k: usize| rows[k][3] = "x".into());
        })
        .unwrap();
        assert_eq!(log.samples(), SAMPLES - lost.iter().count());
        for (t, row) in log.time_s.iter().zip((0..SAMPLES).filter(|k| lost != Some(k + 1))) {
            assert!((t - 100.0 - STEP_S * row as f64).abs() < 1.5e-3, "{t} {row}");
        }
        assert!(log.rows.warnings.iter().any(|w| matches!(w, LogWarning::RoundedStamps { .. })));
    }
}

/// Patterns of stamps that rounding makes as well: every twentieth row missing, every row written twice. The motion says that the stamps
/// are right.
#[test]
fn stamps_that_only_look_rounded() {
    let is_rounded =
        |log: &Log| log.rows.warnings.iter().any(|w| matches!(w, LogWarning::RoundedStamps { .. }));
    let missing = edited(|rows| {
        let mut k = 0;
        rows.retain(|_| {
            k += 1;
            k % 20 != 0
        });
    })
    .unwrap();
    assert!(!is_rounded(&missing));
    assert_eq!(missing.samples(), SAMPLES - SAMPLES / 20);
    let twice = edited(|rows| {
        *rows = rows.iter().flat_map(|row| [row.clone(), row.clone()]).skip(1).collect();
    })
    .unwrap();
    assert!(!is_rounded(&twice));
    assert_eq!(twice.rows.count(Reason::TimeRepeated), SAMPLES);
}

/// A delimiter at the end of every row makes no field, with a header or without.
#[test]
fn delimiters_at_the_ends_of_rows_without_a_header() {
    let layout = Layout::load("ur10e_innopolis").unwrap();
    let read = |end: &str| {
        let rows = text(&valid()[1..], ",", end);
        read_log_from(rows.as_bytes(), "run.csv", &layout, JOINTS).unwrap_or_else(|e| panic!("{e}"))
    };
    let (plain, ended) = (read("\n"), read(",\n"));
    assert_eq!((plain.samples(), plain.rows), (ended.samples(), ended.rows));
    assert_eq!(plain.effort.signals(), ended.effort.signals());
}

#[test]
fn rows_of_another_width() {
    let result = edited(|rows| rows[51].truncate(12));
    assert_one_row_aside(result, Reason::TooFewFields, 52, "12 fields of 19");
    let result = edited(|rows| rows[51].push("1".into()));
    assert_one_row_aside(result, Reason::TooManyFields, 52, "20 fields of 19");
}

#[test]
fn a_file_cut_anywhere_in_its_last_row() {
    let whole = text(&valid(), ",", "\n");
    let last = whole.trim_end().rfind('\n').unwrap() + 1;
    for cut in last + 1..whole.len() {
        let log = read(&whole[..cut]).unwrap();
        assert_eq!(log.rows.count(Reason::CutShort), 1, "{}", log.rows);
        assert_eq!(log.rows.set_aside[0].first_row, row(SAMPLES - 1));
        assert_eq!(log.samples(), SAMPLES - 1);
    }
}

#[test]
fn repeated_and_backward_times() {
    let result = edited(|rows| rows[51][0] = rows[50][0].clone());
    assert_one_row_aside(result, Reason::TimeRepeated, 52, "100.392");
    let result = edited(|rows| rows[51][0] = "3.25".into());
    assert_one_row_aside(result, Reason::TimeBackwards, 52, "3.25");
    let result = edited(|rows| {
        let copy = rows[51].clone();
        rows.insert(51, copy);
    });
    assert_one_row_aside(result, Reason::TimeRepeated, 53, "100.4");
    let result = edited(|rows| rows.swap(51, 52));
    assert_one_row_aside(result, Reason::TimeBackwards, 53, "100.4");
}

#[test]
fn one_time_far_ahead_costs_one_row_and_not_all_that_follow() {
    for k in [1, 51, SAMPLES - 2] {
        let result = edited(|rows| rows[k][0] = "5000".into());
        assert_one_row_aside(result, Reason::TimeAhead, k + 1, "5000");
    }
}

#[test]
fn a_few_times_far_ahead_cost_their_rows_and_not_all_that_follow() {
    let ahead = |k: usize, times: &[f64]| {
        let log = edited(|rows| {
            for (row, time) in rows[k..].iter_mut().zip(times) {
                row[0] = time.to_string();
            }
        });
        log.unwrap().rows
    };
    for k in [1, 51] {
        for count in [2_usize, 8] {
            let times: Vec<f64> = (0..count).map(|i| 5000.0 + STEP_S * i as f64).collect();
            let rows = ahead(k, &times);
            assert_eq!(
                (rows.count(Reason::TimeAhead), rows.used),
                (count, SAMPLES - count),
                "{rows}"
            );
            assert_eq!(rows.set_aside[0].first_row, k + 1);
            assert_eq!(rows.missed_samples, 0, "{rows}");
        }
    }
    // A clock that stands or jumps about up there.
    for times in [[5000.0, 5000.0, 5000.0], [5000.0, 4000.0, 6000.0]] {
        assert_eq!(ahead(51, &times).used, SAMPLES - 3);
    }
}

#[test]
fn a_log_that_goes_on_behind_a_pause_is_kept() {
    // Three rows behind a minute's pause two times of before it, which are too few to be believed.
    let log = edited(|rows| {
        for row in &mut rows[51..] {
            row[0] = (row[0].parse::<f64>().unwrap() + 60.0).to_string();
        }
        for (row, time) in [(54, "101"), (55, "102")] {
            rows[row][0] = time.into();
        }
    });
    let rows = log.unwrap().rows;
    assert_eq!((rows.count(Reason::TimeBackwards), rows.used), (2, SAMPLES - 2), "{rows}");
}

#[test]
fn a_row_shifted_by_a_column() {
    let result = edited(|rows| rows[51][1..].rotate_right(1));
    let log = result.unwrap();
    assert_eq!(log.rows.count(Reason::Inconsistent), 1, "{}", log.rows);
    assert_eq!(log.rows.set_aside[0].first_row, 52);
}

#[test]
fn every_fifth_row_uninitialised() {
    let log = edited(|rows| {
        for row in rows[1..].iter_mut().step_by(5) {
            row[1..].fill("0".into());
        }
    })
    .unwrap();
    assert_eq!(log.rows.count(Reason::Inconsistent), SAMPLES / 5, "{}", log.rows);
    assert_eq!(log.rows.missed_samples, 0, "rows set aside are not rows the recorder left out");
    assert!(log.rows.warnings.iter().any(|w| matches!(w, LogWarning::ManySetAside { .. })));
}

#[test]
fn missed_samples_are_counted() {
    let log = edited(|rows| drop(rows.drain(51..54))).unwrap();
    assert_eq!(log.rows.missed_samples, 3);
    let warning = log.rows.warnings[0].to_string();
    assert!(warning.contains("3 samples") && warning.contains("row 51"), "{warning}");
}

/// Adds `offset_rad` to the angle of joint 2 from row 201 of the file on.
fn with_a_jump(offset_rad: f64) -> Log {
    let log = edited(|rows| {
        for row in &mut rows[200..] {
            row[2] = (row[2].parse::<f64>().unwrap() + offset_rad).to_string();
        }
    });
    log.unwrap()
}

fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    assert_eq!(a.len(), b.len());
    a.iter().zip(b).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
}

#[test]
fn an_angle_that_jumps_by_a_turn_is_unwrapped() {
    let expected = edited(|_| {}).unwrap();
    for offset_rad in [2.0 * PI, -2.0 * PI] {
        let log = with_a_jump(offset_rad);
        assert_eq!((log.samples(), log.rows.warnings.len()), (SAMPLES, 1), "{}", log.rows);
        let warning = log.rows.warnings[0].to_string();
        for part in ["row 200", "joint 2", "unwrapped 1 times"] {
            assert!(warning.contains(part), "{warning}");
        }
        // Two roundings of numbers below 16.
        assert!(largest_difference(log.q_rad.joint(1), expected.q_rad.joint(1)) < 4e-15);
        assert_eq!(log.q_rad.joint(2), expected.q_rad.joint(2));
    }
}

#[test]
fn a_jump_that_is_no_turn_stays() {
    let expected = edited(|_| {}).unwrap();
    let log = with_a_jump(3.0);
    let warning = log.rows.warnings[0].to_string();
    for part in ["jumps 1 times", "row 200", "joint 2", "3.0"] {
        assert!(warning.contains(part), "{warning}");
    }
    let jump_rad = log.q_rad.joint(1)[300] - expected.q_rad.joint(1)[300];
    assert!((jump_rad - 3.0).abs() < 1e-14);
}

/// Angles from −1 to 2π − 1: each joint passes the seam in the middle of its motion, on its way up and down.
#[test]
fn wrapped_angles_and_their_targets_are_put_together_again() {
    let wrapped = |q: f64| if q < -1.0 { q + 2.0 * PI } else { q };
    // The target is ahead, and passes the seam in other rows.
    let target_rad = |j: usize, t: f64| angle_rad(j, t + 0.05);
    let mut seams = 0;
    let log = edited(|rows| {
        rows[0].extend((0..JOINTS).map(|j| format!("target_q_{j}")));
        for row in &mut rows[1..] {
            let t: f64 = row[0].parse().unwrap();
            for j in 0..JOINTS {
                row[1 + j] = wrapped(angle_rad(j, t)).to_string();
                row.push(wrapped(target_rad(j, t)).to_string());
            }
        }
        let is_high = |row: &[String], j: usize| row[1 + j].parse::<f64>().unwrap() > 1.0;
        for pair in rows[1..].windows(2) {
            seams += (0..JOINTS).filter(|&j| is_high(&pair[0], j) != is_high(&pair[1], j)).count();
        }
    })
    .unwrap();
    assert!(seams > JOINTS);
    assert_eq!(log.samples(), SAMPLES);
    assert!(
        matches!(log.rows.warnings[..], [LogWarning::Unwrapped { count, .. }] if count == seams)
    );
    let target = log.target_q_rad.unwrap();
    for j in 0..JOINTS {
        // What a joint began with stays.
        let begin = log.q_rad.joint(j)[0] - angle_rad(j, log.time_s[0]);
        let of = |f: &dyn Fn(usize, f64) -> f64| -> Vec<f64> {
            log.time_s.iter().map(|&t| begin + f(j, t)).collect()
        };
        assert!(largest_difference(log.q_rad.joint(j), &of(&angle_rad)) < 1e-14);
        assert!(largest_difference(target.joint(j), &of(&target_rad)) < 1e-14);
    }
}

/// Column of the first desired moment in [`with_optional_blocks`]; the temperatures are behind these.
const MOMENT: usize = 19;

/// The log after `edit` was done to the fields of the valid one with desired moments and temperatures.
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
    let layout = include_str!("../layouts/armid.toml").replacen(
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

/// The unit that the error names.
fn suspected(result: Result<Log, LogError>) -> (&'static str, &'static str) {
    match result {
        Err(LogError::Units { file, suspicion }) => {
            assert_eq!(file, "run.csv");
            let message = suspicion.to_string();
            let remedy = match suspicion {
                UnitSuspicion::Unrelated { .. } | UnitSuspicion::NoVelocity { .. } => "columns",
                _ => "[units]",
            };
            assert!(message.contains("row") && message.contains(remedy), "{message}");
            match suspicion {
                UnitSuspicion::Ratio { quantity, unit, .. } => (quantity, unit),
                UnitSuspicion::Clock { unit, .. } => ("clock", unit),
                UnitSuspicion::Degrees { .. } => ("both", "deg"),
                UnitSuspicion::Unrelated { .. } => ("none", ""),
                UnitSuspicion::NoVelocity { .. } => ("no velocity", ""),
            }
        }
        other => panic!("{other:?}"),
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
    let layout = include_str!("../layouts/armid.toml").replacen(
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
    // The same layout for numbers that are in SI units is recognised as well.
    let result = read_log_from(text(&valid(), ",", "\n").as_bytes(), "run.csv", &layout, JOINTS);
    assert_eq!(suspected(result), ("clock", "s"));
}

#[test]
fn velocities_that_belong_to_other_joints() {
    let swapped = edited(|rows| scale(rows, 7..13, -1.0));
    assert_eq!(suspected(swapped), ("none", ""));
    let one = edited(|rows| scale(rows, 9..10, -1.0)).unwrap();
    let warning = one.rows.warnings[0].to_string();
    assert!(warning.contains("joint 3") && warning.contains("-1.000"), "{warning}");
}

/// A layout as that of the valid log, without velocities.
fn without_velocities() -> Layout {
    let layout = include_str!("../layouts/armid.toml");
    let lines = layout.lines().filter(|line| !line.starts_with("qd = \"actual"));
    let text = lines.collect::<Vec<_>>().join("\n");
    assert!(text.len() < layout.len() - 10, "{text}");
    Layout::from_toml(&text, "no_qd.toml").unwrap()
}

/// Columns of zeros are no velocities, and the remedy that is named works: slopes of angles, wrapped ones as well, are told to
/// (ω h)⁴/30 of up to 1.8 rad/s, and at the ends, one-sided, to six times that.
#[test]
fn velocities_that_were_not_recorded_are_slopes_of_the_angles() {
    let mut rows = valid();
    scale(&mut rows, 7..13, 0.0);
    assert_eq!(suspected(read(text(&rows, ",", "\n"))), ("no velocity", ""));
    for row in &mut rows[1..] {
        let angle: f64 = row[4].parse().unwrap();
        row[4] = ((angle + 1.0).rem_euclid(TAU) - PI).to_string();
    }
    let (text, layout) = (text(&rows, ",", "\n"), without_velocities());
    let log = read_log_from(text.as_bytes(), "run.csv", &layout, JOINTS).unwrap();
    assert_eq!(log.rows.used, SAMPLES);
    let [LogWarning::Unwrapped { joint: 4, .. }, LogWarning::SlopesOfAngles] =
        log.rows.warnings[..]
    else {
        panic!("{:?}", log.rows.warnings)
    };
    let bound = 6.0 * 1.8 * (2.0 * STEP_S).powi(4) / 30.0;
    for j in 0..JOINTS {
        for (slope, t) in log.qd_rad_s.joint(j).iter().zip(&log.time_s) {
            let off = slope - velocity_rad_s(j, *t);
            assert!(off.abs() < bound, "joint {}: off by {off} at {t} s", j + 1);
        }
    }
}

/// Stamps of 0.01 s at 125 rows a second, without velocities that could tell that rows are even.
#[test]
fn rounded_stamps_are_mended_without_velocities() {
    let mut rows = valid();
    for line in &mut rows[1..] {
        let time: f64 = line[0].parse().unwrap();
        line[0] = format!("{:.2}", time);
    }
    let text = text(&rows, ",", "\n");
    let log = read_log_from(text.as_bytes(), "run.csv", &without_velocities(), JOINTS).unwrap();
    assert_eq!(log.rows.used, SAMPLES);
    assert!(matches!(log.rows.warnings[0], LogWarning::RoundedStamps { .. }), "{}", log.rows);
    for (k, slope) in log.qd_rad_s.joint(1).iter().enumerate() {
        // The line through 400 stamps is known to 0.01 s/√(12 · 400) at its middle and to a ten thousandth of its slope.
        let truth = velocity_rad_s(1, 100.0 + STEP_S * k as f64);
        assert!((slope - truth).abs() < 2e-3, "{slope} {truth}");
    }
}

/// A wild angle costs its own row and none beside it, whose slopes it would be in, and stays out of those.
#[test]
fn wild_angles_are_in_no_slopes() {
    let mut rows = valid();
    let wild: Vec<usize> = (20..SAMPLES).step_by(40).collect();
    for k in &wild {
        rows[row(*k) - 1][3] = "2.5".into();
    }
    let text = text(&rows, ",", "\n");
    let log = read_log_from(text.as_bytes(), "run.csv", &without_velocities(), JOINTS).unwrap();
    assert_eq!(log.rows.used, SAMPLES - wild.len());
    assert_eq!(log.rows.set_aside[0].reason, Reason::Inconsistent);
    assert!(log.rows.set_aside[0].example.contains("2.5"), "{}", log.rows);
    for (slope, t) in log.qd_rad_s.joint(2).iter().zip(&log.time_s) {
        // Beside a row that is missing steps are twice as long, and one-sided at the ends.
        let bound = 16.0 * 6.0 * 1.8 * (2.0 * STEP_S).powi(4) / 30.0;
        assert!((slope - velocity_rad_s(2, *t)).abs() < bound, "{slope} at {t} s");
    }
}

/// A layout that knows no torques asks for none.
/// Seconds and nanoseconds since 1970, of which a number of 53 bits tells a quarter of a microsecond.
#[test]
fn stamps_in_two_columns_are_added() {
    let mut rows = valid();
    rows[0].insert(1, "nanoseconds".to_owned());
    for (k, row) in rows[1..].iter_mut().enumerate() {
        let nanoseconds = 1_700_000_000_900_000_000 + 8_000_000 * k as u64;
        row[0] = (nanoseconds / 1_000_000_000).to_string();
        row.insert(1, (nanoseconds % 1_000_000_000).to_string());
    }
    let layout = include_str!("../layouts/armid.toml");
    let layout = layout.replace("[columns]", "[columns]\ntime_nanoseconds = \"nanoseconds\"");
    let layout = Layout::from_toml(&layout, "ros.toml").unwrap();
    let read = |rows: &[Vec<String>]| {
        read_log_from(text(rows, ",", "\n").as_bytes(), "run.csv", &layout, JOINTS)
    };
    let log = read(&rows).unwrap();
    assert_eq!((log.samples(), log.rows.warnings.len()), (SAMPLES, 0), "{}", log.rows);
    for (k, time_s) in log.time_s.iter().enumerate() {
        let since_s = time_s - 1_700_000_000.0 - 0.9;
        assert!((since_s - STEP_S * k as f64).abs() < 5e-7, "{k}: {since_s}");
    }
    rows[8][1] = "5000000000".to_owned();
    assert_one_row_aside(read(&rows), Reason::Implausible, row(7), "5000000000");
}

#[test]
fn the_effort_that_a_layout_names_is_the_one_that_is_missing() {
    let layout = include_str!("../layouts/armid.toml").lines();
    let layout: Vec<&str> = layout.filter(|line| !line.starts_with("torque =")).collect();
    let layout = Layout::from_toml(&layout.join("\n"), "ampere.toml").unwrap();
    let text = text(&valid(), ",", "\n").replace("actual_current", "ampere");
    let result = read_log_from(text.as_bytes(), "run.csv", &layout, JOINTS);
    assert_says(result, &["no column \"actual_current_0\"", "\"armid\""]);
}

/// Readings at 42 Hz in a file of 125 Hz: two in three rows are held. An arm at rest, whose velocities are noisy, holds none.
#[test]
fn rows_that_hold_old_readings_are_told() {
    let log = edited(|rows| {
        for k in 0..SAMPLES {
            let read = rows[row(k - k % 3) - 1].clone();
            rows[row(k) - 1][1..].clone_from_slice(&read[1..]);
        }
    })
    .unwrap();
    let held = log.rows.warnings.iter().find_map(|warning| match warning {
        LogWarning::Held { share, rate_hz } => Some((*share, *rate_hz)),
        _ => None,
    });
    let (share, rate_hz) = held.expect("it is told");
    let at_rest = edited(|rows| {
        for k in 0..SAMPLES / 2 {
            for j in 0..JOINTS {
                rows[row(k) - 1][1 + j] = rows[row(SAMPLES / 2) - 1][1 + j].clone();
                rows[row(k) - 1][1 + JOINTS + j] =
                    (0.004 * (k as f64 + j as f64).sin()).to_string();
            }
        }
    });
    let warnings = at_rest.unwrap().rows.warnings;
    assert!(!warnings.iter().any(|w| matches!(w, LogWarning::Held { .. })), "{warnings:?}");
    // 400 rows are 133 such readings and one more.
    assert!((share - 2.0 / 3.0).abs() < 0.003, "{share}");
    assert!((rate_hz * STEP_S - 1.0 / 3.0).abs() < 0.003, "{rate_hz}");
}

#[test]
fn files_without_data() {
    assert_says(read(""), &["run.csv", "empty"]);
    assert_says(read("\n\r\n  \n"), &["run.csv", "empty", "3 blank lines"]);
    assert_says(edited(|rows| rows.truncate(1)), &["run.csv", "row 1", "header"]);
    assert_says(edited(|rows| rows.truncate(2)), &["run.csv", "1 can be used"]);
    let result = edited(|rows| rows.iter_mut().skip(1).for_each(|row| row[4] = "NaN".into()));
    assert_says(result, &["run.csv", "400 rows read", "row 2", "actual_q_3", "NaN"]);
}

#[test]
fn files_that_are_no_text() {
    assert_says(read(b"\x7fELF\x02\x01\x01\x00\x00"), &["run.csv", "byte 8", "0x00"]);
    assert_says(read(b"\xff\xfet\x00i\x00"), &["run.csv", "UTF-16", "UTF-8"]);
    let endless = vec![b'x'; 1 << 20];
    assert_says(read(endless), &["run.csv", "row 1", "65536 bytes"]);
    let folder = tempfile::tempdir().unwrap();
    let read_path = |path: &Path| read_log(path, &Layout::default(), JOINTS);
    assert_says(read_path(folder.path()), &["folder"]);
    assert_says(read_path(&folder.path().join("none.csv")), &["none.csv", "cannot be read"]);
}
