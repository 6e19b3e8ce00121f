//! Small multiples, such as one panel per joint, for comparison at a glance.

use super::axis::{Axis, Extent};
use super::canvas::{Anchor, Canvas, Font, Rect, Size, TITLE_PX, render};
use super::error::PlotError;
use super::heading::{self, Heading};
use super::panel::{self, Layout, RIGHT_PX, X_NAME_PX, X_TICKS_PX};
use super::xy::XyPlot;

const PANEL_TITLE_PX: f64 = 19.0;
const GUTTER_PX: f64 = 10.0;

/// Panels in rows and columns under one title and one legend.
///
/// The panels take the names of their axes from `x` and `y`; each panel has its title above it.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    /// Title of the figure.
    pub title: String,
    /// Abscissa of all panels.
    pub x: Axis,
    /// Ordinate of all panels.
    pub y: Axis,
    /// The panels, row by row; their own axes determine scales and fixed ranges.
    pub panels: Vec<XyPlot>,
    /// Panels in a row.
    pub columns: usize,
    /// Whether all panels have the same range of the abscissa, labelled only below the last row.
    pub share_x: bool,
    /// Whether all panels have the same range of the ordinate, labelled only in the first column.
    pub share_y: bool,
    /// Height of a row of panels in pixels, without the labels of the abscissa.
    pub row_height_px: f64,
    /// Width of the figure in pixels.
    pub width_px: f64,
}

impl Grid {
    /// Panels in three columns that share the abscissa, each with its own ordinate.
    pub fn new(title: impl Into<String>, x: Axis, y: Axis) -> Self {
        Self {
            title: title.into(),
            x,
            y,
            panels: Vec::new(),
            columns: 3,
            share_x: true,
            share_y: false,
            row_height_px: 150.0,
            width_px: Size::FULL_WIDTH_PX,
        }
    }

    /// An empty panel with the grid's axes.
    pub fn panel(&self, title: impl Into<String>) -> XyPlot {
        XyPlot::new(title, self.x.clone(), self.y.clone())
    }

    /// The figure as an SVG document.
    pub fn to_svg(&self) -> Result<String, PlotError> {
        let extents = self.extents()?;
        let columns = self.columns.clamp(1, self.panels.len().max(1));
        let rows = self.panels.len().div_ceil(columns).max(1);
        let labels_px = X_TICKS_PX + X_NAME_PX;
        let labelled_rows = if self.share_x { 1 } else { rows };
        let entries = heading::legend_entries(&self.panels);
        // Panels with different ranges carry their own powers of ten; the common name of the ordinate then carries
        // none.
        let unscaled = Extent { scale: self.y.scale, low: 0.0, high: 1.0 };
        let shared_y =
            extents.first().map(|(_, y)| *y).filter(|_| self.share_y).unwrap_or(unscaled);
        let heading =
            Heading { title: &self.title, y: Some((&self.y, shared_y)), entries: &entries };
        let height_px = heading.height_px(self.width_px)
            + rows as f64 * (self.row_height_px + GUTTER_PX)
            + labelled_rows as f64 * labels_px;
        let size = Size { width_px: self.width_px, height_px };
        render(size, &self.title, |canvas| {
            let body = heading.draw(canvas, Rect::of(size))?;
            self.draw_panels(canvas, body, columns, &extents)
        })
    }

    fn draw_panels(
        &self,
        canvas: &Canvas,
        body: Rect,
        columns: usize,
        extents: &[(Extent, Extent)],
    ) -> Result<(), PlotError> {
        let labels_px = X_TICKS_PX + X_NAME_PX;
        let left_px = |column: usize| {
            let in_column = extents.iter().skip(column).step_by(columns);
            in_column.map(|(_, y)| panel::left_px(*y, self.row_height_px)).fold(0.0, f64::max)
        };
        let left: Vec<f64> = (0..columns)
            .map(|column| if self.share_y && column > 0 { 8.0 } else { left_px(column) })
            .collect();
        // Every plot gets the same width, regardless of the width of its tick labels.
        let plot_px = (body.width() - left.iter().sum::<f64>() - GUTTER_PX * (columns - 1) as f64)
            / columns as f64;
        for (k, (plot, &(x, y))) in self.panels.iter().zip(extents).enumerate() {
            let (row, column) = (k / columns, k % columns);
            let last_of_column = k + columns >= self.panels.len();
            let x_labels = !self.share_x || last_of_column;
            let taller = if self.share_x { 0.0 } else { labels_px };
            let top = body.top + row as f64 * (self.row_height_px + GUTTER_PX + taller);
            let offset = left[..column].iter().sum::<f64>() + column as f64 * (plot_px + GUTTER_PX);
            let room = Rect {
                left: body.left + offset,
                right: body.left + offset + left[column] + plot_px,
                top: top + PANEL_TITLE_PX,
                bottom: top + self.row_height_px + if x_labels { labels_px } else { 0.0 },
            };
            let title = Font { size_px: TITLE_PX - 1.0, ..Font::TITLE };
            let at = (room.left + left[column], top + 0.45 * PANEL_TITLE_PX);
            canvas.text(&plot.title, at, Anchor::Left, title)?;
            if !self.share_y && y.exponent() != 0 {
                let unit = Axis::linear("", &self.y.unit).caption(y.exponent());
                let at = (room.left + left[column] + plot_px - RIGHT_PX, at.1);
                canvas.text(&unit, at, Anchor::Right, Font::LABEL)?;
            }
            let layout = Layout {
                left_px: left[column],
                x,
                y,
                x_labels,
                y_labels: !self.share_y || column == 0,
                point_budget: panel::POINT_BUDGET / self.panels.len(),
            };
            panel::draw(canvas, room, plot, &layout)?;
        }
        Ok(())
    }

    fn extents(&self) -> Result<Vec<(Extent, Extent)>, PlotError> {
        let mut extents = self.panels.iter().map(XyPlot::extents).collect::<Result<Vec<_>, _>>()?;
        let x_union = extents.iter().map(|e| e.0).reduce(Extent::union).filter(|_| self.share_x);
        let y_union = extents.iter().map(|e| e.1).reduce(Extent::union).filter(|_| self.share_y);
        for (x, y) in &mut extents {
            *x = x_union.unwrap_or(*x);
            *y = y_union.unwrap_or(*y);
        }
        Ok(extents)
    }
}
