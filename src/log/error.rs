//! Logs that cannot be used.

use std::path::PathBuf;

use thiserror::Error;

use super::account::{RowAccount, SetAside};
use super::layout::LayoutFault;
use super::unit_suspicion::UnitSuspicion;
use crate::output::OutputError;

/// A log that cannot be used. Each message names the place, the value and the remedy.
#[derive(Debug, Error)]
pub enum LogError {
    /// The file cannot be opened, or reading it fails.
    #[error("{file}: cannot be read: {source}")]
    Read {
        /// The file.
        file: String,
        /// Why.
        source: std::io::Error,
    },
    /// The path names a folder.
    #[error("{file}: this is a folder; name the log file in it")]
    IsFolder {
        /// The path.
        file: String,
    },
    /// Not a text file.
    #[error("{file}: byte {byte} is {value:#04x}: not a text file; a log is CSV text{}", utf16_hint(*utf16))]
    NotText {
        /// The file.
        file: String,
        /// Position of the offending byte, counted from 1.
        byte: usize,
        /// The byte.
        value: u8,
        /// Whether the file begins like UTF-16 text.
        utf16: bool,
    },
    /// A line is longer than any row can be.
    #[error("{file}: row {row} is longer than {limit} bytes: not a log of one sample per row")]
    LineTooLong {
        /// The file.
        file: String,
        /// The row.
        row: usize,
        /// Largest length accepted, bytes.
        limit: usize,
    },
    /// The file has no bytes, or blank lines only.
    #[error("{file}: the file is empty{}; record the log again", blank(*lines))]
    Empty {
        /// The file.
        file: String,
        /// Blank lines met.
        lines: usize,
    },
    /// The file has a header and no rows of data.
    #[error("{file}: row {row} is a header and no row of data follows; record the log again")]
    HeaderOnly {
        /// The file.
        file: String,
        /// The header's row.
        row: usize,
    },
    /// The layout expects column names in the first row, which begins with a number.
    #[error(
        "{file}: row {row} begins with the number {value} where the layout \"{layout}\" expects column names; \
         for a file without header give --layout ({} or a .toml file with header = false)",
        without_header()
    )]
    NoHeader {
        /// The file.
        file: String,
        /// The row.
        row: usize,
        /// Its first field.
        value: String,
        /// The layout.
        layout: String,
    },
    /// The layout expects numbers in the first row, which holds a header.
    #[error(
        "{file}: row {row} begins with \"{value}\", a header, and the layout \"{layout}\" is for files without; \
         leave --layout away for RTDE names, or set header = true in the layout"
    )]
    UnexpectedHeader {
        /// The file.
        file: String,
        /// The row.
        row: usize,
        /// Its first field.
        value: String,
        /// The layout.
        layout: String,
    },
    /// A required column is not in the header.
    #[error(
        "{file}: row {row} (header) has no column \"{column}\", which the layout \"{layout}\" needs; it has {found}; \
         name the column in a layout file (--layout)"
    )]
    MissingColumn {
        /// The file.
        file: String,
        /// The header's row.
        row: usize,
        /// The name looked for.
        column: String,
        /// The layout.
        layout: String,
        /// The names that are there, abridged.
        found: String,
    },
    /// A column that is used occurs twice in the header.
    #[error(
        "{file}: row {row} (header) has the column \"{column}\" twice, as columns {first} and {second}; \
         rename or remove one"
    )]
    DuplicateColumn {
        /// The file.
        file: String,
        /// The header's row.
        row: usize,
        /// The name.
        column: String,
        /// Column number of the first, from 1.
        first: usize,
        /// Column number of the second.
        second: usize,
    },
    /// The header has neither currents nor torques.
    #[error(
        "{file}: row {row} (header) has neither \"{current}\" nor \"{torque}\"; one of them must be logged: \
         where it has another name, a layout says so (--layout; layouts/example.toml shows how)"
    )]
    NoEffort {
        /// The file.
        file: String,
        /// The header's row.
        row: usize,
        /// First current column looked for.
        current: String,
        /// First torque column looked for.
        torque: String,
    },
    /// The log or its layout has another number of joints than the arm.
    #[error(
        "{file}: {what} has {found} joints, the arm has {expected}; choose the --robot the log is of"
    )]
    JointCount {
        /// The file.
        file: String,
        /// What was counted.
        what: &'static str,
        /// Joints there.
        found: usize,
        /// Joints of the arm.
        expected: usize,
    },
    /// The width of a file without header is none of those in the layout.
    #[error(
        "{file}: row {row} has {found} fields; the layout \"{layout}\" knows files of {} fields; \
         choose another --layout, or add a [[width]] to it",
        list(expected)
    )]
    Width {
        /// The file.
        file: String,
        /// The first row.
        row: usize,
        /// Its fields.
        found: usize,
        /// Widths that the layout accepts.
        expected: Vec<usize>,
        /// The layout.
        layout: String,
    },
    /// Decimals are written with commas.
    #[error(
        "{file}: row {row}, column {column}: \"{value}\" has a decimal comma; \
         set decimal_comma = true in a layout file (--layout), or export with decimal points"
    )]
    DecimalComma {
        /// The file.
        file: String,
        /// The row.
        row: usize,
        /// Column number, from 1.
        column: usize,
        /// The field.
        value: String,
    },
    /// The numbers only make sense in another unit.
    #[error("{file}: {suspicion}")]
    Units {
        /// The file.
        file: String,
        /// What was seen, where, and what to put into the layout.
        suspicion: UnitSuspicion,
    },
    /// Fewer than two rows remain, or most rows hold values that the quantities cannot have.
    #[error("{file}: of {} rows read {} can be used{}", account.read, account.used, main_reason(account))]
    NoUsableRows {
        /// The file.
        file: String,
        /// Account of the rows: how many were set aside, and why.
        account: RowAccount,
    },
    /// The name is neither a built-in layout nor a layout file.
    #[error("unknown layout \"{name}\": built in are {}; or give a .toml file", built_in())]
    UnknownLayout {
        /// What was asked for.
        name: String,
    },
    /// A layout file that cannot be used.
    #[error("layout {file}: {fault}")]
    Layout {
        /// The layout's name or file.
        file: String,
        /// What is wrong with it.
        fault: LayoutFault,
    },
    /// Signals of one log that differ in joints or samples.
    #[error(
        "{file}: {signal} is {found_joints} joints × {found_samples} samples; the log is {joints} × {samples}"
    )]
    Shape {
        /// The log's source.
        file: String,
        /// Which signal.
        signal: &'static str,
        /// Its joints.
        found_joints: usize,
        /// Its samples.
        found_samples: usize,
        /// The log's joints.
        joints: usize,
        /// The log's samples.
        samples: usize,
    },
    /// A log to be written holds a value that is not finite.
    #[error("{}: row {row}, column \"{column}\" would be {value}; nothing was written", path.display())]
    NotFinite {
        /// The output.
        path: PathBuf,
        /// The row it would have.
        row: usize,
        /// The column.
        column: String,
        /// The value.
        value: f64,
    },
    /// The log cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
}

fn utf16_hint(utf16: bool) -> &'static str {
    if utf16 { " (it begins like UTF-16; save it as UTF-8)" } else { "" }
}

fn blank(lines: usize) -> String {
    match lines {
        0 => String::new(),
        1 => " (1 blank line)".to_owned(),
        lines => format!(" ({lines} blank lines)"),
    }
}

fn built_in() -> String {
    super::layout::built_in_layout_names().collect::<Vec<_>>().join(", ")
}

fn without_header() -> String {
    super::layout::built_in_without_header().collect::<Vec<_>>().join(", ")
}

fn list(numbers: &[usize]) -> String {
    numbers.iter().map(usize::to_string).collect::<Vec<_>>().join(", ")
}

fn main_reason(account: &RowAccount) -> String {
    match account.set_aside.iter().max_by_key(|s| s.count) {
        Some(SetAside { reason, count, first_row, example }) => format!(
            "; {count} were set aside for \"{reason}\" (first: row {first_row}, {example}): {}",
            reason.advice()
        ),
        None => ", and a log needs two; record the log again".to_owned(),
    }
}
