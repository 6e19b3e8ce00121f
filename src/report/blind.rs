//! The blind benchmark: page, Markdown and what a replay prints.

use std::collections::{BTreeMap, BTreeSet};

use super::json::Program;
use super::number::percent;
use super::plot::{Axis, Band, Colour, HeatMap, IntervalPlot, IntervalRow, Mark, XyPlot};
use super::{Column, Page, ReportError, Section, Status, Table, Verdict};
use crate::montecarlo::blind::{
    Hidden, Judged, Named, Record, SAID_NOTHING, SAID_UNEXPLAINED, Scores, Share, StrengthBin,
    Target, power,
};
use crate::montecarlo::calibration;

/// A site in words.
fn place(joint: Option<usize>) -> String {
    joint.map_or_else(|| "arm".into(), |j| format!("joint {j}"))
}

/// A hidden effect in a line.
fn hidden_line(hidden: &Hidden) -> String {
    let numbers: Vec<String> = hidden
        .effect
        .parameters()
        .iter()
        .map(|(key, value)| match value.as_f64() {
            Some(value) => format!("{key} {value:.5}"),
            None => format!("{key} {value}"),
        })
        .collect();
    let size = hidden.strength.map_or_else(String::new, |s| format!(", √λ {s:.1}"));
    format!("{} at {} ({}){size}", hidden.kind, place(hidden.joint), numbers.join(", "))
}

/// A named cause in a line.
fn named_line(named: &Named) -> String {
    let numbers: Vec<String> = named
        .parameters
        .iter()
        .map(|(name, p)| format!("{name} {:.5} in {:.5} … {:.5}", p.value, p.low, p.high))
        .collect();
    let strength = named.strength.map_or_else(String::new, |s| format!(", √λ̂ {s:.1}"));
    let class = if named.class.is_empty() {
        String::new()
    } else {
        format!(", not to be told from {}", named.class.join(", "))
    };
    format!(
        "{} at {} with confidence {:.4}{strength} ({}){class}",
        named.kind,
        place(named.joint),
        named.confidence,
        numbers.join(", ")
    )
}

/// A case, its truth and its answer, for the terminal.
pub fn replay_lines(record: &Record) -> Vec<String> {
    let case = &record.case;
    let against = if case.against_simulation { ", against the nominal simulation" } else { "" };
    let mut lines = vec![
        format!("trial {}: {}, {} noise{against}", record.trial, case.motion, case.noise),
        format!(
            "secret: {}, √λ {:.1}, √λ_sim {:.1}",
            case.secret, case.sqrt_lambda, case.sqrt_lambda_sim
        ),
    ];
    lines.extend(case.cosine.map(|c| format!("  cosine between the two {c:.2}")));
    lines.extend(case.hidden.iter().map(|h| format!("  hidden: {}", hidden_line(h))));
    lines.extend(record.answer.named.iter().map(|n| format!("  named: {}", named_line(n))));
    lines.extend(
        record
            .answer
            .left
            .iter()
            .map(|l| format!("  left: {:.3} Nm on joint {}, by the {}", l.rms_nm, l.joint, l.axis)),
    );
    lines.extend(record.answer.gain.map(|g| {
        let removed = percent(g.share(), 3);
        format!("  held out: {:.3} before, {:.3} after: {removed} removed", g.before, g.after)
    }));
    lines.push(format!("outcome: {}", record.outcome()));
    lines
}

fn status(verdict: calibration::Verdict) -> Status {
    match verdict {
        calibration::Verdict::Pass => Status::Good,
        calibration::Verdict::Fail => Status::Bad,
        calibration::Verdict::NotEvaluated => Status::Warn,
    }
}

/// `12 of 40, 30.0 %`.
fn of(share: Share) -> String {
    if share.of == 0 {
        return "–".into();
    }
    format!("{} of {}, {}", share.count, share.of, percent(share.value(), 3))
}

fn target_in_words(target: &Target) -> String {
    let [low, high] = target.target;
    match (low > 0.0, high < 1.0) {
        (true, true) => format!("{} … {}", percent(low, 3), percent(high, 3)),
        (true, false) => format!("≥ {}", percent(low, 3)),
        _ => format!("≤ {}", percent(high, 2)),
    }
}

/// Every target with what was measured.
pub fn target_table(scores: &Scores) -> Table {
    let mut table = Table::new([
        Column::text("target"),
        Column::number("wanted", ""),
        Column::number("measured", ""),
        Column::number("cases", ""),
        Column::number("chance behind it, 95 %", ""),
        Column::text("verdict"),
    ]);
    for target in &scores.targets {
        let [low, high] = target.interval;
        table.push_judged(
            Some(status(target.verdict)),
            [
                target.what.to_owned(),
                target_in_words(target),
                percent(target.measured, 3),
                format!("{} of {}", target.share.count, target.share.of),
                format!("{} … {}", percent(low, 3), percent(high, 3)),
                target.verdict.to_string(),
            ],
        );
    }
    table
}

