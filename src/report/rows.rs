//! The logs by name, and what became of their rows.

use serde::Serialize;

use crate::log::Log;

/// What became of the rows of one or several logs.
#[derive(Debug, Clone, Serialize)]
pub struct Rows {
    pub(super) read: usize,
    pub(super) used: usize,
    set_aside: Vec<SetAside>,
}

#[derive(Debug, Clone, Serialize)]
struct SetAside {
    reason: &'static str,
    count: usize,
}

/// The logs by name, separated by commas.
pub(super) fn names(logs: &[&Log]) -> String {
    logs.iter().map(|log| log.source.as_str()).collect::<Vec<_>>().join(", ")
}

/// What should be known of a log that could be read, with its name.
pub fn log_warnings(log: &Log) -> impl Iterator<Item = String> {
    log.rows.warnings.iter().map(|warning| format!("{}: {warning}", log.source))
}

impl Rows {
    /// How many were read and used.
    pub fn in_words(&self) -> String {
        format!("{} rows read, {} used", self.read, self.used)
    }

    /// Of all `logs` together.
    pub fn of(logs: &[&Log]) -> Self {
        let mut rows = Self { read: 0, used: 0, set_aside: Vec::new() };
        for log in logs {
            rows.read += log.rows.read;
            rows.used += log.rows.used;
            for part in &log.rows.set_aside {
                let (reason, count) = (part.reason.text(), part.count);
                match rows.set_aside.iter_mut().find(|known| known.reason == reason) {
                    Some(known) => known.count += count,
                    None => rows.set_aside.push(SetAside { reason, count }),
                }
            }
        }
        rows
    }
}
