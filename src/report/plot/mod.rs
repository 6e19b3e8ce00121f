//! Figures as inline SVG.
//!
//! Input: numbers in plain structs. Output: an SVG document, byte for byte the same for the same numbers on every
//! machine, of at most about 150 kB however long the series are. Non-finite values are gaps; empty data give an empty
//! plot, constant data a widened axis.
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
mod heading;
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
pub(super) use canvas::labelled;
pub use error::PlotError;
pub use grid::Grid;
pub use heat::HeatMap;
pub use histogram::{Density, Histogram, standard_normal};
pub use interval::{IntervalPlot, IntervalRow};
pub use palette::Colour;
pub use stick::{Stick, StickFigure, StickStyle};
pub use xy::{Across, Band, Bars, Mark, Marker, Series, Span, XyPlot};

#[cfg(test)]
mod tests {
    use super::*;

    const MOST_BYTES: usize = 150_000;

    fn axes() -> (Axis, Axis) {
        (Axis::linear("time", "s"), Axis::linear("torque", "Nm"))
    }

    fn plot(x: &[f64], y: &[f64], mark: Mark) -> XyPlot {
        let (x_axis, y_axis) = axes();
        XyPlot::new("figure", x_axis, y_axis).with("series", x, y, Colour::series(0), mark)
    }

    /// No coordinate is NaN or infinite, and none lies far off the sheet.
    fn assert_drawn_on_the_sheet(svg: &str) {
        assert!(svg.starts_with("<svg") && svg.ends_with("</svg>\n"), "{svg}");
        assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
        assert!(!svg.contains("2147483647"), "an integer coordinate overflowed: {svg}");
    }

    const MARKS: [Mark; 6] =
        [Mark::Line, Mark::ThinLine, Mark::WideLine, Mark::Dashed, Mark::Dots, Mark::DotsAndLine];

    #[test]
    fn degenerate_data_are_drawn() {
        let cases: [&[f64]; 8] = [
            &[],
            &[0.0],
            &[3.0, 3.0, 3.0],
            &[f64::NAN, f64::NAN],
            &[f64::NAN, 1.0, f64::INFINITY, 2.0],
            &[1e300, -1e300, 1.0],
            &[1e-300, 2e-300],
            &[-5e-324, 5e-324],
        ];
        for values in cases {
            let index: Vec<f64> = (0..values.len()).map(|k| k as f64).collect();
            for mark in MARKS {
                for (x, y) in
                    [(index.as_slice(), values), (values, index.as_slice()), (values, values)]
                {
                    let mut plot = plot(x, y, mark);
                    assert_drawn_on_the_sheet(&plot.to_svg().unwrap());
                    (plot.x.scale, plot.y.scale) = (Scale::Log, Scale::Log);
                    assert_drawn_on_the_sheet(&plot.to_svg().unwrap());
                }
            }
            let (axis, _) = axes();
            assert_drawn_on_the_sheet(
                &Histogram::new("", axis.clone(), "", values.to_vec()).to_svg().unwrap(),
            );
            let mut intervals = IntervalPlot::new("", axis);
            intervals.rows = values
                .iter()
                .map(|&value| IntervalRow {
                    name: "row".into(),
                    value,
                    low: -value,
                    high: value,
                    expected: value,
                    status: None,
                })
                .collect();
            assert_drawn_on_the_sheet(&intervals.to_svg().unwrap());
            let points_m = values.iter().map(|&v| [v, v, -v]).collect();
            let stick = Stick {
                name: "arm".into(),
                points_m,
                colour: Colour::MODEL,
                style: StickStyle::Posture,
            };
            let figure =
                StickFigure { title: "".into(), sticks: vec![stick], size: Size::wide(300.0) };
            assert_drawn_on_the_sheet(&figure.to_svg().unwrap());
        }
        let (x, y) = axes();
        assert_drawn_on_the_sheet(&Grid::new("no panels", x, y).to_svg().unwrap());
    }

