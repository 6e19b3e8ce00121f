//! A log whose channels have to be read differently, and the layout that does so.

use serde::Serialize;

use super::Section;
use crate::identify::{Change, Misreading};
use crate::log::Layout;

/// A log that fits its arm only when its channels are read, or the arm is mounted, differently.
#[derive(Debug, Clone, Serialize)]
pub struct MisreadLog {
    /// Name of the log.
    pub log: String,
    /// How the log has to be read.
    #[serde(flatten)]
    pub misreading: Misreading,
    /// Lines of a layout file that reads the log correctly; `null` where no layout can.
    pub layout: Option<String>,
}

impl MisreadLog {
    /// Combines the `misreading` of `log` with the corrected version of the `layout` it was read with.
    pub fn new(log: String, misreading: Misreading, layout: &Layout) -> Self {
        let layout = misreading.layout(layout);
        Self { log, misreading, layout }
    }

    /// The corrected layout with instructions, for the terminal.
    pub fn advice(&self) -> Option<String> {
        let lines = self.layout.as_ref()?.lines();
        let indented = lines.map(|line| format!("    {line}").trim_end().to_owned());
        let lines: Vec<String> = indented.collect();
        Some(format!("{}\n\n{}", self.what_to_do(), lines.join("\n")))
    }

    /// The corrected layout with instructions, for a page.
    pub fn section(&self) -> Option<Section> {
        let lines = self.layout.as_ref()?;
        Some(Section::new("How to read the log").paragraph(self.what_to_do()).code(lines))
    }

    /// Tells the user how to use the lines of the layout.
    fn what_to_do(&self) -> String {
        let is_mounted =
            self.misreading.changes.iter().any(|change| matches!(change, Change::Mounted { .. }));
        let also = if is_mounted { ", of an arm that is mounted as said" } else { "" };
        format!(
            "With these lines in a file of this folder (--layout FILE.toml) it is read as it was recorded{also}:"
        )
    }
}
