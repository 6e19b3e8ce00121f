//! Values with intervals, one per row, such as parameters with σ or coverage with its bounds.

use super::axis::{Axis, Extent, Frame};
use super::canvas::{Anchor, Canvas, FONT_PX, Font, Rect, Size, Stroke, render, text_width_px};
use super::error::PlotError;
use super::heading::{Entry, Heading, Swatch};
use super::palette::Colour;
use super::panel::{self, RIGHT_PX, X_NAME_PX, X_TICKS_PX};
use super::ticks::Along;
use super::xy::{Mark, Span};
use crate::report::Status;

const ROW_PITCH_PX: f64 = 17.0;
const GUTTER_PX: f64 = 22.0;

/// One value with its interval.
#[derive(Debug, Clone, PartialEq)]
pub struct IntervalRow {
    /// Name of the value.
    pub name: String,
    /// The value.
    pub value: f64,
    /// Lower end of its interval; not finite for none.
    pub low: f64,
    /// Upper end of its interval; not finite for none.
    pub high: f64,
    /// The expected value, drawn as an upright dash; not finite for none.
    pub expected: f64,
    /// Colour of dot and interval; `None` for neutral.
    pub status: Option<Status>,
}

/// Dots with intervals over a common axis, stacked in one or more columns.
#[derive(Debug, Clone, PartialEq)]
pub struct IntervalPlot {
    /// Title of the figure.
    pub title: String,
    /// The common axis.
    pub x: Axis,
    /// The rows.
    pub rows: Vec<IntervalRow>,
    /// Number of columns; one column is easiest to read, two keep fifty rows on one screen.
    pub columns: usize,
    /// The interval in which values are expected, shaded in every column, with its legend entry.
    pub expected: Option<Span>,
    /// Legend entry of dots and intervals, such as `estimate ± 2σ`; empty for none.
    pub value_name: String,
    /// Legend entry of the rows' own expected values, such as `truth`; empty for none.
    pub expected_name: String,
    /// A vertical line, such as the nominal coverage.
    pub reference: Option<f64>,
    /// Width in pixels.
    pub width_px: f64,
}

impl IntervalPlot {
    /// A plot without rows, of the page's width.
    pub fn new(title: impl Into<String>, x: Axis) -> Self {
        Self {
            title: title.into(),
            x,
            rows: Vec::new(),
            columns: 1,
            expected: None,
            value_name: String::new(),
            expected_name: String::new(),
            reference: None,
            width_px: Size::FULL_WIDTH_PX,
        }
    }

    /// The figure as an SVG document; its height follows from the number of rows.
    pub fn to_svg(&self) -> Result<String, PlotError> {
        let values = self.rows.iter().flat_map(|row| [row.value, row.low, row.high, row.expected]);
        let spanned =
            self.expected.iter().flat_map(|span| [span.from, span.to]).chain(self.reference);
        let x = self.x.extent(&self.title, values.chain(spanned), 0.05)?;
        let columns = self.columns.clamp(1, self.rows.len().max(1));
        let per_column = self.rows.len().div_ceil(columns).max(1);
        let rows_px = per_column as f64 * ROW_PITCH_PX;
        let entries = self.entries();
        let heading = Heading { title: &self.title, y: None, entries: &entries };
        let height_px = heading.height_px(self.width_px) + rows_px + X_TICKS_PX + X_NAME_PX;
        let size = Size { width_px: self.width_px, height_px };
        render(size, &self.title, |canvas| {
            let body = heading.draw(canvas, Rect::of(size))?;
            let column_px = (body.width() - GUTTER_PX * (columns - 1) as f64) / columns as f64;
            for (column, rows) in self.rows.chunks(per_column).enumerate() {
                let left = body.left + column as f64 * (column_px + GUTTER_PX);
                let room = Rect { left, right: left + column_px, ..body };
                self.draw_column(canvas, room, rows, x)?;
            }
            Ok(())
        })
    }

    fn entries(&self) -> Vec<Entry> {
        let shaded =
            self.expected.as_ref().map(|span| Entry::new(&span.label, Colour::GRID, Swatch::Patch));
        let expected = Entry::new(&self.expected_name, Colour::INK, Swatch::Dash);
        let value =
            Entry::new(&self.value_name, Colour::series(0), Swatch::Mark(Mark::DotsAndLine));
        let named = |entry: &Entry| !entry.is_nameless();
        [value, expected].into_iter().chain(shaded).filter(named).collect()
    }

    fn draw_column(
        &self,
        canvas: &Canvas,
        room: Rect,
        rows: &[IntervalRow],
        x: Extent,
    ) -> Result<(), PlotError> {
        // All columns use the same width for names, so that positions compare between columns.
        let names_px =
            self.rows.iter().map(|row| text_width_px(&row.name, FONT_PX)).fold(0.0, f64::max);
        let left = (room.left + names_px + 10.0).min(0.5 * (room.left + room.right));
        let bottom = room.top + rows.len() as f64 * ROW_PITCH_PX;
        let area = Rect { left, top: room.top, right: room.right - RIGHT_PX, bottom };
        let frame = Frame { area, x, y: Extent { low: 0.0, high: 1.0, ..x } };
        let ticks = x.ticks(area.width(), Along::Horizontal);
        for (k, _) in rows.iter().enumerate().filter(|(k, _)| k % 2 == 0) {
            let top = area.top + k as f64 * ROW_PITCH_PX;
            canvas.rect(
                Rect { left: room.left, top, right: area.right, bottom: top + ROW_PITCH_PX },
                Colour::STRIPE,
                1.0,
            )?;
        }
        if let Some(span) = &self.expected
            && let (Some(left), Some(right)) = (frame.x_px(span.from), frame.x_px(span.to))
        {
            let (left, right) =
                (left.clamp(area.left, area.right), right.clamp(area.left, area.right));
            canvas.rect(Rect { left, right, ..area }, Colour::GRID, 0.9)?;
        }
        panel::vertical_grid(canvas, &frame, &ticks)?;
        if let Some(at) = self.reference.and_then(|value| frame.x_px(value)) {
            canvas
                .line(&[(at, area.top), (at, area.bottom)], Stroke::dashed(Colour::MUTED, 1.2))?;
        }
        for (k, row) in rows.iter().enumerate() {
            let middle = area.top + (k as f64 + 0.5) * ROW_PITCH_PX;
            canvas.text(
                &row.name,
                (area.left - 8.0, middle),
                Anchor::Right,
                Font::LABEL.colour(Colour::INK),
            )?;
            draw_row(canvas, &frame, row, middle)?;
        }
        panel::baseline(canvas, &area)?;
        panel::x_labels(canvas, &frame, &ticks, &self.x)
    }
}

fn draw_row(canvas: &Canvas, frame: &Frame, row: &IntervalRow, y: f64) -> Result<(), PlotError> {
    let area = &frame.area;
    let colour = row.status.map_or(Colour::series(0), Colour::status);
    let inside = |x: &f64| (area.left..=area.right).contains(x);
    if let (Some(low), Some(high)) = (frame.x_px(row.low), frame.x_px(row.high)) {
        let ends = [(low.clamp(area.left, area.right), y), (high.clamp(area.left, area.right), y)];
        canvas.line(&ends, Stroke::solid(colour, 1.6))?;
    }
    if let Some(at) = frame.x_px(row.expected).filter(inside) {
        canvas.line(&[(at, y - 6.0), (at, y + 6.0)], Stroke::solid(Colour::INK, 1.6))?;
    }
    match frame.x_px(row.value).filter(inside) {
        Some(at) => canvas.dot((at, y), 3.2, colour, 1.0),
        None => Ok(()),
    }
}
