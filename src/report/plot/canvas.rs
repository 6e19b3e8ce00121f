//! A sheet measured in pixels, drawn by the SVG backend of plotters.
//!
//! The backend's coordinates are integers. The sheet is therefore drawn [`UNITS_PER_PX`] times as large and scaled back
//! by the `viewBox`: lines are placed to a tenth of a pixel, and can be thinner than a pixel.

use plotters::backend::SVGBackend;
use plotters::coord::Shift;
use plotters::drawing::{DrawingArea, IntoDrawingArea};
use plotters::element::{
    Circle, DashedPathElement, Drawable, PathElement, PointCollection, Polygon, Rectangle, Text,
};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{
    Color, FontStyle, FontTransform, IntoFont, RGBAColor, ShapeStyle, TextStyle,
};

use super::error::PlotError;
use super::palette::Colour;

const UNITS_PER_PX: f64 = 10.0;
/// The backend divides the font size it is given by this number.
const BACKEND_FONT_DIVISOR: f64 = 1.24;
/// Smallest and largest side of a figure that can be drawn.
pub(super) const LEAST_SIZE_PX: f64 = 40.0;
pub(super) const MOST_SIZE_PX: f64 = 10_000.0;
const DASH_PX: i32 = 5;
const GAP_PX: i32 = 4;

/// Font size of tick labels, legends and axis labels, in pixels.
pub(super) const FONT_PX: f64 = 11.5;
/// Font size of titles, in pixels.
pub(super) const TITLE_PX: f64 = 13.0;

/// A point on the sheet in pixels, y downwards.
pub(super) type Point = (f64, f64);

/// Size of a figure in pixels. It is the size at which fonts are readable; the page may shrink it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Size {
    /// Width in pixels.
    pub width_px: f64,
    /// Height in pixels.
    pub height_px: f64,
}

impl Size {
    /// The full width of a report's text column.
    pub const FULL_WIDTH_PX: f64 = 960.0;

    /// A figure over the full width of the page.
    pub fn wide(height_px: f64) -> Self {
        Self { width_px: Self::FULL_WIDTH_PX, height_px }
    }

    fn check(self) -> Result<(), PlotError> {
        let usable = LEAST_SIZE_PX..=MOST_SIZE_PX;
        if usable.contains(&self.width_px) && usable.contains(&self.height_px) {
            Ok(())
        } else {
            Err(PlotError::Size { width_px: self.width_px, height_px: self.height_px })
        }
    }
}

/// An axis-parallel rectangle on the sheet, in pixels.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Rect {
    pub left: f64,
    pub top: f64,
    pub right: f64,
    pub bottom: f64,
}

impl Rect {
    pub fn of(size: Size) -> Self {
        Self { left: 0.0, top: 0.0, right: size.width_px, bottom: size.height_px }
    }

    pub fn width(&self) -> f64 {
        self.right - self.left
    }

    pub fn height(&self) -> f64 {
        self.bottom - self.top
    }
}

/// Which point of a text its position refers to.
#[derive(Debug, Clone, Copy)]
pub(super) enum Anchor {
    /// The left end, at half height.
    Left,
    /// The centre.
    Centre,
    /// The right end, at half height.
    Right,
}

/// How a text looks.
#[derive(Debug, Clone, Copy)]
pub(super) struct Font {
    pub size_px: f64,
    pub bold: bool,
    pub colour: Colour,
    /// Written upwards.
    pub upwards: bool,
}

impl Font {
    pub const LABEL: Self =
        Self { size_px: FONT_PX, bold: false, colour: Colour::MUTED, upwards: false };
    pub const TITLE: Self =
        Self { size_px: TITLE_PX, bold: true, colour: Colour::INK, upwards: false };

    pub fn colour(self, colour: Colour) -> Self {
        Self { colour, ..self }
    }
}

/// How a line looks.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stroke {
    pub colour: Colour,
    pub opacity: f64,
    pub width_px: f64,
    pub dashed: bool,
}

impl Stroke {
    pub fn solid(colour: Colour, width_px: f64) -> Self {
        Self { colour, opacity: 1.0, width_px, dashed: false }
    }

    pub fn dashed(colour: Colour, width_px: f64) -> Self {
        Self { dashed: true, ..Self::solid(colour, width_px) }
    }
}

pub(super) struct Canvas<'a> {
    area: DrawingArea<SVGBackend<'a>, Shift>,
}

/// An SVG document of the given size with what `draw` draws on the canvas.
pub(super) fn render(
    size: Size,
    title: &str,
    draw: impl FnOnce(&Canvas) -> Result<(), PlotError>,
) -> Result<String, PlotError> {
    size.check()?;
    let units = |px: f64| (px * UNITS_PER_PX).round() as u32;
    let (width, height) = (units(size.width_px), units(size.height_px));
    let mut svg = String::new();
    {
        let canvas =
            Canvas { area: SVGBackend::with_string(&mut svg, (width, height)).into_drawing_area() };
        draw(&canvas)?;
        canvas.area.present().map_err(backend_error)?;
    }
    Ok(finish(&svg, size, title))
}