/// Detection by size.
fn strength_table(bins: &[StrengthBin], right: &str) -> Table {
    let mut table = Table::new([
        Column::text("√λ"),
        Column::number("mean", ""),
        Column::number("anything said", ""),
        Column::number(right, ""),
        Column::number("joint right", ""),
        Column::number("wrong name, no doubt", ""),
        Column::number("power of the best test", ""),
    ]);
    for bin in bins {
        let [low, high] = bin.range;
        let range =
            if high.is_finite() { format!("{low} … {high}") } else { format!("≥ {low}") };
        table.push([
            range,
            format!("{:.1}", bin.mean),
            of(bin.detected),
            of(bin.right),
            of(bin.right_joint),
            of(bin.wrong),
            percent(bin.power, 3),
        ]);
    }
    table
}

fn family_table(scores: &Scores) -> Table {
    let mut table = Table::new([
        Column::text("family"),
        Column::text("seen in"),
        Column::number("mean √λ", ""),
        Column::number("right", ""),
        Column::number("joint right", ""),
        Column::number("nothing said", ""),
        Column::number("others in its class", ""),
        Column::number("intervals that hold the truth", ""),
    ]);
    for f in &scores.families {
        let seen = match f.judged {
            Judged::Residual => "the residual",
            Judged::Simulation => "a simulation",
            Judged::Record => "the readings",
        };
        let is_good = f.right.value() >= 0.97;
        table.push_judged(
            (f.right.of > 0).then_some(if is_good { Status::Good } else { Status::Warn }),
            [
                f.kind.to_string(),
                seen.to_owned(),
                f.mean_strength.map_or_else(|| "–".into(), |s| format!("{s:.1}")),
                of(f.right),
                of(f.right_joint),
                of(f.silent),
                if f.right.count > 0 { format!("{:.1}", f.mean_class) } else { "–".into() },
                of(f.covered),
            ],
        );
    }
    table
}

fn confidence_table(scores: &Scores) -> Table {
    let mut table = Table::new([
        Column::text("stated confidence"),
        Column::number("mean", ""),
        Column::number("right", ""),
    ]);
    for bin in &scores.confidence {
        let [low, high] = bin.range;
        table.push([format!("{low} … {high}"), format!("{:.4}", bin.stated), of(bin.right)]);
    }
    table
}

fn gain_table(scores: &Scores) -> Table {
    let mut table = Table::new([
        Column::text("√λ"),
        Column::number("cases", ""),
        Column::number("removed, median", ""),
        Column::number("what the parameters' noise allows", ""),
    ]);
    for bin in &scores.gains {
        let [low, high] = bin.range;
        table.push([
            if high.is_finite() { format!("{low} … {high}") } else { format!("≥ {low}") },
            bin.cases.to_string(),
            percent(bin.removed, 3),
            percent(bin.predicted, 3),
        ]);
    }
    table
}

fn condition_table(scores: &Scores) -> Table {
    let mut table =
        Table::new([Column::text("motion and noise"), Column::number("right at √λ ≥ 8", "")]);
    for (condition, share) in &scores.conditions {
        table.push([condition.clone(), of(*share)]);
    }
    table
}

/// What was said for what, most frequent first, in words.
fn confusion_table(scores: &Scores) -> Table {
    let mut table = Table::new([
        Column::text("hidden"),
        Column::number("cases", ""),
        Column::text("said first (class counted as right)"),
    ]);
    for row in &scores.confusion {
        let mut said: Vec<(&String, &u64)> = row.said.iter().collect();
        said.sort_by_key(|(name, count)| (std::cmp::Reverse(**count), (*name).clone()));
        let words: Vec<String> =
            said.iter().map(|(name, count)| format!("{name} {count}")).collect();
        let cases: u64 = row.said.values().sum();
        table.push([row.hidden.to_string(), cases.to_string(), words.join(", ")]);
    }
    table
}

fn sentence(scores: &Scores) -> String {
    let [met, judged] = scores.met();
    let right = scores.targets.iter().find(|t| t.target == [0.97, 1.0]);
    let named = right.map_or_else(String::new, |t| {
        format!(
            " Of single effects with √λ ≥ 8 the diagnosis names {} with kind and joint.",
            percent(t.measured, 3)
        )
    });
    format!(
        "{met} of {judged} targets are met, {} cannot be judged.{named}",
        scores.targets.len() - judged
    )
}

