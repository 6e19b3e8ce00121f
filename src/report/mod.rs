//! Output: numbers with their uncertainty, tables, figures, self-contained pages, and JSON.
//!
//! Input: results of the other modules. Output: text for the terminal, Markdown, a [`Page`] as one HTML file without
//! network access or scripts, and [`json`] documents that name program, command, seed and inputs.

pub mod blind;
pub mod cutoff_study;
pub mod diagnose;
mod error;
pub mod excitation;
pub mod identify;
pub mod json;
pub mod misread;
pub mod montecarlo;
pub mod noise_study;
mod page;
pub mod paper_study;
pub mod physical;
pub mod physical_study;
pub mod plot;
pub mod real_arm;
pub mod replay;
pub mod rows;
pub mod saved;
mod status;
mod table;

pub use error::ReportError;
pub use page::{Folded, Page, Section, Verdict};
pub use status::Status;
pub use table::{Align, Column, Row, Table};

/// The last component of a path.
fn file_name(path: &str) -> &str {
    path.rsplit(['/', '\\']).next().unwrap_or(path)
}