/// Scales the sheet to its size, labels it for screen readers, and removes attributes that only state a default.
fn finish(svg: &str, size: Size, title: &str) -> String {
    let body = svg.split_once('\n').map_or("", |(_root, body)| body);
    let head = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}\" height=\"{h}\" viewBox=\"0 0 {uw} {uh}\" \
         role=\"img\" aria-label=\"{label}\" font-family=\"system-ui, -apple-system, 'Segoe UI', Roboto, \
         Helvetica, Arial, sans-serif\" stroke-linejoin=\"round\" stroke-linecap=\"butt\">\n",
        w = size.width_px.round(),
        h = size.height_px.round(),
        uw = (size.width_px * UNITS_PER_PX).round(),
        uh = (size.height_px * UNITS_PER_PX).round(),
        label = escape_attribute(title),
    );
    let mut out = String::with_capacity(head.len() + body.len());
    out.push_str(&head);
    for line in body.lines() {
        // The backend writes each text on a line of its own with `<` escaped, so that the replacements touch only tags.
        if line.starts_with('<') {
            let line = line
                .replace(" opacity=\"1\"", "")
                .replace(" font-family=\"sans-serif\"", "")
                .replace(" stroke=\"none\"", "")
                .replace(" \"", "\"");
            out.push_str(&line);
        } else {
            out.push_str(line);
        }
        out.push('\n');
    }
    out
}

/// The figure `svg`, with `label` as its label for screen readers if it has no title of its own.
pub(in crate::report) fn labelled(svg: String, label: &str) -> String {
    const NAMELESS: &str = " aria-label=\"\"";
    match svg.split_once('\n') {
        Some((head, body)) if head.contains(NAMELESS) => {
            let label = format!(" aria-label=\"{}\"", escape_attribute(label));
            format!("{}\n{body}", head.replace(NAMELESS, &label))
        }
        _ => svg,
    }
}

fn escape_attribute(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

fn backend_error(error: impl std::fmt::Display) -> PlotError {
    PlotError::Backend { reason: error.to_string() }
}

fn grid((x, y): Point) -> (i32, i32) {
    ((x * UNITS_PER_PX).round() as i32, (y * UNITS_PER_PX).round() as i32)
}

impl<'a> Canvas<'a> {
    fn put<E>(&self, element: &E) -> Result<(), PlotError>
    where
        for<'b> &'b E: PointCollection<'b, (i32, i32)>,
        E: Drawable<SVGBackend<'a>>,
    {
        self.area.draw(element).map_err(backend_error)
    }

    pub fn line(&self, points: &[Point], stroke: Stroke) -> Result<(), PlotError> {
        if points.len() < 2 {
            return Ok(());
        }
        let points: Vec<_> = points.iter().copied().map(grid).collect();
        let style = ShapeStyle {
            color: rgba(stroke.colour, stroke.opacity),
            filled: false,
            stroke_width: (stroke.width_px * UNITS_PER_PX).round() as u32,
        };
        if stroke.dashed {
            let px = |length: i32| length * UNITS_PER_PX as i32;
            self.put(&DashedPathElement::new(points, px(DASH_PX), px(GAP_PX), style))
        } else {
            self.put(&PathElement::new(points, style))
        }
    }

    pub fn polygon(&self, points: &[Point], colour: Colour, opacity: f64) -> Result<(), PlotError> {
        let points: Vec<_> = points.iter().copied().map(grid).collect();
        self.put(&Polygon::new(points, rgba(colour, opacity)))
    }

    pub fn rect(&self, rect: Rect, colour: Colour, opacity: f64) -> Result<(), PlotError> {
        let corners = [grid((rect.left, rect.top)), grid((rect.right, rect.bottom))];
        self.put(&Rectangle::new(corners, rgba(colour, opacity).filled()))
    }

    pub fn dot(
        &self,
        centre: Point,
        radius_px: f64,
        colour: Colour,
        opacity: f64,
    ) -> Result<(), PlotError> {
        let radius = (radius_px * UNITS_PER_PX).round() as i32;
        self.put(&Circle::new(grid(centre), radius, rgba(colour, opacity).filled()))
    }

    pub fn text(&self, text: &str, at: Point, anchor: Anchor, font: Font) -> Result<(), PlotError> {
        if text.is_empty() {
            return Ok(());
        }
        let size = font.size_px * UNITS_PER_PX * BACKEND_FONT_DIVISOR;
        let style = if font.bold { FontStyle::Bold } else { FontStyle::Normal };
        let turn = if font.upwards { FontTransform::Rotate270 } else { FontTransform::None };
        let horizontal = match anchor {
            Anchor::Left => HPos::Left,
            Anchor::Centre => HPos::Center,
            Anchor::Right => HPos::Right,
        };
        let colour = rgba(font.colour, 1.0);
        let style = TextStyle::from(("sans-serif", size).into_font().style(style).transform(turn))
            .color(&colour)
            .pos(Pos::new(horizontal, VPos::Center));
        self.put(&Text::new(text.to_owned(), grid(at), style))
    }
}

fn rgba(colour: Colour, opacity: f64) -> RGBAColor {
    RGBAColor(colour.red, colour.green, colour.blue, opacity)
}

/// Width of a text in pixels, estimated from the advance widths of common sans-serif fonts.
///
/// The reader's system supplies the font, so the width can only be estimated; the estimate errs on the wide side.
pub(super) fn text_width_px(text: &str, font_px: f64) -> f64 {
    let em: f64 = text
        .chars()
        .map(|c| match c {
            'i' | 'j' | 'l' | '.' | ',' | ':' | ';' | '\'' | '|' | '!' => 0.29,
            'f'
            | 't'
            | 'r'
            | '('
            | ')'
            | '['
            | ']'
            | ' '
            | '-'
            | '/'
            | '⁰'..='⁹'
            | '⁻'
            | '¹'
            | '²'
            | '³' => 0.37,
            'm' | 'w' | 'M' | 'W' | '%' | '@' => 0.95,
            '−' | '+' | '±' | '=' | '<' | '>' => 0.84,
            'A'..='Z' => 0.72,
            _ => 0.62,
        })
        .sum();
    em * font_px
}
