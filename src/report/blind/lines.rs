//! One trial of the blind benchmark as lines of text: what it hid and what the diagnosis said.

use crate::montecarlo::blind::{Left, Named, Record, place};
use crate::number::percent;

/// A named cause in one line.
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

/// The case, its truth and the answer of the diagnosis, as lines for the terminal.
pub fn replay_lines(record: &Record) -> Vec<String> {
    let case = &record.case;
    let mut lines = vec![
        format!("trial {}: {case}", record.trial),
        format!("  √λ {:.1}, √λ_sim {:.1}", case.sqrt_lambda, case.sqrt_lambda_sim),
    ];
    lines.extend(case.cosine.map(|c| format!("  cosine between the two {c:.2}")));
    lines.extend(record.answer.named.iter().map(|n| format!("  named: {}", named_line(n))));
    let rest = |l: &Left| {
        let all = if l.of_all_joints { ", and on all joints together" } else { "" };
        format!("{:.3} Nm on joint {}, by the {}{all}", l.rms_nm, l.joint, l.axis)
    };
    lines.extend(record.answer.left.iter().map(|l| format!("  left: {}", rest(l))));
    lines.extend(record.answer.form_error.iter().map(|l| format!("  not exact: {}", rest(l))));
    lines.extend(record.answer.gain.map(|g| {
        let [removed, possible] = [g.share(), g.possible()].map(|share| percent(share, 3));
        format!(
            "  held out: {:.3} before, {:.3} after: {removed} removed of {possible} that a right model removes",
            g.before, g.after
        )
    }));
    lines.push(format!("outcome: {}", record.outcome()));
    lines
}
