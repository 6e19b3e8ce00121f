//! What `armid identify` says: JSON, tables and page.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::json::Program;
use super::number::{significant, with_sigma};
use super::physical::{Physical, StandardParameter, standard_parameters};
use super::plot::{Axis, Colour, Grid, IntervalPlot, IntervalRow, Mark};
use super::{Column, Page, ReportError, Section, Status, Table, Verdict};
use crate::base::BaseSet;
use crate::identify::covariance::CovarianceKind;
use crate::identify::physical::PhysicalEstimate;
use crate::identify::{
    Condition, Estimator, FitError, Identification, Prediction, Processing, Regression, Residual,
    gravity_ratio, identifies_the_arm, not_identified,
};
use crate::log::Log;
use crate::robot::{Arm, JointSignals};

/// Format of the JSON output.
pub const IDENTIFY_SCHEMA: &str = "armid.identify/1";

const IDENTIFIED: &str = "identified";
const NOT_IDENTIFIED: &str = "not_identified";

/// What was identified, from what.
pub struct Training<'a> {
    /// The arm.
    pub arm: &'a Arm,
    /// Base parameters.
    pub set: &'a BaseSet,
    /// The logs.
    pub logs: &'a [&'a Log],
    /// The logs laid out for regression.
    pub regression: &'a Regression,
    /// The solution.
    pub identification: &'a Identification,
    /// Base parameters by the robot's description.
    pub nominal: &'a [f64],
}

/// The JSON of a log that leaves parameters without any trace in the torque: same schema, nothing
/// estimated.
#[derive(Debug, Clone, Serialize)]
pub struct Declined {
    robot: String,
    log: String,
    processing: Processing,
    base_parameters: Vec<BaseParameter>,
    standard_parameters: Option<Vec<()>>,
    not_identified: Vec<String>,
    warnings: Vec<String>,
    rows: Rows,
    verdict: &'static str,
}

impl Declined {
    /// `parameters`: names of the base parameters whose columns vanish or coincide.
    pub fn new(arm: &Arm, logs: &[&Log], regression: &Regression, parameters: Vec<String>) -> Self {
        Self {
            robot: arm.name.clone(),
            log: names(logs),
            processing: regression.prepared.processing.clone(),
            base_parameters: Vec::new(),
            standard_parameters: None,
            not_identified: parameters,
            warnings: regression.prepared.warnings.clone(),
            rows: Rows::of(logs),
            verdict: NOT_IDENTIFIED,
        }
    }

    /// The verdict in a sentence.
    pub fn sentence(&self) -> String {
        format!(
            "Declined: this motion does not identify the arm. Along it the columns of {} vanish or \
             depend on the others to within rounding. Record a motion that excites them (armid \
             excite).",
            self.not_identified.join(", ")
        )
    }

    /// A page with the verdict alone.
    pub fn page(&self, program: Program) -> Page {
        let facts = vec![format!("{} rows read, {} used", self.rows.read, self.rows.used)];
        let verdict = Verdict { status: Status::Bad, sentence: self.sentence(), facts };
        let subtitle = format!("{} from {}", self.robot, self.log);
        Page::new("Identified parameters", subtitle, verdict, program)
    }
}

/// A prediction of a log that was not used for the fit.
pub struct Validation {
    /// The log.
    pub log: PathBuf,
    /// Measured and predicted torque.
    pub prediction: Prediction,
    /// The manufacturer's feed-forward torque with the same processing, Nm.
    pub manufacturer: Option<Prediction>,
}

impl Validation {
    /// Of `theta` along `regression`; `manufacturer` is the same log laid out with the
    /// manufacturer's torque in place of the measured one.
    pub fn new(
        log: &Path,
        regression: &Regression,
        manufacturer: Option<&Regression>,
        theta: &[f64],
    ) -> Self {
        let prediction = Prediction::of(regression, theta);
        let manufacturer = manufacturer.map(|m| Prediction {
            predicted_nm: Prediction::of(m, theta).measured_nm,
            ..prediction.clone()
        });
        Self { log: log.to_owned(), prediction, manufacturer }
    }
}

/// The JSON of `armid identify`.
#[derive(Debug, Clone, Serialize)]
pub struct Result {
    robot: String,
    log: String,
    samples: usize,
    rate_hz: f64,
    processing: Processing,
    estimator: Estimator,
    covariance: CovarianceKind,
    covariance_reason: &'static str,
    base_parameters: Vec<BaseParameter>,
    /// Null: only combinations are known.
    standard_parameters: Option<Vec<StandardParameter>>,
    /// How the standard parameters were found; null without `--physical`.
    physical: Option<Physical>,
    residual: ResidualJson,
    noise_floor_nm: Option<Vec<f64>>,
    condition: Condition,
    not_identified: Vec<String>,
    validation: Vec<ValidationJson>,
    /// What the user should know.
    pub warnings: Vec<String>,
    rows: Rows,
    verdict: &'static str,
}

