//! What can be wrong with a log or with the layout that describes it.

use std::path::PathBuf;

use thiserror::Error;

use super::account::{RowAccount, SetAside};
use crate::output::OutputError;

/// A log that cannot be used: where, which value, and what to do.
#[derive(Debug, Error)]
pub enum LogError {
    /// The file cannot be opened or read on.
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
    /// A line longer than any row can be.
    #[error("{file}: row {row} is longer than {limit} bytes: not a log of one sample per row")]
    LineTooLong {
        /// The file.
        file: String,
        /// The row.
        row: usize,
        /// Largest length accepted, bytes.
        limit: usize,
    },
    /// No bytes, or blank lines only.
    #[error("{file}: the file is empty ({lines} blank lines); record the log again")]
    Empty {
        /// The file.
        file: String,
        /// Blank lines met.
        lines: usize,
    },
    /// A header and nothing below it.
    #[error("{file}: row {row} is a header and no row of data follows; record the log again")]
    HeaderOnly {
        /// The file.
        file: String,
        /// The header's row.
        row: usize,
    },
    /// The layout expects names in the first row.
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
    /// The layout expects numbers in the first row.
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
    /// A column that is needed is not in the header.
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
    /// A column that is used is there twice.
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
    /// Neither currents nor torques.
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
    /// A file without header whose rows have no width that the layout knows.
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
        /// What the layout accepts.
        expected: Vec<usize>,
        /// The layout.
        layout: String,
    },
    /// Decimals written with commas.
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
    /// Numbers that only make sense in another unit.
    #[error("{file}: {suspicion}")]
    Units {
        /// The file.
        file: String,
        /// What was seen, where, and what to put into the layout.
        suspicion: UnitSuspicion,
    },
    /// Fewer than two rows are left, or most rows hold what the quantities cannot be.
    #[error("{file}: of {} rows read {} can be used{}", account.read, account.used, main_reason(account))]
    NoUsableRows {
        /// The file.
        file: String,
        /// What became of the rows.
        account: RowAccount,
    },
    /// Neither a built-in layout nor a layout file.
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
    /// A value that must not be written into a log.
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
    /// A block that every log needs.
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
    /// Names where only numbers can be, or the reverse.
    #[error("{block} = {value}: {expected}")]
    BadColumns {
        /// The block.
        block: &'static str,
        /// What the layout says.
        value: String,
        /// What it may say.
        expected: &'static str,
    },
    /// One column for two things.
    #[error("column {column} is used for \"{first}\" and for \"{second}\"")]
    Overlap {
        /// Column number, from 1.
        column: usize,
        /// One block.
        first: &'static str,
        /// The other.
        second: &'static str,
    },
    /// A block reaches beyond the width it is in.
    #[error("\"{block}\" is column {column}, and this [[width]] has {fields} fields")]
    BeyondWidth {
        /// The block.
        block: &'static str,
        /// Its last column, from 1.
        column: usize,
        /// Fields of the row.
        fields: usize,
    },
    /// A file without header and no widths, or a header and widths.
    #[error(
        "header = {header} and {widths} [[width]] tables: files without header need at least one, others none"
    )]
    Widths {
        /// Whether the files have a header.
        header: bool,
        /// Number of widths.
        widths: usize,
    },
    /// The same width twice.
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
    /// Joints count from 1 in layouts.
    #[error("{key} under [joints] names joint 0: joints count from 1")]
    JointFromOne {
        /// The key.
        key: &'static str,
    },
    /// A joint named twice counts as before.
    #[error("{key} under [joints] names joint {joint} twice")]
    JointTwice {
        /// The key.
        key: &'static str,
        /// The joint, from 1.
        joint: usize,
    },
    /// A joint that the arm does not have.
    #[error("{key} under [joints] names joint {joint}, and the arm has {joints} joints")]
    NoSuchJoint {
        /// The key.
        key: &'static str,
        /// The joint, from 1.
        joint: usize,
        /// Of the arm.
        joints: usize,
    },
    /// A zero that is no angle.
    #[error("zero under [joints] is {value} for joint {joint}: it must be an angle")]
    Zero {
        /// The joint, from 1.
        joint: usize,
        /// The value.
        value: f64,
    },
    /// A zero beyond a whole turn.
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
    /// An order or zeros of another number of joints.
    #[error("{key} under [joints] has {found} number(s), and the arm has {joints} joints")]
    NotAllJoints {
        /// The key.
        key: &'static str,
        /// How many there are.
        found: usize,
        /// Joints of the arm.
        joints: usize,
    },
    /// Stamps in two columns have nanoseconds in the second alone.
    #[error(
        "time_nanoseconds is added to the time, which is in nanoseconds as well (time = \"ns\" under [units]): the time of stamps in \
         two columns is in seconds; leave one of the two out"
    )]
    NanosecondsTwice,
    /// The layout that this one is like cannot be used.
    #[error("like = \"{like}\": {fault}")]
    Like {
        /// The name or the file.
        like: String,
        /// What is wrong with it.
        fault: Box<LogError>,
    },
    /// The file of the layout that this one is like is not there.
    #[error(
        "like = \"{like}\": there is no {}; files are looked for beside the layout that is like them",
        looked_for.display()
    )]
    NoLike {
        /// The file as the layout says it.
        like: String,
        /// Where it would be.
        looked_for: PathBuf,
    },
    /// A layout that is like itself, over others or not.
    #[error("like = \"{like}\" leads back to where it came from: no layout can be like itself")]
    LikeItself {
        /// The name or the file.
        like: String,
    },
    /// A key that neither the layout has nor one that it is like.
    #[error("{key} is missing: every layout says it, or is like one that does")]
    MissingKey {
        /// The key.
        key: &'static str,
    },
    /// Commas cannot separate both fields and decimals.
    #[error("decimal_comma = true needs another delimiter than \"comma\"")]
    CommaTwice,
}

