//! The report of `armid diagnose`: verdict in words, residuals before and after each cause, and the alternatives.

use super::json::Program;
use super::plot::{Axis, Colour, Grid, Mark};
use super::{
    Column, Folded, Page, ReportError, Section, Status, Table, Verdict, file_name, replay,
};
use crate::diagnose::{self, Cause, DetectionLimit, Diagnosis, Finding, Kind, class_holds};
use crate::number::{NONE, percent, resolved, significant};
use crate::robot::Arm;

/// The named causes with their parameters.
pub fn cause_table(diagnosis: &Diagnosis) -> Table {
    let mut table = Table::new([
        Column::text("cause"),
        Column::number("joint", ""),
        Column::text("parameter"),
        Column::number("value", ""),
        Column::text("95 % interval"),
        Column::text("unit"),
        Column::number("confidence", ""),
        Column::number("strength/σ", ""),
        Column::number("gain", ""),
    ]);
    for cause in &diagnosis.causes {
        for (k, (name, estimate)) in cause.parameters.iter().enumerate() {
            let once = |text: String| if k == 0 { text } else { String::new() };
            let width = estimate.ci95[1] - estimate.ci95[0];
            let [low, high] = estimate.ci95.map(|v| resolved(v, width));
            let place = match (k, cause.peak_joint) {
                (0, _) => joint(cause.joint),
                (_, Some(j)) if cause.joint.is_none() && *name == "peak_nm" => j.to_string(),
                _ => String::new(),
            };
            table.push([
                once(cause.kind.to_string()),
                place,
                (*name).to_owned(),
                resolved(estimate.value, width),
                // A value that is known exactly has no interval.
                if width == 0.0 { "–".to_owned() } else { format!("{low} … {high}") },
                estimate.unit.to_owned(),
                once(confidence(cause)),
                once(significant(cause.strength, 3)),
                once(cause.gain_fraction.map_or("–".to_owned(), |g| percent(g, 3))),
            ]);
        }
    }
    table
}

/// The confidence in a cause, rounded to what a probability among approximate laws can support. It ends in "if any"
/// where the interval of the effect's size includes zero.
fn confidence(cause: &Cause) -> String {
    let mut text = match cause.confidence {
        _ if cause.is_unlikely() => "< 0.1 %".to_owned(),
        c if c > 0.999 => "> 99.9 %".to_owned(),
        c => percent(c, 3),
    };
    if cause.may_be_none {
        text += ", if any";
    }
    text
}

/// Errors on held-out logs, without and with the causes.
pub fn held_out_table(diagnosis: &Diagnosis) -> Table {
    let columns = [Column::text("held-out log"), Column::text("rms"), Column::text("model")];
    let mut table = Table::new(columns.into_iter().chain(joint_columns(diagnosis, "Nm")));
    let list =
        |values: &[f64]| -> Vec<String> { values.iter().map(|v| significant(*v, 3)).collect() };
    let change = |before: &[f64], after: &[f64]| -> Vec<String> {
        before.iter().zip(after).map(|(before, after)| change(*before, *after)).collect()
    };
    for log in &diagnosis.held_out {
        let free = (&log.before_standstill_free_rms_nm, &log.after_standstill_free_rms_nm);
        let kinds = [
            (
                "moving",
                (&log.before_moving_rms_nm, &log.after_moving_rms_nm),
                [&log.noise_moving_rms_nm, &log.manufacturer_moving_rms_nm],
            ),
            (
                "all",
                (&log.before_rms_nm, &log.after_rms_nm),
                [&log.noise_rms_nm, &log.manufacturer_rms_nm],
            ),
            ("standstill free", free, [&None, &None]),
        ];
        let mut name = file_name(&log.log);
        for (mut samples, (before, after), others) in kinds {
            let others = ["noise alone", "manufacturer"].into_iter().zip(others);
            let others = others.filter_map(|(model, rms)| Some((model, list(rms.as_ref()?))));
            let rows = [
                ("before", list(before)),
                ("after", list(after)),
                ("change", change(before, after)),
            ];
            for (model, cells) in rows.into_iter().chain(others) {
                table.push([name, samples, model].map(str::to_owned).into_iter().chain(cells));
                (name, samples) = ("", "");
            }
        }
    }
    table
}

