//! An axis: what it measures, its scale, and its range.

use super::canvas::Rect;
use super::error::PlotError;
use super::ticks::{self, Along, Tick};

/// How values are mapped to positions along an axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Scale {
    /// Equal distances for equal differences.
    Linear,
    /// Equal distances for equal ratios; values ≤ 0 are gaps.
    Log,
}

/// What an axis measures.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// The quantity, such as `torque`.
    pub label: String,
    /// Its unit, such as `Nm`; empty for none.
    pub unit: String,
    /// Linear or logarithmic.
    pub scale: Scale,
    /// Fixed ends; `None` takes them from the data.
    pub range: Option<(f64, f64)>,
}

impl Axis {
    /// A linear axis whose range follows the data.
    pub fn linear(label: impl Into<String>, unit: impl Into<String>) -> Self {
        Self { label: label.into(), unit: unit.into(), scale: Scale::Linear, range: None }
    }

    /// A logarithmic axis whose range follows the data.
    pub fn log(label: impl Into<String>, unit: impl Into<String>) -> Self {
        Self { scale: Scale::Log, ..Self::linear(label, unit) }
    }

    /// The same axis from `low` to `high`.
    pub fn between(self, low: f64, high: f64) -> Self {
        Self { range: Some((low, high)), ..self }
    }

    /// Ends of the axis in axis coordinates. `margin` is the share of the span left free at either end.
    pub(super) fn extent(
        &self,
        figure: &str,
        data: impl Iterator<Item = f64>,
        margin: f64,
    ) -> Result<Extent, PlotError> {
        if let Some((low, high)) = self.range {
            let ends = Extent {
                scale: self.scale,
                low: self.scale.to_axis(low),
                high: self.scale.to_axis(high),
            };
            let usable = ends.low.abs() < HUGE && ends.high.abs() < HUGE && ends.low < ends.high;
            return if usable {
                Ok(ends)
            } else {
                Err(PlotError::AxisRange {
                    figure: figure.to_owned(),
                    axis: self.label.clone(),
                    low,
                    high,
                })
            };
        }
        let (low, high) = data
            .map(|value| self.scale.to_axis(value))
            .filter(|at| at.abs() < HUGE)
            .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), at| {
                (low.min(at), high.max(at))
            });
        let (low, high) = if low > high { (0.0, 1.0) } else { (low, high) };
        let span = high - low;
        // Below this span the differences are rounding errors of the values themselves.
        let (low, high) = if span <= 1e-9 * low.abs().max(high.abs()) {
            let half = if self.scale == Scale::Log || low == 0.0 { 1.0 } else { 0.1 * low.abs() };
            (low - half, high + half)
        } else {
            (low - margin * span, high + margin * span)
        };
        Ok(Extent { scale: self.scale, low, high })
    }

    /// `label [unit]`; the unit carries the power of ten that was factored out of the tick labels.
    pub(super) fn caption(&self, exponent: i32) -> String {
        let unit = match (exponent, self.unit.as_str()) {
            (0, unit) => unit.to_owned(),
            (exponent, "") => ticks::power_of_ten(exponent),
            (exponent, unit) => format!("{} {unit}", ticks::power_of_ten(exponent)),
        };
        match (self.label.as_str(), unit.as_str()) {
            (label, "") => label.to_owned(),
            ("", unit) => format!("[{unit}]"),
            (label, unit) => format!("{label} [{unit}]"),
        }
    }
}

/// Values beyond this are drawn as gaps: their differences would overflow.
const HUGE: f64 = 1e150;
/// Values below this are drawn as zero (on a log axis, as gaps): steps between them would underflow.
const TINY: f64 = 1e-150;

impl Scale {
    fn to_axis(self, value: f64) -> f64 {
        match self {
            Scale::Linear if value.abs() < TINY => 0.0,
            Scale::Linear => value,
            Scale::Log if (TINY..HUGE).contains(&value) => value.log10(),
            Scale::Log => f64::NAN,
        }
    }
}

/// The ends of an axis in axis coordinates (the value, or its decimal logarithm).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Extent {
    pub scale: Scale,
    pub low: f64,
    pub high: f64,
}

