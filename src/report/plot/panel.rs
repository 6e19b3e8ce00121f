//! One plot laid out in a part of the sheet: grid, axes, data.

use super::axis::{Axis, Extent, Frame, Scale};
use super::canvas::{Anchor, Canvas, FONT_PX, Font, Point, Rect, Stroke, TITLE_PX, text_width_px};
use super::error::PlotError;
use super::palette::Colour;
use super::ticks::{Along, Ticks};
use super::trace;
use super::xy::{Across, Band, Bars, Mark, Series, XyPlot};

/// Points that all curves of one figure may have together: about 100 kB at ten bytes each.
pub(super) const POINT_BUDGET: usize = 10_000;
/// A dot costs seven times as many bytes as a point of a line.
const POINTS_PER_DOT: usize = 7;
/// Room right of the plot for the protruding half of a tick label.
pub(super) const RIGHT_PX: f64 = 14.0;
/// Room for the tick labels below the plot.
pub(super) const X_TICKS_PX: f64 = 19.0;
/// Room for the name of the abscissa.
pub(super) const X_NAME_PX: f64 = 17.0;

/// Layout that a panel shares with its neighbours.
#[derive(Debug, Clone, Copy)]
pub(super) struct Layout {
    /// Room for the tick labels left of the plot.
    pub left_px: f64,
    pub x: Extent,
    pub y: Extent,
    pub x_labels: bool,
    pub y_labels: bool,
    pub point_budget: usize,
}

/// Room that the tick labels of an ordinate need.
pub(super) fn left_px(y: Extent, height_px: f64) -> f64 {
    let ticks = y.ticks(height_px - X_TICKS_PX - X_NAME_PX, Along::Vertical).ticks;
    let widest = ticks.iter().map(|tick| text_width_px(&tick.label, FONT_PX)).fold(0.0, f64::max);
    (widest + 10.0).max(24.0)
}

/// Draws axes and data of one plot in `room`.
pub(super) fn draw(
    canvas: &Canvas,
    room: Rect,
    plot: &XyPlot,
    layout: &Layout,
) -> Result<(), PlotError> {
    let below = if layout.x_labels { X_TICKS_PX + X_NAME_PX } else { 6.0 };
    let area = Rect {
        left: room.left + layout.left_px,
        top: room.top,
        right: room.right - RIGHT_PX,
        bottom: room.bottom - below,
    };
    let frame = Frame { area, x: layout.x, y: layout.y };
    let x_ticks = frame.x.ticks(area.width(), Along::Horizontal);
    let y_ticks = frame.y.ticks(area.height(), Along::Vertical);
    spans(canvas, &frame, plot)?;
    vertical_grid(canvas, &frame, &x_ticks)?;
    horizontal_grid(canvas, &frame, &y_ticks)?;
    let needs =
        plot.bands.iter().map(|b| 2 * b.x.len()).chain(plot.series.iter().map(Series::cost));
    let shares = fair_shares(&needs.collect::<Vec<_>>(), layout.point_budget);
    let (band_shares, series_shares) = shares.split_at(plot.bands.len());
    for group in &plot.bars {
        bars(canvas, &frame, group)?;
    }
    // Dense curves are drawn below the bands, because they would hide them.
    let (dense, sparse): (Vec<_>, Vec<_>) =
        plot.series.iter().zip(series_shares).partition(|(curve, _)| curve.mark.is_dense());
    for (curve, &share) in dense {
        series(canvas, &frame, curve, share)?;
    }
    for (region, &share) in plot.bands.iter().zip(band_shares) {
        band(canvas, &frame, region, share / 2)?;
    }
    for (curve, &share) in sparse {
        series(canvas, &frame, curve, share)?;
    }
    markers(canvas, &frame, plot)?;
    baseline(canvas, &area)?;
    if layout.y_labels {
        for tick in &y_ticks.ticks {
            canvas.text(
                &tick.label,
                (area.left - 6.0, frame.y_tick_px(tick)),
                Anchor::Right,
                Font::LABEL,
            )?;
        }
    }
    if layout.x_labels {
        x_labels(canvas, &frame, &x_ticks, &plot.x)?;
    }
    Ok(())
}

