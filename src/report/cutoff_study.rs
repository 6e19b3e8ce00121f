//! The study of the cutoff: page, Markdown and tables.

use super::json::Program;
use super::plot::{Axis, Colour, Grid, Mark, XyPlot};
use super::{Column, Page, ReportError, Section, Status, Table, Verdict};
use crate::montecarlo::study::{Curve, CutoffStudy, Method, Point, SigmaCase};
use crate::number::{percent, significant};

const HOW: &str = "The error of an estimate is stated in units of the least σ that the torque noise of the record allows, root mean \
square over the 52 parameters; it joins bias and scatter. Left branch: what a low cutoff takes from the motion. Right branch: noise of \
the velocity reading, which differentiation raises with the cutoff (the variance of the acceleration is σ_v² ω_c³/(4 f_s)) and which \
attenuates inertias. Lines are formulas, dots are measured; neither branch is fitted. The paper's branch on the left is a bias, because \
(33) filters the acceleration and not the torque: a rotor inertia comes out too large by about (f/f_c)². With the same low-pass on torque \
and regressor there is no such bias; what a low cutoff costs there is information, so that its left branch is scatter.";

const FORMULA: &str = "θ̂ → (X̄ᵀW²X̄ + N)⁻¹ X̄ᵀW²y\nfilter branch: N = 0, acceleration behind A(ω)/ω = 1/(1 + (f/f_c)²)\n\
noise branch:  N = σ_a² Σ_i Σ_t D_iᵀW²D_i + N_friction, D_i = ∂X/∂q̈_i, σ_a² = σ_v² mean (A G)² → σ_v² ω_c³/(4 f_s)\n\
scatter:       (X̄ᵀW²X̄ + N)⁻¹ Ω (X̄ᵀW²X̄ + N)⁻¹";

const LENGTH: &str = "e_N of (21) divides the length of the error vector by m instead of √m. With the same arm, noise and model it falls \
as 1/√m; the rms does not. Two e_N can be compared only at the same length and rate of the record.";

const SIGMA: &str = "True σ (scatter over fresh noise) over σ of (20), for plain least squares along the record: 1 would be a true claim. \
(20) is right for white noise of 1 Nm on every joint and an unfiltered torque, and for nothing else. Coverage is that of ±1.96 σ, \
nominally 95 %; it also counts the bias of the filter.";

fn name(method: Method) -> &'static str {
    match method {
        Method::Paper => "paper: accelerations by (33), least squares",
        Method::Parallel => "ours, single run: both sides low-passed, weighted",
    }
}

/// The point with the smallest `error`.
fn best(curve: &Curve, error: impl Fn(&Point) -> f64) -> Option<Point> {
    curve.points.iter().copied().min_by(|a, b| error(a).total_cmp(&error(b)))
}

fn sentence(study: &CutoffStudy) -> String {
    let ratios = ratios(study);
    let within = ratios.iter().filter(|r| (0.9..=1.1).contains(*r)).count();
    let worst = ratios.iter().map(|r| r.max(1.0 / r)).fold(1.0, f64::max);
    let cutoffs = |method| {
        let best = study.curves.iter().filter(|c| c.method == method);
        let best: Vec<String> =
            best.filter_map(|c| best_cutoff(c).map(|hz| significant(hz, 3))).collect();
        best.join(", ")
    };
    let sd: Vec<String> = study
        .curves
        .iter()
        .filter(|c| c.method == Method::Paper)
        .map(|c| significant(c.velocity_sd_rad_s, 1))
        .collect();
    format!(
        "The error against the cutoff is a U, and the formulas predict {within} of its {} points to within \
         10 % (the worst to within a factor of {worst:.2}); for velocity noise of {} rad/s the least error was \
         measured at {} Hz with the paper's processing and at {} Hz with ours, whose floor is lower, and \
         averaging the periods needs no cutoff.",
        ratios.len(),
        sd.join(", "),
        cutoffs(Method::Paper),
        cutoffs(Method::Parallel),
    )
}

fn best_cutoff(curve: &Curve) -> Option<f64> {
    best(curve, |p| p.measured).map(|p| p.cutoff_hz)
}

fn summary_table(study: &CutoffStudy) -> Table {
    let mut table = Table::new([
        Column::text("processing"),
        Column::number("velocity noise", "rad/s"),
        Column::number("best cutoff measured", "Hz"),
        Column::number("predicted", "Hz"),
        Column::number("error there", "least σ"),
        Column::number("at 10 Hz", "least σ"),
        Column::number("periods averaged", "least σ"),
    ]);
    for curve in &study.curves {
        let (measured, predicted) = (best(curve, |p| p.measured), best(curve, |p| p.predicted));
        let at_ten = curve.points.iter().find(|p| p.cutoff_hz == 10.0).map(|p| p.measured);
        let show = |value: Option<f64>, digits| {
            value.map_or_else(|| "–".to_owned(), |v| significant(v, digits))
        };
        table.push([
            name(curve.method).to_owned(),
            significant(curve.velocity_sd_rad_s, 1),
            show(measured.map(|p| p.cutoff_hz), 3),
            show(predicted.map(|p| p.cutoff_hz), 3),
            show(measured.map(|p| p.measured), 3),
            show(at_ten, 3),
            significant(curve.averaged_error, 3),
        ]);
    }
    table
}

