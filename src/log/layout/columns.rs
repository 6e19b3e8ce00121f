//! Where the columns of a block are: by name, by pattern or by number.

use std::fmt;

use serde::Deserialize;

use super::block::Block;
use super::fault::LayoutFault;

/// The columns of every block.
#[derive(Debug, Clone, PartialEq, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Blocks {
    time: Option<Columns>,
    time_nanoseconds: Option<Columns>,
    q: Option<Columns>,
    qd: Option<Columns>,
    current: Option<Columns>,
    torque: Option<Columns>,
    target_q: Option<Columns>,
    target_qd: Option<Columns>,
    target_qdd: Option<Columns>,
    target_current: Option<Columns>,
    target_moment: Option<Columns>,
    temperature: Option<Columns>,
}

impl Blocks {
    /// The columns of `block`, if the layout has them.
    pub(super) fn of(&self, block: Block) -> Option<&Columns> {
        match block {
            Block::Time => &self.time,
            Block::TimeNanoseconds => &self.time_nanoseconds,
            Block::Q => &self.q,
            Block::Qd => &self.qd,
            Block::Current => &self.current,
            Block::Torque => &self.torque,
            Block::TargetQ => &self.target_q,
            Block::TargetQd => &self.target_qd,
            Block::TargetQdd => &self.target_qdd,
            Block::TargetCurrent => &self.target_current,
            Block::TargetMoment => &self.target_moment,
            Block::Temperature => &self.temperature,
        }
        .as_ref()
    }
}

/// The columns of one block.
#[derive(Debug, Clone, PartialEq, Deserialize)]
#[serde(
    untagged,
    expecting = "columns are a name (with {0} or {1} for the joint), a list of names, a column number, \
                 or { first = 2, last = 7 }"
)]
pub(in crate::log) enum Columns {
    Name(String),
    Names(Vec<String>),
    Number(usize),
    Range(ColumnRange),
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(in crate::log) struct ColumnRange {
    first: usize,
    last: usize,
}

/// Prints the columns as they are written in a layout file.
impl fmt::Display for Columns {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Self::Name(name) => write!(f, "{name:?}"),
            Self::Names(names) => write!(f, "{names:?}"),
            Self::Number(number) => write!(f, "{number}"),
            Self::Range(ColumnRange { first, last }) => {
                write!(f, "{{ first = {first}, last = {last} }}")
            }
        }
    }
}

impl Columns {
    /// Name of the column of a joint (from 0). A pattern gives a name for any joint. `None` for column numbers.
    pub(in crate::log) fn name(&self, joint: usize) -> Option<String> {
        match self {
            Self::Name(pattern) => Some(
                pattern.replace("{0}", &joint.to_string()).replace("{1}", &(joint + 1).to_string()),
            ),
            Self::Names(names) => names.get(joint).cloned(),
            Self::Number(_) | Self::Range(_) => None,
        }
    }

    /// Column numbers from 0, in the order of the joints. `None` for names.
    pub(in crate::log) fn numbers(&self) -> Option<std::ops::Range<usize>> {
        match *self {
            Self::Number(n) => Some(n - 1..n),
            Self::Range(ColumnRange { first, last }) => Some(first - 1..last),
            Self::Name(_) | Self::Names(_) => None,
        }
    }

    /// Number of columns; `None` for a pattern.
    pub(in crate::log) fn len(&self) -> Option<usize> {
        match self {
            Self::Name(_) => None,
            Self::Names(names) => Some(names.len()),
            Self::Number(_) | Self::Range(_) => self.numbers().map(|r| r.len()),
        }
    }

    pub(super) fn check(&self, block: Block, header: bool) -> Result<(), LayoutFault> {
        let fault = |expected| {
            Err(LayoutFault::BadColumns { block: block.key(), value: self.to_string(), expected })
        };
        let is_pattern = |name: &str| name.contains("{0}") || name.contains("{1}");
        match self {
            Self::Name(_) | Self::Names(_) if !header => {
                fault("files without header have no names; give column numbers")
            }
            Self::Name(name) if block.is_of_time() && is_pattern(name) => {
                fault("the time is one column, without {0} or {1}")
            }
            Self::Name(name) if !block.is_of_time() && !is_pattern(name) => {
                fault("a name for all joints needs {0} or {1} where the joint's number stands")
            }
            Self::Names(_) | Self::Range(_) if block.is_of_time() => {
                fault("the time is one column")
            }
            Self::Names(names) if names.is_empty() => fault("name at least one column"),
            Self::Number(0) => fault("column numbers count from 1"),
            Self::Range(r) if r.first == 0 || r.last < r.first => {
                fault("column numbers count from 1, and last is not before first")
            }
            _ => Ok(()),
        }
    }
}
