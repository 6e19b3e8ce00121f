//! Why a report or JSON document could not be made.

use std::path::PathBuf;

use thiserror::Error;

use crate::output::OutputError;

/// A report or document that could not be made.
#[derive(Debug, Error)]
pub enum ReportError {
    /// A figure could not be drawn.
    #[error(transparent)]
    Plot(#[from] super::plot::PlotError),
    /// The page template could not be rendered.
    #[error("the report page could not be assembled: {0}")]
    Template(#[from] minijinja::Error),
    /// The document could not be written as JSON.
    #[error("the {schema} document could not be written as JSON: {source}")]
    Json {
        /// Schema of the document.
        schema: String,
        /// The error of the serialiser.
        source: serde_json::Error,
    },
    /// The document could not be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// An input could not be read to compute its checksum.
    #[error("{}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The error of the file system.
        source: std::io::Error,
    },
}
