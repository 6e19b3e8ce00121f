//! Names of logs, and how many of their rows were used.

use serde::Serialize;

use crate::log::Log;

/// Numbers of rows read, used and set aside in one or several logs.
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

/// The names of the logs, separated by commas.
pub(super) fn names(logs: &[&Log]) -> String {
    logs.iter().map(|log| log.source.as_str()).collect::<Vec<_>>().join(", ")
}

/// Remarks about a log that could be read, each prefixed with the name of the log.
pub fn log_warnings(log: &Log) -> impl Iterator<Item = String> {
    log.rows.warnings.iter().map(|warning| format!("{}: {warning}", log.source))
}

impl Rows {
    /// Rows read and used, in words.
    pub fn in_words(&self) -> String {
        format!("{} rows read, {} used", self.read, self.used)
    }

    /// Sums over all `logs`.
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
