//! The study of physical consistency: page, Markdown and tables.

use super::json::Program;
use super::plot::{Axis, IntervalPlot, IntervalRow};
use super::{Column, Page, ReportError, Section, Status, Table, Verdict};
use crate::montecarlo::study::physical::{
    CaseResult, Coverage, METHODS, Method, PhysicalStudy, Prediction, SIGMAS, THOROUGH_EVERY,
    VALIDATED_ON,
};
use crate::number::percent;

const HOW: &str = "The simulated arm is not the one of the robot file: every body's log-Cholesky parameters are off by \
10 %, rotor inertias and friction by 20 % (one random draw, the same arm in all cases). Each trial draws fresh noise, is identified \
without constraints and with them (beside the robot file's values, which count as known to 100 %), and predicts the torque of another motion of the same arm without noise, faults included. \
The error is in percent of the torque, root mean square over the joints; its scatter changes from trial to trial (variance), its \
systematic part is the same in all trials (model error).";

const SIGMA: &str = "Which 95 % intervals hold the true base parameters. unconstrained: least squares and its own σ. The other \
three are about the constrained estimate: held, delta method in log-Cholesky parameters with the full curvature, so that a \
direction held by a bound counts as known; released, the same with Gauss and Newton's curvature, as if no bound were there; \
drawn, root mean square over estimates drawn around the estimate. All three are σ of the data's noise: where that is large the robot file decides some combinations, and its errors are not \
in them (`identify --physical` states no σ for standard parameters of which this holds).";

fn of(case: &CaseResult, method: Method) -> Option<&Prediction> {
    case.predictions[method as usize].as_ref()
}

/// Scatter and systematic error of the constrained estimate, each relative to the unconstrained one.
fn gain(case: &CaseResult) -> Option<(f64, f64)> {
    let before = of(case, Method::Unconstrained)?;
    let after = of(case, Method::Constrained)?;
    Some((
        after.scatter_percent / before.scatter_percent,
        after.systematic_percent / before.systematic_percent,
    ))
}

/// Whether the systematic error exceeds the scatter, so that the model counts as wrong and not only the data as noisy.
fn is_wrong(case: &CaseResult) -> bool {
    of(case, Method::Unconstrained).is_some_and(|p| p.systematic_percent > p.scatter_percent)
}

fn sentence(study: &PhysicalStudy) -> String {
    let list = |wrong: bool, ratio: fn((f64, f64)) -> f64| -> String {
        let cases = study.cases.iter().filter(|case| is_wrong(case) == wrong);
        let ratios: Vec<f64> = cases.filter_map(gain).map(ratio).collect();
        let least = ratios.iter().copied().fold(f64::INFINITY, f64::min);
        let most = ratios.iter().copied().fold(0.0, f64::max);
        format!("{least:.2} to {most:.2}")
    };
    format!(
        "Where noise is all that is wrong, constraints and a robot file known to 100 % leave {} of the scatter of predictions; \
         where the model is wrong, {} of the systematic error stays: they make every arm \
         runnable, but no wrong model right.",
        list(false, |(scatter, _)| scatter),
        list(true, |(_, systematic)| systematic)
    )
}

/// Number of trials in which the model was called wrong, and of all tested trials, for the cases where the model is
/// wrong or for those where it is right.
fn called_wrong(study: &PhysicalStudy, where_wrong: bool) -> [u64; 2] {
    let cases = study.cases.iter().filter(|case| is_wrong(case) == where_wrong);
    cases.fold([0, 0], |[called, tested], case| [called + case.called_wrong, tested + case.tested])
}

/// Largest share over the cases of constrained estimates with a mass matrix that is not positive definite.
fn impossible(study: &PhysicalStudy) -> f64 {
    study.cases.iter().map(|case| case.indefinite[1]).fold(0.0, f64::max)
}

/// Largest share of false alarms, over the trials in which the model is right, for a good verdict.
const FALSE_ALARMS: f64 = 0.05;