/// Judges how well the formulas predict a point whose measured error is `ratio` times the predicted one.
fn status(ratio: f64) -> Status {
    match (ratio - 1.0).abs() {
        off if off < 0.1 => Status::Good,
        off if off < 0.3 => Status::Warn,
        _ => Status::Bad,
    }
}

/// Share of the points that the formulas must predict to within 10 % for a good verdict.
const MOST: f64 = 0.9;

/// Judges the whole study by the `ratios` of all points.
fn overall(ratios: &[f64]) -> Status {
    let count =
        |wanted: Status| ratios.iter().filter(|ratio| status(**ratio) == wanted).count() as f64;
    match count(Status::Good) >= MOST * ratios.len() as f64 {
        _ if count(Status::Bad) > 0.0 => Status::Bad,
        true => Status::Good,
        false => Status::Warn,
    }
}

/// Measured over predicted error, for every point.
fn ratios(study: &CutoffStudy) -> Vec<f64> {
    study.curves.iter().flat_map(|c| &c.points).map(|p| p.measured / p.predicted).collect()
}

fn point_table(curve: &Curve) -> Table {
    let mut table = Table::new([
        Column::number("cutoff", "Hz"),
        Column::number("filter bias, formula", ""),
        Column::number("noise bias, formula", ""),
        Column::number("bias measured", ""),
        Column::number("scatter, formula", ""),
        Column::number("scatter measured", ""),
        Column::number("error, formula", ""),
        Column::number("error measured", ""),
        Column::number("measured/formula", ""),
    ]);
    for p in &curve.points {
        let ratio = p.measured / p.predicted;
        table.push_judged(
            Some(status(ratio)),
            [
                significant(p.cutoff_hz, 3),
                significant(p.filter_bias, 3),
                significant(p.noise_bias, 3),
                significant(p.measured_bias, 3),
                significant(p.scatter, 3),
                significant(p.measured_scatter, 3),
                significant(p.predicted, 3),
                significant(p.measured, 3),
                format!("{ratio:.2}"),
            ],
        );
    }
    table
}

fn length_table(study: &CutoffStudy) -> Table {
    let mut table = Table::new([
        Column::number("record", "s"),
        Column::number("samples m", ""),
        Column::number("e_N", ""),
        Column::number("noise alone, formula", ""),
        Column::number("rms", "Nm"),
    ]);
    for l in &study.lengths {
        table.push([
            significant(l.record_s, 3),
            l.samples.to_string(),
            format!("{:.4}", l.e_n),
            format!("{:.4}", l.predicted_e_n),
            format!("{:.4}", l.rms_nm),
        ]);
    }
    table
}

fn sigma_table(study: &CutoffStudy) -> Table {
    let mut table = Table::new([
        Column::text("torque noise"),
        Column::text("torque"),
        Column::number("true σ / σ of (20): rms", ""),
        Column::number("least … greatest", ""),
        Column::number("formula: rms", ""),
        Column::number("least … greatest", ""),
        Column::number("coverage", ""),
    ]);
    for SigmaCase { noise, torque_filtered, predicted, measured, coverage } in &study.sigmas {
        let status = match coverage {
            0.935..=0.965 => Status::Good,
            0.9..=0.99 => Status::Warn,
            _ => Status::Bad,
        };
        table.push_judged(
            Some(status),
            [
                (*noise).to_owned(),
                if *torque_filtered { "low-passed, 10 Hz" } else { "as measured" }.to_owned(),
                format!("{:.2}", measured[1]),
                format!("{:.2} … {:.2}", measured[0], measured[2]),
                format!("{:.2}", predicted[1]),
                format!("{:.2} … {:.2}", predicted[0], predicted[2]),
                percent(*coverage, 3),
            ],
        );
    }
    table
}

