//! The numbers of one row of a file.

use super::account::Reason;
use super::layout::Block;
use super::lines::Line;
use super::plan::Plan;

/// What is wrong with a row: `at` is the column (from 0) or, for a wrong number of fields, that number.
pub(super) struct Defect {
    pub(super) reason: Reason,
    pub(super) at: usize,
}

/// Writes the numbers of one row, in SI units, into `values`; unusable fields of optional blocks become NaN.
pub(super) fn parse(plan: &Plan, line: &Line, values: &mut [f64]) -> Result<(), Defect> {
    let mut defect = None;
    let mut count = 0;
    let mut last_is_empty = false;
    for (at, text) in plan.delimiter.split(&line.bytes).enumerate() {
        count += 1;
        last_is_empty = text.is_empty();
        let Some(&Some(place)) = plan.place.get(at) else { continue };
        let field = &plan.fields[place];
        let value = number(text, plan.decimal_comma)
            .map(|raw| field.factor.map_or(raw, |factor| raw * factor))
            .and_then(|value| {
                let is_plausible = value.abs() <= field.block.bound();
                if is_plausible { Ok(value) } else { Err(Reason::Implausible) }
            });
        match value {
            Ok(value) => values[place] = value,
            Err(_) if field.block.is_optional() => values[place] = f64::NAN,
            Err(reason) => defect = defect.or(Some(Defect { reason, at })),
        }
    }
    // A trailing delimiter does not start another field.
    let surplus = usize::from(last_is_empty && count == plan.width + 1);
    let fields = count - surplus;
    let last_is_used = plan.place.last().is_some_and(Option::is_some);
    let reason = if !line.ended && surplus == 0 && (fields < plan.width || last_is_used) {
        Some(Reason::CutShort)
    } else {
        match fields.cmp(&plan.width) {
            std::cmp::Ordering::Less => Some(Reason::TooFewFields),
            std::cmp::Ordering::Greater => Some(Reason::TooManyFields),
            std::cmp::Ordering::Equal => None,
        }
    };
    if let Some(defect) = reason.map(|reason| Defect { reason, at: fields }).or(defect) {
        return Err(defect);
    }
    if let (Some(time), Some(rest)) = (plan.range(Block::Time), plan.range(Block::TimeNanoseconds))
    {
        values[time.start] += values[rest.start];
    }
    Ok(())
}

fn number(text: &[u8], decimal_comma: bool) -> Result<f64, Reason> {
    if text.is_empty() {
        return Err(Reason::EmptyField);
    }
    let text = std::str::from_utf8(text).map_err(|_| Reason::NotANumber)?;
    let value: Result<f64, _> =
        if decimal_comma { text.replace(',', ".").parse() } else { text.parse() };
    match value {
        Ok(value) if value.is_finite() => Ok(value),
        Ok(_) => Err(Reason::NotFinite),
        Err(_) => Err(Reason::NotANumber),
    }
}

/// Whether the text is a number once its only comma is replaced by a point, such as "0,25" or "-1,5e3".
pub(super) fn is_decimal_comma(text: &str) -> bool {
    text.matches(',').count() == 1 && text.replace(',', ".").parse::<f64>().is_ok()
}

/// Shortens a value for messages; uninitialised doubles can print as 300 digits.
pub(super) fn abridged(text: &str) -> String {
    const SHOWN: usize = 24;
    match text.char_indices().nth(SHOWN) {
        Some((end, _)) => format!("{}… ({} characters)", &text[..end], text.chars().count()),
        None => text.to_owned(),
    }
}