impl Extent {
    pub fn union(self, other: Self) -> Self {
        Self { low: self.low.min(other.low), high: self.high.max(other.high), ..self }
    }

    pub fn ticks(self, length_px: f64, along: Along) -> ticks::Ticks {
        // A figure can be lower than its heading and labels, which leaves a negative length.
        let length_px = length_px.max(1.0);
        match self.scale {
            Scale::Linear => ticks::linear(self.low, self.high, length_px, along),
            Scale::Log => ticks::logarithmic(self.low, self.high, length_px, along),
        }
    }

    /// Power of ten that is factored out of the tick labels.
    pub fn exponent(self) -> i32 {
        match self.scale {
            Scale::Linear => ticks::shared_exponent(self.low.abs().max(self.high.abs())),
            Scale::Log if self.high - self.low < 1.0 => {
                ticks::shared_exponent(10f64.powf(self.high))
            }
            Scale::Log => 0,
        }
    }

    /// Position of a value between the ends (0 to 1 inside), `None` for a value that cannot be placed.
    fn fraction(self, value: f64) -> Option<f64> {
        let at = self.scale.to_axis(value);
        (at.abs() < HUGE).then(|| (at - self.low) / (self.high - self.low))
    }

    fn tick_fraction(self, tick: &Tick) -> f64 {
        (tick.at - self.low) / (self.high - self.low)
    }
}

/// Two axes laid over a rectangle of the sheet.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    pub area: Rect,
    pub x: Extent,
    pub y: Extent,
}

impl Frame {
    /// Abscissa on the sheet in pixels.
    pub fn x_px(&self, value: f64) -> Option<f64> {
        self.x.fraction(value).map(|f| self.area.left + f * self.area.width())
    }

    /// Ordinate on the sheet in pixels.
    pub fn y_px(&self, value: f64) -> Option<f64> {
        self.y.fraction(value).map(|f| self.area.bottom - f * self.area.height())
    }

    pub fn x_tick_px(&self, tick: &Tick) -> f64 {
        self.area.left + self.x.tick_fraction(tick) * self.area.width()
    }

    pub fn y_tick_px(&self, tick: &Tick) -> f64 {
        self.area.bottom - self.y.tick_fraction(tick) * self.area.height()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn extent(axis: &Axis, data: &[f64]) -> (f64, f64) {
        let ends = axis.extent("figure", data.iter().copied(), 0.0).unwrap();
        (ends.low, ends.high)
    }

    #[test]
    fn no_data_give_a_unit_axis_and_one_value_a_widened_one() {
        let axis = Axis::linear("torque", "Nm");
        assert_eq!(extent(&axis, &[]), (0.0, 1.0));
        assert_eq!(extent(&axis, &[f64::NAN, f64::INFINITY]), (0.0, 1.0));
        assert_eq!(extent(&axis, &[0.0]), (-1.0, 1.0));
        assert_eq!(extent(&axis, &[5.0, 5.0]), (4.5, 5.5));
    }

    #[test]
    fn a_log_axis_leaves_out_what_is_not_positive() {
        assert_eq!(extent(&Axis::log("power", ""), &[-1.0, 0.0, 0.01, 100.0]), (-2.0, 2.0));
    }

    #[test]
    fn values_that_would_overflow_are_gaps() {
        assert_eq!(extent(&Axis::linear("q", "rad"), &[-1.0, 1.0, 1e300, -1e300]), (-1.0, 1.0));
    }

    #[test]
    fn a_reversed_range_is_refused() {
        let axis = Axis::linear("q", "rad").between(1.0, -1.0);
        let error = axis.extent("figure", std::iter::empty(), 0.0).unwrap_err();
        assert!(matches!(error, PlotError::AxisRange { low: 1.0, high: -1.0, .. }));
    }

    #[test]
    fn the_unit_carries_the_exponent() {
        assert_eq!(Axis::linear("noise", "rad").caption(-6), "noise [10⁻⁶ rad]");
        assert_eq!(Axis::linear("ratio", "").caption(0), "ratio");
    }
}