/// Divides the budget: small needs are met in full, the others share the remainder equally.
fn fair_shares(needs: &[usize], budget: usize) -> Vec<usize> {
    let mut order: Vec<usize> = (0..needs.len()).collect();
    order.sort_by_key(|&k| needs[k]);
    let mut shares = vec![0; needs.len()];
    let mut left = budget;
    for (served, &k) in order.iter().enumerate() {
        shares[k] = needs[k].min(left / (needs.len() - served));
        left -= shares[k];
    }
    shares
}

impl Mark {
    /// Whether it is meant for dense data.
    fn is_dense(self) -> bool {
        matches!(self, Self::ThinLine | Self::WideLine)
    }

    /// Opacity of its line.
    pub(super) fn opacity(self) -> f64 {
        if self == Self::WideLine { 0.4 } else { 1.0 }
    }
}

impl Series {
    /// Points of the budget that the series needs if no sample is dropped.
    fn cost(&self) -> usize {
        let per_sample = match self.mark {
            Mark::Line | Mark::ThinLine | Mark::WideLine | Mark::Dashed => 1,
            Mark::Dots => POINTS_PER_DOT,
            Mark::DotsAndLine => POINTS_PER_DOT + 1,
        };
        per_sample * self.x.len()
    }
}

/// The bottom line of a plot.
pub(super) fn baseline(canvas: &Canvas, area: &Rect) -> Result<(), PlotError> {
    canvas.line(
        &[(area.left, area.bottom), (area.right, area.bottom)],
        Stroke::solid(Colour::AXIS, 1.0),
    )
}

/// Vertical grid lines.
pub(super) fn vertical_grid(
    canvas: &Canvas,
    frame: &Frame,
    ticks: &Ticks,
) -> Result<(), PlotError> {
    for tick in &ticks.ticks {
        let x = frame.x_tick_px(tick);
        let colour = if tick.label.is_empty() { Colour::GRID_MINOR } else { Colour::GRID };
        canvas.line(&[(x, frame.area.top), (x, frame.area.bottom)], Stroke::solid(colour, 1.0))?;
    }
    Ok(())
}

/// Horizontal grid lines.
pub(super) fn horizontal_grid(
    canvas: &Canvas,
    frame: &Frame,
    ticks: &Ticks,
) -> Result<(), PlotError> {
    for tick in &ticks.ticks {
        let y = frame.y_tick_px(tick);
        let zero = frame.y.scale == Scale::Linear && tick.at == 0.0 && frame.y.low < 0.0;
        let colour = match (tick.label.is_empty(), zero) {
            (true, _) => Colour::GRID_MINOR,
            (false, true) => Colour::AXIS,
            (false, false) => Colour::GRID,
        };
        canvas.line(&[(frame.area.left, y), (frame.area.right, y)], Stroke::solid(colour, 1.0))?;
    }
    Ok(())
}

/// Tick labels and name below the plot. A label at the right end is moved inwards rather than cut.
pub(super) fn x_labels(
    canvas: &Canvas,
    frame: &Frame,
    ticks: &Ticks,
    axis: &Axis,
) -> Result<(), PlotError> {
    let area = &frame.area;
    for tick in &ticks.ticks {
        let half = 0.5 * text_width_px(&tick.label, FONT_PX);
        let x = frame.x_tick_px(tick).min(area.right + RIGHT_PX - half);
        canvas.text(
            &tick.label,
            (x, area.bottom + 0.55 * X_TICKS_PX),
            Anchor::Centre,
            Font::LABEL,
        )?;
    }
    let at = (0.5 * (area.left + area.right), area.bottom + X_TICKS_PX + 0.45 * X_NAME_PX);
    canvas.text(&axis.caption(ticks.exponent), at, Anchor::Centre, Font::LABEL)
}

