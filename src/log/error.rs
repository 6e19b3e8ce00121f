//! Errors of logs and of the layouts that describe them.

use std::path::PathBuf;

use thiserror::Error;

use super::account::{RowAccount, SetAside};
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
    #[error("{file}: the file is empty ({lines} blank lines); record the log again")]
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
    /// The layout expects column names in the first row, which holds numbers.
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
        "{file}: row {row} (header) has neither \"{current}\" nor \"{torque}\"; one of them must be logged"
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

/// What is wrong with a layout.
#[derive(Debug, Error)]
pub enum LayoutFault {
    /// Cannot be read.
    #[error("cannot be read: {0}")]
    Read(std::io::Error),
    /// Not valid TOML, or a key or value that layouts do not have (the parser names line and key).
    #[error("{0}")]
    Toml(String),
    /// A block that every log needs is missing.
    #[error(
        "the block \"{block}\" is missing in {place}; a log needs time, q, and current or torque (without qd, velocities are the \
         slopes of the angles)"
    )]
    MissingBlock {
        /// The block.
        block: &'static str,
        /// `[columns]` or `[[width]]`.
        place: String,
    },
    /// Columns are given by names where only numbers are possible, or the reverse.
    #[error("{block} = {value}: {expected}")]
    BadColumns {
        /// The block.
        block: &'static str,
        /// What the layout says.
        value: String,
        /// What it may say.
        expected: &'static str,
    },
    /// One column is used for two quantities.
    #[error("column {column} is used for \"{first}\" and for \"{second}\"")]
    Overlap {
        /// Column number, from 1.
        column: usize,
        /// One block.
        first: &'static str,
        /// The other.
        second: &'static str,
    },
    /// A block reaches beyond the width that lists it.
    #[error("\"{block}\" is column {column}, and this [[width]] has {fields} fields")]
    BeyondWidth {
        /// The block.
        block: &'static str,
        /// Its last column, from 1.
        column: usize,
        /// Fields of the row.
        fields: usize,
    },
    /// A layout without header lists no widths, or one with header does.
    #[error(
        "header = {header} and {widths} [[width]] tables: files without header need at least one, others none"
    )]
    Widths {
        /// Whether the files have a header.
        header: bool,
        /// Number of widths.
        widths: usize,
    },
    /// The same width is listed twice.
    #[error("two [[width]] tables have fields = {fields}")]
    SameWidth {
        /// Fields of both.
        fields: usize,
    },
    /// A drive gain that is not positive.
    #[error("drive_gain_nm_a of joint {joint} is {value}: it must be positive")]
    Gain {
        /// Joint, from 1.
        joint: usize,
        /// The value.
        value: f64,
    },
    /// A list names joint 0, but joints count from 1 in layouts.
    #[error("{key} under [joints] names joint 0: joints count from 1")]
    JointFromOne {
        /// The key.
        key: &'static str,
    },
    /// A list names a joint twice; reversing it twice would cancel out.
    #[error("{key} under [joints] names joint {joint} twice")]
    JointTwice {
        /// The key.
        key: &'static str,
        /// The joint, from 1.
        joint: usize,
    },
    /// A list names a joint that the arm does not have.
    #[error("{key} under [joints] names joint {joint}, and the arm has {joints} joints")]
    NoSuchJoint {
        /// The key.
        key: &'static str,
        /// The joint, from 1.
        joint: usize,
        /// Joints of the arm.
        joints: usize,
    },
    /// A zero is not a finite angle.
    #[error("zero under [joints] is {value} for joint {joint}: it must be an angle")]
    Zero {
        /// The joint, from 1.
        joint: usize,
        /// The value.
        value: f64,
    },
    /// A zero in radians is larger than a whole turn.
    #[error(
        "zero under [joints] is {value} for joint {joint}, more than a whole turn in radians: it looks like degrees. Zeros are in the \
         unit of q: write {:.4}, or put q = \"deg\" under [units] where the angles are in degrees as well",
        value.to_radians()
    )]
    ZeroInDegrees {
        /// The joint, from 1.
        joint: usize,
        /// The value.
        value: f64,
    },
    /// The number of entries of an order, or of the zeros, differs from the number of joints.
    #[error("{key} under [joints] has {found} number(s), and the arm has {joints} joints")]
    NotAllJoints {
        /// The key.
        key: &'static str,
        /// Number of entries.
        found: usize,
        /// Joints of the arm.
        joints: usize,
    },
    /// The layout adds a column of nanoseconds to a time that is in nanoseconds as well. Of a time stamp split into two
    /// columns, only the second column may be in nanoseconds.
    #[error(
        "time_nanoseconds is added to the time, which is in nanoseconds as well (time = \"ns\" under [units]): the time of stamps in \
         two columns is in seconds; leave one of the two out"
    )]
    NanosecondsTwice,
    /// The layout named by `like` cannot be used.
    #[error("like = \"{like}\": {fault}")]
    Like {
        /// The name or the file.
        like: String,
        /// What is wrong with it.
        fault: Box<LogError>,
    },
    /// The layout file named by `like` does not exist.
    #[error(
        "like = \"{like}\": there is no {}; files are looked for beside the layout that is like them",
        looked_for.display()
    )]
    NoLike {
        /// The file as named in the layout.
        like: String,
        /// The path where it was looked for.
        looked_for: PathBuf,
    },
    /// A chain of `like` leads back to a layout that is already in it.
    #[error("like = \"{like}\" leads back to where it came from: no layout can be like itself")]
    LikeItself {
        /// The name or the file.
        like: String,
    },
    /// A required key is in neither the layout nor any layout that it is like.
    #[error("{key} is missing: every layout says it, or is like one that does")]
    MissingKey {
        /// The key.
        key: &'static str,
    },
    /// Commas are to separate both fields and decimals.
    #[error("decimal_comma = true needs another delimiter than \"comma\"")]
    CommaTwice,
}