/// The study as a page.
pub fn page(study: &CutoffStudy, program: Program) -> Result<Page, ReportError> {
    let status = overall(&ratios(study));
    let verdict = Verdict { status, sentence: sentence(study), facts: Vec::new() };
    let subtitle = format!(
        "{}; {} s of record, {} trials per point",
        study.description, study.record_s, study.trials
    );
    let mut page = Page::new("Where should the low-pass sit?", subtitle, verdict, program);
    page.push(
        Section::new("Error against cutoff")
            .paragraph(HOW)
            .figure(curves_figure(study, Method::Paper)?, name(Method::Paper))
            .figure(curves_figure(study, Method::Parallel)?, name(Method::Parallel))
            .table(summary_table(study), "")
            .code(FORMULA),
    );
    let mut points = Section::new("The points behind the curves");
    for curve in &study.curves {
        let sd = significant(curve.velocity_sd_rad_s, 1);
        points = points.details(
            Section::new(format!("{}, velocity noise {sd} rad/s", name(curve.method)))
                .table(point_table(curve), "In units of the least σ"),
        );
    }
    page.push(points);
    page.push(
        Section::new("e_N is not an rms")
            .paragraph(LENGTH)
            .figure(length_figure(study)?, "")
            .table(length_table(study), ""),
    );
    page.push(
        Section::new("Where the paper's σ is off")
            .paragraph(SIGMA)
            .table(sigma_table(study), format!("{} trials each", study.trials)),
    );
    Ok(page)
}

fn curves_figure(study: &CutoffStudy, method: Method) -> Result<String, ReportError> {
    let (x, y) = (Axis::log("cutoff", "Hz"), Axis::log("error", "least σ"));
    let mut grid = Grid::new("Error against cutoff", x, y);
    grid.columns = 2;
    grid.share_y = true;
    grid.row_height_px = 220.0;
    for curve in study.curves.iter().filter(|c| c.method == method) {
        let of = |value: fn(&Point) -> f64| curve.points.iter().map(value).collect::<Vec<f64>>();
        let cutoff = of(|p| p.cutoff_hz);
        let flat = vec![curve.averaged_error; cutoff.len()];
        let title = format!("velocity noise {} rad/s", significant(curve.velocity_sd_rad_s, 1));
        // A branch far below the noise floor carries no information.
        let seen = |value: Vec<f64>| -> Vec<f64> {
            value.into_iter().map(|v| if v > 0.02 { v } else { f64::NAN }).collect()
        };
        let panel = grid
            .panel(title)
            .with(
                "filter bias",
                &cutoff,
                &seen(of(|p| p.filter_bias)),
                Colour::series(3),
                Mark::Dashed,
            )
            .with(
                "noise bias",
                &cutoff,
                &seen(of(|p| p.noise_bias)),
                Colour::series(2),
                Mark::Dashed,
            )
            .with("scatter", &cutoff, &of(|p| p.scatter), Colour::REFERENCE, Mark::Dashed)
            .with("all by formula", &cutoff, &of(|p| p.predicted), Colour::MODEL, Mark::Line)
            .with("periods averaged, measured", &cutoff, &flat, Colour::AFTER, Mark::ThinLine)
            .with("measured", &cutoff, &of(|p| p.measured), Colour::MEASURED, Mark::Dots);
        grid.panels.push(panel);
    }
    Ok(grid.to_svg()?)
}

fn length_figure(study: &CutoffStudy) -> Result<String, ReportError> {
    let of = |value: fn(&crate::montecarlo::study::RecordLength) -> f64| {
        study.lengths.iter().map(value).collect::<Vec<f64>>()
    };
    let x = of(|l| l.record_s);
    let plot = XyPlot::new(
        "e_N and rms of the same fit",
        Axis::log("length of the record", "s"),
        Axis::log("e_N, rms", "Nm"),
    )
    .with("e_N by formula", &x, &of(|l| l.predicted_e_n), Colour::MODEL, Mark::Line)
    .with("e_N", &x, &of(|l| l.e_n), Colour::MEASURED, Mark::Dots)
    .with("rms", &x, &of(|l| l.rms_nm), Colour::AFTER, Mark::DotsAndLine);
    Ok(plot.to_svg()?)
}

/// The study as Markdown, with the command that produced it.
pub fn markdown(study: &CutoffStudy, command: &str) -> String {
    let formula: String = FORMULA.lines().map(|line| format!("    {line}\n")).collect();
    let mut text = format!(
        "# Where should the low-pass sit?\n\n{}\n\n    {command}\n\n{}; {} s of record, {} trials per \
         point.\n\n{HOW}\n\n{formula}\n{}\n## e_N is not an rms\n\n{LENGTH}\n\n{}\n## Where the paper's σ \
         is off\n\n{SIGMA}\n\n{}",
        sentence(study),
        study.description,
        study.record_s,
        study.trials,
        summary_table(study).to_markdown(),
        length_table(study).to_markdown(),
        sigma_table(study).to_markdown(),
    );
    for curve in &study.curves {
        text += &format!(
            "\n## {}, velocity noise {} rad/s\n\nIn units of the least σ.\n\n{}",
            name(curve.method),
            significant(curve.velocity_sd_rad_s, 1),
            point_table(curve).to_markdown()
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_banner_is_green_where_the_formulas_hold() {
        let with = |others: &[f64]| overall(&[&[1.0; 9][..], others].concat());
        assert_eq!(with(&[1.2]), Status::Good);
        assert_eq!(with(&[1.2, 0.8]), Status::Warn);
        assert_eq!(with(&[1.4]), Status::Bad);
    }
}
