//! The study of section IV of the paper on the simulated arm: page, Markdown and tables.

use super::json::Program;
use super::plot::{Axis, Colour, Grid, Mark, XyPlot};
use super::{Column, Page, ReportError, Section, Status, Table, Verdict};
use crate::montecarlo::study::{ErrorResult, Mechanism, MechanismResult, PaperStudy, Trace};
use crate::number::{percent, significant};
use crate::robot::JointSignals;

/// e_N that the paper reports in (34) and (35).
const PAPER_E_N: [f64; 2] = [0.0279, 0.0152];
/// Length of the trajectories in the figures, s, as in the paper.
const SHOWN_S: f64 = 10.0;

const SETTING: &str = "The arm is the simulated UR5 with all its products of inertia and centres of mass; the model is the \
paper's: 33 parameters, its (30). Velocities are taken from the log, accelerations are made by (33) forward and backward at 10 Hz, \
read as one derivative and a low-pass; the parameters are those of plain least squares, (19), and σ is (20) as printed. The \
paper's own arm is not at hand: its e_N stand beside ours for the size, not as a target.";

const E_N_NOTE: &str = "e_N = √(eᵀe)/m is (21), m the number of time samples, e over all six joints: the definition behind (34) \
and (35). It is not an rms: it falls as 1/√m. A model that is exact would reach the e_N of the noise alone.";

/// The cost of the reduced parameter set on an arm that the full model describes exactly, in words.
fn reduction(study: &PaperStudy) -> String {
    let of = |parameters: fn(usize) -> bool| {
        let exact = |e: &&ErrorResult| !e.hidden_effects && !e.torque_filtered;
        study.errors.iter().filter(exact).find(|e| parameters(e.parameters))
    };
    let (Some(reduced), Some(full)) = (of(|n| n == 33), of(|n| n == 52)) else {
        return String::new();
    };
    let mean = |e: &ErrorResult| {
        let squares: f64 = e.validation_rms_without_noise_nm.iter().map(|v| v * v).sum();
        (squares / e.validation_rms_without_noise_nm.len() as f64).sqrt()
    };
    let percent = |k: usize| 100.0 * (reduced.e_n[k] / full.e_n[k] - 1.0);
    format!(
        "The 33 parameters leave out products of inertia, two coordinates of every centre of mass, and most of \
         body 1; 52 are all that torque can tell of this arm. On the arm with viscous and Coulomb friction only, \
         which the 52 describe exactly, leaving them out changes e_N by {:+.1} % on the identification \
         trajectory and by {:+.1} % on the other. Against the torque without noise the validation error, rms over \
         the joints, is {} Nm with {} parameters and {} Nm with {}: what the smaller model gets wrong weighs \
         against what the larger one scatters.",
        percent(0),
        percent(1),
        significant(mean(reduced), 3),
        reduced.parameters,
        significant(mean(full), 3),
        full.parameters,
    )
}

const SIGMA: &str = "σ of (20) leaves out the variance of the noise, takes it for white, and for the same on every joint. Beside it \
stands the scatter of the estimates over fresh noise; a ratio of 1 is a σ that is true. The value of the arm is that of the combination \
with everything left out of the model taken as zero, so that mean minus arm is what the reduction and the unmodelled friction do to it.";

const START: &str = "Before t = 0 the arm has come to rest where its motion starts, and what friction held it with is still in the \
gear: the drive carries it, a model of friction by speed alone knows nothing of it at standstill. Noise is left out here.";

const MECHANISMS: &str = "The paper reports negative rotor inertias and a mass matrix that is not positive definite in some poses. Each \
row hides one mechanism in the same arm, without static friction, and identifies it by the paper's processing, noise left out. \
These are candidates: that a mechanism makes rotor inertias negative here does not show that it was at work in the paper's data.";

/// The verdict in a sentence.
fn sentence(study: &PaperStudy) -> String {
    let [first, second] = study.errors[0].e_n;
    let ratios = || study.parameters.iter().map(|p| p.sigma_empirical / p.sigma_paper);
    let (least, most) = ratios().fold((f64::INFINITY, 0.0_f64), |(a, b), r| (a.min(r), b.max(r)));
    let negative: Vec<String> = study
        .mechanisms
        .iter()
        .filter(|m| any_negative(m))
        .map(|m| m.mechanism.to_string())
        .collect();
    let found = match negative.len() {
        0 => "no mechanism tried makes a rotor inertia negative".to_owned(),
        n => format!(
            "of {} mechanisms tried {n} make rotor inertias negative ({})",
            study.mechanisms.len() - 1,
            negative.join("; ")
        ),
    };
    format!(
        "By the paper's own processing its 33 parameters predict our arm with e_N = {first:.4} and, on \
         the second trajectory, {second:.4} (paper: {} and {}; our noise alone: {:.4}); the scatter of its \
         parameters is {least:.2} to {most:.2} times its σ; {found}.",
        PAPER_E_N[0], PAPER_E_N[1], study.noise_e_n
    )
}

