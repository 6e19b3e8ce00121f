//! The study of estimators under noise: page, Markdown and tables.

use super::json::Program;
use super::plot::{Axis, IntervalPlot, IntervalRow, Span};
use super::{Column, Page, ReportError, Section, Status, Table, Verdict};
use crate::montecarlo::CheckSummary;
use crate::montecarlo::calibration::{Statistic, claims, wilson};
use crate::montecarlo::study::{MethodResult, NoiseStudy, ScenarioResult};
use crate::number::percent;

impl ScenarioResult {
    /// The name without the prefix that all noise scenarios share.
    fn short_name(&self) -> &str {
        self.name.trim_start_matches("noise_")
    }

    fn method(&self, estimator: &str, covariance: &str) -> Option<&MethodResult> {
        self.methods.iter().find(|m| m.estimator == estimator && m.covariance == covariance)
    }

    fn chosen_method(&self) -> Option<&MethodResult> {
        self.method(&self.chosen[0], &self.chosen[1])
    }

    /// Claimed range of the mean coverage for the automatically chosen method.
    fn coverage_claim(&self) -> [f64; 2] {
        claims::mean_coverage(self.single_run)
    }

    fn check(&self, statistic: Statistic) -> Option<&CheckSummary> {
        self.checks.iter().find(|check| check.what == statistic.in_words())
    }
}

/// Judges whether the mean coverage lies within the claim.
fn status(method: &MethodResult, [low, high]: [f64; 2]) -> Status {
    match method.coverage_mean {
        c if c >= low && c <= high => Status::Good,
        c if (0.9..=0.99).contains(&c) => Status::Warn,
        _ => Status::Bad,
    }
}

/// Judges a scenario: by coverage where the model is right; where it is wrong, by whether the intervals are withheld.
fn scenario_status(scenario: &ScenarioResult, method: &MethodResult) -> Status {
    match (scenario.model_is_wrong, 2 * scenario.rejected_fits > scenario.tested_for_fit) {
        (true, true) => Status::Good,
        (true, false) => Status::Bad,
        (false, _) => status(method, scenario.coverage_claim()),
    }
}

/// Status and verdict in a sentence.
fn sentence(study: &NoiseStudy) -> (Status, String) {
    let right = study.scenarios.iter().filter(|s| !s.model_is_wrong);
    let held = right
        .clone()
        .filter(|s| {
            s.chosen_method().is_some_and(|m| status(m, s.coverage_claim()) == Status::Good)
        })
        .count();
    let all = right.count();
    let [low, high] = claims::MEAN_COVERAGE;
    let mut sentence = format!(
        "The method that a log calls for by itself has a mean coverage of {} to {} (from {} for logs that do not repeat) \
         in {held} of {all} scenarios with a correct model.",
        percent(low, 3),
        percent(high, 3),
        percent(claims::MEAN_COVERAGE_OF_A_SINGLE_RUN[0], 2)
    );
    let wrong: Vec<_> = study.scenarios.iter().filter(|s| s.model_is_wrong).collect();
    let mut flagged = true;
    for s in wrong {
        flagged &= 2 * s.rejected_fits > s.tested_for_fit;
        sentence += &format!(
            " With friction that the model does not know the intervals are withheld in {} of {} trials.",
            s.rejected_fits, s.tested_for_fit
        );
    }
    (if held == all && flagged { Status::Good } else { Status::Warn }, sentence)
}

