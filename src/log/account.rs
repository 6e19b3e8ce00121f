//! The account of every row of a file: used, or set aside and why.

use std::fmt;

/// Why a row was not used.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Reason {
    /// The last line does not end in a newline, so its last value may be cut short.
    CutShort,
    /// Fewer fields than the other rows.
    TooFewFields,
    /// More fields than the other rows.
    TooManyFields,
    /// A required field is empty.
    EmptyField,
    /// A required field is not a number.
    NotANumber,
    /// A required field is NaN or infinite.
    NotFinite,
    /// A number that the quantity cannot have (see [`super::read_log`] for the bounds).
    Implausible,
    /// The same time as the row before.
    TimeRepeated,
    /// A time earlier than that of the row before.
    TimeBackwards,
    /// A time far ahead of the rows before and after it, in one row or a few consecutive ones.
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

    /// The advice given when this reason rules out most rows of a file.
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
    /// The first of these rows, numbered as in the file (from 1, header and blank lines counted).
    pub first_row: usize,
    /// The offending value in that row.
    pub example: String,
}

/// Something a reader of the results should know about a log that could be read.
#[derive(Debug, Clone, PartialEq)]
pub enum LogWarning {
    /// The recorder left out rows.
    MissedSamples {
        /// Number of rows missing.
        missed: usize,
        /// Number of gaps in which they are missing.
        gaps: usize,
        /// The longest step of time, s.
        longest_s: f64,
        /// The row before the longest step.
        after_row: usize,
    },
    /// Time stamps are rounded more coarsely than half the sampling interval; evenly sampled rows are put on the
    /// straight line through their stamps.
    RoundedStamps {
        /// Resolution of the stamps, s.
        resolution_s: f64,
        /// Rows per second.
        rate_hz: f64,
    },
    /// The torque was filtered before it was logged.
    FilteredTorque {
        /// Frequency above which it holds nothing, Hz.
        above_hz: f64,
    },
    /// Time stamps say when a row arrived; evenly sampled rows are put on the straight line through their stamps.
    ArrivalStamps {
        /// Scatter of the stamps about the line (rms), s.
        rms_s: f64,
        /// Rows per second.
        rate_hz: f64,
    },
    /// The clock that stamped the rows was set while the arm moved on; evenly sampled rows go on evenly through it.
    ClockSet {
        /// How many times.
        times: usize,
        /// The row before the first time.
        after_row: usize,
        /// By how much it was set there, s; negative if it was set back.
        first_s: f64,
    },
    /// The clock that stamped the rows ran unevenly against the sampling; evenly sampled rows stay evenly apart.
    ClockWanders {
        /// How far the stamps wander about even steps, s.
        wander_s: f64,
    },
    /// The recorder held rows back and wrote them in bursts, stamped with the time of writing; they are spaced evenly
    /// instead.
    LateBursts {
        /// Number of rows with late stamps.
        rows: usize,
        /// Number of bursts.
        bursts: usize,
        /// The row before the first burst.
        after_row: usize,
        /// Largest lateness of a row, s.
        latest_s: f64,
    },
    /// More than one row in ten was set aside.
    ManySetAside {
        /// Rows set aside.
        set_aside: usize,
        /// Rows read.
        read: usize,
    },
    /// The position of a joint does not change as its velocity predicts.
    VelocityDisagrees {
        /// The joint, counted from 1.
        joint: usize,
        /// Change of position divided by the integral of velocity, median over the log; 1 if they agree.
        ratio: f64,
    },
    /// The position jumps between two rows that each belong to a longer consistent stretch.
    PositionJumps {
        /// Number of jumps.
        count: usize,
        /// The row before the first jump.
        after_row: usize,
        /// The joint with the largest jump there, counted from 1.
        joint: usize,
        /// Size of that jump, rad.
        jump_rad: f64,
    },
    /// Angles were recorded within one turn and jumped at its ends; they have been unwrapped.
    Unwrapped {
        /// Number of jumps by one turn, over all joints.
        count: usize,
        /// The row before the first jump.
        after_row: usize,
        /// The joint that jumps there, counted from 1.
        joint: usize,
    },
    /// Rows are written faster than new readings arrive, so many rows repeat the reading of the row before.
    Held {
        /// Among the rows in which the arm moves, the share that repeat the angles of the row before.
        share: f64,
        /// New readings per second.
        rate_hz: f64,
    },
    /// The file has no velocities; they are computed from the angles.
    SlopesOfAngles,
    /// An optional block is not used, because some of its fields are empty, not numbers, or beyond what the quantity
    /// can be.
    LeftOut {
        /// The block's key in a layout.
        block: &'static str,
        /// Number of unusable fields among the rows used.
        fields: usize,
        /// The first row with an unusable field.
        first_row: usize,
        /// The column of that field.
        column: String,
    },
    /// An optional block is not used, because the file lacks some of its columns.
    Incomplete {
        /// The block's key in a layout.
        block: &'static str,
        /// The first column that is missing.
        column: String,
    },
    /// Torques were read with a layout that expects currents: what it states about them has no effect on torques.
    TorquesRead {
        /// The layout.
        layout: String,
        /// What it states about currents.
        stated: Vec<&'static str>,
    },
    /// Currents became torques by drive gains that are a guess.
    AssumedGains {
        /// The robot.
        robot: String,
        /// Its gains, Nm/A.
        gain_nm_a: Vec<f64>,
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
            Self::FilteredTorque { above_hz } => write!(
                f,
                "the torques hold nothing above {above_hz:.0} Hz, not even noise: they were filtered before they were logged, or simulated \
                 without noise. Give them as they were measured: a filter rounds off friction where joints reverse, which looks like other effects"
            ),
            Self::ArrivalStamps { rms_s, rate_hz } => write!(
                f,
                "time stamps scatter by {:.2} ms (rms), as times of arrival do: rows are taken to be evenly apart, {rate_hz:.3} a second, as the \
                 motion says that they are",
                1e3 * rms_s
            ),
            Self::ClockSet { times, after_row, first_s } => write!(
                f,
                "the clock of the time stamps was set while the arm moved on (times: {times}, the first after row {after_row}, by {first_s:+.4} s): \
                 rows are taken to be evenly apart there, as the motion says that they are"
            ),
            Self::ClockWanders { wander_s } => write!(
                f,
                "time stamps wander by {:.1} ms about even steps, as those of a clock that is slewed do: rows are taken to be evenly apart",
                1e3 * wander_s
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
                "the position jumps {count} times; first after row {after_row}, joint {joint} by {jump_rad:.3} rad: if another recording begins there, \
                 split the file"
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
            Self::Incomplete { block, ref column } => write!(
                f,
                "the log has some columns of {block} and no \"{column}\": the block is left out"
            ),
            Self::TorquesRead { ref layout, ref stated } => write!(
                f,
                "the torques of the log are read, to which nothing applies that the layout \"{layout}\" says of currents ({}): name the \
                 log's columns of currents in it (current under [columns]) to have them read instead",
                stated.join(", ")
            ),
            Self::AssumedGains { ref robot, ref gain_nm_a } => {
                let gains: Vec<String> = gain_nm_a.iter().map(|gain| format!("{gain:.3}")).collect();
                write!(
                    f,
                    "the drive gains of {robot} ({} Nm/A) are a guess, and masses, inertias and friction are as wrong as they are: state \
                     those of your arm (drive_gain_nm_a in a layout, or a robot file without drive_gains_assumed), or log torques",
                    gains.join(", ")
                )
            }
        }
    }
}

/// The account of every row: `read` = `used` + the sum of the counts in `set_aside`.
///
/// Blank lines and the header are not rows of data and are not counted. Prints as a short table.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct RowAccount {
    /// Rows of data in the file.
    pub read: usize,
    /// Rows that entered the log.
    pub used: usize,
    /// Rows set aside, by reason, in the order in which the reasons first occurred.
    pub set_aside: Vec<SetAside>,
    /// Rows that the recorder left out, judged by the median time step.
    pub missed_samples: usize,
    /// Further things that a reader of the results should know.
    pub warnings: Vec<LogWarning>,
}

impl RowAccount {
    /// The account of a log that was created rather than read: all `rows` are used.
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

    /// Counts one row as set aside; `example` is called only for the first row of each reason.
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
