//! A heat map, such as the confusion of causes or the correlation of parameters.

use super::canvas::{
    Anchor, Canvas, FONT_PX, Font, LEAST_SIZE_PX, Rect, Size, TITLE_PX, render, text_width_px,
};
use super::error::PlotError;
use super::heading::ROW_PX;
use super::palette::Colour;

use super::ticks::typographic;

const DARKEST: Colour = Colour { red: 0x08, green: 0x45, blue: 0x7e };
const DARKEST_NEGATIVE: Colour = Colour { red: 0x9c, green: 0x3a, blue: 0x10 };

/// A matrix of shaded cells with labelled rows and columns; cells show their numbers where these fit.
#[derive(Debug, Clone, PartialEq)]
pub struct HeatMap {
    /// Title of the figure.
    pub title: String,
    /// What the rows are, such as `hidden`.
    pub row_axis: String,
    /// What the columns are, such as `named`.
    pub column_axis: String,
    /// Label of every row.
    pub row_labels: Vec<String>,
    /// Label of every column.
    pub column_labels: Vec<String>,
    /// Values, row by row; a non-finite value leaves its cell empty.
    pub values: Vec<Vec<f64>>,
    /// Value of the darkest shade; `None` takes the largest magnitude. Negative values have a colour of their own.
    pub full_scale: Option<f64>,
    /// Decimals of the numbers in the cells.
    pub decimals: usize,
    /// Height of a cell in pixels.
    pub cell_height_px: f64,
    /// Largest width of a cell in pixels.
    pub cell_width_px: f64,
}

impl HeatMap {
    /// The figure as an SVG document; its size follows from the labels and cells.
    pub fn to_svg(&self) -> Result<String, PlotError> {
        self.check()?;
        let widest = |labels: &[String]| {
            labels.iter().map(|l| text_width_px(l, FONT_PX)).fold(0.0, f64::max)
        };
        let left =
            widest(&self.row_labels) + 14.0 + if self.row_axis.is_empty() { 0.0 } else { ROW_PX };
        let columns = self.column_labels.len().max(1) as f64;
        let cell_px =
            ((Size::FULL_WIDTH_PX - left - 2.0) / columns).min(self.cell_width_px).max(4.0);
        let upwards = widest(&self.column_labels) + 6.0 > cell_px;
        let labels_px = if upwards { widest(&self.column_labels) + 10.0 } else { ROW_PX };
        let heading_px = if self.title.is_empty() { 0.0 } else { ROW_PX + 2.0 };
        let axis_px = if self.column_axis.is_empty() { 0.0 } else { ROW_PX };
        let rows_px = self.row_labels.len().max(1) as f64 * self.cell_height_px;
        // What the rows are is written upwards beside their middle: room for its ends, where it is longer than a few
        // rows are high.
        let ends_px = 0.5 * (text_width_px(&self.row_axis, FONT_PX) - rows_px).max(0.0);
        let top = (heading_px + axis_px + labels_px).max(ends_px);
        let cells = Rect { left, top, right: left + columns * cell_px, bottom: top + rows_px };
        let title_px = text_width_px(&self.title, TITLE_PX) * 1.1;
        let size = Size {
            width_px: (cells.right + 2.0).max(title_px).max(LEAST_SIZE_PX),
            height_px: (cells.bottom + ends_px.max(2.0)).max(LEAST_SIZE_PX),
        };
        render(size, &self.title, |canvas| {
            canvas.text(&self.title, (0.0, 0.5 * ROW_PX), Anchor::Left, Font::TITLE)?;
            let above = (0.5 * (cells.left + cells.right), heading_px + 0.5 * axis_px);
            canvas.text(&self.column_axis, above, Anchor::Centre, Font::LABEL)?;
            let beside = (0.5 * ROW_PX, 0.5 * (cells.top + cells.bottom));
            canvas.text(
                &self.row_axis,
                beside,
                Anchor::Centre,
                Font { upwards: true, ..Font::LABEL },
            )?;
            self.draw_labels(canvas, &cells, cell_px, upwards)?;
            self.draw_cells(canvas, &cells, cell_px)
        })
    }

    fn draw_labels(
        &self,
        canvas: &Canvas,
        cells: &Rect,
        cell_px: f64,
        upwards: bool,
    ) -> Result<(), PlotError> {
        let font = Font { upwards, ..Font::LABEL.colour(Colour::INK) };
        for (k, label) in self.column_labels.iter().enumerate() {
            let x = cells.left + (k as f64 + 0.5) * cell_px;
            let (y, anchor) = if upwards {
                (cells.top - 6.0, Anchor::Left)
            } else {
                (cells.top - 0.5 * ROW_PX, Anchor::Centre)
            };
            canvas.text(label, (x, y), anchor, font)?;
        }
        for (k, label) in self.row_labels.iter().enumerate() {
            let y = cells.top + (k as f64 + 0.5) * self.cell_height_px;
            canvas.text(
                label,
                (cells.left - 8.0, y),
                Anchor::Right,
                Font { upwards: false, ..font },
            )?;
        }
        Ok(())
    }