/// Relative change of an rms; none for a joint that never moves.
fn change(before: f64, after: f64) -> String {
    let change = after / before - 1.0;
    if change.is_finite() { format!("{:+.0} %", 100.0 * change) } else { NONE.to_owned() }
}

/// Caption of the table of detection limits.
const OF_ONE_SHAPE: &str = "Each is the limit of the shape in its last column alone: a law in another shape, such as a \
                            Stribeck curve that falls faster, has another limit.";

/// Detection limits: one row per family, one column per joint.
pub fn limit_table(diagnosis: &Diagnosis) -> Table {
    let head = [
        Column::text("found with 90 % probability"),
        Column::text("parameter"),
        Column::text("unit"),
        Column::number("arm", ""),
    ];
    let joints = joint_columns(diagnosis, "");
    let mut table = Table::new(head.into_iter().chain(joints).chain([Column::text("for")]));
    let same =
        |a: &DetectionLimit, b: &DetectionLimit| (a.kind, a.parameter) == (b.kind, b.parameter);
    for limits in diagnosis.detection_limits.chunk_by(same) {
        let at = |joint: Option<usize>| match limits.iter().find(|limit| limit.joint == joint) {
            Some(limit) => limit.value.map_or("absorbed".to_owned(), |v| significant(v, 3)),
            None => String::new(),
        };
        let first = &limits[0];
        let head = [first.kind.to_string(), first.parameter.to_owned(), first.unit.to_owned()];
        let joints = (1..=diagnosis.before.rms_nm.len()).map(Some);
        let values = std::iter::once(None).chain(joints).map(at);
        table.push(head.into_iter().chain(values).chain([given(limits)]));
    }
    table
}

/// The shape parameters for which `limits` hold.
fn given(limits: &[DetectionLimit]) -> String {
    let ranges = limits[0].given.keys().map(|name| {
        let values =
            limits.iter().flat_map(|limit| &limit.given).filter(|(other, _)| other == &name);
        let ends = |[low, high]: [f64; 2], (_, v): (&&str, &f64)| [low.min(*v), high.max(*v)];
        let [low, high] = values.fold([f64::INFINITY, f64::NEG_INFINITY], ends);
        let [low, high] = [low, high].map(|v| significant(v, 2));
        if low == high { format!("{name} {low}") } else { format!("{name} {low} … {high}") }
    });
    ranges.collect::<Vec<_>>().join(", ")
}

fn joint_columns<'a>(diagnosis: &Diagnosis, unit: &'a str) -> impl Iterator<Item = Column> + 'a {
    (1..=diagnosis.before.rms_nm.len()).map(move |j| Column::number(format!("joint {j}"), unit))
}

fn joint(joint: Option<usize>) -> String {
    joint.map_or("all".to_owned(), |j| j.to_string())
}

