//! Every element of a report with made-up contents, on one page:
//! `cargo run --example report_gallery -- gallery.html`.

use std::error::Error;
use std::f64::consts::TAU;
use std::path::PathBuf;

use armid::number;
use armid::report::json::Program;
use armid::report::plot::{
    Across, Axis, Band, Colour, Grid, HeatMap, Histogram, IntervalPlot, IntervalRow, Mark,
    PlotError, Span, Stick, StickFigure, StickStyle, XyPlot,
};
use armid::report::{Column, Page, Section, Status, Table, Verdict};
use rand::SeedableRng;
use rand::rngs::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

const RATE_HZ: f64 = 125.0;
const SEED: u64 = 20;

fn main() -> Result<(), Box<dyn Error>> {
    let path =
        std::env::args_os().nth(1).map_or_else(|| PathBuf::from("gallery.html"), PathBuf::from);
    page()?.write(&path)?;
    println!("wrote {}", path.display());
    Ok(())
}

fn page() -> Result<Page, Box<dyn Error>> {
    let verdict = Verdict {
        status: Status::Warn,
        sentence: "Joint 2's model misses friction that grows with load (6.3 ± 0.3 % of the gear torque).".into(),
        facts: vec![
            "Adding it removes 71 % of what the noise floor leaves to explain, on periods that were not used to fit it.".into(),
            "Held-out torque error of joint 2: 3.1 Nm before, 1.7 Nm after; noise floor 1.2 Nm.".into(),
            format!("{} of {} rows used; 214 set aside as standstill.", number::count(9_786), number::count(10_000)),
            "Everything on this page is made up.".into(),
        ],
    };
    let program =
        Program::new(std::env::args().take(1).map(|_| "report_gallery"), Some(SEED), Vec::new());
    let mut page =
        Page::new("Gallery of report elements", "UR5, simulated, 80 s at 125 Hz", verdict, program);
    page.push(
        Section::new("Torques")
            .paragraph("Small multiples share the abscissa; each joint has its own ordinate.")
            .figure(torques()?, "Measured torque and the model's prediction over one period.")
            .figure(
                residual_bands()?,
                "Ten thousand noisy samples, thinned out without losing a peak, and a band.",
            ),
    );
    page.push(
        Section::new("What the model misses")
            .figure(
                residual_against_load()?,
                "Residual against the axis that matters, before and after.",
            )
            .figure(spectrum()?, "Two logarithmic axes."),
    );
    page.push(
        Section::new("Calibration")
            .figure(
                coverage()?,
                "Each parameter's 95 % interval held the truth in this share of 1000 trials.",
            )
            .figure(estimates()?, "Estimates of the viscous friction against the truth.")
            .figure(
                histograms()?,
                "Normalised errors of six parameters against the density they should have.",
            ),
    );
    page.push(
        Section::new("Parameters")
            .table(parameters(), "Rows are judged by their distance from the truth.")
            .details(Section::new("How the table is read").list([
                "σ is written with two significant digits, the value to the same place.",
                "A judged row has a bar at its left; doubtful and bad rows are tinted.",
            ])),
    );
    page.push(
        Section::new("Causes")
            .note(
                Status::Good,
                "No false alarm among 1000 clean cases: at most 0.3 % with 95 % confidence.",
            )
            .figure(
                confusion()?,
                "Kinds of hidden effects (rows) and what they were named (columns), in percent.",
            ),
    );
    page.push(
        Section::new("Motion")
            .figure(arm()?, "Postures along the motion, and the way of the flange."),
    );
    page.push(
        Section::new("Degenerate data")
            .figure(degenerate()?, "No samples, one value, gaps, and a peak of 1e300."),
    );
    Ok(page)
}

fn noise(count: usize, stream: u64) -> Vec<f64> {
    let mut random = ChaCha8Rng::seed_from_u64(SEED);
    random.set_stream(stream);
    (0..count).map(|_| StandardNormal.sample(&mut random)).collect()
}

fn times_s(seconds: f64) -> Vec<f64> {
    (0..(seconds * RATE_HZ) as usize).map(|k| k as f64 / RATE_HZ).collect()
}

fn model_nm(joint: usize, t: f64) -> f64 {
    let size = [28.0, 75.0, 34.0, 6.0, 5.5, 1.8][joint];
    let phase = joint as f64;
    size * ((TAU * 0.1 * t + phase).sin()
        + 0.45 * (TAU * 0.3 * t + 2.0 * phase).cos()
        + 0.2 * (TAU * 0.5 * t).sin())
}

