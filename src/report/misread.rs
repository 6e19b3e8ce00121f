//! A log that is not read as it was recorded, and the layout with which it is.

use serde::Serialize;

use super::Section;
use crate::identify::Misreading;

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

/// What is to be done with the lines.
const WHAT_TO_DO: &str = "Read with these lines in a file (--layout FILE.toml) it fits:";

impl MisreadLog {
    /// The layout with which the log fits, for the terminal.
    pub fn advice(&self) -> Option<String> {
        let lines = self.layout.as_ref()?.lines();
        let indented = lines.map(|line| format!("    {line}").trim_end().to_owned());
        Some(
            [WHAT_TO_DO.to_owned(), String::new()]
                .into_iter()
                .chain(indented)
                .collect::<Vec<_>>()
                .join("\n"),
        )
    }

    /// The same for a page.
    pub fn section(&self) -> Option<Section> {
        let lines = self.layout.as_ref()?;
        Some(Section::new("How to read the log").paragraph(WHAT_TO_DO).code(lines))
    }
}