fn any_negative(result: &MechanismResult) -> bool {
    result.rotor_inertia_kg_m2.iter().any(|ia| *ia < 0.0)
}

fn joined(values: &[f64], digits: usize) -> String {
    values.iter().map(|v| significant(*v, digits)).collect::<Vec<_>>().join(" / ")
}

fn error_table(study: &PaperStudy) -> Table {
    let mut table = Table::new([
        Column::text("arm"),
        Column::number("parameters", ""),
        Column::text("torque"),
        Column::number("e_N identification", ""),
        Column::number("e_N validation", ""),
    ]);
    for e in &study.errors {
        table.push([
            arm(e.hidden_effects).to_owned(),
            e.parameters.to_string(),
            if e.torque_filtered { "low-passed, 10 Hz" } else { "as measured" }.to_owned(),
            format!("{:.4}", e.e_n[0]),
            format!("{:.4}", e.e_n[1]),
        ]);
    }
    table
}

fn joint_table(study: &PaperStudy) -> Table {
    let mut table = Table::new([
        Column::text("arm"),
        Column::number("parameters", ""),
        Column::text("against"),
        Column::number("rms, joints 1 / … / 6", "Nm"),
    ]);
    for e in study.errors.iter().filter(|e| !e.torque_filtered) {
        let rows = [
            ("measured torque", &e.validation_rms_nm),
            ("torque without noise", &e.validation_rms_without_noise_nm),
        ];
        for (against, rms_nm) in rows {
            table.push([
                arm(e.hidden_effects).to_owned(),
                e.parameters.to_string(),
                against.to_owned(),
                joined(rms_nm, 3),
            ]);
        }
    }
    table
}

fn arm(hidden_effects: bool) -> &'static str {
    if hidden_effects { "static friction" } else { "viscous and Coulomb friction only" }
}

fn parameter_table(study: &PaperStudy) -> Table {
    let mut table = Table::new([
        Column::number("", ""),
        Column::text("parameter"),
        Column::text("unit"),
        Column::number("arm", ""),
        Column::number("estimate", ""),
        Column::number("σ of (20)", ""),
        Column::number("mean", ""),
        Column::number("scatter", ""),
        Column::number("scatter/σ", ""),
    ]);
    for (k, p) in study.parameters.iter().enumerate() {
        table.push([
            (k + 1).to_string(),
            p.formula.clone(),
            p.unit.clone(),
            significant(p.truth, 4),
            significant(p.estimate, 4),
            significant(p.sigma_paper, 2),
            significant(p.mean, 4),
            significant(p.sigma_empirical, 2),
            format!("{:.2}", p.sigma_empirical / p.sigma_paper),
        ]);
    }
    table
}

fn start_table(study: &PaperStudy) -> Table {
    let mut table = Table::new([
        Column::text("arm"),
        Column::text(""),
        Column::number("joints 1 / … / 6", "Nm"),
    ]);
    for s in &study.starts {
        let arm = arm(s.hidden_effects);
        table.push([arm, "error at t = 0", &joined(&s.error_at_zero_nm, 3)]);
        table.push([arm, "rms over the trajectory", &joined(&s.rms_nm, 3)]);
        table.push([arm, "identified Coulomb friction", &joined(&s.coulomb_nm, 3)]);
    }
    table
}

fn mechanism_table(study: &PaperStudy) -> Table {
    let mut table = Table::new([
        Column::text("mechanism"),
        Column::number("Ia3", "kg m²"),
        Column::number("Ia4", "kg m²"),
        Column::number("Ia5", "kg m²"),
        Column::number("Ia6", "kg m²"),
        Column::number("e_N", ""),
        Column::number("poses with an indefinite mass matrix", ""),
        Column::number("its smallest eigenvalue", "kg m²"),
    ]);
    for m in &study.mechanisms {
        let status = if any_negative(m) { Status::Bad } else { Status::Good };
        let [a, b, c, d] = m.rotor_inertia_kg_m2.map(|ia| format!("{ia:.3}"));
        table.push_judged(
            Some(status),
            [
                m.mechanism.to_string(),
                a,
                b,
                c,
                d,
                format!("{:.4}", m.e_n),
                percent(m.indefinite_share, 3),
                format!("{:.3}", m.smallest_eigenvalue_kg_m2),
            ],
        );
    }
    table
}

