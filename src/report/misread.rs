//! A log that is not read as it was recorded, and the layout with which it is.

use serde::Serialize;

use super::Section;
use crate::identify::{Change, Misreading};
use crate::log::Layout;

/// A log that fits its arm when it is read otherwise.
#[derive(Debug, Clone, Serialize)]
pub struct MisreadLog {
    /// Its name.
    pub log: String,
    /// How it has to be read.
    #[serde(flatten)]
    pub misreading: Misreading,
    /// The lines of a layout that reads it so; `null` where a layout cannot.
    pub layout: Option<String>,
}

impl MisreadLog {
    /// Of `log`, which was read with `layout`.
    pub fn new(log: String, misreading: Misreading, layout: &Layout) -> Self {
        let layout = misreading.layout(layout);
        Self { log, misreading, layout }
    }

    /// The layout with which the log fits, for the terminal.
    pub fn advice(&self) -> Option<String> {
        let lines = self.layout.as_ref()?.lines();
        let indented = lines.map(|line| format!("    {line}").trim_end().to_owned());
        let lines: Vec<String> = indented.collect();
        Some(format!("{}\n\n{}", self.what_to_do(), lines.join("\n")))
    }

    /// The same for a page.
    pub fn section(&self) -> Option<Section> {
        let lines = self.layout.as_ref()?;
        Some(Section::new("How to read the log").paragraph(self.what_to_do()).code(lines))
    }

    /// What is to be done with the lines.
    fn what_to_do(&self) -> String {
        let is_mounted =
            self.misreading.changes.iter().any(|change| matches!(change, Change::Mounted { .. }));
        let also = if is_mounted { ", of an arm that is mounted as said" } else { "" };
        format!(
            "With these lines in a file of this folder (--layout FILE.toml) it is read as it was recorded{also}:"
        )
    }
}
