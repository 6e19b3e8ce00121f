//! An arm as lines in space, seen from the side and from above.

use super::axis::{Axis, Extent, Frame};
use super::canvas::{Anchor, Canvas, Font, Point, Rect, Size, Stroke, render};
use super::error::PlotError;
use super::heading::{Entry, Heading, ROW_PX, Swatch};
use super::palette::Colour;
use super::panel::{self, RIGHT_PX, X_NAME_PX, X_TICKS_PX};
use super::ticks::Along;
use super::trace;
use super::xy::Mark;

const GUTTER_PX: f64 = 26.0;
const LEFT_PX: f64 = 38.0;

/// How a polyline in space is drawn.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum StickStyle {
    /// One posture: thick, with a dot at every joint.
    Posture,
    /// One of many postures: thin and pale.
    Trail,
    /// The path of one point: thin.
    Path,
}

/// A polyline in space, in the base frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Stick {
    /// Name in the legend; empty to be left out of it.
    pub name: String,
    /// Points x, y, z in metres.
    pub points_m: Vec<[f64; 3]>,
    /// Colour.
    pub colour: Colour,
    /// Posture, trail or path.
    pub style: StickStyle,
}

/// Two views of polylines at the same scale.
#[derive(Debug, Clone, PartialEq)]
pub struct StickFigure {
    /// Title of the figure.
    pub title: String,
    /// The polylines, the last on top.
    pub sticks: Vec<Stick>,
    /// Size in pixels.
    pub size: Size,
}

/// One view, defined by the components that point right and up.
struct View {
    title: &'static str,
    right: usize,
    up: usize,
}

const VIEWS: [View; 2] =
    [View { title: "side view", right: 0, up: 2 }, View { title: "top view", right: 0, up: 1 }];
const COMPONENTS: [&str; 3] = ["x", "y", "z"];

impl StickFigure {
    /// The figure as an SVG document.
    pub fn to_svg(&self) -> Result<String, PlotError> {
        let extent = |component: usize| {
            let values = self.sticks.iter().flat_map(|s| &s.points_m).map(|p| p[component]);
            Axis::linear(COMPONENTS[component], "m").extent(&self.title, values, 0.06)
        };
        let extents = [extent(0)?, extent(1)?, extent(2)?];
        render(self.size, &self.title, |canvas| {
            let entries = self.entries();
            let body = Heading { title: &self.title, y: None, entries: &entries }
                .draw(canvas, Rect::of(self.size))?;
            let view_px = 0.5 * (body.width() - GUTTER_PX);
            let area = |k: usize| {
                let left = body.left + k as f64 * (view_px + GUTTER_PX);
                Rect {
                    left: left + LEFT_PX,
                    top: body.top + ROW_PX,
                    right: left + view_px - RIGHT_PX,
                    bottom: body.bottom - X_TICKS_PX - X_NAME_PX,
                }
            };
            // The largest scale at which both views fit into their areas.
            let px_per_m = VIEWS.iter().enumerate().fold(f64::INFINITY, |scale, (k, view)| {
                let (area, right, up) = (area(k), extents[view.right], extents[view.up]);
                scale
                    .min(area.width() / (right.high - right.low))
                    .min(area.height() / (up.high - up.low))
            });
            for (k, view) in VIEWS.iter().enumerate() {
                let area = area(k);
                let frame = Frame {
                    area,
                    x: widened(extents[view.right], area.width() / px_per_m),
                    y: widened(extents[view.up], area.height() / px_per_m),
                };
                self.draw_view(canvas, &frame, view)?;
            }
            Ok(())
        })
    }

    fn entries(&self) -> Vec<Entry> {
        let mut entries: Vec<Entry> = Vec::new();
        for stick in &self.sticks {
            let mark = match stick.style {
                StickStyle::Posture => Mark::DotsAndLine,
                StickStyle::Trail | StickStyle::Path => Mark::Line,
            };
            let entry = Entry::new(&stick.name, stick.colour, Swatch::Mark(mark));
            if !entry.is_nameless() && !entries.contains(&entry) {
                entries.push(entry);
            }
        }
        entries
    }

    fn draw_view(&self, canvas: &Canvas, frame: &Frame, view: &View) -> Result<(), PlotError> {
        let area = &frame.area;
        let x_ticks = frame.x.ticks(area.width(), Along::Horizontal);
        let y_ticks = frame.y.ticks(area.height(), Along::Vertical);
        panel::vertical_grid(canvas, frame, &x_ticks)?;
        panel::horizontal_grid(canvas, frame, &y_ticks)?;
        let budget = panel::POINT_BUDGET / (VIEWS.len() * self.sticks.len().max(1));
        for stick in &self.sticks {
            let place = |p: &[f64; 3]| Some((frame.x_px(p[view.right])?, frame.y_px(p[view.up])?));
            for run in trace::runs(stick.points_m.iter().map(place)) {
                draw_stick(canvas, &run, stick, budget)?;
            }
        }
        panel::baseline(canvas, area)?;
        for tick in &y_ticks.ticks {
            canvas.text(
                &tick.label,
                (area.left - 6.0, frame.y_tick_px(tick)),
                Anchor::Right,
                Font::LABEL,
            )?;
        }
        let heading =
            format!("{}: {} over {} [m]", view.title, COMPONENTS[view.up], COMPONENTS[view.right]);
        canvas.text(&heading, (area.left, area.top - 0.5 * ROW_PX), Anchor::Left, Font::LABEL)?;
        panel::x_labels(canvas, frame, &x_ticks, &Axis::linear(COMPONENTS[view.right], "m"))
    }
}

fn draw_stick(
    canvas: &Canvas,
    run: &[Point],
    stick: &Stick,
    budget: usize,
) -> Result<(), PlotError> {
    match stick.style {
        StickStyle::Posture => {
            canvas.line(run, Stroke::solid(stick.colour, 3.0))?;
            run.iter().try_for_each(|&joint| {
                canvas.dot(joint, 4.2, stick.colour, 1.0)?;
                canvas.dot(joint, 2.0, Colour::PAPER, 1.0)
            })
        }
        StickStyle::Trail => {
            canvas.line(run, Stroke { opacity: 0.25, ..Stroke::solid(stick.colour, 1.2) })
        }
        StickStyle::Path => {
            let every = run.len().div_ceil(budget.max(2)).max(1);
            let points: Vec<Point> = run.iter().step_by(every).chain(run.last()).copied().collect();
            canvas.line(&points, Stroke::solid(stick.colour, 1.2))
        }
    }
}

/// The extent with the same middle, widened to `span`.
fn widened(extent: Extent, span: f64) -> Extent {
    let middle = 0.5 * (extent.low + extent.high);
    Extent { low: middle - 0.5 * span, high: middle + 0.5 * span, ..extent }
}
