//! Tables and page of an identification.

use std::path::Path;

use super::short_names::short_names;
use super::{Result, Training, Validation};
use crate::identify::Prediction;
use crate::number::{significant, with_sigma};
use crate::report::json::Program;
use crate::report::misread::MisreadLog;
use crate::report::plot::{Axis, Colour, Grid, IntervalPlot, IntervalRow, Mark};
use crate::report::{Column, Page, ReportError, Section, Status, Table, Verdict};
use crate::robot::JointSignals;

/// Every base parameter with its σ and 95 % interval.
pub fn parameter_table(result: &Result) -> Table {
    let distrusted = result.intervals.trusted == Some(false);
    let mut table = Table::new([
        Column::text("parameter"),
        Column::text("unit"),
        Column::number("estimate ± σ", ""),
        Column::number(
            if distrusted { "95 % interval, of the noise alone" } else { "95 % interval" },
            "",
        ),
        Column::text("combination"),
    ]);
    for p in &result.base_parameters {
        let open = result.not_identified.contains(&p.name);
        table.push_judged(
            open.then_some(Status::Bad),
            [
                p.name.clone(),
                p.unit.to_owned(),
                with_sigma(p.value, p.sigma),
                format!("{} … {}", significant(p.ci95[0], 4), significant(p.ci95[1], 4)),
                p.formula.clone(),
            ],
        );
    }
    table
}

/// Residual rms per joint: of the fit, and of every validation log over all and over moving samples.
pub fn residual_table(result: &Result) -> Table {
    let joints = result.residual.rms_nm.len();
    let columns = (1..=joints).map(|j| Column::number(format!("joint {j}"), ""));
    let mut table =
        Table::new([Column::text("rms"), Column::text("unit")].into_iter().chain(columns));
    let mut row = |name: String, unit: &str, values: &[f64]| {
        let cells = values.iter().map(|v| significant(*v, 3));
        table.push([name, unit.to_owned()].into_iter().chain(cells));
    };
    row("residual of the fit".into(), "Nm", &result.residual.rms_nm);
    row("… of the torque".into(), "%", &result.residual.relative_percent);
    if let Some(floor) = &result.noise_floor_nm {
        row("noise floor of single samples (scatter between periods)".into(), "Nm", floor);
    }
    if let Some(explainable) = &result.explainable_nm {
        row("repeats and is not explained".into(), "Nm", explainable);
        let drift = |j: usize| result.drifting_friction.iter().find(|drift| drift.joint == j + 1);
        let of_drift: Vec<f64> =
            (0..joints).map(|j| drift(j).map_or(0.0, |drift| drift.rms_nm)).collect();
        if of_drift.iter().any(|nm| *nm > 0.0) {
            row("friction that drifts, beside its mean".into(), "Nm", &of_drift);
        }
        let held = |j: usize| result.held_at_rest.iter().find(|held| held.joint == j + 1);
        let of_held: Vec<f64> =
            (0..joints).map(|j| held(j).map_or(0.0, |held| held.held_nm)).collect();
        if of_held.iter().any(|nm| *nm > 0.0) {
            row("friction held in pauses (left out of the fit)".into(), "Nm", &of_held);
        }
    }
    for (v, name) in result.validation.iter().zip(validation_names(result)) {
        row(format!("{name}: prediction"), "Nm", &v.residual.rms_nm);
        row(format!("{name}: … moving samples"), "Nm", &v.moving_rms_nm);
        if let (Some(all), Some(moving)) = (&v.manufacturer_rms_nm, &v.manufacturer_moving_rms_nm) {
            row(format!("{name}: manufacturer's feed-forward"), "Nm", all);
            row(format!("{name}: … moving samples"), "Nm", moving);
        }
    }
    table
}

/// Names of the validation logs that differ, in their order.
fn validation_names(result: &Result) -> Vec<String> {
    let files: Vec<&Path> = result.validation.iter().map(|v| Path::new(&v.log)).collect();
    short_names(&files)
}