fn spans(canvas: &Canvas, frame: &Frame, plot: &XyPlot) -> Result<(), PlotError> {
    let area = &frame.area;
    for span in &plot.spans {
        let (Some(left), Some(right)) = (frame.x_px(span.from), frame.x_px(span.to)) else {
            continue;
        };
        let (left, right) = (left.max(area.left), right.min(area.right));
        if left < right {
            canvas.rect(Rect { left, right, ..*area }, Colour::GRID, 0.75)?;
            if text_width_px(&span.label, FONT_PX) < right - left {
                let at = (0.5 * (left + right), area.top + 0.5 * TITLE_PX + 2.0);
                canvas.text(&span.label, at, Anchor::Centre, Font::LABEL)?;
            }
        }
    }
    Ok(())
}

fn band(canvas: &Canvas, frame: &Frame, band: &Band, budget: usize) -> Result<(), PlotError> {
    let area = &frame.area;
    let edge = |values: &[f64]| -> Vec<Option<Point>> {
        let both = band.low.iter().zip(&band.high);
        band.x
            .iter()
            .zip(values)
            .zip(both)
            .map(|((&x, &y), (low, high))| {
                let finite = low.is_finite() && high.is_finite();
                let x = frame.x_px(x)?.clamp(area.left, area.right);
                let y = frame.y_px(y)?.clamp(area.top, area.bottom);
                finite.then_some((x, y))
            })
            .collect()
    };
    let bucket = bucket_px(area, budget);
    let (low, high) = (edge(&band.low), edge(&band.high));
    let present = |(l, h): (&Option<Point>, &Option<Point>)| l.is_some() && h.is_some();
    let common: Vec<bool> = low.iter().zip(&high).map(present).collect();
    let keep = |points: Vec<Option<Point>>| {
        let kept = points.into_iter().zip(&common).map(|(point, &both)| point.filter(|_| both));
        trace::runs(kept)
    };
    for (low, high) in keep(low).into_iter().zip(keep(high)) {
        let mut outline = trace::thin_line(&low, bucket);
        outline.extend(trace::thin_line(&high, bucket).into_iter().rev());
        canvas.polygon(&outline, band.colour, 0.2)?;
    }
    Ok(())
}

/// Colour of bars: pale, so that a curve in front of them stands out.
pub(super) fn bar_colour(colour: Colour) -> Colour {
    colour.towards(Colour::PAPER, 0.45)
}

fn bars(canvas: &Canvas, frame: &Frame, bars: &Bars) -> Result<(), PlotError> {
    let area = &frame.area;
    let foot = frame.y_px(0.0).unwrap_or(area.bottom).clamp(area.top, area.bottom);
    for (edges, &height) in bars.edges.windows(2).zip(&bars.heights) {
        let ends = (frame.x_px(edges[0]), frame.x_px(edges[1]), frame.y_px(height));
        let (Some(left), Some(right), Some(y)) = ends else { continue };
        let (left, right) = (left.max(area.left), right.min(area.right));
        let y = y.clamp(area.top, area.bottom);
        // A hairline gap between neighbours, if the bars are wide enough for it.
        let gap = if right - left > 4.0 { 0.5 } else { 0.0 };
        if left < right {
            let bar = Rect {
                left: left + gap,
                top: y.min(foot),
                right: right - gap,
                bottom: y.max(foot),
            };
            canvas.rect(bar, bar_colour(bars.colour), 1.0)?;
        }
    }
    Ok(())
}

