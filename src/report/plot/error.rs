//! Why a figure could not be drawn.

use thiserror::Error;

use super::canvas::{LEAST_SIZE_PX, MOST_SIZE_PX};

/// A figure that cannot be drawn because its inputs do not fit together.
///
/// Empty, constant and non-finite data are not errors: they give an empty figure, a widened axis and a gap.
#[derive(Debug, Error, PartialEq)]
pub enum PlotError {
    /// Abscissae and ordinates of one series differ in number.
    #[error("figure \"{figure}\": series \"{series}\" has {x} abscissae but {y} ordinates")]
    LengthMismatch {
        /// Title of the figure.
        figure: String,
        /// Name of the series or band.
        series: String,
        /// Number of abscissae.
        x: usize,
        /// Number of ordinates.
        y: usize,
    },
    /// A row of a heat map does not have one value per column, or the map not one row per label.
    #[error("figure \"{figure}\": row {row} has {found} values for {expected} labels")]
    RaggedRow {
        /// Title of the figure.
        figure: String,
        /// Row, from 0; equal to the number of labels when the number of rows itself is wrong.
        row: usize,
        /// Values found.
        found: usize,
        /// Labels given.
        expected: usize,
    },
    /// A fixed axis range that is empty, reversed, not finite, or not positive on a log axis.
    #[error(
        "figure \"{figure}\": the fixed range {low} to {high} of axis \"{axis}\" is not usable"
    )]
    AxisRange {
        /// Title of the figure.
        figure: String,
        /// Label of the axis.
        axis: String,
        /// Lower end.
        low: f64,
        /// Upper end.
        high: f64,
    },
    /// The figure is too small or too large, or its size is not finite.
    #[error(
        "a figure of {width_px} x {height_px} pixels is outside {} to {}",
        LEAST_SIZE_PX,
        MOST_SIZE_PX
    )]
    Size {
        /// Width in pixels.
        width_px: f64,
        /// Height in pixels.
        height_px: f64,
    },
    /// The drawing backend failed.
    #[error("drawing failed: {reason}")]
    Backend {
        /// The backend's message.
        reason: String,
    },
}