/// How the log was processed and how estimate and σ were computed.
pub fn facts(result: &Result) -> Vec<String> {
    let processing = &result.processing;
    let periods = match processing.period_s {
        _ if processing.logs > 1 && processing.periods > 1 => format!(
            "{} logs with {} periods in all, each log weighted by the noise that its own periods show",
            processing.logs, processing.periods
        ),
        _ if processing.logs > 1 => format!(
            "{} logs one below the other, as one single run: that the motion of one repeats is not used",
            processing.logs
        ),
        Some(period) => format!(
            "{} periods of {period:.3} s averaged and differentiated as a Fourier series",
            processing.periods
        ),
        None => format!(
            "a single run, torque and regressor low-passed at {} Hz",
            significant(processing.cutoff_hz.unwrap_or(f64::NAN), 3)
        ),
    };
    vec![
        format!("{} rows read, {} used; {periods}", result.rows.read, result.rows.used),
        format!(
            "estimator {}, σ from {}: {}",
            result.estimator, result.covariance, result.covariance_reason
        ),
        format!(
            "condition of the regressor {:.0}, with columns of unit length {:.1}; e_N = {:.4}",
            result.condition.regressor, result.condition.scaled, result.residual.e_n
        ),
    ]
}

/// The page: verdict, measured and predicted torque, residuals, parameters.
pub fn page(
    result: &Result,
    training: &Training,
    validations: &[Validation],
    program: Program,
) -> std::result::Result<Page, ReportError> {
    let status = match result.intervals.trusted {
        _ if result.is_declined() || result.is_contradicted() => Status::Bad,
        _ if result.doubt.is_some() => Status::Warn,
        Some(false) => Status::Warn,
        _ if !result.drifting_friction.is_empty() => Status::Warn,
        _ => Status::Good,
    };
    let verdict = Verdict { status, sentence: result.sentence(), facts: facts(result) };
    let subtitle = format!("{} from {}", result.robot, result.log);
    let mut page = Page::new("Identified parameters", subtitle, verdict, program);
    page.extend(result.misread().and_then(MisreadLog::section));
    let fit = Prediction::of(training.regression, &training.identification.fit.theta);
    let section = Section::new("Torque: measured and predicted")
        .figure(
            torque_figure("Torque along the training log", &fit, result.processing.period_s)?,
            "",
        )
        .figure(
            error_figure("What the model leaves", &fit)?,
            "Measured minus predicted torque. Structure that returns at every reversal or with \
             every period is not noise: the model lacks something.",
        )
        .table(residual_table(result), "Root mean square over all samples used")
        .paragraph(&result.intervals.reason)
        .warnings(result.notes());
    page.push(section);
    for (v, name) in validations.iter().zip(validation_names(result)) {
        page.push(
            Section::new(format!("Validation on {name}"))
                .paragraph("Nothing is fitted to this log; same processing.")
                .figure(
                    torque_figure(
                        "Torque along the validation log",
                        &v.prediction,
                        v.processing.period_s,
                    )?,
                    "",
                )
                .figure(error_figure("What the model leaves", &v.prediction)?, ""),
        );
    }
    page.push(
        Section::new("Parameters")
            .figure(
                relative_sigma_figure(result)?,
                "σ relative to the estimate; parameters near zero are far right without being \
                 badly known.",
            )
            .table(parameter_table(result), "Base parameters, named by the column that is kept"),
    );
    if let (Some(physical), Some(standard)) = (&result.physical, &result.standard_parameters) {
        page.push(physical.section(standard));
    }
    Ok(page)
}

/// Length of the drawn part of a single run, s. On the width of a panel, a good prediction hides what was measured along
/// a much longer one.
const DRAWN_S: f64 = 20.0;