/// Units that the numbers contradict.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum UnitSuspicion {
    /// Positions and velocities are related by the factor of another unit.
    #[error(
        "rows {first_row} to {last_row}, joint {joint}: the position moves {ratio:.4} times as far as the integral of \
         the velocity (from {q_from:.4} to {q_to:.4} rad as read): {quantity} looks like {unit}; \
         put {quantity} = \"{unit}\" under [units] in a layout file (--layout)"
    )]
    Ratio {
        /// Quantity that is in another unit: `time`, `q` or `qd`.
        quantity: &'static str,
        /// The unit it seems to be in.
        unit: &'static str,
        /// The joint it is seen on, from 1.
        joint: usize,
        /// Change of position over integral of velocity.
        ratio: f64,
        /// First row of the stretch it is seen in.
        first_row: usize,
        /// Last row of it.
        last_row: usize,
        /// Position there, as read.
        q_from: f64,
        /// Position at its end.
        q_to: f64,
    },
    /// The clock's steps are no recorder's.
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
    /// Positions and velocities agree with each other and both are too large.
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
    /// Angles change and velocities do not follow.
    #[error(
        "rows {first_row} to {last_row}, joint {joint}: the position moves and the velocities are zero, as if they were not recorded; \
         leave qd out of [columns] in a layout file (--layout), and they are taken from the angles"
    )]
    NoVelocity {
        /// The joint it is seen on, from 1.
        joint: usize,
        /// First row of the stretch it is seen in.
        first_row: usize,
        /// Last row of it.
        last_row: usize,
    },
    /// No unit explains how positions and velocities are related.
    #[error(
        "rows {first_row} to {last_row}, joint {joint}: the position moves {ratio:.4e} times as far as the integral of \
         the velocity, which no unit explains; check which columns are q, qd and time in the layout"
    )]
    Unrelated {
        /// The joint it is seen on, from 1.
        joint: usize,
        /// Change of position over integral of velocity.
        ratio: f64,
        /// First row of the stretch it is seen in.
        first_row: usize,
        /// Last row of it.
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
