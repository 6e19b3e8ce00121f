//! Reads the samples of a planned motion back from CSV.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Read};
use std::path::Path;

use thiserror::Error;

use super::export::columns;
use crate::dynamics::Motion;
use crate::input::without_mark;
use crate::robot::JointSignals;

/// Longest header that is read, bytes: enough for a thousand joints.
const HEADER_LIMIT: u64 = 1 << 16;

/// A motion that was planned, sample by sample, as [`write_csv`](super::export::write_csv) writes it.
#[derive(Debug, Clone, PartialEq)]
pub struct PlannedMotion {
    /// Time of every sample, s.
    pub time_s: Vec<f64>,
    /// The motion.
    pub motion: Motion,
}

/// A planned motion that cannot be used.
#[derive(Debug, Error)]
pub enum PlannedError {
    /// Reading fails.
    #[error("{file}: cannot be read: {source}")]
    Read {
        /// The file.
        file: String,
        /// Why.
        source: io::Error,
    },
    /// The motion is one of another arm.
    #[error(
        "{file}: the motion has {found} joints, the arm has {expected}; choose the --robot it is planned for"
    )]
    Joints {
        /// The file.
        file: String,
        /// Joints of the motion.
        found: usize,
        /// Joints of the arm.
        expected: usize,
    },
    /// A row is longer or shorter than the header.
    #[error("{file}: row {row} has {found} fields, the header has {expected}")]
    Fields {
        /// The file.
        file: String,
        /// Number of the line in the file, from 1.
        row: usize,
        /// Fields of the row.
        found: usize,
        /// Fields of the header.
        expected: usize,
    },
    /// A field that is no finite number.
    #[error("{file}: row {row}: {column} is \"{value}\", which is no finite number")]
    Number {
        /// The file.
        file: String,
        /// Number of the line in the file, from 1.
        row: usize,
        /// Name of the column.
        column: String,
        /// The field.
        value: String,
    },
    /// A header without rows.
    #[error("{file}: a header, and no row of a motion follows")]
    HeaderOnly {
        /// The file.
        file: String,
    },
}

impl PlannedMotion {
    /// Reads the motion in `path`, of an arm with `joints` joints. `None` if the file is no planned motion, or cannot be
    /// opened: it is one if its header has exactly the columns that [`write_csv`](super::export::write_csv) writes, in
    /// their order. No log has these columns alone, since they tell no torque. Pipes are not looked into, because what
    /// is read from them is gone.
    ///
    /// # Errors
    /// [`PlannedError`] for a planned motion of another number of joints, and for rows that are not made of as many
    /// finite numbers as the header has columns.
    pub fn read(path: &Path, joints: usize) -> Result<Option<Self>, PlannedError> {
        let file = path.display().to_string();
        let source = if path.is_file() { File::open(path).ok() } else { None };
        let Some(mut source) = source.map(BufReader::new) else { return Ok(None) };
        let fault = |source| PlannedError::Read { file: file.clone(), source };
        let mut header = Vec::new();
        source.by_ref().take(HEADER_LIMIT).read_until(b'\n', &mut header).map_err(fault)?;
        let header = String::from_utf8_lossy(&header);
        let names: Vec<&str> = without_mark(&header).split(',').map(str::trim).collect();
        let found = names.len() / 3;
        if found == 0 || names != columns(found) {
            return Ok(None);
        }
        if found != joints {
            return Err(PlannedError::Joints { file, found, expected: joints });
        }
        let values = rows(source, &names, &file)?;
        if values.is_empty() {
            return Err(PlannedError::HeaderOnly { file });
        }
        let (width, samples) = (names.len(), values.len() / names.len());
        let block = |first: usize| {
            JointSignals::from_fn(joints, samples, |j, k| values[k * width + first + j])
        };
        let [q_rad, qd_rad_s, qdd_rad_s2] = [0, 1, 2].map(|b| block(1 + b * joints));
        let time_s = values.iter().step_by(width).copied().collect();
        Ok(Some(Self { time_s, motion: Motion { q_rad, qd_rad_s, qdd_rad_s2 } }))
    }
}