/// How many of the rows at `time_s` are drawn, and which these are in words, behind the title: one period of a motion
/// with the period `period_s`, or the beginning of a single run.
fn drawn(time_s: &[f64], period_s: Option<f64>) -> (usize, String) {
    let length_s = period_s.unwrap_or(DRAWN_S);
    let rows = time_s.iter().take_while(|t_s| **t_s - time_s[0] <= length_s).count();
    let words = match period_s {
        _ if rows == time_s.len() => String::new(),
        Some(period_s) => format!(": its first period, {period_s:.1} s"),
        None => format!(": its first {DRAWN_S} s"),
    };
    (rows, words)
}

/// Measured and predicted torque, one panel per joint.
fn torque_figure(
    title: &str,
    p: &Prediction,
    period_s: Option<f64>,
) -> std::result::Result<String, ReportError> {
    let (rows, words) = drawn(&p.time_s, period_s);
    joints_figure(
        &format!("{title}{words}"),
        "Nm",
        &p.time_s[..rows],
        &[
            ("measured", &p.measured_nm, Colour::MEASURED, Mark::WideLine),
            ("predicted", &p.predicted_nm, Colour::MODEL, Mark::ThinLine),
        ],
    )
}

/// Measured minus predicted, one panel per joint.
fn error_figure(title: &str, p: &Prediction) -> std::result::Result<String, ReportError> {
    let error = p.error_nm();
    joints_figure(title, "Nm", &p.time_s, &[("residual", &error, Colour::AFTER, Mark::ThinLine)])
}

type JointLine<'a> = (&'a str, &'a JointSignals, Colour, Mark);

/// Curves over time, one panel per joint. Of longer signals the samples at `time_s`, which are their first, are drawn.
fn joints_figure(
    title: &str,
    unit: &str,
    time_s: &[f64],
    lines: &[JointLine],
) -> std::result::Result<String, ReportError> {
    let mut grid = Grid::new(title, Axis::linear("time", "s"), Axis::linear("torque", unit));
    grid.columns = 2;
    grid.share_x = true;
    let joints = lines.first().map_or(0, |(_, signals, ..)| signals.joints());
    for j in 0..joints {
        let mut panel = grid.panel(format!("joint {}", j + 1));
        for (name, signals, colour, mark) in lines {
            panel = panel.with(*name, time_s, &signals.joint(j)[..time_s.len()], *colour, *mark);
        }
        grid.panels.push(panel);
    }
    Ok(grid.to_svg()?)
}

/// σ relative to the estimate, for every parameter.
fn relative_sigma_figure(result: &Result) -> std::result::Result<String, ReportError> {
    let mut plot = IntervalPlot::new("σ of each parameter", Axis::log("σ / |estimate|", "%"));
    plot.columns = 2;
    plot.value_name = "relative σ".into();
    plot.rows = result
        .base_parameters
        .iter()
        .map(|p| IntervalRow {
            name: p.name.clone(),
            value: 100.0 * p.sigma / p.value.abs(),
            low: f64::NAN,
            high: f64::NAN,
            expected: f64::NAN,
            status: result.not_identified.contains(&p.name).then_some(Status::Bad),
        })
        .collect();
    Ok(plot.to_svg()?)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// 30 s at 8 Hz, from 2 s on.
    #[test]
    fn one_period_or_the_beginning_is_drawn() {
        let time_s: Vec<f64> = (0..=240).map(|k| 2.0 + 0.125 * f64::from(k)).collect();
        let said = |rows, words: &str| (rows, words.to_owned());
        assert_eq!(drawn(&time_s, Some(10.0)), said(81, ": its first period, 10.0 s"));
        assert_eq!(drawn(&time_s, None), said(161, ": its first 20 s"));
        assert_eq!(drawn(&time_s[..81], Some(10.0)), said(81, ""));
        assert_eq!(drawn(&time_s[..81], None), said(81, ""));
        assert_eq!(drawn(&[], None), said(0, ""));
    }
}