/// The chosen method against its targets, one row per scenario.
fn target_table(study: &NoiseStudy) -> Table {
    let mut table = Table::new([
        Column::text("scenario"),
        Column::number("trials", ""),
        Column::text("mean coverage"),
        Column::text("coverage of the worst parameter"),
        Column::text("worst bias/σ"),
        Column::text("σ/least σ"),
    ]);
    for s in study.scenarios.iter().filter(|s| !s.model_is_wrong) {
        let Some(m) = s.chosen_method() else { continue };
        // For a log that does not repeat, only the mean coverage is a target.
        let judged = |statistic| match s.check(statistic) {
            None => "–".into(),
            Some(check) if s.single_run => measured(check),
            Some(check) => target(check),
        };
        let coverage = s.check(Statistic::MeanCoverage).map_or_else(|| "–".into(), target);
        let efficiency = m.efficiency.as_ref().map_or_else(
            || "–".into(),
            |e| {
                let answer = if e.rms <= claims::EFFICIENCY { "pass" } else { "miss" };
                format!("{answer}: {:.3}, worst {:.2} {}", e.rms, e.worst, e.worst_of)
            },
        );
        table.push([
            s.short_name().to_owned(),
            m.trials.to_string(),
            coverage,
            judged(Statistic::EachCoverage),
            judged(Statistic::Bias),
            efficiency,
        ]);
    }
    table
}

/// A measured value with pass or miss against its claim.
fn target(check: &CheckSummary) -> String {
    let CheckSummary { value, interval: [low, high], claim, .. } = check;
    let inside = (claim[0]..=claim[1]).contains(value);
    let answer = match (inside, *high < claim[0] || *low > claim[1]) {
        (true, _) => "pass",
        (false, false) => "miss, chance can explain it",
        (false, true) => "miss",
    };
    format!("{answer}: {}", measured(check))
}

/// A measured value, its parameter, and the confidence interval of the true value.
fn measured(check: &CheckSummary) -> String {
    let CheckSummary { value, interval: [low, high], .. } = check;
    let of = check.parameter.as_ref().map_or(String::new(), |name| format!(" {name}"));
    format!("{value:.3}{of} ({low:.3} … {high:.3})")
}

fn targets() -> String {
    let [low, high] = claims::MEAN_COVERAGE;
    let [each_low, each_high] = claims::EACH_COVERAGE;
    format!(
        "Asked are a mean coverage of {} to {} ({} or more where the log does not repeat), a coverage of {} to {} and a bias of at \
         most {} σ for every parameter, and at most {} times the least possible σ (rms over the parameters; – where the noise has \
         no known law or every trial its own motion). In brackets where the true value lies, by Clopper and Pearson's binomial \
         bounds, Student's t (of the bias, and of the mean coverage by the scatter between trials) and χ², so wide that all of \
         them together are wrong once in a thousand studies of one scenario.",
        percent(low, 3),
        percent(high, 3),
        percent(claims::MEAN_COVERAGE_OF_A_SINGLE_RUN[0], 2),
        percent(each_low, 2),
        percent(each_high, 3),
        claims::BIAS[1],
        claims::EFFICIENCY
    )
}

/// How often the lack-of-fit test rejects a right and a wrong model, in words.
fn lack_of_fit(study: &NoiseStudy) -> String {
    let count = |wrong: bool| {
        let of = study.scenarios.iter().filter(|s| s.model_is_wrong == wrong);
        of.fold([0, 0], |[r, t], s| [r + s.rejected_fits, t + s.tested_for_fit])
    };
    let line = |[rejected, tested]: [u64; 2]| {
        if tested == 0 {
            return "no tested log".to_owned();
        }
        let share = rejected as f64 / tested as f64;
        let [low, high] = wilson(share, tested as f64, 1.96);
        format!(
            "{rejected} of {tested} ({}; 95 % bounds {} … {})",
            percent(share, 2),
            percent(low.max(0.0), 2),
            percent(high, 3)
        )
    };
    format!(
        "Lack-of-fit test, intervals withheld at p < {}: where the model is right in {}, where it is wrong in {}.",
        NoiseStudy::rejection_level(),
        line(count(false)),
        line(count(true))
    )
}

