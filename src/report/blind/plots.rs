//! The scores as figures.

use std::collections::{BTreeMap, BTreeSet};

use super::tables::range;
use crate::montecarlo::Share;
use crate::montecarlo::blind::{SAID_NOTHING, SAID_UNEXPLAINED, Scores, StrengthBin, power};
use crate::report::ReportError;
use crate::report::plot::{Axis, Band, Colour, HeatMap, IntervalPlot, IntervalRow, Mark, XyPlot};

/// √λ up to which answers by size are drawn: beyond it, only the strongest effects of a family would stretch the axis.
const DRAWN: f64 = 60.0;

pub(super) fn detection_plot(bins: &[StrengthBin]) -> Result<String, ReportError> {
    let bins: Vec<&StrengthBin> = bins.iter().filter(|bin| bin.mean <= DRAWN).collect();
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

pub(super) fn confusion_plot(scores: &Scores) -> Result<String, ReportError> {
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

pub(super) fn confidence_plot(scores: &Scores) -> Result<String, ReportError> {
    let mut plot = IntervalPlot::new("Right by stated confidence", Axis::linear("right", "%"));
    plot.value_name = "right, with 95 % interval".into();
    plot.expected_name = "stated".into();
    plot.rows = scores
        .confidence
        .iter()
        .map(|bin| {
            let [low, high] = bin.right.bounds(0.025);
            IntervalRow {
                name: format!("{} ({})", range(bin.range), bin.right.of),
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
