//! One valid log and one test per defect: every message names file, row and value.

mod angles;
mod blocks;
mod rows;
mod slopes;
mod stamps;
mod units;

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

/// The log that results when `edit` changes the fields of the valid one.
fn edited(edit: impl FnOnce(&mut Vec<Vec<String>>)) -> Result<Log, LogError> {
    let mut rows = valid();
    edit(&mut rows);
    read(text(&rows, ",", "\n"))
}

/// Multiplies `columns` of every data row by `factor`.
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

/// Asserts that exactly one row, `row`, is set aside for `reason`, and that the example shows `value`.
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

/// The quantity and unit that the error suspects.
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
                UnitSuspicion::TooFast { .. } => ("speed", ""),
                UnitSuspicion::Degrees { .. } => ("both", "deg"),
                UnitSuspicion::Unrelated { .. } => ("none", ""),
                UnitSuspicion::NoVelocity { .. } => ("no velocity", ""),
            }
        }
        other => panic!("{other:?}"),
    }
}