fn torques() -> Result<String, PlotError> {
    let t = times_s(10.0);
    let mut grid =
        Grid::new("Torque of every joint", Axis::linear("time", "s"), Axis::linear("torque", "Nm"));
    for joint in 0..6 {
        let sigma_nm = [1.0, 1.0, 0.7, 0.15, 0.15, 0.15][joint];
        let model: Vec<f64> = t.iter().map(|&t| model_nm(joint, t)).collect();
        let measured: Vec<f64> =
            model.iter().zip(noise(t.len(), joint as u64)).map(|(m, e)| m + sigma_nm * e).collect();
        let residual: Vec<f64> = measured.iter().zip(&model).map(|(a, b)| a - b).collect();
        let panel = grid
            .panel(format!("Joint {}", joint + 1))
            .with("measured", &t, &measured, Colour::MEASURED, Mark::ThinLine)
            .with("predicted", &t, &model, Colour::MODEL, Mark::Line)
            .with("residual", &t, &residual, Colour::REFERENCE, Mark::ThinLine);
        grid.panels.push(panel);
    }
    grid.to_svg()
}

fn residual_bands() -> Result<String, PlotError> {
    let t = times_s(80.0);
    let drift = |t: f64| 1.6 * (1.0 - (-t / 25.0).exp());
    let residual: Vec<f64> =
        t.iter().zip(noise(t.len(), 10)).map(|(&t, e)| drift(t) + 0.9 * e).collect();
    let coarse: Vec<f64> = (0..=160).map(|k| 0.5 * f64::from(k)).collect();
    let edge = |sign: f64| coarse.iter().map(|&t| drift(t) + sign * 0.35).collect::<Vec<f64>>();
    let fitted: Vec<f64> = coarse.iter().map(|&t| drift(t)).collect();
    let mut plot = XyPlot::new(
        "Residual of joint 2 while its friction changes",
        Axis::linear("time", "s"),
        Axis::linear("measured − predicted torque", "Nm"),
    )
    .with("residual", &t, &residual, Colour::REFERENCE, Mark::ThinLine)
    .with("fitted drift", &coarse, &fitted, Colour::series(0), Mark::Line)
    .with_marker(Across::X, 25.0, "time constant 25 s")
    .with_marker(Across::X, 27.5, "held-out data start here")
    .with_marker(Across::Y, 0.0, "");
    plot.bands.push(Band {
        name: "95 % interval".into(),
        x: coarse.clone(),
        low: edge(-1.0),
        high: edge(1.0),
        colour: Colour::series(0),
    });
    plot.spans.push(Span { from: 0.0, to: 6.0, label: "run-in".into() });
    plot.to_svg()
}

fn residual_against_load() -> Result<String, PlotError> {
    let mut grid = Grid::new(
        "Residual of joint 2 against its load",
        Axis::linear("gear torque", "Nm"),
        Axis::linear("residual", "Nm"),
    );
    grid.columns = 2;
    grid.share_y = true;
    grid.row_height_px = 260.0;
    for (name, title, slope, colour) in [
        ("before", "Friction without load", 0.06, Colour::BEFORE),
        ("after", "Friction that grows by 6.3 % of the load", 0.0, Colour::AFTER),
    ] {
        let load = noise(1500, 30).into_iter().map(|e| 45.0 * e).collect::<Vec<_>>();
        let residual: Vec<f64> =
            load.iter().zip(noise(1500, 31)).map(|(l, e)| slope * l.abs() + 0.8 * e).collect();
        let bins: Vec<f64> = (-4..=4).map(|k| 25.0 * f64::from(k)).collect();
        let curve: Vec<f64> = bins.iter().map(|l| slope * l.abs()).collect();
        let panel = grid.panel(title).with(name, &load, &residual, colour, Mark::Dots).with(
            "mean in bins",
            &bins,
            &curve,
            Colour::MEASURED,
            Mark::DotsAndLine,
        );
        grid.panels.push(panel);
    }
    grid.to_svg()
}

