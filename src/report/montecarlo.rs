//! Page and tables of a Monte Carlo run.

use super::json::Program;
use super::plot::{
    Axis, Bars, Colour, IntervalPlot, IntervalRow, Mark, Span, XyPlot, standard_normal,
};
use super::{Column, Page, ReportError, Section, Status, Table, Verdict};
use crate::montecarlo::calibration::{claims, wilson};
use crate::montecarlo::tally::BIN_WIDTH;
use crate::montecarlo::{Efficiency, Estimation, Summary, shard::Merged};
use crate::number::{percent, significant};

/// Every base parameter: truth, mean, bias, empirical and predicted σ, coverage.
pub fn parameter_table(summary: &Summary) -> Table {
    let mut table = Table::new([
        Column::text("parameter"),
        Column::text("unit"),
        Column::number("truth", ""),
        Column::number("mean", ""),
        Column::number("bias/σ", ""),
        Column::number("σ empirical", ""),
        Column::number("σ predicted", ""),
        Column::number("ratio", ""),
        Column::number("σ/least", ""),
        Column::number(
            if summary.failed > 0 { "coverage, failed trials as missed" } else { "coverage" },
            "",
        ),
    ]);
    for p in &summary.parameters {
        let ratio = p.sigma_empirical / p.sigma_predicted;
        table.push_judged(
            covered(p.coverage, summary),
            [
                p.name.clone(),
                p.unit.clone(),
                significant(p.truth, 5),
                significant(p.mean, 5),
                format!("{:+.3}", (p.mean - p.truth) / p.sigma_empirical),
                significant(p.sigma_empirical, 3),
                significant(p.sigma_predicted, 3),
                format!("{ratio:.3}"),
                p.sigma_least.map_or_else(
                    || "–".into(),
                    |least| format!("{:.2}", p.sigma_empirical / least),
                ),
                percent(p.coverage, 3),
            ],
        );
    }
    table
}

/// Standard errors from the claim that the coverage of one given parameter exceeds by chance in 5 % of runs.
const UNUSUAL: f64 = 1.96;
/// Standard errors that any of 60 parameters exceeds by chance in one of a thousand runs.
const IMPOSSIBLE: f64 = 4.3;

/// Judges the coverage of one parameter; `None` where chance can explain the deviation from the claim.
fn covered(coverage: f64, summary: &Summary) -> Option<Status> {
    let is_outside = |z: f64| {
        let [low, high] = wilson(coverage, summary.trials as f64, z);
        high < claims::EACH_COVERAGE[0] || low > claims::EACH_COVERAGE[1]
    };
    let statuses = [(IMPOSSIBLE, Status::Bad), (UNUSUAL, Status::Warn)];
    statuses.into_iter().find(|(z, _)| is_outside(*z)).map(|(_, status)| status)
}

/// Empirical σ relative to the Cramér–Rao bound, in words.
pub fn efficiency_sentence(efficiency: &Efficiency) -> String {
    format!(
        "the estimates scatter {:.2} times as far as the best unbiased estimator's could (Cramér–Rao; rms over \
         parameters, worst {:.2} for {})",
        efficiency.rms, efficiency.worst, efficiency.worst_of
    )
}

/// The checks: measured value, its confidence interval, claim, verdict.
pub fn check_table(summary: &Summary) -> Table {
    let mut table = Table::new([
        Column::text("check"),
        Column::text("decided by"),
        Column::number("measured", ""),
        Column::number("true value within", ""),
        Column::number("claim", ""),
        Column::text("verdict"),
    ]);
    for check in &summary.checks {
        let range = |[low, high]: [f64; 2]| format!("{} … {}", end(low), end(high));
        let measured = |text: String| if check.reason.is_none() { text } else { "–".to_owned() };
        let reason = check.reason.as_ref().map_or(String::new(), |reason| format!(": {reason}"));
        table.push_judged(
            Some(check.verdict.into()),
            [
                check.what.clone(),
                check.parameter.clone().unwrap_or_else(|| "all".into()),
                measured(format!("{:.3}", check.value)),
                measured(range(check.interval)),
                range(check.claim),
                format!("{}{reason}", check.verdict),
            ],
        );
    }
    table
}

/// An end of an interval. That of a ratio of σ from a few trials may be any power of ten, or beyond all numbers.
fn end(value: f64) -> String {
    if value.is_infinite() {
        "∞".to_owned()
    } else if value.abs() < 1e6 {
        format!("{value:.3}")
    } else {
        significant(value, 3)
    }
}

/// Facts that support the verdict.
fn facts(summary: &Summary) -> Vec<String> {
    let mut facts = vec![
        format!(
            "{} trials, {} failed; estimator {}, covariance {}",
            summary.trials, summary.failed, summary.estimator, summary.covariance
        ),
        format!(
            "coverage of 95 % intervals: mean {}, worst {} ({}){}",
            percent(summary.coverage_mean, 3),
            percent(summary.coverage_worst.value, 3),
            summary.coverage_worst.name,
            if summary.failed > 0 { "; those of failed trials count as missed" } else { "" }
        ),
        format!("empirical over predicted σ, pooled: {:.3}", summary.sigma_ratio_pooled),
    ];
    facts.extend(summary.joint_ratio.map(|ratio| {
        format!("error of all parameters together over their predicted covariance: {ratio:.3}")
    }));
    facts.push(format!("{:.0} trials per second", summary.trials_per_second));
    let missing: u64 = summary.missing.iter().map(|[start, end]| end - start).sum();
    if missing > 0 {
        facts.push(format!("{missing} trials of the scenario have not been run"));
    }
    facts.extend(summary.efficiency.as_ref().map(efficiency_sentence));
    facts
}

