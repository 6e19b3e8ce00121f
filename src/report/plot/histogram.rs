//! A histogram of a sample, compared with the density it should follow.

use super::axis::Axis;
use super::canvas::Size;
use super::error::PlotError;
use super::palette::Colour;
use super::xy::{Bars, Mark, XyPlot};

const CURVE_POINTS: usize = 200;
const MOST_BINS: f64 = 80.0;

/// A probability density to compare with.
#[derive(Debug, Clone)]
pub struct Density {
    /// Name in the legend.
    pub name: String,
    /// Density per unit of the abscissa.
    pub at: fn(f64) -> f64,
}

/// Density of the standard normal distribution.
pub fn standard_normal(z: f64) -> f64 {
    (-0.5 * z * z).exp() / std::f64::consts::TAU.sqrt()
}

/// A histogram scaled to unit area, with a reference density.
#[derive(Debug, Clone)]
pub struct Histogram {
    /// Title of the figure.
    pub title: String,
    /// The quantity.
    pub x: Axis,
    /// The sample; non-finite values are left out.
    pub sample: Vec<f64>,
    /// Legend entry of the sample.
    pub name: String,
    /// Number of bins; `None` takes the rule of Freedman and Diaconis (1981), width 2·IQR/n^(1/3).
    pub bins: Option<usize>,
    /// The expected density.
    pub reference: Option<Density>,
    /// Size in pixels.
    pub size: Size,
}

impl Histogram {
    /// A histogram without reference.
    pub fn new(
        title: impl Into<String>,
        x: Axis,
        name: impl Into<String>,
        sample: Vec<f64>,
    ) -> Self {
        Self {
            title: title.into(),
            x,
            sample,
            name: name.into(),
            bins: None,
            reference: None,
            size: Size::wide(300.0),
        }
    }

    /// Adds the density of the standard normal distribution.
    pub fn against_standard_normal(mut self) -> Self {
        self.reference = Some(Density { name: "standard normal".into(), at: standard_normal });
        self
    }

    /// The figure as an SVG document.
    pub fn to_svg(&self) -> Result<String, PlotError> {
        self.to_plot().to_svg()
    }

    /// The histogram as a plot, for use in a [`Grid`](super::Grid).
    pub fn to_plot(&self) -> XyPlot {
        let per_unit =
            if self.x.unit.is_empty() { String::new() } else { format!("1/({})", self.x.unit) };
        let mut plot = XyPlot::new(&self.title, self.x.clone(), Axis::linear("density", per_unit));
        plot.size = self.size;
        let edges = self.edges();
        plot.bars.push(Bars {
            name: self.name.clone(),
            heights: densities(&self.sample, &edges),
            edges: edges.clone(),
            colour: Colour::series(0),
        });
        let sampled = edges.first().copied().zip(edges.last().copied());
        if let (Some(reference), Some((low, high))) = (&self.reference, self.x.range.or(sampled)) {
            let step = (high - low) / CURVE_POINTS as f64;
            let x: Vec<f64> = (0..=CURVE_POINTS).map(|k| low + k as f64 * step).collect();
            let y: Vec<f64> = x.iter().map(|&x| (reference.at)(x)).collect();
            plot = plot.with(&reference.name, &x, &y, Colour::MODEL, Mark::Line);
        }
        plot
    }

    /// Edges of equally wide bins that cover the whole sample; none for an empty sample.
    fn edges(&self) -> Vec<f64> {
        let mut sorted: Vec<f64> = self.sample.iter().copied().filter(|x| x.is_finite()).collect();
        sorted.sort_unstable_by(f64::total_cmp);
        let (Some(&low), Some(&high)) = (sorted.first(), sorted.last()) else { return Vec::new() };
        let span = high - low;
        if span <= 1e-9 * low.abs().max(high.abs()) || !span.is_finite() {
            let half = if low == 0.0 { 0.5 } else { 0.05 * low.abs() };
            return vec![low - half, low + half];
        }
        let quartile = |p: f64| sorted[((sorted.len() - 1) as f64 * p).round() as usize];
        let width = 2.0 * (quartile(0.75) - quartile(0.25)) / (sorted.len() as f64).cbrt();
        let suggested =
            if width > 0.0 { (span / width).ceil().clamp(1.0, MOST_BINS) as usize } else { 10 };
        let bins = self.bins.unwrap_or(suggested).max(1);
        (0..=bins).map(|k| low + span * k as f64 / bins as f64).collect()
    }
}

/// Share of the sample in each bin, divided by the bin's width.
fn densities(sample: &[f64], edges: &[f64]) -> Vec<f64> {
    let (Some(&low), Some(&high)) = (edges.first(), edges.last()) else { return Vec::new() };
    let bins = edges.len() - 1;
    let mut counts = vec![0usize; bins];
    let mut total = 0usize;
    for x in sample.iter().filter(|x| x.is_finite()) {
        let bin = ((x - low) / (high - low) * bins as f64).floor();
        counts[(bin.max(0.0) as usize).min(bins - 1)] += 1;
        total += 1;
    }
    let unit = (high - low) / bins as f64 * total as f64;
    counts.into_iter().map(|count| count as f64 / unit).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_area_is_one() {
        let sample: Vec<f64> = (0..1000).map(|k| (k as f64 * 0.37).sin()).collect();
        let histogram = Histogram::new("", Axis::linear("x", ""), "", sample);
        let edges = histogram.edges();
        let area: f64 = densities(&histogram.sample, &edges)
            .iter()
            .zip(edges.windows(2))
            .map(|(h, e)| h * (e[1] - e[0]))
            .sum();
        assert!((area - 1.0).abs() < 1e-12, "{area}");
    }

    #[test]
    fn every_value_falls_into_a_bin() {
        let edges = [0.0, 1.0, 2.0];
        assert_eq!(densities(&[0.0, 1.0, 2.0, f64::NAN], &edges), [1.0 / 3.0, 2.0 / 3.0]);
    }
}
