//! What became of every row of a file.

use std::fmt;

/// Why a row was not used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Reason {
    /// The last line has no line end, so its last value may be cut short.
    CutShort,
    /// Fewer fields than the other rows.
    TooFewFields,
    /// More fields than the other rows.
    TooManyFields,
    /// A field that is needed is empty.
    EmptyField,
    /// A field that is needed is no number.
    NotANumber,
    /// NaN or infinite.
    NotFinite,
    /// A number beyond what the quantity can be (see [`super::read_log`] for the bounds).
    Implausible,
    /// The same time as the row before.
    TimeRepeated,
    /// A time before that of the row before.
    TimeBackwards,
    /// A time far ahead of the rows before and behind, alone or with a few others.
    TimeAhead,
    /// Positions that do not follow from the neighbouring rows' positions and velocities.
    Inconsistent,
}

impl Reason {
    /// The reason in a few words, for tables and JSON.
    pub fn text(self) -> &'static str {
        match self {
            Self::CutShort => "last row without a line end",
            Self::TooFewFields => "too few fields",
            Self::TooManyFields => "too many fields",
            Self::EmptyField => "empty field",
            Self::NotANumber => "not a number",
            Self::NotFinite => "NaN or infinite",
            Self::Implausible => "implausible value",
            Self::TimeRepeated => "repeated time",
            Self::TimeBackwards => "time runs backwards",
            Self::TimeAhead => "time far ahead of its neighbours",
            Self::Inconsistent => "position does not follow from its neighbours",
        }
    }

    /// What to look at when every row of a file falls to this reason.
    pub(super) fn advice(self) -> &'static str {
        match self {
            Self::CutShort => "copy the file again",
            Self::TooFewFields | Self::TooManyFields => {
                "check that the layout and its delimiter are the file's own, and that decimals are not \
                 written with the delimiter"
            }
            Self::EmptyField | Self::NotANumber | Self::NotFinite => {
                "record the quantity, or leave its block out of the layout"
            }
            Self::Implausible => "check the layout: the columns or the units are not these",
            Self::TimeRepeated | Self::TimeBackwards | Self::TimeAhead => {
                "check which column is the time, and that the file holds one recording: several in one file are several logs, split it where \
                 the time begins again"
            }
            Self::Inconsistent => "check which columns are positions and which are velocities",
        }
    }
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.text())
    }
}

/// The rows set aside for one reason.
#[derive(Debug, Clone, PartialEq)]
pub struct SetAside {
    /// Why.
    pub reason: Reason,
    /// How many rows.
    pub count: usize,
    /// The first of them, numbered as in the file (from 1, header and blank lines counted).
    pub first_row: usize,
    /// The value met in that row.
    pub example: String,
}

/// Something a reader of the results should know about a log that could be read.
#[derive(Debug, Clone, PartialEq)]
pub enum LogWarning {
    /// Rows that the recorder should have written and did not.
    MissedSamples {
        /// Rows missing.
        missed: usize,
        /// Number of gaps they are missing in.
        gaps: usize,
        /// The longest step of time, s.
        longest_s: f64,
        /// The row before the longest step.
        after_row: usize,
    },
    /// Time stamps that are coarser than half of what rows are apart: evenly recorded rows are put on the line through them.
    RoundedStamps {
        /// What they are rounded to, s.
        resolution_s: f64,
        /// Rows a second.
        rate_hz: f64,
    },
    /// Rows that were kept back and written all at once, with the time at which they were: they are put where even rows have them.
    LateBursts {
        /// Rows with such stamps.
        rows: usize,
        /// How often rows were kept back.
        bursts: usize,
        /// The row before the first of them.
        after_row: usize,
        /// By how much the latest was late, s.
        latest_s: f64,
    },
    /// More than one row in ten was set aside.
    ManySetAside {
        /// Rows set aside.
        set_aside: usize,
        /// Rows read.
        read: usize,
    },
    /// A joint's position does not move as its velocity says.
    VelocityDisagrees {
        /// The joint, counted from 1.
        joint: usize,
        /// Change of position over the integral of velocity, median over the log; 1 when they agree.
        ratio: f64,
    },
    /// The position jumps between rows that are each part of a longer consistent stretch.
    PositionJumps {
        /// How often.
        count: usize,
        /// The row before the first jump.
        after_row: usize,
        /// The joint that jumps most there, counted from 1.
        joint: usize,
        /// By how much, rad.
        jump_rad: f64,
    },
    /// Angles that were given within one turn and jumped at its ends, put together again.
    Unwrapped {
        /// How many jumps of one turn, in all joints.
        count: usize,
        /// The row before the first.
        after_row: usize,
        /// The joint that jumps there, counted from 1.
        joint: usize,
    },
    /// The file is written faster than its readings are new.
    Held {
        /// Share of the rows of a moving arm whose angles are those of the row before.
        share: f64,
        /// New readings a second.
        rate_hz: f64,
    },
    /// The file has no velocities.
    SlopesOfAngles,
    /// A block that a log need not have, with fields that are empty, no numbers or beyond what the quantity can be: it is
    /// not used.
    LeftOut {
        /// The block's key in a layout.
        block: &'static str,
        /// How many such fields in the rows used.
        fields: usize,
        /// The first row with one.
        first_row: usize,
        /// The column it is in.
        column: String,
    },
}

