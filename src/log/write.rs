//! Writes a log as CSV in the project's own format.

use std::io::Write;
use std::path::Path;

use sha2::{Digest, Sha256};

use super::error::LogError;
use super::lines::hexadecimal;
use super::record::{Effort, Log};
use crate::output::{OutputError, write_atomically};
use crate::robot::JointSignals;

/// Writes a log as comma-separated values with RTDE column names.
///
/// Every number is written in the shortest form that reads back to the same bits. The file appears whole or not at all.
/// Returns the SHA-256 of the file.
///
/// Drive gains are not part of the file: currents are written as currents.
///
/// # Errors
/// [`LogError::Shape`] or [`LogError::NotFinite`] for a log that could not be read back, checked before anything is
/// written; [`LogError::Output`] if the file cannot be written.
pub fn write_log(path: &Path, log: &Log) -> Result<String, LogError> {
    log.check_shape()?;
    let columns = columns(log);
    for (name, values) in &columns {
        if let Some(k) = values.iter().position(|v| !v.is_finite()) {
            return Err(LogError::NotFinite {
                path: path.to_owned(),
                row: k + 2,
                column: name.clone(),
                value: values[k],
            });
        }
    }
    let mut hash = Sha256::new();
    write_columns(path, &columns, |line| hash.update(line))?;
    Ok(hexadecimal(hash))
}

/// Writes columns of equal length, with their names in a header, as comma-separated values; passes every line to
/// `seen`.
///
/// Every number is written in the shortest form that reads back to the same bits. The file appears whole or not at all.
///
/// # Errors
/// [`OutputError`] if the file cannot be written.
pub(crate) fn write_columns(
    path: &Path,
    columns: &[(String, &[f64])],
    mut seen: impl FnMut(&[u8]),
) -> Result<(), OutputError> {
    let samples = columns.first().map_or(0, |(_, values)| values.len());
    write_atomically(path, |file| {
        let names: Vec<&str> = columns.iter().map(|(name, _)| name.as_str()).collect();
        let mut line = names.join(",").into_bytes();
        for k in 0..=samples {
            line.push(b'\n');
            seen(&line);
            file.write_all(&line)?;
            line.clear();
            if k < samples {
                for (i, (_, values)) in columns.iter().enumerate() {
                    let comma = if i == 0 { "" } else { "," };
                    // Debug rather than Display, because it switches to exponents where that is shorter.
                    write!(line, "{comma}{:?}", values[k])?;
                }
            }
        }
        Ok(())
    })
}

/// All columns with their names, in the order in which they are written.
fn columns(log: &Log) -> Vec<(String, &[f64])> {
    fn effort<'a>(
        effort: &'a Effort,
        current: &'a str,
        torque: &'a str,
    ) -> (&'a str, &'a JointSignals) {
        match effort {
            Effort::Current { ampere, .. } => (current, ampere),
            Effort::Torque(nm) => (torque, nm),
        }
    }
    let blocks = [
        Some(("actual_q", &log.q_rad)),
        Some(("actual_qd", &log.qd_rad_s)),
        Some(effort(&log.effort, "actual_current", "actual_torque")),
        log.target_q_rad.as_ref().map(|s| ("target_q", s)),
        log.target_qd_rad_s.as_ref().map(|s| ("target_qd", s)),
        log.target_qdd_rad_s2.as_ref().map(|s| ("target_qdd", s)),
        log.target_effort.as_ref().map(|e| effort(e, "target_current", "target_moment")),
        log.temperature_c.as_ref().map(|s| ("joint_temperatures", s)),
    ];
    let mut columns = vec![("timestamp".to_owned(), log.time_s.as_slice())];
    for (name, signals) in blocks.into_iter().flatten() {
        columns.extend((0..signals.joints()).map(|j| (format!("{name}_{j}"), signals.joint(j))));
    }
    columns
}