#[derive(Debug, Clone, Serialize)]
struct BaseParameter {
    name: String,
    formula: String,
    value: f64,
    unit: &'static str,
    sigma: f64,
    ci95: [f64; 2],
}

#[derive(Debug, Clone, Serialize)]
struct ResidualJson {
    rms_nm: Vec<f64>,
    relative_percent: Vec<f64>,
    e_n: f64,
}

impl From<Residual> for ResidualJson {
    fn from(r: Residual) -> Self {
        Self { rms_nm: r.rms_nm, relative_percent: r.relative_percent, e_n: r.e_n }
    }
}

#[derive(Debug, Clone, Serialize)]
struct ValidationJson {
    log: String,
    #[serde(flatten)]
    residual: ResidualJson,
    moving_rms_nm: Vec<f64>,
    manufacturer_rms_nm: Option<Vec<f64>>,
    manufacturer_moving_rms_nm: Option<Vec<f64>>,
}

#[derive(Debug, Clone, Serialize)]
struct Rows {
    read: usize,
    used: usize,
    set_aside: Vec<SetAside>,
}

#[derive(Debug, Clone, Serialize)]
struct SetAside {
    reason: &'static str,
    count: usize,
}

/// The logs by name, separated by commas.
fn names(logs: &[&Log]) -> String {
    logs.iter().map(|log| log.source.as_str()).collect::<Vec<_>>().join(", ")
}

impl Rows {
    fn of(logs: &[&Log]) -> Self {
        let mut rows = Self { read: 0, used: 0, set_aside: Vec::new() };
        for log in logs {
            rows.read += log.rows.read;
            rows.used += log.rows.used;
            for part in &log.rows.set_aside {
                let (reason, count) = (part.reason.text(), part.count);
                match rows.set_aside.iter_mut().find(|known| known.reason == reason) {
                    Some(known) => known.count += count,
                    None => rows.set_aside.push(SetAside { reason, count }),
                }
            }
        }
        rows
    }
}

/// Factor between gravity found and described beyond which it is remarked on: payloads and
/// tolerances of drive gains stay below.
const GRAVITY_OFF: f64 = 1.5;

impl Result {
    /// Collects everything that is said.
    pub fn of(
        training: &Training,
        validations: &[Validation],
    ) -> std::result::Result<Self, FitError> {
        let Training { arm, set, identification, regression, .. } = training;
        let sigma = identification.sigma();
        let quantile = identification.covariance.quantile_95();
        let half_width: Vec<f64> = sigma.iter().map(|s| quantile * s).collect();
        let open = not_identified(arm, set, &half_width);
        let base_parameters = (0..set.rank())
            .map(|k| {
                let value = identification.fit.theta[k];
                BaseParameter {
                    name: set.name(k).to_owned(),
                    formula: set.formula(k),
                    value,
                    unit: set.unit(k),
                    sigma: sigma[k],
                    ci95: [value - half_width[k], value + half_width[k]],
                }
            })
            .collect();
        let mut warnings = identification.warnings.clone();
        let ratio = gravity_ratio(arm, set, training.nominal, &identification.fit.theta);
        if let Some(ratio) = ratio.filter(|r| !(1.0 / GRAVITY_OFF..GRAVITY_OFF).contains(r)) {
            warnings.push(format!(
                "gravity torque is {ratio:.2} times what the description of {} says: another robot, \
                 a payload, or drive gains that are off?",
                arm.name
            ));
        }
        Ok(Self {
            robot: arm.name.clone(),
            log: names(training.logs),
            samples: identification.samples,
            rate_hz: regression.problem.rate_hz,
            processing: identification.processing.clone(),
            estimator: identification.estimator,
            covariance: identification.covariance.kind,
            covariance_reason: identification.covariance_reason,
            base_parameters,
            standard_parameters: None,
            physical: None,
            residual: identification.residual().into(),
            noise_floor_nm: identification.replicates.as_ref().map(|r| r.sigma.clone()),
            condition: Condition::of(&regression.problem, set)?,
            verdict: if identifies_the_arm(arm, set, &open) { IDENTIFIED } else { NOT_IDENTIFIED },
            not_identified: open.iter().map(|&k| set.name(k).to_owned()).collect(),
            validation: validations.iter().map(ValidationJson::of).collect(),
            warnings,
            rows: Rows::of(training.logs),
        })
    }