fn series(canvas: &Canvas, frame: &Frame, series: &Series, budget: usize) -> Result<(), PlotError> {
    let place = |(&x, &y): (&f64, &f64)| Some((frame.x_px(x)?, frame.y_px(y)?));
    let width_px = match series.mark {
        Mark::Line => 1.8,
        Mark::ThinLine => 0.9,
        Mark::WideLine => 4.0,
        Mark::Dashed => 1.6,
        Mark::DotsAndLine => 1.2,
        Mark::Dots => 0.0,
    };
    let stroke = Stroke {
        dashed: series.mark == Mark::Dashed,
        opacity: series.mark.opacity(),
        ..Stroke::solid(series.colour, width_px)
    };
    if series.mark != Mark::Dots {
        let bucket = bucket_px(&frame.area, budget);
        for run in trace::runs(series.x.iter().zip(&series.y).map(place)) {
            for part in trace::clip(&trace::thin_line(&run, bucket), &frame.area) {
                canvas.line(&part, stroke)?;
            }
        }
    }
    if matches!(series.mark, Mark::Dots | Mark::DotsAndLine) {
        let points: Vec<Point> = series.x.iter().zip(&series.y).filter_map(place).collect();
        let inside: Vec<Point> =
            points.into_iter().filter(|&p| trace::inside(p, &frame.area)).collect();
        let dots = trace::thin_dots(&inside, budget / POINTS_PER_DOT);
        let (radius, opacity) = if dots.len() > 150 { (1.5, 0.55) } else { (2.8, 0.95) };
        for dot in dots {
            canvas.dot(dot, radius, series.colour, opacity)?;
        }
    }
    Ok(())
}

/// Width of a decimation bucket: a pixel, or more if the budget requires it.
fn bucket_px(area: &Rect, budget: usize) -> f64 {
    (2.0 * area.width() / budget.max(1) as f64).max(1.0)
}

/// Straight lines across the plot; labels that would touch are moved into separate rows.
fn markers(canvas: &Canvas, frame: &Frame, plot: &XyPlot) -> Result<(), PlotError> {
    let area = &frame.area;
    let mut taken: Vec<(usize, f64, f64)> = Vec::new();
    for marker in &plot.markers {
        let width = text_width_px(&marker.label, FONT_PX);
        let stroke = Stroke::dashed(Colour::MUTED, 1.2);
        match marker.across {
            Across::X => {
                let Some(x) =
                    frame.x_px(marker.at).filter(|x| (area.left..=area.right).contains(x))
                else {
                    continue;
                };
                canvas.line(&[(x, area.top), (x, area.bottom)], stroke)?;
                let left = if x + width + 6.0 > area.right { x - width - 6.0 } else { x + 5.0 };
                let right = left + width;
                let free =
                    |row: usize| taken.iter().all(|&(r, l, h)| r != row || right < l || left > h);
                let row = (0..taken.len()).find(|&row| free(row)).unwrap_or(taken.len());
                taken.push((row, left - 6.0, right + 6.0));
                note(canvas, &marker.label, (left, area.top + 8.0 + 16.0 * row as f64))?;
            }
            Across::Y => {
                let Some(y) =
                    frame.y_px(marker.at).filter(|y| (area.top..=area.bottom).contains(y))
                else {
                    continue;
                };
                canvas.line(&[(area.left, y), (area.right, y)], stroke)?;
                let above = y - area.top > 16.0;
                note(
                    canvas,
                    &marker.label,
                    (area.right - 4.0 - width, if above { y - 9.0 } else { y + 9.0 }),
                )?;
            }
        }
    }
    Ok(())
}

/// A text on a translucent background, readable over data.
fn note(canvas: &Canvas, text: &str, (left, middle): Point) -> Result<(), PlotError> {
    if text.is_empty() {
        return Ok(());
    }
    let right = left + text_width_px(text, FONT_PX);
    let paper =
        Rect { left: left - 2.0, top: middle - 7.5, right: right + 2.0, bottom: middle + 7.5 };
    canvas.rect(paper, Colour::PAPER, 0.85)?;
    canvas.text(text, (left, middle), Anchor::Left, Font::LABEL.colour(Colour::INK))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_needs_are_met_and_the_rest_is_shared() {
        assert_eq!(fair_shares(&[10_000, 50, 10_000], 1000), [475, 50, 475]);
        assert_eq!(fair_shares(&[5, 5], 1000), [5, 5]);
        assert!(fair_shares(&[], 1000).is_empty());
    }
}