fn facts(scores: &Scores) -> Vec<String> {
    let secrets: Vec<String> =
        scores.secrets.iter().map(|(secret, count)| format!("{count} {secret}")).collect();
    let mut facts = vec![
        format!(
            "{} cases ({}), {} without an answer",
            scores.trials,
            secrets.join(", "),
            scores.failures.len()
        ),
        format!("stated confidence is off by {} on average", percent(scores.calibration_error, 2)),
    ];
    let missing: u64 = scores.missing.iter().map(|[start, end]| end - start).sum();
    if missing > 0 {
        facts.push(format!("{missing} trials of the scenario have not been run"));
    }
    facts
}

const HOW: &str = "Each case draws what is hidden (nothing, one effect, two, or one whose family is taken out of the \
dictionary), where, its shape and size, the motion and the colour of the noise. The effect is made by the plant's physics; \
the diagnosis sees the log alone. √λ is the size of the effect in standard deviations of the noise of the best test that \
could be made; where the null model absorbs the effect, √λ_sim, against a given simulation. A name is right if kind and \
joint are, or if the class that the diagnosis states holds them. Of one effect the first cause counts.";

/// Misses listed in the report.
const LISTED: usize = 60;

fn misses(scores: &Scores) -> Vec<String> {
    let line = |r: &Record| {
        let hidden: Vec<String> = r.case.hidden.iter().map(hidden_line).collect();
        let named: Vec<String> = r
            .answer
            .named
            .iter()
            .map(|n| format!("{} at {} ({:.3})", n.kind, place(n.joint), n.confidence))
            .collect();
        let said = |list: Vec<String>| {
            if list.is_empty() { "nothing".to_owned() } else { list.join("; ") }
        };
        format!(
            "trial {} ({}, {} noise, {}): hidden {}; named {}{}",
            r.trial,
            r.case.motion,
            r.case.noise,
            r.case.secret,
            said(hidden),
            said(named),
            if r.answer.left.is_some() { ", and something left unexplained" } else { "" }
        )
    };
    let mut lines: Vec<String> = scores.misses.iter().take(LISTED).map(line).collect();
    if scores.misses.len() > LISTED {
        lines.push(format!("… and {} more: they are in the JSON", scores.misses.len() - LISTED));
    }
    lines
}

/// The tables that page and Markdown share: heading, words, table.
fn parts(scores: &Scores) -> Vec<(&'static str, &'static str, Table)> {
    let mut parts = vec![
        ("Targets", HOW, target_table(scores)),
        (
            "Detection by size",
            "Single effects that the residual shows. The power is that of a test of one coefficient among as many as the \
             dictionary has families and sites, at the design's rate of false alarms.",
            strength_table(&scores.residual, "right"),
        ),
        (
            "Against a given simulation",
            "Single effects that the null model absorbs, by √λ_sim.",
            strength_table(&scores.simulation, "right"),
        ),
        (
            "Families withheld",
            "The true family is not in the dictionary: no name is right, and something should be left unexplained.",
            strength_table(&scores.withheld, "left unexplained"),
        ),
        ("By family", "At √λ ≥ 8; faults of the record: all.", family_table(scores)),
        (
            "What was said for what",
            "Single effects with √λ ≥ 8 and faults of the record.",
            confusion_table(scores),
        ),
        (
            "Is the stated confidence true?",
            "All causes named where no family was withheld.",
            confidence_table(scores),
        ),
        ("By motion and noise", "Single effects that the residual shows.", condition_table(scores)),
    ];
    if !scores.gains.is_empty() {
        parts.push((
            "Gain on another motion",
            "Mean square, without noise, along a motion that was not used: the share that the named causes remove. What is \
             left of it even by the right cause is the noise of the estimated parameters.",
            gain_table(scores),
        ));
    }
    parts
}

/// In Markdown.
pub fn markdown(scores: &Scores, command: &str) -> String {
    let mut text = format!(
        "# Does the diagnosis find what is hidden?\n\n{}\n\n    {command}\n",
        sentence(scores)
    );
    for fact in facts(scores) {
        text += &format!("\n- {fact}");
    }
    text.push('\n');
    for (heading, words, table) in parts(scores) {
        text += &format!("\n## {heading}\n\n{words}\n\n{}", table.to_markdown());
    }
    text += "\n## Misses\n\nFalse alarms, single effects with √λ ≥ 8 that were not named, pairs of which one was not, \
             and wrong names of withheld families. `montecarlo --scenario … --trial K` replays trial K.\n";
    for line in misses(scores) {
        text += &format!("\n- {line}");
    }
    if !scores.failures.is_empty() {
        text += "\n\n## Trials without an answer\n";
        for f in &scores.failures {
            text += &format!("\n- trial {}: {}", f.trial, f.reason);
        }
    }
    text.push('\n');
    text
}