/// The study as a page.
pub fn page(study: &PaperStudy, program: Program) -> Result<Page, ReportError> {
    let verdict = Verdict { status: Status::Warn, sentence: sentence(study), facts: Vec::new() };
    let subtitle = study.description.clone();
    let mut page =
        Page::new("The paper's section IV on the simulated arm", subtitle, verdict, program);
    let [first, second] = &study.traces;
    page.push(
        Section::new("How well the model predicts")
            .paragraph(SETTING)
            .table(error_table(study), "")
            .paragraph(E_N_NOTE)
            .paragraph(reduction(study))
            .details(
                Section::new("Joint by joint, on the validation trajectory")
                    .table(joint_table(study), "Torque as measured."),
            ),
    );
    page.push(
        Section::new("Identification: figures 2 and 3")
            .figure(angles("Figure 2: the identification trajectory", first)?, "")
            .figure(currents(first)?, ""),
    );
    page.push(
        Section::new("Parameters: figure 4")
            .paragraph(SIGMA)
            .figure(parameter_figure(study)?, "")
            .figure(sigma_figure(study)?, "")
            .details(
                Section::new("The 33 parameters")
                    .table(parameter_table(study), format!("{} trials", study.trials)),
            ),
    );
    page.push(Section::new("Torques: figures 5 to 7").figure(
        torques("Figures 5–7: torques along the identification trajectory", first)?,
        "Measured and predicted.",
    ));
    page.push(
        Section::new("Validation: figures 8 to 11")
            .figure(angles("Figure 8: the validation trajectory", second)?, "")
            .figure(
                torques("Figures 9–11: torques along the validation trajectory", second)?,
                "Measured, and predicted with the parameters of the other trajectory.",
            ),
    );
    page.push(
        Section::new("The error at t = 0")
            .paragraph(START)
            .table(start_table(study), "")
            .figure(start_figure(first)?, "The first 0.8 s of figures 5–7, noise included."),
    );
    page.push(
        Section::new("Negative rotor inertias")
            .paragraph(MECHANISMS)
            .table(mechanism_table(study), "")
            .figure(
                mechanism_figure(study)?,
                "Rotor inertias against the size of the mechanism, in units of the arm's own.",
            ),
    );
    Ok(page)
}

fn shown(trace: &Trace, seconds: f64) -> usize {
    trace.time_s.partition_point(|t| *t <= seconds)
}

fn angles(title: &str, trace: &Trace) -> Result<String, ReportError> {
    all_joints(XyPlot::new(title, time(), Axis::linear("angle", "rad")), trace, &trace.q_rad, "q")
}

fn currents(trace: &Trace) -> Result<String, ReportError> {
    let plot = XyPlot::new("Figure 3: motor currents", time(), Axis::linear("current", "A"));
    all_joints(plot, trace, &trace.current_a, "I")
}

fn time() -> Axis {
    Axis::linear("time", "s")
}

fn all_joints(
    mut plot: XyPlot,
    trace: &Trace,
    signals: &JointSignals,
    symbol: &str,
) -> Result<String, ReportError> {
    let n = shown(trace, SHOWN_S);
    for j in 0..signals.joints() {
        plot = plot.with(
            format!("{symbol}{}", j + 1),
            &trace.time_s[..n],
            &signals.joint(j)[..n],
            Colour::series(j),
            Mark::ThinLine,
        );
    }
    Ok(plot.to_svg()?)
}

fn torques(title: &str, trace: &Trace) -> Result<String, ReportError> {
    torque_grid(title, trace, SHOWN_S)
}

fn start_figure(trace: &Trace) -> Result<String, ReportError> {
    torque_grid("Leaving rest", trace, 0.8)
}

fn torque_grid(title: &str, trace: &Trace, seconds: f64) -> Result<String, ReportError> {
    let n = shown(trace, seconds);
    let mut grid = Grid::new(title, time(), Axis::linear("torque", "Nm"));
    grid.columns = 2;
    for j in 0..trace.measured_nm.joints() {
        let x = &trace.time_s[..n];
        let panel = grid
            .panel(format!("joint {}", j + 1))
            .with("measured", x, &trace.measured_nm.joint(j)[..n], Colour::MEASURED, Mark::ThinLine)
            .with("predicted", x, &trace.predicted_nm.joint(j)[..n], Colour::MODEL, Mark::ThinLine);
        grid.panels.push(panel);
    }
    Ok(grid.to_svg()?)
}