fn spectrum() -> Result<String, PlotError> {
    let f: Vec<f64> = (1..=600).map(|k| 0.1 * f64::from(k)).collect();
    let joint = |floor: f64, corner: f64, stream| -> Vec<f64> {
        let e = noise(f.len(), stream);
        f.iter()
            .zip(e)
            .map(|(f, e)| floor * (1.0 + (corner / f).powi(2)) * (0.25 * e).exp())
            .collect()
    };
    let mut plot = XyPlot::new(
        "Noise spectrum from replicates",
        Axis::log("frequency", "Hz"),
        Axis::log("power spectral density", "Nm²/Hz"),
    );
    for k in 0..6 {
        let power = joint([2e-2, 1.5e-2, 8e-3, 6e-4, 3e-4, 1e-4][k], 2.0 + k as f64, 40 + k as u64);
        plot = plot.with(format!("joint {}", k + 1), &f, &power, Colour::series(k), Mark::ThinLine);
    }
    plot.with_marker(Across::X, 10.0, "filter cut-off 10 Hz").to_svg()
}

/// Names like those of a UR5's base parameters.
fn names() -> Vec<String> {
    let of_body = ["mx", "my", "A−B", "D", "E", "F", "C", "rv", "rc"];
    (1..=6)
        .flat_map(|body| of_body.iter().map(move |name| format!("{name}{body}")))
        .take(52)
        .collect()
}

fn coverage() -> Result<String, PlotError> {
    let mut plot =
        IntervalPlot::new("Coverage of the 95 % intervals", Axis::linear("share of trials", ""));
    plot.columns = 2;
    plot.reference = Some(0.95);
    plot.value_name = "coverage with its 95 % interval".into();
    plot.expected =
        Some(Span { from: 0.928, to: 0.972, label: "range expected of 52 right ones".into() });
    let half = 1.96 * (0.95f64 * 0.05 / 1000.0).sqrt();
    plot.rows = names()
        .into_iter()
        .zip(noise(52, 50))
        .enumerate()
        .map(|(k, (name, e))| {
            let value = if k == 31 { 0.905 } else { 0.95 + 0.0069 * e };
            let status = if k == 31 { Some(Status::Bad) } else { None };
            IntervalRow {
                name,
                value,
                low: value - half,
                high: value + half,
                expected: f64::NAN,
                status,
            }
        })
        .collect();
    plot.to_svg()
}

fn estimates() -> Result<String, PlotError> {
    let mut plot =
        IntervalPlot::new("Viscous friction", Axis::linear("viscous friction", "Nm s/rad"));
    plot.value_name = "estimate ± 2σ".into();
    plot.expected_name = "truth".into();
    plot.rows = [(13.2, 0.31), (11.8, 0.28), (8.4, 0.22), (1.9, 0.08), (2.1, 0.09), (1.7, 0.07)]
        .into_iter()
        .zip(noise(6, 51))
        .enumerate()
        .map(|(k, ((truth, sigma), e))| {
            let value: f64 = truth + sigma * e;
            let name = format!("rv{}", k + 1);
            IntervalRow {
                name,
                value,
                low: value - 2.0 * sigma,
                high: value + 2.0 * sigma,
                expected: truth,
                status: None,
            }
        })
        .collect();
    plot.to_svg()
}

fn histograms() -> Result<String, PlotError> {
    let axis = Axis::linear("error / σ", "").between(-4.0, 4.0);
    let mut grid =
        Grid::new("Normalised errors of 1000 trials", axis.clone(), Axis::linear("density", ""));
    grid.share_y = true;
    for (k, name) in ["mx2", "my2", "D3", "rv4", "rc5", "C6"].into_iter().enumerate() {
        let scale = if k == 4 { 1.35 } else { 1.0 };
        let sample = noise(1000, 60 + k as u64).into_iter().map(|e| scale * e).collect();
        let histogram =
            Histogram::new(name, axis.clone(), "trials", sample).against_standard_normal();
        grid.panels.push(histogram.to_plot());
    }
    grid.to_svg()
}

fn parameters() -> Table {
    let mut table = Table::new([
        Column::text("parameter"),
        Column::number("truth", "SI"),
        Column::number("estimate ± σ", "SI"),
        Column::number("error / σ", ""),
        Column::number("coverage", "%"),
        Column::text("remark"),
    ]);
    let rows = [
        ("mx2 + 0.425·m3 + 0.425·m4", 4.7213, 0.0123, 0.4, None, ""),
        ("A2 − B2", -1.2034, 0.0311, -1.1, None, ""),
        ("Ia3", 0.7140, 0.0092, 0.2, Some(Status::Good), "checked on the second motion"),
        ("rc4", 2.0104, 0.0310, 2.4, Some(Status::Warn), "depends on the window"),
        ("F6", 3.1e-5, 8.2e-6, 7.9, Some(Status::Bad), "not identified by these data"),
    ];
    for (name, truth, sigma, z, status, remark) in rows {
        let estimate = number::with_sigma(truth + z * sigma, sigma);
        let cells =
            [name, &number::significant(truth, 5), &estimate, &format!("{z:+.1}"), "94.7", remark];
        table.push_judged(status, cells.map(String::from));
    }
    table
}

