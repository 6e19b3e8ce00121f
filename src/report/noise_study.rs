//! The study of noise: page, Markdown and tables.

use super::json::Program;
use super::number::percent;
use super::plot::{Axis, IntervalPlot, IntervalRow, Span};
use super::{Column, Page, ReportError, Section, Status, Table, Verdict};
use crate::montecarlo::calibration::{claims, wilson};
use crate::montecarlo::study::{MethodResult, NoiseStudy, ScenarioResult};

/// One row per method.
fn method_table(scenario: &ScenarioResult) -> Table {
    let mut table = Table::new([
        Column::text("estimator"),
        Column::text("σ from"),
        Column::number("trials", ""),
        Column::number("coverage", ""),
        Column::number("worst", ""),
        Column::number("σ empirical/predicted", ""),
        Column::number("least … greatest", ""),
        Column::number("worst bias/σ", ""),
        Column::number("σ/bound", ""),
    ]);
    for m in &scenario.methods {
        let failed = if m.failed > 0 { format!(" ({} failed)", m.failed) } else { String::new() };
        table.push_judged(
            Some(status(m)),
            [
                m.estimator.clone(),
                m.covariance.clone(),
                format!("{}{failed}", m.trials),
                percent(m.coverage_mean, 3),
                format!("{} {}", percent(m.coverage_worst, 3), m.coverage_worst_of),
                format!("{:.2}", m.ratio[1]),
                format!("{:.2} … {:.2}", m.ratio[0], m.ratio[2]),
                format!("{:.2} {}", m.bias_worst, m.bias_worst_of),
                m.efficiency
                    .map_or_else(|| "–".into(), |b| format!("{:.2} (≤ {:.2})", b.rms, b.worst)),
            ],
        );
    }
    table
}

/// Whether the mean coverage is what is claimed, as far as chance tells.
fn status(method: &MethodResult) -> Status {
    let [low, high] = claims::MEAN_COVERAGE;
    match method.coverage_mean {
        c if c >= low && c <= high => Status::Good,
        c if (0.9..=0.99).contains(&c) => Status::Warn,
        _ => Status::Bad,
    }
}

fn chosen(scenario: &ScenarioResult) -> Option<&MethodResult> {
    let [estimator, covariance] = &scenario.chosen;
    scenario.methods.iter().find(|m| &m.estimator == estimator && &m.covariance == covariance)
}

fn sentence(study: &NoiseStudy) -> (Status, String) {
    let held = |s: &&ScenarioResult| chosen(s).is_some_and(|m| status(m) == Status::Good);
    let good = study.scenarios.iter().filter(held).count();
    let all = study.scenarios.len();
    let [low, high] = claims::MEAN_COVERAGE;
    let sentence = format!(
        "The method that is chosen by itself has a mean coverage of {} to {} in {good} of {all} \
         scenarios.",
        percent(low, 3),
        percent(high, 3)
    );
    (if good == all { Status::Good } else { Status::Warn }, sentence)
}

fn summary_table(study: &NoiseStudy) -> Table {
    let mut table = Table::new([
        Column::text("scenario"),
        Column::text("chosen"),
        Column::number("trials", ""),
        Column::number("coverage", ""),
        Column::number("worst parameter", ""),
        Column::number("worst bias/σ", ""),
        Column::number("σ/bound, rms", ""),
        Column::number("paper: σ true/claimed", ""),
        Column::number("misfit alarms", ""),
    ]);
    for s in &study.scenarios {
        let Some(m) = chosen(s) else { continue };
        let paper = s.methods.iter().find(|m| m.covariance == "paper");
        table.push_judged(
            Some(status(m)),
            [
                s.name.clone(),
                format!("{} / {}", m.estimator, m.covariance),
                m.trials.to_string(),
                percent(m.coverage_mean, 3),
                format!("{} {}", percent(m.coverage_worst, 3), m.coverage_worst_of),
                format!("{:.2} {}", m.bias_worst, m.bias_worst_of),
                m.efficiency.map_or_else(|| "–".into(), |b| format!("{:.2}", b.rms)),
                paper.map_or_else(
                    || "–".into(),
                    |p| format!("{:.2} … {:.2}", p.ratio[0], p.ratio[2]),
                ),
                format!("{} of {}", s.rejected_fits, s.tested_for_fit),
            ],
        );
    }
    table
}

const HOW: &str = "Every trial draws fresh noise and is identified by all methods from the same log. Coverage is the \
share of 95 % intervals that hold the true value, as mean over the parameters and for the parameter furthest from 95 %. σ/bound \
is the scatter of the estimates over the Cramér–Rao bound for noise of known law and a motion known exactly, over all \
frequencies. Misfit alarms are trials in which the lack-of-fit test at p < 0.001 says that the model does not explain what \
repeats; here it always does.";

/// The page.
pub fn page(study: &NoiseStudy, program: Program) -> Result<Page, ReportError> {
    let (status, sentence) = sentence(study);
    let verdict = Verdict { status, sentence, facts: Vec::new() };
    let mut page = Page::new("Which σ is true under which noise?", "", verdict, program);
    page.push(
        Section::new("The method that is chosen by itself")
            .paragraph(HOW)
            .table(summary_table(study), "")
            .figure(coverage_plot(study)?, "Mean coverage of every method in every scenario."),
    );
    for s in &study.scenarios {
        page.push(
            Section::new(s.name.clone())
                .paragraph(format!("{}. {} trials in {:.0} s.", s.description, s.trials, s.seconds))
                .table(method_table(s), ""),
        );
    }
    Ok(page)
}

fn coverage_plot(study: &NoiseStudy) -> Result<String, ReportError> {
    let mut plot =
        IntervalPlot::new("Mean coverage of nominal 95 % intervals", Axis::linear("coverage", "%"));
    plot.columns = 2;
    plot.reference = Some(95.0);
    let [low, high] = claims::MEAN_COVERAGE;
    plot.expected = Some(Span { from: 100.0 * low, to: 100.0 * high, label: "claimed".into() });
    plot.value_name = "coverage ± chance".into();
    for s in &study.scenarios {
        for m in &s.methods {
            // One parameter's trials: an outer bound, parameters of one trial are not independent.
            let [low, high] = wilson(m.coverage_mean, (m.trials - m.failed) as f64, 1.96);
            plot.rows.push(IntervalRow {
                name: format!(
                    "{}: {}/{}",
                    s.name.trim_start_matches("noise_"),
                    m.estimator,
                    m.covariance
                ),
                value: 100.0 * m.coverage_mean,
                low: 100.0 * low,
                high: 100.0 * high,
                expected: f64::NAN,
                status: Some(status(m)),
            });
        }
    }
    Ok(plot.to_svg()?)
}

/// The same in Markdown.
pub fn markdown(study: &NoiseStudy, command: &str) -> String {
    let (_, sentence) = sentence(study);
    let mut text = format!(
        "# Which σ is true under which noise?\n\n{sentence}\n\n    {command}\n\n{HOW}\n\n{}",
        summary_table(study).to_markdown()
    );
    for s in &study.scenarios {
        text += &format!(
            "\n## {}\n\n{}. {} trials in {:.0} s.\n\n{}",
            s.name,
            s.description,
            s.trials,
            s.seconds,
            method_table(s).to_markdown()
        );
    }
    text
}