    /// Adds standard parameters that an arm can have.
    pub fn set_physical(&mut self, estimate: &PhysicalEstimate, training: &Training) {
        let problem = &training.regression.problem;
        self.standard_parameters = Some(standard_parameters(estimate, training.arm));
        self.physical = Some(Physical::of(estimate, problem));
        if estimate.evidence.model_is_wrong() {
            self.warnings.push(estimate.evidence.sentence());
        }
    }

    /// How the standard parameters were found.
    pub fn physical(&self) -> Option<&Physical> {
        self.physical.as_ref()
    }

    /// Whether the data do not identify the model.
    pub fn is_declined(&self) -> bool {
        self.verdict == NOT_IDENTIFIED
    }

    /// The verdict in a sentence.
    pub fn sentence(&self) -> String {
        let b = self.base_parameters.len();
        if self.is_declined() {
            let names = &self.not_identified;
            return format!(
                "Declined: this motion does not identify the arm. For {} of {b} base parameters the \
                 95 % interval is wider than anything an arm of this size could have: {}. Record a \
                 motion that excites them (armid excite).",
                names.len(),
                names.join(", ")
            );
        }
        let percent = self.residual.relative_percent.iter();
        let (low, high) = percent.fold((f64::INFINITY, 0f64), |(l, h), &p| (l.min(p), h.max(p)));
        let open = match self.not_identified.len() {
            0 => String::new(),
            n => format!(
                " {n} moments of inertia of light bodies stay open ({}): no torque in this motion \
                 depends on them.",
                self.not_identified.join(", ")
            ),
        };
        format!(
            "Identified {b} base parameters of {} from {} samples: what the model leaves of the \
             torque is {low:.1} to {high:.1} % per joint.{open}",
            self.robot, self.samples
        )
    }
}

impl ValidationJson {
    fn of(v: &Validation) -> Self {
        let rms = |f: fn(&Prediction) -> Residual| v.manufacturer.as_ref().map(|m| f(m).rms_nm);
        Self {
            log: v.log.display().to_string(),
            residual: v.prediction.residual().into(),
            moving_rms_nm: v.prediction.moving_residual().rms_nm,
            manufacturer_rms_nm: rms(Prediction::residual),
            manufacturer_moving_rms_nm: rms(Prediction::moving_residual),
        }
    }
}

/// Every base parameter with its σ and interval.
pub fn parameter_table(result: &Result) -> Table {
    let mut table = Table::new([
        Column::text("parameter"),
        Column::text("unit"),
        Column::number("estimate ± σ", ""),
        Column::number("95 % interval", ""),
        Column::text("combination"),
    ]);
    for p in &result.base_parameters {
        let open = result.not_identified.contains(&p.name);
        table.push_judged(
            open.then_some(Status::Bad),
            [
                p.name.clone(),
                p.unit.to_owned(),
                with_sigma(p.value, p.sigma),
                format!("{} … {}", significant(p.ci95[0], 4), significant(p.ci95[1], 4)),
                p.formula.clone(),
            ],
        );
    }
    table
}

/// Residual per joint: of the fit, and of every validation log with all and with moving samples.
pub fn residual_table(result: &Result) -> Table {
    let joints = result.residual.rms_nm.len();
    let columns = (1..=joints).map(|j| Column::number(format!("joint {j}"), ""));
    let mut table =
        Table::new([Column::text("rms"), Column::text("unit")].into_iter().chain(columns));
    let mut row = |name: String, unit: &str, values: &[f64]| {
        let cells = values.iter().map(|v| significant(*v, 3));
        table.push([name, unit.to_owned()].into_iter().chain(cells));
    };
    row("residual of the fit".into(), "Nm", &result.residual.rms_nm);
    row("… of the torque".into(), "%", &result.residual.relative_percent);
    if let Some(floor) = &result.noise_floor_nm {
        row("noise floor (scatter between periods)".into(), "Nm", floor);
    }
    for v in &result.validation {
        let name = Path::new(&v.log)
            .file_stem()
            .map_or_else(|| v.log.clone(), |stem| stem.to_string_lossy().into_owned());
        row(format!("{name}: prediction"), "Nm", &v.residual.rms_nm);
        row(format!("{name}: … moving samples"), "Nm", &v.moving_rms_nm);
        if let (Some(all), Some(moving)) = (&v.manufacturer_rms_nm, &v.manufacturer_moving_rms_nm) {
            row(format!("{name}: manufacturer's feed-forward"), "Nm", all);
            row(format!("{name}: … moving samples"), "Nm", moving);
        }
    }
    table
}

