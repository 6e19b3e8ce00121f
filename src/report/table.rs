//! A table for the terminal, for Markdown and for the page.

use serde::ser::SerializeStruct;
use serde::{Serialize, Serializer};

use super::error::ReportError;
use super::page;
use super::status::Status;

/// Side to which the cells of a column are aligned.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Align {
    /// For words.
    Left,
    /// For numbers.
    Right,
}

/// Heading of a column.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Column {
    /// What the column holds.
    pub name: String,
    /// Unit of its numbers; empty for none.
    pub unit: String,
    /// Side of its cells.
    pub align: Align,
}

impl Column {
    /// A column of words.
    pub fn text(name: impl Into<String>) -> Self {
        Self { name: name.into(), unit: String::new(), align: Align::Left }
    }

    /// A column of numbers; an empty `unit` is for pure numbers.
    pub fn number(name: impl Into<String>, unit: impl Into<String>) -> Self {
        Self { name: name.into(), unit: unit.into(), align: Align::Right }
    }

    fn heading(&self) -> String {
        if self.unit.is_empty() {
            self.name.clone()
        } else {
            format!("{} [{}]", self.name, self.unit)
        }
    }
}

/// A row: one cell per column, and a judgement that determines its colour.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Row {
    /// The cells, already formatted (see [`crate::number`]).
    pub cells: Vec<String>,
    /// `None` for a row without judgement.
    pub status: Option<Status>,
}

impl Serialize for Row {
    /// Adds symbol and label of the judgement, for readers who cannot see its colour.
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut row = serializer.serialize_struct("Row", 4)?;
        row.serialize_field("cells", &self.cells)?;
        row.serialize_field("status", &self.status)?;
        row.serialize_field("symbol", &self.status.map(Status::symbol))?;
        row.serialize_field("label", &self.status.map(Status::label))?;
        row.end()
    }
}

/// Columns and rows of text.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct Table {
    columns: Vec<Column>,
    rows: Vec<Row>,
}

impl Table {
    /// A table without rows.
    pub fn new(columns: impl IntoIterator<Item = Column>) -> Self {
        Self { columns: columns.into_iter().collect(), rows: Vec::new() }
    }

    /// Adds a row.
    ///
    /// # Panics
    /// If there is not one cell per column.
    pub fn push(&mut self, cells: impl IntoIterator<Item = impl Into<String>>) {
        self.push_judged(None, cells);
    }

    /// Adds a row with a judgement.
    ///
    /// # Panics
    /// If there is not one cell per column.
    pub fn push_judged(
        &mut self,
        status: Option<Status>,
        cells: impl IntoIterator<Item = impl Into<String>>,
    ) {
        let cells: Vec<String> = cells.into_iter().map(Into::into).collect();
        assert_eq!(
            cells.len(),
            self.columns.len(),
            "a row of a table has one cell per column: {cells:?}"
        );
        self.rows.push(Row { cells, status });
    }

    /// Headings.
    pub fn columns(&self) -> &[Column] {
        &self.columns
    }

    /// Rows.
    pub fn rows(&self) -> &[Row] {
        &self.rows
    }

    /// The table as an HTML element, all text escaped.
    pub fn to_html(&self) -> Result<String, ReportError> {
        page::render_table(self)
    }

    /// The table in GitHub's Markdown, with columns aligned in the source as well; judgements are written in the first
    /// cell.
    pub fn to_markdown(&self) -> String {
        let escape = |text: &str| text.replace('|', "\\|").replace('\n', " ");
        let headings: Vec<String> = self.columns.iter().map(|c| escape(&c.heading())).collect();
        let cells = |row: &Row| {
            let mut cells: Vec<String> = row.cells.iter().map(|cell| escape(cell)).collect();
            if let (Some(status), Some(first)) = (row.status, cells.first_mut()) {
                *first = format!("{} {}: {first}", status.symbol(), status.label());
            }
            cells
        };
        let rows: Vec<Vec<String>> = self.rows.iter().map(cells).collect();
        let widths = self.widths(&headings, &rows, 3);
        let line = |cells: &[String]| format!("| {} |\n", self.padded(cells, &widths).join(" | "));
        let rule = self.columns.iter().zip(&widths).map(|(column, &width)| match column.align {
            Align::Left => "-".repeat(width + 2),
            Align::Right => format!("{}:", "-".repeat(width + 1)),
        });
        let rule = format!("|{}|\n", rule.collect::<Vec<_>>().join("|"));
        line(&headings) + &rule + &rows.iter().map(|row| line(row)).collect::<String>()
    }

