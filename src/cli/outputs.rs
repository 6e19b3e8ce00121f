//! Outputs of a run or a study: tables on the terminal and, on request, Markdown, a page and JSON.

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;

use super::{CommandResult, Outcome};
use crate::output::{OutputError, check_outputs, write_text};
use crate::report::json::{Document, Program};
use crate::report::{Page, ReportError};

#[derive(Debug, Args)]
pub(super) struct Outputs {
    /// Write the result as Markdown.
    #[arg(long)]
    markdown: Option<PathBuf>,
    /// Write the report as one HTML page.
    #[arg(long)]
    report: Option<PathBuf>,
    /// Write the result as JSON.
    #[arg(long)]
    json: Option<PathBuf>,
}

impl Outputs {
    /// Refuses, before any work is done, paths that cannot be written or that would overwrite one of the `inputs`.
    pub(super) fn check(&self, inputs: &[PathBuf]) -> Result<(), OutputError> {
        check_outputs([&self.markdown, &self.report, &self.json].into_iter().flatten(), inputs)
    }

    /// Prints the results as `markdown` and writes the requested files.
    pub(super) fn write<T: Serialize>(
        &self,
        schema: &'static str,
        results: &T,
        program: Program,
        markdown: impl Fn(&T, &str) -> String,
        page: impl Fn(&T, Program) -> Result<Page, ReportError>,
    ) -> CommandResult {
        say!("{}", markdown(results, &program.command));
        self.save(schema, results, program, markdown, page)?;
        Ok(Outcome::Done)
    }

    /// Prints where the page is, if one was asked for.
    pub(super) fn name_report(&self) {
        if let Some(path) = &self.report {
            say!("report: {}", path.display());
        }
    }

    /// Writes the requested files. Also called while a study is still running, so that a study that is stopped early
    /// leaves its results so far.
    pub(super) fn save<T: Serialize>(
        &self,
        schema: &'static str,
        results: &T,
        program: Program,
        markdown: impl Fn(&T, &str) -> String,
        page: impl Fn(&T, Program) -> Result<Page, ReportError>,
    ) -> Result<(), Box<dyn std::error::Error>> {
        if let Some(path) = &self.markdown {
            write_text(path, &markdown(results, &program.command))?;
        }
        if let Some(path) = &self.json {
            Document { schema, program: &program, body: results }.write(path)?;
        }
        if let Some(path) = &self.report {
            page(results, program)?.write(path)?;
        }
        Ok(())
    }
}
