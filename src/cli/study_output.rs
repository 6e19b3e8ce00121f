//! What every study writes: tables on the terminal, and where it was asked for Markdown, a page, JSON.

use std::path::PathBuf;

use clap::Args;
use serde::Serialize;

use super::{CommandResult, Outcome};
use crate::output::{OutputError, check_outputs, write_atomically};
use crate::report::json::{Document, Program};
use crate::report::{Page, ReportError};

#[derive(Debug, Args)]
pub(super) struct StudyOutput {
    /// Write the tables as Markdown.
    #[arg(long)]
    markdown: Option<PathBuf>,
    /// Write a page with plots.
    #[arg(long)]
    report: Option<PathBuf>,
    /// Write the numbers as JSON.
    #[arg(long)]
    json: Option<PathBuf>,
}

impl StudyOutput {
    /// Refuses paths that cannot be written, or where one of the `inputs` stands, before any work is done.
    pub(super) fn check(&self, inputs: &[PathBuf]) -> Result<(), OutputError> {
        check_outputs([&self.markdown, &self.report, &self.json].into_iter().flatten(), inputs)
    }

    /// Prints `markdown` of the results and writes what was asked for.
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

    /// Writes what was asked for: also of a study that is still running, so that one that is ended
    /// early leaves what it has.
    pub(super) fn save<T: Serialize>(
        &self,
        schema: &'static str,
        results: &T,
        program: Program,
        markdown: impl Fn(&T, &str) -> String,
        page: impl Fn(&T, Program) -> Result<Page, ReportError>,
    ) -> Result<(), Box<dyn std::error::Error>> {
        if let Some(path) = &self.markdown {
            let text = markdown(results, &program.command);
            write_atomically(path, |out| out.write_all(text.as_bytes()))?;
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