    /// The table for a terminal: columns aligned, judged rows preceded by a symbol, no trailing blanks.
    pub fn to_text(&self) -> String {
        let headings: Vec<String> = self.columns.iter().map(Column::heading).collect();
        let rows: Vec<Vec<String>> = self.rows.iter().map(|row| row.cells.clone()).collect();
        let widths = self.widths(&headings, &rows, 0);
        let judged = self.rows.iter().any(|row| row.status.is_some());
        let line = |symbol: char, cells: &[String]| {
            let front = if judged { format!("{symbol} ") } else { String::new() };
            let text = format!("{front}{}", self.padded(cells, &widths).join("  "));
            format!("{}\n", text.trim_end())
        };
        let rule: Vec<String> = widths.iter().map(|&width| "─".repeat(width)).collect();
        let mut out = line(' ', &headings) + &line(' ', &rule);
        for (row, cells) in self.rows.iter().zip(&rows) {
            out += &line(row.status.map_or(' ', Status::symbol), cells);
        }
        out
    }

    /// Number of characters of the longest cell of every column, at least `least`.
    fn widths(&self, headings: &[String], rows: &[Vec<String>], least: usize) -> Vec<usize> {
        (0..self.columns.len())
            .map(|k| {
                let cells = rows
                    .iter()
                    .chain(std::iter::once(&headings.to_vec()))
                    .map(|row| row[k].chars().count())
                    .max();
                cells.unwrap_or(0).max(least)
            })
            .collect()
    }

    fn padded(&self, cells: &[String], widths: &[usize]) -> Vec<String> {
        let sides = self.columns.iter().map(|column| column.align);
        let pad = |((cell, &width), align): ((&String, &usize), Align)| match align {
            Align::Left => format!("{cell:<width$}"),
            Align::Right => format!("{cell:>width$}"),
        };
        cells.iter().zip(widths).zip(sides).map(pad).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> Table {
        let mut table = Table::new([Column::text("name"), Column::number("value", "µrad")]);
        table.push(["rc|1", "1.5"]);
        table.push_judged(Some(Status::Bad), ["σ of <q>", "12345.6789"]);
        table
    }

    #[test]
    fn text_is_aligned_by_characters_not_bytes() {
        let expected = "  name      value [µrad]\n  ────────  ────────────\n  rc|1               1.5\n✗ σ of <q>    12345.6789\n";
        assert_eq!(table().to_text(), expected);
    }

    #[test]
    fn markdown_escapes_the_bar_and_says_judgements() {
        let expected = "| name              | value [µrad] |\n|-------------------|-------------:|\n| rc\\|1             |          1.5 |\n| ✗ fails: σ of <q> |   12345.6789 |\n";
        assert_eq!(table().to_markdown(), expected);
    }

    #[test]
    fn html_escapes_text_and_marks_numbers_and_judgements() {
        let html = table().to_html().unwrap();
        assert!(html.contains("σ of &lt;q&gt;"), "{html}");
        assert!(
            html.contains("<tr class=\"bad\">")
                && html.contains("<td class=\"right\">12345.6789</td>"),
            "{html}"
        );
        // Once, in the first cell of the judged row: not every reader sees the colour.
        assert_eq!(html.matches("aria-label=\"fails\"").count(), 1, "{html}");
        assert!(html.contains(">✗</span> σ of"), "{html}");
    }

    #[test]
    fn a_table_without_rows_has_its_headings() {
        let table = Table::new([Column::text("cause")]);
        assert_eq!(table.to_text(), "cause\n─────\n");
    }

    #[test]
    #[should_panic(expected = "one cell per column")]
    fn a_short_row_is_refused() {
        table().push(["alone"]);
    }
}
