//! Curves, points, bands and bars over two axes.

use super::axis::{Axis, Extent, Scale};
use super::canvas::{Rect, Size, render};
use super::error::PlotError;
use super::heading::{self, Heading};
use super::palette::Colour;
use super::panel::{self, Layout};

/// How a series is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mark {
    /// A line for a few hundred samples.
    Line,
    /// A thin line for dense data.
    ThinLine,
    /// A wide, translucent line for dense data that a thin line in front of it follows.
    WideLine,
    /// A dashed line, for references.
    Dashed,
    /// Dots.
    Dots,
    /// Dots joined by a thin line.
    DotsAndLine,
}

/// Points in the order in which they are joined. A value that is not finite is a gap.
#[derive(Debug, Clone, PartialEq)]
pub struct Series {
    /// Name in the legend; empty to be left out of it.
    pub name: String,
    /// Abscissae, in the unit of the x axis.
    pub x: Vec<f64>,
    /// Ordinates, in the unit of the y axis.
    pub y: Vec<f64>,
    /// Colour.
    pub colour: Colour,
    /// Line or dots.
    pub mark: Mark,
}

/// A shaded region between two curves, such as ±σ.
#[derive(Debug, Clone, PartialEq)]
pub struct Band {
    /// Name in the legend; empty to be left out of it.
    pub name: String,
    /// Abscissae.
    pub x: Vec<f64>,
    /// Lower curve.
    pub low: Vec<f64>,
    /// Upper curve.
    pub high: Vec<f64>,
    /// Colour, drawn translucent.
    pub colour: Colour,
}

/// Adjacent bars that stand on zero: bar `k` reaches from `edges[k]` to `edges[k + 1]`.
#[derive(Debug, Clone, PartialEq)]
pub struct Bars {
    /// Name in the legend; empty to be left out of it.
    pub name: String,
    /// Edges, one more than there are bars.
    pub edges: Vec<f64>,
    /// Heights.
    pub heights: Vec<f64>,
    /// Colour.
    pub colour: Colour,
}

/// Direction of a straight line through the whole plot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Across {
    /// Vertical, at one abscissa.
    X,
    /// Horizontal, at one ordinate.
    Y,
}

/// A dashed straight line through the whole plot with a label.
#[derive(Debug, Clone, PartialEq)]
pub struct Marker {
    /// Vertical or horizontal.
    pub across: Across,
    /// Position of the line on that axis.
    pub at: f64,
    /// What it marks; may be empty.
    pub label: String,
}

/// A shaded interval of abscissae, such as a standstill.
#[derive(Debug, Clone, PartialEq)]
pub struct Span {
    /// Start.
    pub from: f64,
    /// End.
    pub to: f64,
    /// What it marks; may be empty.
    pub label: String,
}

/// A plot over two axes: lines, scatter, bands, bars, markers.
#[derive(Debug, Clone, PartialEq)]
pub struct XyPlot {
    /// Title of the figure; empty for none.
    pub title: String,
    /// Abscissa.
    pub x: Axis,
    /// Ordinate.
    pub y: Axis,
    /// Shaded intervals, at the back.
    pub spans: Vec<Span>,
    /// Shaded regions.
    pub bands: Vec<Band>,
    /// Bars.
    pub bars: Vec<Bars>,
    /// Lines and dots, the last on top.
    pub series: Vec<Series>,
    /// Straight lines across the plot.
    pub markers: Vec<Marker>,
    /// Size of the figure when drawn alone.
    pub size: Size,
}

impl XyPlot {
    /// An empty plot of the page's width.
    pub fn new(title: impl Into<String>, x: Axis, y: Axis) -> Self {
        Self {
            title: title.into(),
            x,
            y,
            spans: Vec::new(),
            bands: Vec::new(),
            bars: Vec::new(),
            series: Vec::new(),
            markers: Vec::new(),
            size: Size::wide(300.0),
        }
    }

    /// Adds a series.
    pub fn with(
        mut self,
        name: impl Into<String>,
        x: &[f64],
        y: &[f64],
        colour: Colour,
        mark: Mark,
    ) -> Self {
        self.series.push(Series { name: name.into(), x: x.to_vec(), y: y.to_vec(), colour, mark });
        self
    }

    /// Adds a straight line across the plot.
    pub fn with_marker(mut self, across: Across, at: f64, label: impl Into<String>) -> Self {
        self.markers.push(Marker { across, at, label: label.into() });
        self
    }

    /// The figure as an SVG document.
    pub fn to_svg(&self) -> Result<String, PlotError> {
        let (x, y) = self.extents()?;
        render(self.size, &self.title, |canvas| {
            let sheet = Rect::of(self.size);
            let entries = heading::legend_entries([self]);
            let heading = Heading { title: &self.title, y: Some((&self.y, y)), entries: &entries };
            let area = heading.draw(canvas, sheet)?;
            let layout = Layout {
                left_px: panel::left_px(y, area.height()),
                x,
                y,
                x_labels: true,
                y_labels: true,
                point_budget: panel::POINT_BUDGET,
            };
            panel::draw(canvas, area, self, &layout)
        })
    }

    /// The ends of both axes.
    pub(super) fn extents(&self) -> Result<(Extent, Extent), PlotError> {
        self.check()?;
        let series = || self.series.iter();
        let x_data = series()
            .flat_map(|s| &s.x)
            .chain(self.bands.iter().flat_map(|b| &b.x))
            .chain(self.bars.iter().flat_map(|b| &b.edges))
            .copied()
            .chain(self.marked(Across::X));
        // Bars stand on zero, which the range must include; on a log axis zero is a gap and has no effect.
        let y_data = series()
            .flat_map(|s| &s.y)
            .chain(self.bands.iter().flat_map(|b| b.low.iter().chain(&b.high)))
            .chain(self.bars.iter().flat_map(|b| b.heights.iter().chain(&[0.0])))
            .copied()
            .chain(self.marked(Across::Y));
        let dotted = series().any(|s| matches!(s.mark, Mark::Dots | Mark::DotsAndLine));
        let x = self.x.extent(&self.title, x_data, if dotted { 0.03 } else { 0.0 })?;
        let mut y = self.y.extent(&self.title, y_data, 0.06)?;
        let floor =
            !self.bars.is_empty() && self.y.range.is_none() && self.y.scale == Scale::Linear;
        if floor && self.bars.iter().flat_map(|b| &b.heights).all(|&h| h.is_nan() || h >= 0.0) {
            y.low = y.low.max(0.0);
        }
        Ok((x, y))
    }

    fn marked(&self, across: Across) -> impl Iterator<Item = f64> {
        self.markers.iter().filter(move |m| m.across == across).map(|m| m.at)
    }

    fn check(&self) -> Result<(), PlotError> {
        let series = self.series.iter().map(|s| (&s.name, s.x.len(), s.y.len()));
        let low = self.bands.iter().map(|b| (&b.name, b.x.len(), b.low.len()));
        let high = self.bands.iter().map(|b| (&b.name, b.x.len(), b.high.len()));
        let bars =
            self.bars.iter().map(|b| (&b.name, b.edges.len().saturating_sub(1), b.heights.len()));
        match series.chain(low).chain(high).chain(bars).find(|(_, x, y)| x != y) {
            None => Ok(()),
            Some((name, x, y)) => Err(PlotError::LengthMismatch {
                figure: self.title.clone(),
                series: name.clone(),
                x,
                y,
            }),
        }
    }
}