/// Judges the study: constraints must make every arm physical, and the test must detect a wrong model in at least half
/// of the trials.
fn status(impossible: f64, [false_alarms, sound]: [u64; 2], [found, unsound]: [u64; 2]) -> Status {
    let is_told = 2 * found >= unsound && false_alarms as f64 <= FALSE_ALARMS * sound as f64;
    match is_told {
        _ if impossible > 0.0 => Status::Bad,
        true => Status::Good,
        false => Status::Warn,
    }
}

fn facts(study: &PhysicalStudy) -> Vec<String> {
    let [[false_alarms, sound], [found, unsound]] =
        [false, true].map(|where_wrong| called_wrong(study, where_wrong));
    vec![
        format!(
            "\"The model is wrong, not only noisy\" was said in {found} of {unsound} trials where \
             it is, and in {false_alarms} of {sound} where it is not."
        ),
        format!(
            "Constrained estimates whose mass matrix is not positive definite: {}.",
            percent(impossible(study), 3)
        ),
    ]
}

fn prediction_table(study: &PhysicalStudy) -> Table {
    let mut table = Table::new([
        Column::text("case"),
        Column::text("estimate"),
        Column::number("trials", ""),
        Column::number("error", "%"),
        Column::number("scatter", "%"),
        Column::number("systematic", "%"),
        Column::number("median weight", ""),
    ]);
    for case in &study.cases {
        for (k, name) in METHODS.iter().enumerate() {
            let Some(p) = case.predictions[k] else { continue };
            let weight = k.checked_sub(2).and_then(|metric| case.weights[metric]);
            let [low, high] = p.interval_percent;
            table.push([
                short(case).to_owned(),
                (*name).to_owned(),
                p.trials.to_string(),
                format!("{:.3} ({low:.3} … {high:.3})", p.error_percent),
                format!("{:.3}", p.scatter_percent),
                format!("{:.3}", p.systematic_percent),
                weight.map_or_else(String::new, |w| format!("{w:.0e}")),
            ]);
        }
    }
    table
}

fn realisable_table(study: &PhysicalStudy) -> Table {
    let mut table = Table::new([
        Column::text("case"),
        Column::number("trials", ""),
        Column::number("no links have it", ""),
        Column::number("negative Ia, rv or rc", ""),
        Column::number("mass matrix indefinite", ""),
        Column::number("constrained: indefinite", ""),
        Column::number("called wrong", ""),
    ]);
    for case in &study.cases {
        let failed = case.failures.len();
        let lost = if failed > 0 { format!(" ({failed} failed)") } else { String::new() };
        table.push([
            short(case).to_owned(),
            format!("{}{lost}", case.trials),
            percent(case.not_realisable, 3),
            percent(case.negative_drive, 3),
            percent(case.indefinite[0], 3),
            percent(case.indefinite[1], 3),
            format!("{} of {}", case.called_wrong, case.tested),
        ]);
    }
    table
}

fn coverage_table(study: &PhysicalStudy) -> Table {
    let columns = [Column::text("case"), Column::number("trials", "")];
    let sigmas = SIGMAS.iter().map(|name| Column::number(*name, ""));
    let mut table = Table::new(columns.into_iter().chain(sigmas));
    for case in &study.cases {
        let cell = |coverage: &Option<Coverage>| match coverage {
            Some(c) => format!("{} (worst {})", percent(c.mean, 3), percent(c.worst, 3)),
            None => "–".to_owned(),
        };
        let cells = case.coverage.iter().map(cell);
        table.push([short(case).to_owned(), case.trials.to_string()].into_iter().chain(cells));
    }
    table
}

fn short(case: &CaseResult) -> &str {
    case.name.trim_start_matches("physical_")
}