/// The page.
pub fn page(scores: &Scores, program: Program) -> Result<Page, ReportError> {
    let verdict = Verdict {
        status: status(scores.verdict),
        sentence: sentence(scores),
        facts: facts(scores),
    };
    let subtitle = format!("Scenario {}", scores.scenario);
    let mut page = Page::new("Does the diagnosis find what is hidden?", subtitle, verdict, program);
    for (heading, words, table) in parts(scores) {
        let mut section = Section::new(heading).paragraph(words);
        section = match heading {
            "Detection by size" => section.figure(
                detection_plot(&scores.residual)?,
                "Share of single effects that are named with kind and joint, with 95 % intervals.",
            ),
            "What was said for what" => section.figure(
                confusion_plot(scores)?,
                "Rows: what was hidden; columns: what was named first, percent of the row.",
            ),
            "Is the stated confidence true?" => section.figure(
                confidence_plot(scores)?,
                "Share of right causes by stated confidence, with 95 % intervals; the mark is what is stated.",
            ),
            _ => section,
        };
        page.push(section.table(table, ""));
    }
    page.push(Section::new("Misses").list(misses(scores)));
    if !scores.failures.is_empty() {
        let failures = scores.failures.iter().map(|f| format!("trial {}: {}", f.trial, f.reason));
        page.push(Section::new("Trials without an answer").list(failures));
    }
    Ok(page)
}

fn detection_plot(bins: &[StrengthBin]) -> Result<String, ReportError> {
    let mut plot = XyPlot::new(
        "Named rightly by size",
        Axis::linear("√λ", ""),
        Axis::linear("share", "%").between(0.0, 100.0),
    );
    let x: Vec<f64> = bins.iter().map(|bin| bin.mean).collect();
    let bound = |k: usize| -> Vec<f64> {
        bins.iter().map(|bin| 100.0 * bin.right.bounds(0.025)[k]).collect()
    };
    plot.bands.push(Band {
        name: "95 %".into(),
        x: x.clone(),
        low: bound(0),
        high: bound(1),
        colour: Colour::MEASURED,
    });
    let value = |f: &dyn Fn(&StrengthBin) -> Share| -> Vec<f64> {
        bins.iter().map(|bin| 100.0 * f(bin).value()).collect()
    };
    let strongest = x.last().copied().unwrap_or(1.0);
    let fine: Vec<f64> = (0..=200).map(|k| strongest * f64::from(k) / 200.0).collect();
    let theory: Vec<f64> = fine.iter().map(|s| 100.0 * power(*s)).collect();
    Ok(plot
        .with("power of the best test", &fine, &theory, Colour::REFERENCE, Mark::Dashed)
        .with("anything said", &x, &value(&|b| b.detected), Colour::MODEL, Mark::DotsAndLine)
        .with("kind and joint right", &x, &value(&|b| b.right), Colour::MEASURED, Mark::DotsAndLine)
        .to_svg()?)
}

fn confusion_plot(scores: &Scores) -> Result<String, ReportError> {
    let hidden: Vec<String> = scores.confusion.iter().map(|row| row.hidden.to_string()).collect();
    let others: BTreeSet<&String> = scores
        .confusion
        .iter()
        .flat_map(|row| row.said.keys())
        .filter(|name| !hidden.contains(name) && !is_no_name(name))
        .collect();
    let mut columns = hidden.clone();
    columns.extend(others.into_iter().cloned());
    columns.extend([SAID_UNEXPLAINED.to_owned(), SAID_NOTHING.to_owned()]);
    let share = |said: &BTreeMap<String, u64>, name: &String| {
        let cases: u64 = said.values().sum();
        said.get(name).map_or(f64::NAN, |count| 100.0 * *count as f64 / cases as f64)
    };
    let map = HeatMap {
        title: String::new(),
        row_axis: "hidden".into(),
        column_axis: "named first".into(),
        values: scores
            .confusion
            .iter()
            .map(|row| columns.iter().map(|name| share(&row.said, name)).collect())
            .collect(),
        row_labels: hidden,
        column_labels: columns,
        full_scale: Some(100.0),
        decimals: 0,
        cell_height_px: 20.0,
        cell_width_px: 34.0,
    };
    Ok(map.to_svg()?)
}

fn is_no_name(said: &str) -> bool {
    said == SAID_NOTHING || said == SAID_UNEXPLAINED
}

fn confidence_plot(scores: &Scores) -> Result<String, ReportError> {
    let mut plot = IntervalPlot::new("Right by stated confidence", Axis::linear("right", "%"));
    plot.value_name = "right, with 95 % interval".into();
    plot.expected_name = "stated".into();
    plot.rows = scores
        .confidence
        .iter()
        .map(|bin| {
            let [low, high] = bin.right.bounds(0.025);
            IntervalRow {
                name: format!("{} … {} ({})", bin.range[0], bin.range[1], bin.right.of),
                value: 100.0 * bin.right.value(),
                low: 100.0 * low,
                high: 100.0 * high,
                expected: 100.0 * bin.stated,
                status: None,
            }
        })
        .collect();
    Ok(plot.to_svg()?)
}