/// The page: verdict, torque measured and predicted, residuals, parameters.
pub fn page(
    result: &Result,
    training: &Training,
    validations: &[Validation],
    program: Program,
) -> std::result::Result<Page, ReportError> {
    let processing = &result.processing;
    let periods = match processing.period_s {
        Some(period) => format!(
            "{} periods of {period:.3} s averaged and differentiated as a Fourier series",
            processing.periods
        ),
        None => format!(
            "a single run, torque and regressor low-passed at {:.0} Hz",
            processing.cutoff_hz.unwrap_or(f64::NAN)
        ),
    };
    let facts = vec![
        format!("{} rows read, {} used; {periods}", result.rows.read, result.rows.used),
        format!(
            "estimator {}, σ from {}: {}",
            result.estimator, result.covariance, result.covariance_reason
        ),
        format!(
            "condition of the regressor {:.0}, with columns of unit length {:.1}; e_N = {:.4}",
            result.condition.regressor, result.condition.scaled, result.residual.e_n
        ),
    ];
    let status = if result.is_declined() { Status::Bad } else { Status::Good };
    let verdict = Verdict { status, sentence: result.sentence(), facts };
    let subtitle = format!("{} from {}", result.robot, result.log);
    let mut page = Page::new("Identified parameters", subtitle, verdict, program);
    let fit = Prediction::of(training.regression, &training.identification.fit.theta);
    let mut section = Section::new("Torque: measured and predicted")
        .figure(torque_figure("Torque along the training log", &fit)?, "")
        .figure(
            error_figure("What the model leaves", &fit)?,
            "Measured minus predicted torque. Structure that returns at every reversal or with \
             every period is not noise: the model lacks something.",
        )
        .table(residual_table(result), "Root mean square over all samples used");
    for warning in &result.warnings {
        section = section.note(Status::Warn, warning);
    }
    page.push(section);
    for v in validations {
        let name = v.log.file_stem().map_or_else(String::new, |s| s.to_string_lossy().into_owned());
        page.push(
            Section::new(format!("Validation on {name}"))
                .paragraph("Nothing is fitted to this log; same processing.")
                .figure(torque_figure("Torque along the validation log", &v.prediction)?, "")
                .figure(error_figure("What the model leaves", &v.prediction)?, ""),
        );
    }
    page.push(
        Section::new("Parameters")
            .figure(
                relative_sigma_figure(result)?,
                "σ relative to the estimate; parameters near zero are far right without being \
                 badly known.",
            )
            .table(parameter_table(result), "Base parameters, named by the column that is kept"),
    );
    if let (Some(physical), Some(standard)) = (&result.physical, &result.standard_parameters) {
        page.push(physical.section(standard));
    }
    Ok(page)
}

fn torque_figure(title: &str, p: &Prediction) -> std::result::Result<String, ReportError> {
    joints_figure(
        title,
        "Nm",
        p,
        &[
            ("measured", &p.measured_nm, Colour::MEASURED, Mark::ThinLine),
            ("predicted", &p.predicted_nm, Colour::MODEL, Mark::ThinLine),
        ],
    )
}

fn error_figure(title: &str, p: &Prediction) -> std::result::Result<String, ReportError> {
    let error = p.error_nm();
    joints_figure(title, "Nm", p, &[("residual", &error, Colour::AFTER, Mark::ThinLine)])
}

type JointLine<'a> = (&'a str, &'a JointSignals, Colour, Mark);

/// One panel per joint over time.
fn joints_figure(
    title: &str,
    unit: &str,
    p: &Prediction,
    lines: &[JointLine],
) -> std::result::Result<String, ReportError> {
    let mut grid = Grid::new(title, Axis::linear("time", "s"), Axis::linear("torque", unit));
    grid.columns = 2;
    grid.share_x = true;
    for j in 0..p.measured_nm.joints() {
        let mut panel = grid.panel(format!("joint {}", j + 1));
        for (name, signals, colour, mark) in lines {
            panel = panel.with(*name, &p.time_s, signals.joint(j), *colour, *mark);
        }
        grid.panels.push(panel);
    }
    Ok(grid.to_svg()?)
}

fn relative_sigma_figure(result: &Result) -> std::result::Result<String, ReportError> {
    let mut plot = IntervalPlot::new("σ of each parameter", Axis::log("σ / |estimate|", "%"));
    plot.columns = 2;
    plot.value_name = "relative σ".into();
    plot.rows = result
        .base_parameters
        .iter()
        .map(|p| IntervalRow {
            name: p.name.clone(),
            value: 100.0 * p.sigma / p.value.abs(),
            low: f64::NAN,
            high: f64::NAN,
            expected: f64::NAN,
            status: result.not_identified.contains(&p.name).then_some(Status::Bad),
        })
        .collect();
    Ok(plot.to_svg()?)
}
