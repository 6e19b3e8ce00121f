//! Figures as inline SVG.
//!
//! Enters: numbers in plain structs. Leaves: an SVG document, the same bytes for the same numbers on every
//! machine, of at most some 150 kB however long the series are. Values that are not finite are gaps; empty and
//! constant data give an empty plot and a widened axis.
//!
//! | struct | shows |
//! |---|---|
//! | [`XyPlot`] | lines, scatter, bands such as ±σ, bars, markers, on linear or logarithmic axes |
//! | [`Grid`] | small multiples of [`XyPlot`], one per joint |
//! | [`IntervalPlot`] | values with intervals: parameters with σ, coverage with its bounds |
//! | [`Histogram`] | a sample against its reference density |
//! | [`HeatMap`] | a matrix with numbers |
//! | [`StickFigure`] | an arm in space, two views |

mod axis;
mod canvas;
mod error;
mod grid;
mod heat;
mod histogram;
mod interval;
mod palette;
mod panel;
mod stick;
mod ticks;
mod trace;
mod xy;

pub use axis::{Axis, Scale};
pub use canvas::Size;
pub use error::PlotError;
pub use grid::Grid;
pub use heat::HeatMap;
pub use histogram::{Density, Histogram};
pub use interval::{IntervalPlot, IntervalRow};
pub use palette::Colour;
pub use stick::{Stick, StickFigure, StickStyle};
pub use xy::{Across, Band, Bars, Mark, Marker, Series, Span, XyPlot};
