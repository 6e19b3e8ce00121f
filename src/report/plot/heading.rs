//! The heading above the plots: title, name of the ordinate, legend.
//!
//! The name of the ordinate is written horizontally above its axis, where it is easy to read. The legend is on the same
//! row at the right end, where it cannot hide data.

use super::axis::{Axis, Extent};
use super::canvas::{Anchor, Canvas, FONT_PX, Font, Point, Rect, Stroke, text_width_px};
use super::error::PlotError;
use super::palette::Colour;
use super::panel::{RIGHT_PX, bar_colour};
use super::xy::{Mark, XyPlot};

/// Height of a row of the heading.
pub(super) const ROW_PX: f64 = 20.0;
const SWATCH_PX: f64 = 18.0;

/// The symbol of a legend entry.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Swatch {
    Mark(Mark),
    Patch,
    /// An upright dash.
    Dash,
}

/// An entry of a legend.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Entry {
    name: String,
    colour: Colour,
    swatch: Swatch,
}

impl Entry {
    pub fn new(name: &str, colour: Colour, swatch: Swatch) -> Self {
        Self { name: name.to_owned(), colour, swatch }
    }

    pub fn is_nameless(&self) -> bool {
        self.name.is_empty()
    }

    fn width_px(&self) -> f64 {
        SWATCH_PX + 6.0 + text_width_px(&self.name, FONT_PX) + 16.0
    }
}

/// Every name once, in order of first appearance.
pub(super) fn legend_entries<'p>(plots: impl IntoIterator<Item = &'p XyPlot>) -> Vec<Entry> {
    let mut entries: Vec<Entry> = Vec::new();
    for plot in plots {
        let series =
            plot.series.iter().map(|s| Entry::new(&s.name, s.colour, Swatch::Mark(s.mark)));
        let bands = plot
            .bands
            .iter()
            .map(|b| Entry::new(&b.name, b.colour.towards(Colour::PAPER, 0.7), Swatch::Patch));
        let bars =
            plot.bars.iter().map(|b| Entry::new(&b.name, bar_colour(b.colour), Swatch::Patch));
        for entry in bars.chain(series).chain(bands) {
            if !entry.is_nameless() && !entries.iter().any(|known| known.name == entry.name) {
                entries.push(entry);
            }
        }
    }
    entries
}

/// The heading above the plots.
pub(super) struct Heading<'a> {
    pub title: &'a str,
    /// The ordinate, and its range, which determines the power of ten in its name.
    pub y: Option<(&'a Axis, Extent)>,
    pub entries: &'a [Entry],
}

impl Heading<'_> {
    /// Height on a sheet of width `width_px`.
    pub fn height_px(&self, width_px: f64) -> f64 {
        let title = if self.title.is_empty() { 0.0 } else { ROW_PX + 2.0 };
        let legend = if self.shares_row(width_px) {
            0.0
        } else {
            legend_rows(self.entries, width_px) as f64 * ROW_PX
        };
        let names =
            if self.name().is_empty() && (self.entries.is_empty() || !self.shares_row(width_px)) {
                6.0
            } else {
                ROW_PX + 4.0
            };
        title + legend + names
    }

    /// Draws the heading at the top of the sheet; returns the remaining area.
    pub fn draw(&self, canvas: &Canvas, sheet: Rect) -> Result<Rect, PlotError> {
        let mut top = sheet.top;
        if !self.title.is_empty() {
            canvas.text(self.title, (sheet.left, top + 0.5 * ROW_PX), Anchor::Left, Font::TITLE)?;
            top += ROW_PX + 2.0;
        }
        if self.shares_row(sheet.width()) {
            legend(
                canvas,
                Rect { top, right: sheet.right - RIGHT_PX, ..sheet },
                self.entries,
                Anchor::Right,
            )?;
        } else {
            top = legend(canvas, Rect { top, ..sheet }, self.entries, Anchor::Left)?;
        }
        canvas.text(&self.name(), (sheet.left, top + 0.5 * ROW_PX), Anchor::Left, Font::LABEL)?;
        Ok(Rect { top: sheet.top + self.height_px(sheet.width()), ..sheet })
    }

    fn name(&self) -> String {
        self.y.map_or_else(String::new, |(axis, extent)| axis.caption(extent.exponent()))
    }

    /// Whether the legend fits beside the name of the ordinate.
    fn shares_row(&self, width_px: f64) -> bool {
        let legend_px: f64 = self.entries.iter().map(Entry::width_px).sum();
        legend_px + text_width_px(&self.name(), FONT_PX) + RIGHT_PX <= width_px
    }
}