    #[test]
    fn a_heat_map_of_nothing_and_of_no_numbers_is_drawn() {
        let mut map = HeatMap {
            title: "nothing".into(),
            row_axis: String::new(),
            column_axis: String::new(),
            row_labels: Vec::new(),
            column_labels: Vec::new(),
            values: Vec::new(),
            full_scale: None,
            decimals: 0,
            cell_height_px: 24.0,
            cell_width_px: 48.0,
        };
        assert_drawn_on_the_sheet(&map.to_svg().unwrap());
        map.row_labels = vec!["row".into()];
        map.column_labels = vec!["a".into(), "b".into()];
        map.values = vec![vec![f64::NAN, f64::INFINITY]];
        assert_drawn_on_the_sheet(&map.to_svg().unwrap());
        map.values = vec![vec![1.0]];
        assert!(matches!(
            map.to_svg(),
            Err(PlotError::RaggedRow { row: 0, found: 1, expected: 2, .. })
        ));
    }

    #[test]
    fn long_series_stay_small_in_every_mark_and_in_a_grid() {
        let x: Vec<f64> = (0..300_000).map(|k| f64::from(k) * 0.002).collect();
        let y: Vec<f64> = (0..300_000).map(|k| f64::from(k % 1009 * 71 % 1009) - 500.0).collect();
        for mark in MARKS.into_iter().filter(|&mark| mark != Mark::Dashed) {
            let svg = plot(&x, &y, mark).to_svg().unwrap();
            assert!(svg.len() < MOST_BYTES, "{mark:?}: {} bytes", svg.len());
        }
        let (x_axis, y_axis) = axes();
        let mut grid = Grid::new("grid", x_axis, y_axis);
        for _ in 0..6 {
            let panel = plot(&x, &y, Mark::ThinLine).with("b", &x, &y, Colour::MODEL, Mark::Line);
            grid.panels.push(panel);
        }
        let svg = grid.to_svg().unwrap();
        assert!(svg.len() < MOST_BYTES, "{} bytes", svg.len());
    }

    #[test]
    fn the_same_numbers_give_the_same_bytes() {
        let x: Vec<f64> = (0..5000).map(|k| f64::from(k) * 0.01).collect();
        let y: Vec<f64> = x.iter().map(|x| x.sin()).collect();
        for mark in MARKS {
            assert_eq!(plot(&x, &y, mark).to_svg(), plot(&x, &y, mark).to_svg());
        }
    }

    #[test]
    fn a_gap_is_not_bridged() {
        let svg = plot(&[0.0, 1.0, 2.0, 3.0, 4.0], &[0.0, 1.0, f64::NAN, 1.0, 0.0], Mark::Line)
            .to_svg()
            .unwrap();
        let series = svg
            .lines()
            .filter(|line| line.contains("#006BAC") && line.contains("stroke-width=\"18\""));
        assert_eq!(series.count(), 2, "{svg}");
    }

    #[test]
    fn lengths_that_differ_are_an_error_that_names_the_series() {
        let error = plot(&[0.0, 1.0], &[0.0], Mark::Line).to_svg().unwrap_err();
        assert_eq!(
            error.to_string(),
            "figure \"figure\": series \"series\" has 2 abscissae but 1 ordinates"
        );
    }

    #[test]
    fn a_figure_lower_than_its_labels_is_drawn() {
        let mut plot = plot(&[0.0, 1.0], &[0.0, 1.0], Mark::Line);
        plot.size = Size { width_px: 41.0, height_px: 41.0 };
        assert_drawn_on_the_sheet(&plot.to_svg().unwrap());
    }

    #[test]
    fn a_figure_without_room_is_an_error() {
        let mut plot = plot(&[0.0], &[0.0], Mark::Line);
        plot.size = Size { width_px: f64::NAN, height_px: 100.0 };
        assert!(matches!(plot.to_svg(), Err(PlotError::Size { .. })));
    }
}
