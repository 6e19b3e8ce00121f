//! What a trial hides and what is said of it, in lines of text.

use crate::montecarlo::blind::{Hidden, Named, Record};
use crate::report::number::percent;

/// A site in words.
pub(super) fn place(joint: Option<usize>) -> String {
    joint.map_or_else(|| "arm".into(), |j| format!("joint {j}"))
}

/// A hidden effect in a line.
pub(super) fn hidden_line(hidden: &Hidden) -> String {
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