fn legend_rows(entries: &[Entry], width_px: f64) -> usize {
    let mut rows = 0;
    let mut rest = entries;
    while !rest.is_empty() {
        rest = &rest[fitting(rest, width_px)..];
        rows += 1;
    }
    rows
}

/// Number of entries that fit into one row of a legend, at least one.
fn fitting(entries: &[Entry], width_px: f64) -> usize {
    let mut used_px = 0.0;
    let fits = |entry: &&Entry| {
        used_px += entry.width_px();
        used_px <= width_px
    };
    entries.iter().take_while(fits).count().max(1)
}

/// Draws entries in rows that wrap; returns the ordinate below them.
pub(super) fn legend(
    canvas: &Canvas,
    room: Rect,
    entries: &[Entry],
    side: Anchor,
) -> Result<f64, PlotError> {
    let mut top = room.top;
    let mut rest = entries;
    while !rest.is_empty() {
        let (row, later) = rest.split_at(fitting(rest, room.width()));
        let row_px: f64 = row.iter().map(Entry::width_px).sum::<f64>() - 16.0;
        let mut x = match side {
            Anchor::Left => room.left,
            Anchor::Centre => 0.5 * (room.left + room.right - row_px),
            Anchor::Right => room.right - row_px,
        };
        for entry in row {
            swatch(canvas, entry, (x, top + 0.5 * ROW_PX))?;
            let at = (x + SWATCH_PX + 6.0, top + 0.5 * ROW_PX);
            canvas.text(&entry.name, at, Anchor::Left, Font::LABEL.colour(Colour::INK))?;
            x += entry.width_px();
        }
        top += ROW_PX;
        rest = later;
    }
    Ok(top)
}

fn swatch(canvas: &Canvas, entry: &Entry, (x, y): Point) -> Result<(), PlotError> {
    let stroke = Stroke::solid(entry.colour, 2.2);
    let line = [(x, y), (x + SWATCH_PX, y)];
    let centre = (x + 0.5 * SWATCH_PX, y);
    match entry.swatch {
        Swatch::Mark(Mark::Line | Mark::ThinLine) => canvas.line(&line, stroke),
        Swatch::Mark(wide @ Mark::WideLine) => {
            canvas.line(&line, Stroke { width_px: 4.0, opacity: wide.opacity(), ..stroke })
        }
        Swatch::Mark(Mark::Dashed) => canvas.line(&line, Stroke { dashed: true, ..stroke }),
        Swatch::Mark(Mark::Dots) => canvas.dot(centre, 3.5, entry.colour, 1.0),
        Swatch::Mark(Mark::DotsAndLine) => {
            canvas.line(&line, Stroke { width_px: 1.2, ..stroke })?;
            canvas.dot(centre, 3.5, entry.colour, 1.0)
        }
        Swatch::Dash => canvas
            .line(&[(centre.0, y - 6.0), (centre.0, y + 6.0)], Stroke { width_px: 1.6, ..stroke }),
        Swatch::Patch => {
            let patch =
                Rect { left: x + 3.0, top: y - 5.0, right: x + SWATCH_PX - 1.0, bottom: y + 5.0 };
            canvas.rect(patch, entry.colour, 1.0)
        }
    }
}