    fn draw_cells(&self, canvas: &Canvas, cells: &Rect, cell_px: f64) -> Result<(), PlotError> {
        let magnitudes = self.values.iter().flatten().map(|v| v.abs()).filter(|v| v.is_finite());
        let full = self.full_scale.unwrap_or_else(|| magnitudes.fold(0.0, f64::max));
        for (i, row) in self.values.iter().enumerate() {
            for (j, &value) in row.iter().enumerate() {
                let left = cells.left + j as f64 * cell_px;
                let top = cells.top + i as f64 * self.cell_height_px;
                let cell = Rect {
                    left: left + 0.5,
                    top: top + 0.5,
                    right: left + cell_px - 0.5,
                    bottom: top + self.cell_height_px - 0.5,
                };
                // The minimum of NaN and 1 is 1: a cell without a value would be the darkest.
                let is_shaded = value.is_finite() && full > 0.0;
                let share = if is_shaded { (value.abs() / full).min(1.0) } else { 0.0 };
                let dark = if value < 0.0 { DARKEST_NEGATIVE } else { DARKEST };
                // The square root emphasises small values: off the diagonal, these are the interesting ones.
                let shade = Colour::STRIPE.towards(dark, share.sqrt());
                canvas.rect(cell, shade, 1.0)?;
                let ink = match share {
                    0.0 => Colour::AXIS,
                    share if share > 0.35 => Colour::PAPER,
                    _ => Colour::INK,
                };
                let text = self.cell_text(value);
                if text_width_px(&text, FONT_PX) < cell_px {
                    let middle = (0.5 * (cell.left + cell.right), 0.5 * (cell.top + cell.bottom));
                    canvas.text(&text, middle, Anchor::Centre, Font::LABEL.colour(ink))?;
                }
            }
        }
        Ok(())
    }

    /// The number; a dot for zero, so that non-zero values stand out.
    fn cell_text(&self, value: f64) -> String {
        if !value.is_finite() {
            String::new()
        } else if value == 0.0 {
            "·".into()
        } else {
            typographic(&format!("{value:.0$}", self.decimals))
        }
    }

    fn check(&self) -> Result<(), PlotError> {
        let ragged = |row, found, expected| PlotError::RaggedRow {
            figure: self.title.clone(),
            row,
            found,
            expected,
        };
        if self.values.len() != self.row_labels.len() {
            return Err(ragged(self.row_labels.len(), self.values.len(), self.row_labels.len()));
        }
        let columns = self.column_labels.len();
        match self.values.iter().enumerate().find(|(_, row)| row.len() != columns) {
            Some((k, row)) => Err(ragged(k, row.len(), columns)),
            None => Ok(()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A map of percents with one column for every value of a row.
    fn map(values: &[&[f64]]) -> HeatMap {
        HeatMap {
            title: String::new(),
            row_axis: "hidden".into(),
            column_axis: String::new(),
            row_labels: vec!["row".into(); values.len()],
            column_labels: vec!["a".into(); values[0].len()],
            values: values.iter().map(|row| row.to_vec()).collect(),
            full_scale: Some(100.0),
            decimals: 0,
            cell_height_px: 20.0,
            cell_width_px: 34.0,
        }
    }

    /// Number of cells that are filled with `colour`.
    fn filled(svg: &str, colour: Colour) -> usize {
        let Colour { red, green, blue } = colour;
        let fill = format!("fill=\"#{red:02X}{green:02X}{blue:02X}\"");
        svg.lines().filter(|line| line.starts_with("<rect") && line.contains(&fill)).count()
    }

    /// Only the full value is dark: cells without a value, and zeros, have the colour of an empty cell.
    #[test]
    fn a_cell_without_a_value_is_empty() {
        let svg = map(&[&[100.0, f64::NAN, 0.0], &[f64::INFINITY, f64::NAN, -100.0]]);
        let svg = svg.to_svg().unwrap();
        let shades = [DARKEST, DARKEST_NEGATIVE, Colour::STRIPE];
        assert_eq!(shades.map(|shade| filled(&svg, shade)), [1, 1, 4], "{svg}");
    }

    /// The height of the sheet that the first line of an SVG document states, px.
    fn height_px(svg: &str) -> f64 {
        let height = svg.split_once(" height=\"").and_then(|(_, rest)| rest.split_once('"'));
        height.unwrap().0.parse().unwrap()
    }

    /// The name of the rows ends half its length below the middle of the rows. Heights are whole pixels.
    #[test]
    fn the_name_of_a_few_rows_is_not_cut_off() {
        let name_px = text_width_px("hidden", FONT_PX);
        for rows in 1..4_u8 {
            let values = vec![&[100.0][..]; usize::from(rows)];
            let rows_px = 20.0 * f64::from(rows);
            let below_middle_px =
                height_px(&map(&values).to_svg().unwrap()) - ROW_PX - 0.5 * rows_px;
            assert!(below_middle_px > 0.5 * name_px - 0.5, "{rows} rows: {below_middle_px}");
        }
    }
}