/// The study as a page.
pub fn page(study: &PhysicalStudy, program: Program) -> Result<Page, ReportError> {
    let [sound, unsound] = [false, true].map(|where_wrong| called_wrong(study, where_wrong));
    let status = status(impossible(study), sound, unsound);
    let verdict = Verdict { status, sentence: sentence(study), facts: facts(study) };
    let title = "What does physical consistency repair, and what not?";
    let mut page = Page::new(title, "", verdict, program);
    let cases = study.cases.iter().map(|case| format!("{}: {}.", short(case), case.description));
    page.push(
        Section::new("Prediction of another motion")
            .paragraph(format!("{HOW} Validated on {VALIDATED_ON}."))
            .list(cases)
            .figure(error_plot(study)?, "Scatter and systematic part of the error.")
            .table(prediction_table(study), "")
            .paragraph(format!(
                "Cross-validated priors, bootstrap tests and drawn σ take a hundred solves each: \
                 every {THOROUGH_EVERY}th trial has them. A single run has no periods to leave out."
            )),
    );
    page.push(
        Section::new("Could the unconstrained estimate be an arm?")
            .table(realisable_table(study), ""),
    );
    page.push(
        Section::new("Is the σ of the constrained estimate true?")
            .paragraph(SIGMA)
            .figure(coverage_plot(study)?, "Mean coverage; bars are ±1.96 standard errors.")
            .table(
                coverage_table(study),
                "Mean over the base parameters, and the one covered least",
            ),
    );
    Ok(page)
}

fn error_plot(study: &PhysicalStudy) -> Result<String, ReportError> {
    let axis = Axis::log("error of the predicted torque", "%");
    let mut plot = IntervalPlot::new("Another motion, predicted", axis);
    plot.value_name = "scatter".into();
    plot.expected_name = "systematic part".into();
    for case in &study.cases {
        for (name, p) in METHODS.iter().zip(&case.predictions) {
            let Some(p) = p else { continue };
            plot.rows.push(IntervalRow {
                name: format!("{}: {name}", short(case)),
                value: p.scatter_percent,
                low: f64::NAN,
                high: f64::NAN,
                expected: p.systematic_percent,
                status: None,
            });
        }
    }
    Ok(plot.to_svg()?)
}

fn coverage_plot(study: &PhysicalStudy) -> Result<String, ReportError> {
    let axis = Axis::linear("coverage of 95 % intervals", "%");
    let mut plot = IntervalPlot::new("Base parameters", axis);
    plot.reference = Some(95.0);
    plot.value_name = "mean coverage".into();
    for case in study.cases.iter().filter(|case| !is_wrong(case)) {
        for (name, coverage) in SIGMAS.iter().zip(&case.coverage) {
            let Some(c) = coverage else { continue };
            let half = 1.96 * c.standard_error;
            plot.rows.push(IntervalRow {
                name: format!("{}: {name}", short(case)),
                value: 100.0 * c.mean,
                low: 100.0 * (c.mean - half),
                high: 100.0 * (c.mean + half),
                expected: f64::NAN,
                status: None,
            });
        }
    }
    Ok(plot.to_svg()?)
}

/// The study as Markdown, with the command that produced it.
pub fn markdown(study: &PhysicalStudy, command: &str) -> String {
    let mut text = format!(
        "# What does physical consistency repair, and what not?\n\n{}\n\n",
        sentence(study)
    );
    for fact in facts(study) {
        text += &format!("- {fact}\n");
    }
    text += &format!("\n    {command}\n\n{HOW} Validated on {VALIDATED_ON}.\n\n");
    for case in &study.cases {
        let seconds = case.seconds;
        text += &format!("- **{}**: {} ({seconds:.0} s).\n", short(case), case.description);
    }
    text += &format!(
        "\n## Prediction of another motion\n\n{}\n## Could the unconstrained estimate be an arm?\n\n{}\n\
         ## Is the σ of the constrained estimate true?\n\n{SIGMA}\n\n{}",
        prediction_table(study).to_markdown(),
        realisable_table(study).to_markdown(),
        coverage_table(study).to_markdown()
    );
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_banner_is_green_where_the_claims_hold() {
        assert_eq!(status(0.0, [1, 200], [150, 150]), Status::Good);
        assert_eq!(status(0.0, [20, 200], [150, 150]), Status::Warn);
        assert_eq!(status(0.0, [1, 200], [50, 150]), Status::Warn);
        assert_eq!(status(0.01, [1, 200], [150, 150]), Status::Bad);
    }
}
