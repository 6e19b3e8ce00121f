//! The scores as tables.

use crate::montecarlo::Share;
use crate::montecarlo::blind::{Judged, Scores, StrengthBin, Target};
use crate::number::percent;
use crate::report::{Column, Status, Table};

/// Formats a share, such as `12 of 40, 30.0 %`.
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

/// Every target with the measured value.
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
            Some(target.verdict.into()),
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

/// The range of a bin; non-breaking spaces keep it on one line.
pub(super) fn range([low, high]: [f64; 2]) -> String {
    if high.is_finite() { format!("{low}\u{a0}…\u{a0}{high}") } else { format!("≥\u{a0}{low}") }
}

/// Detection rates by the size of the effect.
pub(super) fn strength_table(bins: &[StrengthBin], right: &str) -> Table {
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
        table.push([
            range(bin.range),
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

pub(super) fn family_table(scores: &Scores) -> Table {
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

pub(super) fn confidence_table(scores: &Scores) -> Table {
    let mut table = Table::new([
        Column::text("stated confidence"),
        Column::number("mean", ""),
        Column::number("right", ""),
    ]);
    for bin in &scores.confidence {
        table.push([range(bin.range), format!("{:.4}", bin.stated), of(bin.right)]);
    }
    table
}

pub(super) fn gain_table(scores: &Scores) -> Table {
    let mut table = Table::new([
        Column::text("√λ"),
        Column::number("cases", ""),
        Column::number("removed, median", ""),
        Column::number("what the parameters' noise allows", ""),
    ]);
    for bin in &scores.gains {
        table.push([
            range(bin.range),
            bin.cases.to_string(),
            percent(bin.removed, 3),
            percent(bin.possible, 3),
        ]);
    }
    table
}

pub(super) fn condition_table(scores: &Scores) -> Table {
    let mut table =
        Table::new([Column::text("motion and noise"), Column::number("right at √λ ≥ 8", "")]);
    for (condition, share) in &scores.conditions {
        table.push([condition.clone(), of(*share)]);
    }
    table
}

/// Confusion table: what was named first for each hidden effect, most frequent answer first.
pub(super) fn confusion_table(scores: &Scores) -> Table {
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