/// Results of the chosen method in every scenario.
fn summary_table(study: &NoiseStudy) -> Table {
    let mut table = Table::new([
        Column::text("scenario"),
        Column::text("chosen"),
        Column::number("trials", ""),
        Column::number("mean coverage", "%"),
        Column::number("worst parameter, 95 % bounds", "%"),
        Column::number("worst bias/σ", ""),
        Column::number("σ empirical/predicted", ""),
        Column::number("σ/least σ, rms (worst)", ""),
        Column::number("withheld", ""),
        Column::number("trials/s, all methods", ""),
    ]);
    for s in &study.scenarios {
        let Some(m) = s.chosen_method() else { continue };
        let [low, high] = m.coverage_worst_within;
        let withheld = match s.tested_for_fit {
            0 => "not tested".to_owned(),
            tested => format!("{} ({}) of {tested}", s.rejected_fits, s.tested_again),
        };
        table.push_judged(
            Some(scenario_status(s, m)),
            [
                s.short_name().to_owned(),
                format!("{} / {}", m.estimator, m.covariance),
                format!("{}{}", m.trials, lost(m)),
                format!("{:.2} ± {:.2}", 100.0 * m.coverage_mean, 196.0 * m.coverage_error),
                format!(
                    "{} {:.1} ({:.1} … {:.1})",
                    m.coverage_worst_of,
                    100.0 * m.coverage_worst,
                    100.0 * low,
                    100.0 * high
                ),
                format!("{:.2} {}", m.bias_worst, m.bias_worst_of),
                format!("{:.3} ({:.2} … {:.2})", m.ratio[1], m.ratio[0], m.ratio[2]),
                m.efficiency
                    .as_ref()
                    .map_or_else(|| "–".into(), |e| format!("{:.3} ({:.2})", e.rms, e.worst)),
                withheld,
                format!("{:.1}", s.trials as f64 / s.seconds),
            ],
        );
    }
    table
}

fn lost(method: &MethodResult) -> String {
    if method.failed > 0 { format!(" ({} failed)", method.failed) } else { String::new() }
}

/// How far the paper's σ is off: its (20) assumes a noise variance of 1 Nm².
fn paper_table(study: &NoiseStudy) -> Table {
    let mut table = Table::new([
        Column::text("scenario"),
        Column::number("true σ / paper's σ, least", ""),
        Column::number("pooled", ""),
        Column::number("greatest", ""),
        Column::number("mean coverage", "%"),
    ]);
    for s in &study.scenarios {
        let paper = s.methods.iter().find(|m| m.covariance == "paper");
        let Some(m) = paper else { continue };
        let [least, pooled, greatest] = m.ratio;
        table.push([
            s.short_name().to_owned(),
            format!("{least:.2}"),
            format!("{pooled:.2}"),
            format!("{greatest:.2}"),
            format!("{:.1}", 100.0 * m.coverage_mean),
        ]);
    }
    table
}

/// Instrumental variables beside the competing methods, for motions that repeat.
fn instruments_table(study: &NoiseStudy) -> Table {
    const METHODS: [(&str, &str); 3] =
        [("wls", "periods"), ("iv", "periods"), ("spectral", "spectral")];
    let columns = METHODS.iter().flat_map(|(estimator, _)| {
        [format!("{estimator}: bias/σ"), format!("{estimator}: coverage %")]
            .map(|heading| Column::number(heading, ""))
    });
    let mut table = Table::new(std::iter::once(Column::text("scenario")).chain(columns));
    for s in study.scenarios.iter().filter(|s| !s.model_is_wrong && !s.single_run) {
        let cells = METHODS.iter().flat_map(|(estimator, covariance)| {
            s.method(estimator, covariance).map_or_else(
                || ["–".to_owned(), "–".to_owned()],
                |m| {
                    let bias = format!("{:.2} {}", m.bias_worst, m.bias_worst_of);
                    [bias, format!("{:.1}", 100.0 * m.coverage_mean)]
                },
            )
        });
        table.push(std::iter::once(s.short_name().to_owned()).chain(cells));
    }
    table
}