impl fmt::Display for LogWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::MissedSamples { missed, gaps, longest_s, after_row } => write!(
                f,
                "{missed} samples are missing in {gaps} gaps; the longest step is {longest_s:.4} s, \
                 after row {after_row}"
            ),
            Self::RoundedStamps { resolution_s, rate_hz } => write!(
                f,
                "time stamps are rounded to {resolution_s:.4} s: rows are taken to be evenly apart, {rate_hz:.3} a second, as the motion \
                 says that they are"
            ),
            Self::LateBursts { rows, bursts, after_row, latest_s } => write!(
                f,
                "the recorder wrote rows late in bursts, by up to {:.1} ms (rows: {rows}, bursts: {bursts}, the first after row \
                 {after_row}); they are read as evenly sampled",
                1e3 * latest_s
            ),
            Self::ManySetAside { set_aside, read } => write!(
                f,
                "{set_aside} of {read} rows were set aside: look at the file before trusting the rest"
            ),
            Self::VelocityDisagrees { joint, ratio } => write!(
                f,
                "joint {joint}: the position changes {ratio:.3} times as much as the velocity says; \
                 check these two columns"
            ),
            Self::PositionJumps { count, after_row, joint, jump_rad } => write!(
                f,
                "the position jumps {count} times; first after row {after_row}, joint {joint} by \
                 {jump_rad:.3} rad"
            ),
            Self::Unwrapped { count, after_row, joint } => write!(
                f,
                "angles are wrapped, first joint {joint}'s after row {after_row}: unwrapped {count} times"
            ),
            Self::Held { share, rate_hz } => write!(
                f,
                "{:.0} % of the rows repeat the angles of the one before while the arm moves: some {rate_hz:.0} readings a second are \
                 new, and the others are late and bend what is identified; keep the rows with new readings only",
                100.0 * share
            ),
            Self::SlopesOfAngles => f.write_str(
                "the log has no velocities: they are the slopes of polynomials through five angles, and noisier than recorded ones"
            ),
            Self::LeftOut { block, fields, first_row, ref column } => write!(
                f,
                "{fields} fields of {block} hold nothing that can be used, the first in row {first_row}, {column}: \
                 the block is left out"
            ),
        }
    }
}

/// What became of every row: `read` = `used` + the counts of `set_aside`.
///
/// Blank lines and the header are not rows of data and are not counted. Prints as a short table.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RowAccount {
    /// Rows of data met.
    pub read: usize,
    /// Rows in the log.
    pub used: usize,
    /// Rows left out, by reason, in the order first met.
    pub set_aside: Vec<SetAside>,
    /// Rows that the recorder did not write, judged by the median step of time.
    pub missed_samples: usize,
    /// What else should be known.
    pub warnings: Vec<LogWarning>,
}

impl RowAccount {
    /// The account of a log that was made, not read: all `rows` used.
    pub fn complete(rows: usize) -> Self {
        Self { read: rows, used: rows, ..Self::default() }
    }

    /// Number of rows set aside for `reason`.
    pub fn count(&self, reason: Reason) -> usize {
        self.set_aside.iter().find(|s| s.reason == reason).map_or(0, |s| s.count)
    }

    /// Number of rows set aside for any reason.
    pub fn total_set_aside(&self) -> usize {
        self.set_aside.iter().map(|s| s.count).sum()
    }

    /// Counts one row; `example` is only asked for at the first of its reason.
    pub(super) fn add(&mut self, reason: Reason, row: usize, example: impl FnOnce() -> String) {
        match self.set_aside.iter_mut().find(|s| s.reason == reason) {
            Some(entry) => entry.count += 1,
            None => {
                self.set_aside.push(SetAside {
                    reason,
                    count: 1,
                    first_row: row,
                    example: example(),
                });
            }
        }
    }
}

impl fmt::Display for RowAccount {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:>9} rows read\n{:>9} used", self.read, self.used)?;
        for entry in &self.set_aside {
            write!(
                f,
                "\n{:>9} set aside: {} (first: row {}, {})",
                entry.count, entry.reason, entry.first_row, entry.example
            )?;
        }
        for warning in &self.warnings {
            write!(f, "\n  warning: {warning}")?;
        }
        Ok(())
    }
}