fn parameter_figure(study: &PaperStudy) -> Result<String, ReportError> {
    let index: Vec<f64> = (1..=study.parameters.len()).map(|k| k as f64).collect();
    let of = |f: &dyn Fn(usize) -> f64| (0..study.parameters.len()).map(f).collect::<Vec<f64>>();
    let plot = XyPlot::new(
        "Figure 4: base parameters",
        Axis::linear("index in the base vector", ""),
        Axis::linear("value", "SI"),
    )
    .with("arm", &index, &of(&|k| study.parameters[k].truth), Colour::REFERENCE, Mark::Dots)
    .with("estimate", &index, &of(&|k| study.parameters[k].estimate), Colour::AFTER, Mark::Dots)
    .with(
        "σ of (20)",
        &index,
        &of(&|k| study.parameters[k].sigma_paper),
        Colour::MODEL,
        Mark::Dots,
    );
    Ok(plot.to_svg()?)
}

fn sigma_figure(study: &PaperStudy) -> Result<String, ReportError> {
    let index: Vec<f64> = (1..=study.parameters.len()).map(|k| k as f64).collect();
    let of = |f: &dyn Fn(usize) -> f64| (0..study.parameters.len()).map(f).collect::<Vec<f64>>();
    let plot = XyPlot::new(
        "σ as printed and σ as it is",
        Axis::linear("index in the base vector", ""),
        Axis::log("σ", "SI"),
    )
    .with(
        "σ of (20)",
        &index,
        &of(&|k| study.parameters[k].sigma_paper),
        Colour::MODEL,
        Mark::DotsAndLine,
    )
    .with(
        "scatter over fresh noise",
        &index,
        &of(&|k| study.parameters[k].sigma_empirical),
        Colour::AFTER,
        Mark::DotsAndLine,
    );
    Ok(plot.to_svg()?)
}

/// Ia3 … Ia6 relative to their values without any mechanism, over the delay and over the presliding angle.
fn mechanism_figure(study: &PaperStudy) -> Result<String, ReportError> {
    let Some(nothing) = study.mechanisms.iter().find(|m| m.mechanism == Mechanism::Nothing) else {
        return Ok(String::new());
    };
    let relative =
        |m: &MechanismResult, k: usize| m.rotor_inertia_kg_m2[k] / nothing.rotor_inertia_kg_m2[k];
    let late: Vec<(f64, &MechanismResult)> = study
        .mechanisms
        .iter()
        .filter_map(|m| match m.mechanism {
            Mechanism::Nothing => Some((0.0, m)),
            Mechanism::Delay { delay_s } => Some((1e3 * delay_s, m)),
            _ => None,
        })
        .collect();
    let bristles: Vec<(f64, &MechanismResult)> = study
        .mechanisms
        .iter()
        .filter_map(|m| match m.mechanism {
            Mechanism::Nothing => Some((0.0, m)),
            Mechanism::Presliding { stiffness_per_rad } => Some((1e3 / stiffness_per_rad, m)),
            _ => None,
        })
        .collect();
    let y = Axis::linear("identified over true rotor inertia", "");
    let mut grid =
        Grid::new("Rotor inertia against the size of the mechanism", Axis::linear("", ""), y);
    grid.columns = 2;
    grid.share_x = false;
    for (title, points) in [("torque late, by ms", late), ("presliding, over mrad", bristles)] {
        let mut panel = grid.panel(title).with_marker(super::plot::Across::Y, 0.0, "");
        let x: Vec<f64> = points.iter().map(|(x, _)| *x).collect();
        for k in 0..4 {
            let y: Vec<f64> = points.iter().map(|(_, m)| relative(m, k)).collect();
            panel =
                panel.with(format!("Ia{}", k + 3), &x, &y, Colour::series(k), Mark::DotsAndLine);
        }
        grid.panels.push(panel);
    }
    Ok(grid.to_svg()?)
}

/// The study as Markdown, with the command that produced it.
pub fn markdown(study: &PaperStudy, command: &str) -> String {
    format!(
        "# The paper's section IV on the simulated arm\n\n{}\n\n    {command}\n\n{SETTING}\n\n## How well the \
         model predicts\n\n{}\n{E_N_NOTE}\n\n{}\n\n{}\n## The error at t = 0\n\n{START}\n\n{}\n## Negative \
         rotor inertias\n\n{MECHANISMS}\n\n{}\n## The 33 parameters\n\n{SIGMA}\n\n{} trials.\n\n{}",
        sentence(study),
        error_table(study).to_markdown(),
        reduction(study),
        joint_table(study).to_markdown(),
        start_table(study).to_markdown(),
        mechanism_table(study).to_markdown(),
        study.trials,
        parameter_table(study).to_markdown(),
    )
}