/// The numbers behind the header with the columns `names`, row by row. Blank lines do not count.
fn rows(mut source: impl BufRead, names: &[&str], file: &str) -> Result<Vec<f64>, PlannedError> {
    let mut values = Vec::new();
    let mut line = String::new();
    for row in 2.. {
        line.clear();
        let length = source
            .read_line(&mut line)
            .map_err(|source| PlannedError::Read { file: file.to_owned(), source })?;
        if length == 0 {
            break;
        }
        if line.trim().is_empty() {
            continue;
        }
        for (k, field) in line.split(',').map(str::trim).enumerate() {
            let Some(column) = names.get(k) else { continue };
            let number: Option<f64> = field.parse().ok().filter(|number: &f64| number.is_finite());
            let Some(number) = number else {
                let (column, value) = ((*column).to_owned(), field.to_owned());
                return Err(PlannedError::Number { file: file.to_owned(), row, column, value });
            };
            values.push(number);
        }
        let (found, expected) = (line.split(',').count(), names.len());
        if found != expected {
            return Err(PlannedError::Fields { file: file.to_owned(), row, found, expected });
        }
    }
    Ok(values)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::excitation::export::write_csv;
    use crate::excitation::{Excitation, FourierSeries, Reference};

    fn motion() -> Excitation {
        let series = FourierSeries::built_in("ur5_identification").unwrap();
        Excitation::new(series, 1.0, 1).unwrap()
    }

    /// What is written at 10 Hz.
    fn text() -> String {
        let mut text = Vec::new();
        write_csv(&mut text, &motion(), 10.0).unwrap();
        String::from_utf8(text).unwrap()
    }

    fn read(text: &str, joints: usize) -> Result<Option<PlannedMotion>, String> {
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        PlannedMotion::read(file.path(), joints).map_err(|error| error.to_string())
    }

    #[test]
    fn what_was_written_comes_back_to_the_last_bit() {
        let planned = read(&text(), 6).unwrap().unwrap();
        assert_eq!(planned.time_s.len(), planned.motion.samples());
        for (k, t_s) in planned.time_s.iter().enumerate() {
            assert_eq!(*t_s, k as f64 / 10.0);
            let [mut q, mut qd, mut qdd] = [[0.0; 6]; 3];
            motion().sample(*t_s, &mut q, &mut qd, &mut qdd);
            let mut row = [0.0; 6];
            for (signals, expected) in [
                (&planned.motion.q_rad, q),
                (&planned.motion.qd_rad_s, qd),
                (&planned.motion.qdd_rad_s2, qdd),
            ] {
                signals.sample_into(k, &mut row);
                assert_eq!(row, expected);
            }
        }
        // Spreadsheets write a byte order mark, carriage returns and blanks.
        let other = format!("\u{feff}{}\r\n", text().replace('\n', "\r\n").replace(',', ", "));
        assert_eq!(read(&other, 6), Ok(Some(planned)));
    }

    #[test]
    fn logs_are_no_planned_motions() {
        let with_torque = text().replacen("target_qdd_5", "target_qdd_5,actual_torque_0", 1);
        let renamed = text().replacen("timestamp", "t", 1);
        for other in [with_torque.as_str(), renamed.as_str(), "", "timestamp\n"] {
            assert_eq!(read(other, 6), Ok(None));
        }
        assert!(PlannedMotion::read(Path::new("missing.csv"), 6).unwrap().is_none());
    }

    #[test]
    fn what_is_wrong_is_named_by_its_row() {
        let message = |text: &str, joints| read(text, joints).unwrap_err();
        assert!(message(&text(), 3).contains("has 6 joints, the arm has 3"));
        let header = text().lines().next().unwrap().to_owned();
        assert!(message(&header, 6).contains("no row of a motion follows"));
        let zeros = "0,".repeat(18);
        let rows = |second: &str| format!("{header}\n{zeros}0\n\n{zeros}{second}\n");
        assert!(read(&rows("0"), 6).unwrap().is_some());
        let not_a_number = message(&rows("nan"), 6);
        assert!(not_a_number.contains("row 4: target_qdd_5 is \"nan\""), "{not_a_number}");
        let longer = message(&rows("0,0"), 6);
        assert!(longer.contains("row 4 has 20 fields, the header has 19"), "{longer}");
        let shorter = message(&format!("{header}\n0,0\n"), 6);
        assert!(shorter.contains("row 2 has 2 fields, the header has 19"), "{shorter}");
    }
}