fn confusion() -> Result<String, PlotError> {
    let kinds = [
        "none",
        "stribeck",
        "load_friction",
        "asymmetric_friction",
        "presliding",
        "ripple",
        "elasticity",
        "backlash",
        "torque_gain",
        "time_skew",
        "payload",
        "base_tilt",
        "contact",
    ];
    let values = (0..kinds.len())
        .map(|i| {
            let misses: Vec<f64> = (0..kinds.len())
                .map(|j| {
                    if i != j && i > 0 && (3 * i + 5 * j) % 11 == 0 {
                        1.0 + ((i + j) % 3) as f64
                    } else {
                        0.0
                    }
                })
                .collect();
            let missed: f64 = misses.iter().sum();
            misses
                .iter()
                .enumerate()
                .map(|(j, &m)| if i == j { 100.0 - missed } else { m })
                .collect()
        })
        .collect();
    let labels: Vec<String> = kinds.iter().map(|kind| kind.replace('_', " ")).collect();
    HeatMap {
        title: "What was hidden and what it was named [%]".into(),
        row_axis: "hidden".into(),
        column_axis: "named".into(),
        row_labels: labels.clone(),
        column_labels: labels,
        values,
        full_scale: Some(100.0),
        decimals: 0,
        cell_height_px: 24.0,
        cell_width_px: 48.0,
    }
    .to_svg()
}

fn arm() -> Result<String, PlotError> {
    let posture = |t: f64| -> Vec<[f64; 3]> {
        let (pan, lift, elbow) =
            (0.7 * t.sin(), -1.2 + 0.4 * (2.0 * t).cos(), 1.3 + 0.5 * (1.5 * t).sin());
        let mut points = vec![[0.0; 3], [0.0, 0.0, 0.089]];
        let (mut reach, mut height, mut pitch) = (0.0, 0.089, 0.0);
        for (length, turn) in [(0.425, lift), (0.392, elbow), (0.18, 0.9)] {
            pitch += turn;
            reach += length * f64::cos(pitch);
            height -= length * f64::sin(pitch);
            points.push([reach * pan.cos(), reach * pan.sin(), height]);
        }
        points
    };
    let mut figure = StickFigure {
        title: "Motion of the arm".into(),
        sticks: Vec::new(),
        size: armid::report::plot::Size::wide(380.0),
    };
    let stick =
        |name: &str, points_m, colour, style| Stick { name: name.into(), points_m, colour, style };
    for k in 0..24 {
        let points = posture(TAU * f64::from(k) / 24.0);
        figure.sticks.push(stick("postures", points, Colour::REFERENCE, StickStyle::Trail));
    }
    let way = (0..=400)
        .filter_map(|k| posture(TAU * 2.0 * f64::from(k) / 400.0).last().copied())
        .collect();
    figure.sticks.push(stick("flange", way, Colour::series(1), StickStyle::Path));
    figure.sticks.push(stick("start", posture(0.0), Colour::series(0), StickStyle::Posture));
    figure.to_svg()
}

fn degenerate() -> Result<String, PlotError> {
    let mut grid = Grid::new("", Axis::linear("time", "s"), Axis::linear("torque", "Nm"));
    grid.share_x = false;
    grid.columns = 4;
    let t = times_s(4.0);
    let gaps: Vec<f64> = t
        .iter()
        .map(|&t| if (1.0..1.8).contains(&t) { f64::NAN } else { 1e-5 * t.sin() })
        .collect();
    let peak: Vec<f64> =
        t.iter().enumerate().map(|(k, &t)| if k == 99 { 1e300 } else { 4e6 * t.cos() }).collect();
    for (title, y) in [
        ("Nothing", None),
        ("Constant", Some(vec![2.0; t.len()])),
        ("Gap", Some(gaps)),
        ("Peak", Some(peak)),
    ] {
        let panel = grid.panel(title);
        grid.panels.push(match y {
            Some(y) => panel.with("", &t, &y, Colour::series(0), Mark::Line),
            None => panel,
        });
    }
    grid.to_svg()
}
