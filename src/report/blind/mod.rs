//! Reports of the blind benchmark: page, Markdown, and the lines that a replay prints.
//!
//! Input: the [`Scores`] of a run, or the [`Record`] of one trial. Output: a [`Page`], Markdown, or lines of text.

mod lines;
mod plots;
mod tables;

use super::json::Program;
use super::{Page, ReportError, Section, Status, Table, Verdict};
use crate::montecarlo::blind::{NAMED_RIGHTLY, Record, Scores, place};
use crate::number::percent;

use plots::{confidence_plot, confusion_plot, detection_plot};
use tables::{
    condition_table, confidence_table, confusion_table, family_table, gain_table, strength_table,
};

pub use lines::replay_lines;
pub use tables::target_table;

fn sentence(scores: &Scores) -> String {
    let [met, judged] = scores.met();
    let right = scores.targets.iter().find(|target| target.what == NAMED_RIGHTLY);
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

const HOW: &str = "Each case draws what is hidden (nothing, one effect, two, one whose family is taken out of the \
dictionary, or a change of the arm with a law beside it, which is compared with the arm's simulation), where, its shape and size, the motion and the colour of the noise. The effect is made by the plant's physics; \
the diagnosis sees the log alone. √λ is the size of the effect in standard deviations of the noise (of torques and \
encoders) of the best test that could be made; where the null model absorbs the effect, √λ_sim, against a given simulation. A name is right if kind and \
joint are, or if the class that the diagnosis states holds them. Of one effect the first cause counts. Strong effects have targets of their own and count nowhere else but among the causes named with confidence.";

/// Most misses that the report lists.
const LISTED: usize = 60;

fn misses(scores: &Scores) -> Vec<String> {
    let line = |r: &Record| {
        let hidden: Vec<String> = r.case.hidden.iter().map(ToString::to_string).collect();
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

/// The tables that page and Markdown share: heading, introductory text, table.
fn parts(scores: &Scores) -> Vec<(&'static str, &'static str, Table)> {
    let mut parts = vec![
        ("Targets", HOW, target_table(scores)),
        (
            "Detection by size",
            "Single effects that the residual shows. The power is that of a test of one coefficient among as many as the \
             dictionary has families and sites, at the rate of false alarms by which laws are named.",
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
        (
            "Strong effects",
            "Single effects far above the noise, or as far as physics allows, by √λ or √λ_sim. Here chance says nothing \
             more; a second cause, or a rest without a name, shows where a law is not exact enough.",
            strength_table(&scores.strong, "right, and nothing else said"),
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
            "Mean square, without noise, along a motion that was not used: the share that the named causes remove, and the \
             share that a right model removes whose parameters are identified under the same noise (the arm without the \
             effect is logged, identified and predicted along that motion).",
            gain_table(scores),
        ));
    }
    parts
}

/// The scores as Markdown, with the command that produced them and the `seed` of the trials.
pub fn markdown(scores: &Scores, command: &str, seed: u64) -> String {
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
    text += &format!(
        "\n## Misses\n\nFalse alarms, single effects with √λ ≥ 8 that were not named, pairs of which one was not, \
         wrong names of withheld families, and strong effects beside which something else was said. \
         `montecarlo --scenario … --seed {seed} --trial K` replays trial K of the scenario “{}”.\n",
        scores.scenario
    );
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

/// The scores as a page.
pub fn page(scores: &Scores, program: Program) -> Result<Page, ReportError> {
    let status = Status::from(scores.verdict).of_a_part(&scores.missing);
    let verdict = Verdict { status, sentence: sentence(scores), facts: facts(scores) };
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