const INSTRUMENTS: &str = "Instrumental variables (Janot 2014) take the regressor along a smoother motion as instruments, \
so that the noise of the motion does not attenuate. Worst |bias|/σ of any parameter and mean coverage beside plain weighted \
least squares and the method chosen by itself; chance alone makes the worst of 52 about 2.6/√trials.";

/// A table of methods by scenarios, filled by `cell` for every existing pair.
fn matrix(study: &NoiseStudy, cell: impl Fn(&MethodResult) -> String) -> Table {
    let mut names: Vec<(&str, &str)> = Vec::new();
    for m in study.scenarios.iter().flat_map(|s| &s.methods) {
        let name = (m.estimator.as_str(), m.covariance.as_str());
        if !names.contains(&name) {
            names.push(name);
        }
    }
    // Spaces instead of underscores let the headings wrap in narrow columns.
    let heading = |s: &ScenarioResult| Column::number(s.short_name().replace('_', " "), "");
    let columns = study.scenarios.iter().map(heading);
    let labels = ["estimator", "σ from"].map(Column::text);
    let mut table = Table::new(labels.into_iter().chain(columns));
    for (estimator, covariance) in names {
        let cells = study.scenarios.iter().map(|s| {
            let is_it = |m: &&MethodResult| m.estimator == estimator && m.covariance == covariance;
            s.methods.iter().find(is_it).map_or_else(|| "–".into(), &cell)
        });
        table.push([estimator.to_owned(), covariance.to_owned()].into_iter().chain(cells));
    }
    table
}

fn coverage_matrix(study: &NoiseStudy) -> Table {
    matrix(study, |m| format!("{:.1}", 100.0 * m.coverage_mean))
}

fn worst_matrix(study: &NoiseStudy) -> Table {
    matrix(study, |m| format!("{:.1} {}", 100.0 * m.coverage_worst, m.coverage_worst_of))
}

fn bias_matrix(study: &NoiseStudy) -> Table {
    matrix(study, |m| format!("{:.2} {}", m.bias_worst, m.bias_worst_of))
}

fn ratio_matrix(study: &NoiseStudy) -> Table {
    matrix(study, |m| format!("{:.2}", m.ratio[1]))
}

fn efficiency_matrix(study: &NoiseStudy) -> Table {
    let rms = |m: &MethodResult| m.efficiency.as_ref().map_or(f64::NAN, |e| e.rms);
    matrix(study, |m| if rms(m).is_nan() { "–".into() } else { format!("{:.2}", rms(m)) })
}

fn how() -> String {
    format!(
        "Every trial draws fresh noise; its log is laid out once and solved by all methods. Coverage is the share of 95 % \
         intervals that hold the true value: the mean over the parameters (± 1.96 standard errors from the scatter between \
         trials) and the parameter furthest from 95 % with its binomial bounds (Wilson, 95 %; the furthest of 52 lies outside \
         its own bounds more often than one chosen beforehand). Least σ is the Cramér–Rao bound for noise of known law and a \
         motion known exactly, over all frequencies. Withheld are trials in which the lack-of-fit test at p < {} says that \
         the model does not explain what repeats (in brackets those that fail against the scatter of the torque alone). The slower methods (everything but ols, wls with wls, blocks or periods, and \
         spectral) ran on a share of the trials that stands with each scenario at the end.",
        NoiseStudy::rejection_level()
    )
}

const PAPER: &str = "The paper's (20) is (XᵀX)⁻¹ without the variance of the noise: it takes it for 1 Nm², equal on all \
joints and white. What it claims is off by the true σ over it:";

const TITLE: &str = "The method that a log calls for by itself";