/// The run as Markdown: verdict, checks, parameters.
pub fn markdown(summary: &Summary, command: &str) -> String {
    let mut text = format!("# Is the σ true?\n\n{}\n\n    {command}\n", summary.sentence());
    for fact in facts(summary) {
        text += &format!("\n- {fact}");
    }
    text += &format!("\n\n## What was checked\n\n{}", check_table(summary).to_markdown());
    text += &format!("\n## Parameters\n\n{}", parameter_table(summary).to_markdown());
    if summary.failed > 0 {
        text += "\n## Failed trials\n";
        for f in &summary.failures {
            text += &format!("\n- trial {}: {}", f.trial, f.reason);
        }
        text.push('\n');
    }
    text
}

/// The page: verdict, coverage and σ ratio per parameter, distribution of the errors, tables.
pub fn page(
    summary: &Summary,
    merged: &Merged<Estimation>,
    program: Program,
) -> Result<Page, ReportError> {
    let status = Status::from(summary.verdict).of_a_part(&summary.missing);
    let verdict = Verdict { status, sentence: summary.sentence(), facts: facts(summary) };
    let subtitle = format!("Scenario {}", summary.scenario);
    let mut page = Page::new("Is the σ true?", subtitle, verdict, program);
    page.push(
        Section::new("What was checked")
            .paragraph(
                "Each trial draws fresh sensor noise, identifies the arm from the noisy log with \
                 the same code that real logs go through, and compares the estimate with the \
                 known truth. A check fails only when chance cannot explain the deviation (all \
                 checks together fail a true claim once in a thousand runs).",
            )
            .table(check_table(summary), ""),
    );
    page.push(
        Section::new("Coverage")
            .figure(
                coverage_plot(summary)?,
                "Share of trials whose 95 % interval holds the true value, with what chance \
                 leaves open at 95 % confidence.",
            )
            .figure(
                ratio_plot(summary)?,
                "Scatter of the estimates over the σ that was predicted from a single log.",
            ),
    );
    page.push(Section::new("Distribution of the errors").figure(
        histogram(merged)?,
        "Errors in units of the σ predicted in the same trial, all parameters pooled.",
    ));
    let combinations = summary.parameters.iter().map(|p| format!("{}: {}", p.name, p.formula));
    page.push(
        Section::new("Parameters")
            .table(parameter_table(summary), "Base parameters, named by the column that is kept")
            .details(Section::new("The combinations behind the names").list(combinations)),
    );
    if summary.failed > 0 {
        let failures = summary.failures.iter().map(|f| format!("trial {}: {}", f.trial, f.reason));
        page.push(Section::new("Failed trials").list(failures));
    }
    Ok(page)
}

fn coverage_plot(summary: &Summary) -> Result<String, ReportError> {
    let n = summary.trials as f64;
    let mut plot =
        IntervalPlot::new("Coverage of nominal 95 % intervals", Axis::linear("coverage", "%"));
    plot.columns = 2;
    plot.reference = Some(95.0);
    let [low, high] = claims::EACH_COVERAGE;
    plot.expected =
        Some(Span { from: 100.0 * low, to: 100.0 * high, label: "claimed for each".into() });
    plot.value_name = "coverage ± chance".into();
    plot.rows = summary
        .parameters
        .iter()
        .map(|p| {
            let [low, high] = wilson(p.coverage, n, 1.96);
            interval_row(&p.name, 100.0 * p.coverage, [100.0 * low, 100.0 * high])
        })
        .collect();
    Ok(plot.to_svg()?)
}

fn ratio_plot(summary: &Summary) -> Result<String, ReportError> {
    let n = (summary.trials - summary.failed) as f64;
    let mut plot = IntervalPlot::new(
        "Empirical over predicted σ",
        Axis::linear("σ empirical / σ predicted", ""),
    );
    plot.columns = 2;
    plot.reference = Some(1.0);
    let [low, high] = claims::EACH_RATIO;
    plot.expected = Some(Span { from: low, to: high, label: "claimed for each".into() });
    plot.value_name = "ratio ± chance".into();
    plot.rows = summary
        .parameters
        .iter()
        .map(|p| {
            let ratio = p.sigma_empirical / p.sigma_predicted;
            let half = 1.96 * ratio / (2.0 * n).sqrt();
            interval_row(&p.name, ratio, [ratio - half, ratio + half])
        })
        .collect();
    Ok(plot.to_svg()?)
}

fn interval_row(name: &str, value: f64, [low, high]: [f64; 2]) -> IntervalRow {
    IntervalRow { name: name.to_owned(), value, low, high, expected: f64::NAN, status: None }
}

fn histogram(merged: &Merged<Estimation>) -> Result<String, ReportError> {
    let bins = merged.tally.histogram();
    let inner = &bins[1..bins.len() - 1];
    let density: Vec<f64> = inner.iter().map(|(_, share)| share / BIN_WIDTH).collect();
    let mut edges: Vec<f64> = inner.iter().map(|(centre, _)| centre - 0.5 * BIN_WIDTH).collect();
    edges.push(inner[inner.len() - 1].0 + 0.5 * BIN_WIDTH);
    let x: Vec<f64> = (-200..=200).map(|k| k as f64 * 0.025).collect();
    let normal: Vec<f64> = x.iter().map(|z| standard_normal(*z)).collect();
    let mut plot = XyPlot::new(
        "Errors in units of the predicted σ",
        Axis::linear("(estimate − truth) / predicted σ", ""),
        Axis::linear("density", ""),
    );
    plot.bars.push(Bars {
        name: "trials".into(),
        edges,
        heights: density,
        colour: Colour::REFERENCE,
    });
    let plot = plot.with("standard normal", &x, &normal, Colour::MODEL, Mark::Line);
    Ok(plot.to_svg()?)
}