/// The diagnosis as a page.
pub fn page(finding: &Finding, arm: &Arm, program: Program) -> Result<Page, ReportError> {
    let diagnosis = &finding.diagnosis;
    let status = match diagnosis.verdict {
        diagnose::Verdict::NothingFound => Status::Good,
        diagnose::Verdict::CauseNamed => Status::Warn,
        diagnose::Verdict::Unexplained | diagnose::Verdict::Contradicted => Status::Bad,
    };
    let (folded, shown): (Vec<String>, Vec<String>) = diagnosis
        .sentences
        .iter()
        .cloned()
        .partition(|sentence| diagnosis.behind_the_overview.contains(sentence));
    let mut shown = shown.into_iter();
    let list =
        |values: &[f64]| values.iter().map(|v| significant(*v, 3)).collect::<Vec<_>>().join(", ");
    let sentence = shown.next().unwrap_or_default();
    let mut facts: Vec<String> = shown.collect();
    facts.push(format!(
        "Residual rms per joint: {} Nm before, {} Nm with the causes in the model.",
        list(&diagnosis.before.rms_nm),
        list(&diagnosis.after.rms_nm)
    ));
    if let (Some(of_mean), Some(floor)) = (&diagnosis.noise_of_mean_nm, &diagnosis.noise_floor_nm) {
        facts.push(format!(
            "Of these, noise of the mean of the periods, torque and encoders together: {} Nm. Noise of one sample of torque: {} Nm.",
            list(of_mean),
            list(floor)
        ));
    }
    let verdict = Verdict { status, sentence, facts };
    let subtitle = format!("{}, {}", arm.name, diagnosis.log);
    let mut page = Page::new("What the model gets wrong", subtitle, verdict, program);
    let are_many = !folded.is_empty();
    page.folded =
        are_many.then(|| Folded { title: "All causes in words".to_owned(), facts: folded });
    let each = diagnosis.causes.iter().map(|cause| cause_section(finding, cause));
    let each = each.collect::<Result<Vec<Section>, ReportError>>()?;
    if are_many {
        // Sections of their own would be a long way down to everything behind them.
        page.push(each.into_iter().fold(Section::new("Cause by cause"), Section::details));
    } else {
        page.extend(each);
    }
    page = page.with_warnings(&diagnosis.warnings);
    if let Some(replay) = &diagnosis.replay {
        page.push(replay::section(replay)?);
    }
    if let Some(unexplained) = &diagnosis.unexplained {
        let [x, y]: [Vec<f64>; 2] =
            [0, 1].map(|k| unexplained.curve.iter().map(|point| point[k]).collect());
        // The distance travelled since a reversal spans 0.1 mrad to radians, which calls for a logarithmic axis.
        let is_wide = x.first().zip(x.last()).is_some_and(|(a, b)| *a > 0.0 && *b > 100.0 * a);
        let scaled = if is_wide { Axis::log } else { Axis::linear };
        let axis = scaled(unexplained.axis, unexplained.unit);
        let mut grid = Grid::new("", axis, Axis::linear("torque", "Nm"));
        let panel = grid.panel(format!("Joint {}", unexplained.joint));
        grid.panels.push(panel.with("unexplained", &x, &y, Colour::MEASURED, Mark::DotsAndLine));
        page.push(
            Section::new("Not explained")
                .paragraph(if unexplained.of_all_joints {
                    "No known effect explains this. Only the joints together tell it from noise; the curve is that of the joint that \
                     shows most."
                } else {
                    "No known effect explains this part; the curve says on what it depends."
                })
                .figure(
                    grid.to_svg()?,
                    "Mean of the unexplained torque along the axis on which it depends most; behind reversals and since \
                     the start, in the direction of motion.",
                ),
        );
    }
    if !diagnosis.causes.is_empty() {
        page.push(Section::new("Causes in numbers").table(cause_table(diagnosis), ""));
    }
    if !diagnosis.held_out.is_empty() {
        page.push(
            Section::new("On logs that were not used")
                .paragraph("The same processing for every model; nothing was fitted to these logs.")
                .table(held_out_table(diagnosis), ""),
        );
    }
    if !diagnosis.detection_limits.is_empty() {
        page.push(
            Section::new("What would not have been seen").details(
                Section::new("Detection limits").table(limit_table(diagnosis), OF_ONE_SHAPE),
            ),
        );
    }
    Ok(page)
}

/// The section of one cause: residual before and after over the quantity the cause depends on, and the rejected
/// alternatives.
fn cause_section(finding: &Finding, cause: &Cause) -> Result<Section, ReportError> {
    let title = match cause.joint {
        Some(j) => format!("Joint {j}: {}", cause.in_words),
        None => format!("All joints: {}", cause.in_words),
    };
    let Diagnosis { before, after, .. } = &finding.diagnosis;
    let j = cause.joint.map_or_else(|| most_improved(&before.rms_nm, &after.rms_nm), |j| j - 1);
    let (label, unit, axis) = axis(finding, cause.kind, j);
    let residual = residual_axis(finding, j, "residual");
    let mut grid = Grid::new("", Axis::linear(label, unit), residual);
    grid.columns = 2;
    for (name, residual, colour) in [
        ("before", &finding.before_nm, Colour::BEFORE),
        ("after", &finding.after_nm, Colour::AFTER),
    ] {
        let panel = grid.panel(format!("Joint {}, {name}", j + 1));
        grid.panels.push(panel.with("", &axis, residual.joint(j), colour, Mark::Dots));
    }
    let mut table = Table::new([
        Column::text("alternative"),
        Column::number("joint", ""),
        Column::number("evidence behind, 2 ln", ""),
        Column::text("told apart"),
    ]);
    for rival in &cause.rivals {
        let in_class = class_holds(&cause.class, cause.joint, rival.kind, rival.joint);
        table.push([
            rival.kind.to_string(),
            joint(rival.joint),
            significant(rival.evidence_behind, 3),
            if in_class { "no" } else { "yes" }.to_owned(),
        ]);
    }
    Ok(Section::new(title)
        .figure(grid.to_svg()?, "Residual of the model without and with the causes.")
        .table(table, "What else was tried in its place, best first"))
}