/// The study as a page.
pub fn page(study: &NoiseStudy, program: Program) -> Result<Page, ReportError> {
    let (status, sentence) = sentence(study);
    let verdict = Verdict { status, sentence, facts: Vec::new() };
    let mut page = Page::new("Which σ is true under which noise?", "", verdict, program);
    page.push(
        Section::new(TITLE)
            .paragraph(how())
            .table(summary_table(study), "")
            .paragraph(lack_of_fit(study))
            .paragraph(targets())
            .table(target_table(study), ""),
    );
    page.push(
        Section::new("All methods")
            .table(coverage_matrix(study), "Mean coverage of 95 % intervals, %")
            .table(ratio_matrix(study), "Empirical over predicted σ, pooled over the parameters")
            .table(worst_matrix(study), "Coverage of the parameter furthest from 95 %, %")
            .table(bias_matrix(study), "Largest |bias|/σ of any parameter")
            .table(efficiency_matrix(study), "Empirical over least possible σ, rms over parameters")
            .figure(coverage_plot(study)?, "Mean coverage of every method in every scenario."),
    );
    page.push(
        Section::new("Instrumental variables")
            .paragraph(INSTRUMENTS)
            .table(instruments_table(study), ""),
    );
    page.push(Section::new("The paper's σ").paragraph(PAPER).table(paper_table(study), ""));
    page.push(Section::new("Scenarios").list(study.scenarios.iter().map(scenario_line)));
    Ok(page)
}

fn scenario_line(s: &ScenarioResult) -> String {
    let ScenarioResult { description, trials, slow_every, seconds, .. } = s;
    format!(
        "{}: {description}. {trials} trials in {seconds:.0} s, the slower methods on one in {slow_every}.",
        s.short_name()
    )
}

fn coverage_plot(study: &NoiseStudy) -> Result<String, ReportError> {
    let mut plot =
        IntervalPlot::new("Mean coverage of nominal 95 % intervals", Axis::linear("coverage", "%"));
    plot.columns = 2;
    plot.reference = Some(95.0);
    let [low, high] = claims::MEAN_COVERAGE;
    plot.expected = Some(Span { from: 100.0 * low, to: 100.0 * high, label: "claimed".into() });
    plot.value_name = "coverage ± 1.96 standard errors".into();
    for s in study.scenarios.iter().filter(|s| !s.model_is_wrong) {
        for m in &s.methods {
            let half = 1.96 * m.coverage_error;
            plot.rows.push(IntervalRow {
                name: format!("{}: {}/{}", s.short_name(), m.estimator, m.covariance),
                value: 100.0 * m.coverage_mean,
                low: 100.0 * (m.coverage_mean - half),
                high: 100.0 * (m.coverage_mean + half),
                expected: f64::NAN,
                status: Some(status(m, s.coverage_claim())),
            });
        }
    }
    Ok(plot.to_svg()?)
}

/// The study as Markdown, with the command that produced it.
pub fn markdown(study: &NoiseStudy, command: &str) -> String {
    let (_, sentence) = sentence(study);
    let mut text = format!(
        "# Which σ is true under which noise?\n\n{sentence}\n\n    {command}\n\n{}\n",
        how()
    );
    let (lack_of_fit, targets) = (lack_of_fit(study), targets());
    let parts = [
        (TITLE, lack_of_fit.as_str(), summary_table(study)),
        ("What is asked of it", targets.as_str(), target_table(study)),
        ("Mean coverage of 95 % intervals, %", "", coverage_matrix(study)),
        ("Empirical over predicted σ, pooled over the parameters", "", ratio_matrix(study)),
        ("Coverage of the parameter furthest from 95 %, %", "", worst_matrix(study)),
        ("Largest |bias|/σ of any parameter", "", bias_matrix(study)),
        ("Empirical over least possible σ, rms over the parameters", "", efficiency_matrix(study)),
        ("Instrumental variables", INSTRUMENTS, instruments_table(study)),
        ("The paper's σ", PAPER, paper_table(study)),
    ];
    for (title, words, table) in parts {
        text += &format!("\n## {title}\n\n");
        if !words.is_empty() {
            text += &format!("{words}\n\n");
        }
        text += &table.to_markdown();
    }
    text += "\n## Scenarios\n\n";
    for s in &study.scenarios {
        text += &format!("- {}\n", scenario_line(s));
    }
    text
}