/// A stated unit that the numbers contradict.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum UnitSuspicion {
    /// Positions and velocities are related by the factor between two units.
    #[error(
        "rows {first_row} to {last_row}, joint {joint}: the position moves {ratio:.4} times as far as the integral of \
         the velocity (from {q_from:.4} to {q_to:.4} rad as read): {quantity} looks like {unit}; \
         put {quantity} = \"{unit}\" under [units] in a layout file (--layout)"
    )]
    Ratio {
        /// The quantity that is in another unit: `time`, `q` or `qd`.
        quantity: &'static str,
        /// The unit it seems to be in.
        unit: &'static str,
        /// The joint on which it is seen, from 1.
        joint: usize,
        /// Change of position over integral of velocity.
        ratio: f64,
        /// First row of the stretch in which it is seen.
        first_row: usize,
        /// Last row of that stretch.
        last_row: usize,
        /// Position at the start of the stretch, as read.
        q_from: f64,
        /// Position at the end of the stretch, as read.
        q_to: f64,
    },
    /// The time steps are too long or too short for a recorder of motion.
    #[error(
        "the time steps by {step_s:.3e} s from row to row (first at row {row}, time {time_s}): it looks like {unit}; \
         put time = \"{unit}\" under [units] in a layout file (--layout)"
    )]
    Clock {
        /// The unit it seems to be in.
        unit: &'static str,
        /// Median step as read, s.
        step_s: f64,
        /// The first row.
        row: usize,
        /// Its time as read, s.
        time_s: f64,
    },
    /// Positions and velocities agree with each other, and both are too large.
    #[error(
        "row {row}, joint {joint}: q = {q:.4} rad, and {joints} joints stay beyond one turn on average: q and qd look \
         like degrees; put q = \"deg\" and qd = \"deg/s\" under [units] in a layout file (--layout)"
    )]
    Degrees {
        /// The row.
        row: usize,
        /// The joint, from 1.
        joint: usize,
        /// Its position as read.
        q: f64,
        /// How many joints show it.
        joints: usize,
    },
    /// The angles change, but the velocities are zero.
    #[error(
        "rows {first_row} to {last_row}, joint {joint}: the position moves and the velocities are zero, as if they were not recorded; \
         leave qd out of [columns] in a layout file (--layout), and they are taken from the angles"
    )]
    NoVelocity {
        /// The joint on which it is seen, from 1.
        joint: usize,
        /// First row of the stretch in which it is seen.
        first_row: usize,
        /// Last row of that stretch.
        last_row: usize,
    },
    /// No unit explains how positions and velocities are related.
    #[error(
        "rows {first_row} to {last_row}, joint {joint}: the position moves {ratio:.4e} times as far as the integral of \
         the velocity, which no unit explains; check which columns are q, qd and time in the layout, and whether the velocities \
         are those of the motors, before the gears"
    )]
    Unrelated {
        /// The joint on which it is seen, from 1.
        joint: usize,
        /// Change of position over integral of velocity.
        ratio: f64,
        /// First row of the stretch in which it is seen.
        first_row: usize,
        /// Last row of that stretch.
        last_row: usize,
    },
}

fn utf16_hint(utf16: bool) -> &'static str {
    if utf16 { " (it begins like UTF-16; save it as UTF-8)" } else { "" }
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