/// The joint (0-based) whose rms drops most. A cause that concerns the whole arm is drawn for this joint.
fn most_improved(before_nm: &[f64], after_nm: &[f64]) -> usize {
    let drops = before_nm.iter().zip(after_nm).map(|(before, after)| before - after);
    let known = drops.enumerate().filter(|(_, drop)| !drop.is_nan());
    known.max_by(|(_, a), (_, b)| a.total_cmp(b)).map_or(0, |(j, _)| j)
}

/// An ordinate for the residual of joint `j` that is the same before and after, so that the two panels compare.
pub(super) fn residual_axis(finding: &Finding, j: usize, name: &str) -> Axis {
    let both = [&finding.before_nm, &finding.after_nm].map(|residual| residual.joint(j));
    let largest = both.into_iter().flatten().fold(0.0, |largest: f64, y| largest.max(y.abs()));
    let axis = Axis::linear(name, "Nm");
    if largest > 0.0 { axis.between(-1.05 * largest, 1.05 * largest) } else { axis }
}

/// The abscissa over which the residual of a family is drawn: label, unit and values.
fn axis(finding: &Finding, kind: Kind, j: usize) -> (&'static str, &'static str, Vec<f64>) {
    let scene = &finding.scene;
    let pick = |y: &[f64]| finding.samples.iter().map(|&k| y[k]).collect::<Vec<f64>>();
    match kind {
        Kind::Stribeck
        | Kind::NonlinearViscous
        | Kind::AsymmetricFriction
        | Kind::Presliding
        | Kind::ReversalWidth
        | Kind::FeedForward => ("speed", "rad/s", pick(scene.motion.qd_rad_s.joint(j))),
        Kind::LoadFriction => {
            let signed = scene.link_nm.joint(j).iter().zip(scene.sign.joint(j));
            (
                "gear torque in the direction of motion",
                "Nm",
                pick(&signed.map(|(l, s)| l.abs() * s).collect::<Vec<_>>()),
            )
        }
        Kind::TimeSkew => ("rate of the torque", "Nm/s", pick(&scene.torque_rate_nm_s(j))),
        Kind::VelocityLag => ("acceleration", "rad/s²", pick(scene.motion.qdd_rad_s2.joint(j))),
        Kind::Contact | Kind::ThermalDrift | Kind::ClockFault => {
            let time_s = |&k: &usize| scene.lead_in_s + k as f64 / scene.rate_hz;
            let name = if scene.periodic { "time, periods averaged" } else { "time" };
            (name, "s", finding.samples.iter().map(time_s).collect())
        }
        Kind::TorqueGain | Kind::Saturation => ("torque", "Nm", pick(scene.torque_nm.joint(j))),
        _ => ("angle", "rad", pick(scene.motion.q_rad.joint(j))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The rms of joint 3 is unknown (NaN), so it cannot be the one that improves most.
    #[test]
    fn what_concerns_all_joints_is_shown_where_it_is_seen() {
        assert_eq!(most_improved(&[1.0, 2.0, f64::NAN], &[0.9, 0.5, f64::NAN]), 1);
        assert_eq!(most_improved(&[], &[]), 0);
    }

    #[test]
    fn a_joint_that_never_moves_changes_by_nothing_that_could_be_said() {
        assert_eq!(change(2.0, 1.0), "-50 %");
        assert_eq!([change(f64::NAN, f64::NAN), change(0.0, 0.0)], [NONE; 2]);
    }
}
