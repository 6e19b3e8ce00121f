//! What can be wrong with a layout.

use std::path::PathBuf;

use thiserror::Error;

use crate::log::error::LogError;

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
    /// The number of drive gains differs from the number of joints.
    #[error(
        "drive_gain_nm_a has {found} number(s), and the arm has {joints} joints: give one for each joint, or choose the --robot the \
         log is of"
    )]
    GainCount {
        /// Number of gains.
        found: usize,
        /// Joints of the arm.
        joints: usize,
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
