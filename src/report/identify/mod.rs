//! The report of `armid identify`: JSON, tables and page.
//!
//! Input: the logs, what was identified from them, and the logs for validation. Output: the [`Result`] that becomes
//! JSON, or the reason why there is none ([`Declined`]), and a [`Page`](crate::report::Page).

mod declined;
mod drift;
mod foreign;
mod held;
mod intervals;
mod page;
mod short_names;

use std::path::PathBuf;

use serde::Serialize;

pub use declined::{Declined, NOTHING_MOVES};
use declined::{remedy, rest_in_words};
pub use drift::DriftResult;
pub use held::HeldResult;
pub use intervals::{AgreementResult, Intervals, TestResult};
pub use page::{facts, page, parameter_table, residual_table};

use super::misread::MisreadLog;
use super::physical::{Physical, StandardParameter, standard_parameters};
use super::rows::{Rows, log_warnings, names};
use crate::base::BaseSet;
use crate::identify::covariance::CovarianceKind;
use crate::identify::physical::PhysicalEstimate;
use crate::identify::{
    Condition, Doubt, Estimator, FitError, Identification, Lowered, Prediction, Processing,
    Regression, Residual, Rest, drive_limit_remark, identifies_the_arm, not_identified, unlike,
};
use crate::log::Log;
use crate::robot::{Arm, Kinematics};

/// Schema of the JSON output.
pub const IDENTIFY_SCHEMA: &str = "armid.identify/1";

/// Degrees of freedom below which the user is warned. At 10, Student's 95 % interval is 14 % longer than ±1.96 σ.
const FEW_DEGREES_OF_FREEDOM: f64 = 10.0;

const IDENTIFIED: &str = "identified";
/// Verdict on a log that leaves parameters open.
pub const NOT_IDENTIFIED: &str = "not_identified";
/// Verdict if no arm can have the identified parameters, or if the log fits only when its channels are read
/// differently.
pub const CONTRADICTED: &str = "contradicted";

/// An identification with everything that it was made from.
pub struct Training<'a> {
    /// The arm.
    pub arm: &'a Arm,
    /// How the arm was loaded: a built-in name, or a file and possibly the last link of the arm.
    pub robot_source: &'a str,
    /// The base parameters.
    pub set: &'a BaseSet,
    /// The logs.
    pub logs: &'a [&'a Log],
    /// The logs, laid out for regression.
    pub regression: &'a Regression,
    /// The solution.
    pub identification: &'a Identification,
    /// Base parameters according to the robot's description.
    pub nominal: &'a [f64],
    /// Name of the reduced parameter set; `None` if the full set was identified.
    pub reduced: Option<&'a str>,
    /// The first log that fits the arm only when its channels are read differently; `None` if there is none.
    pub misread: Option<&'a MisreadLog>,
}

impl Training<'_> {
    /// Half-widths of the 95 % intervals of all base parameters.
    fn half_widths(&self) -> Vec<f64> {
        let quantile = self.identification.covariance.quantile_95();
        self.identification.sigma().iter().map(|sigma| quantile * sigma).collect()
    }

    /// The base parameters that the logs leave open.
    fn open(&self) -> Vec<usize> {
        not_identified(self.arm, self.set, &self.half_widths())
    }

    /// Begins a remark on `log` with its name, where there are several.
    fn named(&self, log: &str, remark: String) -> String {
        if self.logs.len() > 1 { format!("{log}: {remark}") } else { remark }
    }

    /// What makes it doubtful that the parameters belong to this robot. That a log is misread explains every other
    /// doubt.
    fn doubt(&self) -> Option<Doubt> {
        let Self { arm, set, identification, .. } = self;
        if let Some(MisreadLog { log, misreading, .. }) = self.misread {
            return Some(Doubt::contradiction(self.named(log, misreading.sentence())));
        }
        let doubt = Doubt::of(
            (*arm, *set),
            self.nominal,
            &identification.fit.theta,
            &identification.sigma(),
            &identification.covariance,
            &self.regression.prepared.motion.q_rad,
            &identification.residual().torque_rms_nm,
        );
        Doubt::or_unlike(doubt, unlike(arm, &identification.left()))
    }

    /// The verdict with the base parameters `open` and a `doubt`.
    fn verdict(&self, open: &[usize], doubt: Option<&Doubt>) -> &'static str {
        match doubt {
            // What a misread log does not tell need not be a matter of its motion.
            _ if self.misread.is_some() => CONTRADICTED,
            _ if !identifies_the_arm(self.arm, self.set, open) => NOT_IDENTIFIED,
            Some(doubt) if doubt.is_contradiction() => CONTRADICTED,
            _ => IDENTIFIED,
        }
    }

    /// All remarks: on the logs, on the fit with its `doubt`, on the `validations`, and on the drives.
    fn warnings(&self, doubt: Option<&Doubt>, validations: &[Validation]) -> Vec<String> {
        let Self { identification, regression, .. } = self;
        let mut warnings: Vec<String> =
            self.logs.iter().flat_map(|log| log_warnings(log)).collect();
        warnings.extend(identification.warnings.clone());
        warnings.extend(drift::remarks(self));
        warnings.extend(held::remarks(self));
        warnings.extend(identification.lack_of_fit.and_then(|lack| lack.warning()));
        warnings.extend(few_degrees_of_freedom(identification.covariance.degrees_of_freedom));
        warnings.extend(doubt.map(Doubt::sentence));
        warnings.extend(doubt.and_then(|_| self.lowered()));
        // For a misread log, no further remark about the fit makes sense.
        warnings.extend(unrelated(&identification.residual()).filter(|_| self.misread.is_none()));
        let described = Prediction::of(regression, &identification.fit.theta);
        let described = (&described, &regression.prepared.processing);
        warnings.extend(validations.iter().filter_map(|v| foreign::remark(v, described)));
        warnings.extend(self.logs.iter().filter_map(|log| self.drive_limits(log)));
        warnings.extend(validations.iter().flat_map(|validation| validation.warnings.clone()));
        warnings
    }

    /// A remark on options that can be the reason of a doubt. Where the model fails, the intervals say so.
    fn lowered(&self) -> Option<String> {
        let fails = self.identification.lack_of_fit.is_some_and(|lack| !lack.fits());
        let lowered = Lowered::in_words(&self.regression.lowered).filter(|_| !fails)?;
        Some(format!("{lowered}: leave that out before you look for another reason"))
    }

    /// A remark on drives at their limits in `log`.
    fn drive_limits(&self, log: &Log) -> Option<String> {
        // Logs whose torque cannot be read never get here: such an error is ignored.
        let remark = drive_limit_remark(self.arm, &log.torque_nm(self.arm).ok()?)?;
        Some(self.named(&log.source, remark))
    }
}

/// Warns of intervals that are far longer than ± tells.
fn few_degrees_of_freedom(freedom: f64) -> Option<String> {
    (freedom < FEW_DEGREES_OF_FREEDOM).then(|| {
        format!(
            "σ is known with {freedom:.1} degrees of freedom: rely on the intervals, which are longer for that, not on ±"
        )
    })
}

/// A prediction of a log that was not used for the fit.
pub struct Validation {
    /// The log.
    pub log: PathBuf,
    /// Measured and predicted torque.
    pub prediction: Prediction,
    /// How the log was processed.
    pub processing: Processing,
    /// The manufacturer's feed-forward torque after the same processing, Nm.
    pub manufacturer: Option<Prediction>,
    /// Remarks about the log and its processing.
    pub warnings: Vec<String>,
}

impl Validation {
    /// Predicts the torque along `regression` with `theta`. `manufacturer` is the same log laid out with the
    /// manufacturer's torque in place of the measured one.
    pub fn new(
        log: &Log,
        regression: &Regression,
        manufacturer: Option<&Regression>,
        theta: &[f64],
    ) -> Self {
        let prediction = Prediction::of(regression, theta);
        let manufacturer = manufacturer.map(|m| Prediction {
            predicted_nm: Prediction::of(m, theta).measured_nm,
            ..prediction.clone()
        });
        let prepared = &regression.prepared;
        let of_it = prepared.warnings.iter().map(|warning| format!("{}: {warning}", log.source));
        Self {
            log: PathBuf::from(&log.source),
            prediction,
            processing: prepared.processing.clone(),
            manufacturer,
            warnings: log_warnings(log).chain(of_it).collect(),
        }
    }
}

/// The JSON output of `armid identify`.
#[derive(Debug, Clone, Serialize)]
pub struct Result {
    robot: String,
    robot_source: String,
    kinematics: Kinematics,
    /// Name of the reduced parameter set; null for the full one.
    reduced: Option<String>,
    log: String,
    samples: usize,
    rate_hz: f64,
    processing: Processing,
    estimator: Estimator,
    covariance: CovarianceKind,
    covariance_reason: &'static str,
    /// Degrees of freedom of the noise estimate; null if there are infinitely many.
    degrees_of_freedom: f64,
    base_parameters: Vec<BaseParameter>,
    /// Covariance of the base parameters, row by row.
    base_covariance: Vec<Vec<f64>>,
    /// Drive gains by which currents became torques, Nm/A; null if torques were logged.
    drive_gain_nm_a: Option<Vec<f64>>,
    /// Null without `--physical`: only combinations of standard parameters are then known.
    standard_parameters: Option<Vec<StandardParameter>>,
    /// How the standard parameters were found; null without `--physical`.
    physical: Option<Physical>,
    residual: ResidualJson,
    noise_floor_nm: Option<Vec<f64>>,
    /// Rms of the torque that repeats from period to period and that the model does not explain; null for a single run.
    explainable_nm: Option<Vec<f64>>,
    /// Friction that drifts along the logs.
    drifting_friction: Vec<DriftResult>,
    /// Friction that joints hold in their pauses.
    held_at_rest: Vec<HeldResult>,
    intervals: Intervals,
    condition: Condition,
    not_identified: Vec<String>,
    /// Joints whose motion is missing.
    #[serde(skip)]
    rest: Rest,
    /// How the log has to be read; null if it fits the arm as it is.
    misreading: Option<MisreadLog>,
    validation: Vec<ValidationJson>,
    /// Remarks for the user.
    pub warnings: Vec<String>,
    /// The warning which doubts that the identified parameters belong to this robot, or to any; null if there is none.
    pub(super) doubt: Option<Doubt>,
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

impl BaseParameter {
    /// All base parameters with their intervals.
    fn all(training: &Training) -> Vec<Self> {
        let Training { set, identification, .. } = training;
        let values = identification.fit.theta.iter().zip(identification.sigma());
        let estimate = |(k, ((value, sigma), half_width)): (usize, ((&f64, f64), f64))| Self {
            name: set.name(k).to_owned(),
            formula: set.formula(k),
            value: *value,
            unit: set.unit(k),
            sigma,
            ci95: [value - half_width, value + half_width],
        };
        values.zip(training.half_widths()).enumerate().map(estimate).collect()
    }
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
    samples: usize,
    #[serde(flatten)]
    residual: ResidualJson,
    moving_rms_nm: Vec<f64>,
    manufacturer_rms_nm: Option<Vec<f64>>,
    manufacturer_moving_rms_nm: Option<Vec<f64>>,
}

impl Result {
    /// Collects the result and all remarks about it.
    pub fn of(
        training: &Training,
        validations: &[Validation],
    ) -> std::result::Result<Self, FitError> {
        let Training { arm, set, logs, identification, regression, .. } = training;
        let covariance = &identification.covariance;
        let open = training.open();
        let doubt = training.doubt();
        Ok(Self {
            robot: arm.name.clone(),
            robot_source: training.robot_source.to_owned(),
            kinematics: Kinematics::of(arm),
            reduced: training.reduced.map(str::to_owned),
            log: names(logs),
            samples: identification.samples,
            rate_hz: regression.problem.rate_hz,
            processing: identification.processing.clone(),
            estimator: identification.estimator,
            covariance: covariance.kind,
            covariance_reason: identification.covariance_reason,
            degrees_of_freedom: covariance.degrees_of_freedom,
            base_parameters: BaseParameter::all(training),
            drive_gain_nm_a: logs.iter().find_map(|log| log.drive_gain_nm_a(arm)),
            base_covariance: covariance
                .matrix
                .row_iter()
                .map(|row| row.iter().copied().collect())
                .collect(),
            standard_parameters: None,
            physical: None,
            residual: identification.residual().into(),
            noise_floor_nm: identification.replicates.as_ref().map(|r| r.sigma.clone()),
            explainable_nm: identification.explainable_nm.clone(),
            drifting_friction: DriftResult::all(training),
            held_at_rest: HeldResult::all(training),
            intervals: Intervals::of(training),
            condition: Condition::of(&regression.problem, set)?,
            verdict: training.verdict(&open, doubt.as_ref()),
            not_identified: open.iter().map(|&k| set.name(k).to_owned()).collect(),
            rest: Rest::of(regression),
            misreading: training.misread.cloned(),
            validation: validations.iter().map(ValidationJson::of).collect(),
            warnings: training.warnings(doubt.as_ref(), validations),
            doubt,
            rows: Rows::of(logs),
        })
    }

    /// Adds physically consistent standard parameters.
    pub fn set_physical(&mut self, estimate: &PhysicalEstimate, training: &Training) {
        let problem = &training.regression.problem;
        self.standard_parameters = Some(standard_parameters(estimate, training.arm));
        self.physical = Some(Physical::of(estimate, problem));
        if estimate.evidence.model_is_wrong() {
            self.warnings.push(estimate.evidence.sentence());
        }
    }

    /// How the standard parameters were found; `None` without `--physical`.
    pub fn physical(&self) -> Option<&Physical> {
        self.physical.as_ref()
    }

    /// Whether the motion fails to identify the model.
    pub fn is_declined(&self) -> bool {
        self.verdict == NOT_IDENTIFIED
    }

    /// Whether no arm can have the identified parameters, or the log is misread or has little to do with the arm.
    pub fn is_contradicted(&self) -> bool {
        self.verdict == CONTRADICTED
    }

    /// Why the intervals are trusted, or why that is unknown. Distrust is already part of [`Self::sentence`].
    pub fn trust(&self) -> Option<&str> {
        let is_asked = self.intervals.trusted != Some(false) && self.misreading.is_none();
        is_asked.then_some(&*self.intervals.reason)
    }

    /// How the log has to be read, if it is misread.
    pub fn misread(&self) -> Option<&MisreadLog> {
        self.misreading.as_ref()
    }

    /// The warnings without the one that [`Self::sentence`] begins with.
    pub fn notes(&self) -> impl Iterator<Item = &String> {
        let doubt = self.doubt.as_ref().filter(|_| !self.is_declined());
        let leads = move |warning: &String| doubt.is_some_and(|d| d.sentence() == *warning);
        self.warnings.iter().filter(move |warning| !leads(warning))
    }

    /// The verdict in a sentence.
    pub fn sentence(&self) -> String {
        let b = self.base_parameters.len();
        if self.is_declined() {
            let names = &self.not_identified;
            return format!(
                "Declined: this motion does not identify the arm. {}For {} of {b} base parameters the \
                 95 % interval is wider than anything an arm of this size could have: {}. {}",
                rest_in_words(&self.rest),
                names.len(),
                names.join(", "),
                remedy(&self.rest)
            );
        }
        if let (Some(doubt), Some(_)) = (&self.doubt, &self.misreading) {
            return doubt.sentence();
        }
        let percent = self.residual.relative_percent.iter();
        let (low, high) = percent.fold((f64::INFINITY, 0f64), |(l, h), &p| (l.min(p), h.max(p)));
        // No motion is designed for a reduced set.
        let help = match (Lowered::in_words(&self.rest.lowered), &self.reduced) {
            (Some(lowered), _) => format!(". {lowered}: leave that out first"),
            (None, None) => {
                "; a motion designed for what is open helps (`armid excite --prior RESULT.json`)"
                    .to_owned()
            }
            (None, Some(_)) => String::new(),
        };
        let open = match self.not_identified.len() {
            0 => String::new(),
            n => format!(
                " {n} {} open ({}): the torque of this motion depends on {} too little{help}.",
                if n == 1 {
                    "moment of inertia of a light body stays"
                } else {
                    "moments of inertia of light bodies stay"
                },
                self.not_identified.join(", "),
                if n == 1 { "it" } else { "them" },
            ),
        };
        let distrust = match self.intervals.trusted {
            Some(false) => format!(" {}", self.intervals.reason),
            _ => String::new(),
        };
        let doubt = self.doubt.as_ref().map_or(String::new(), |doubt| doubt.sentence() + " ");
        format!(
            "{doubt}Identified {b} base parameters of {} from {} samples: what the model leaves of the \
             torque is {low:.1} to {high:.1} % per joint.{open}{distrust}",
            self.robot, self.samples
        )
    }
}

/// Residual in percent of a joint's torque above which the model explains next to nothing of the torque.
const NEARLY_ALL: f64 = 70.0;

/// A remark on joints whose recorded torque has next to nothing to do with the motion.
fn unrelated(fit: &Residual) -> Option<String> {
    let joints = fit.relative_percent.iter().zip(1..).filter(|(percent, _)| **percent > NEARLY_ALL);
    let joints: Vec<String> =
        joints.map(|(percent, joint)| format!("joint {joint} ({percent:.0} %)")).collect();
    (!joints.is_empty()).then(|| {
        format!(
            "the model leaves nearly all of the torque of {}: what is recorded there is noise, or not the torque of that joint",
            joints.join(", ")
        )
    })
}

impl ValidationJson {
    fn of(v: &Validation) -> Self {
        let rms = |f: fn(&Prediction) -> Residual| v.manufacturer.as_ref().map(|m| f(m).rms_nm);
        Self {
            log: v.log.display().to_string(),
            samples: v.prediction.samples(),
            residual: v.prediction.residual().into(),
            moving_rms_nm: v.prediction.moving_residual().rms_nm,
            manufacturer_rms_nm: rms(Prediction::residual),
            manufacturer_moving_rms_nm: rms(Prediction::moving_residual),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_joint_whose_torque_has_nothing_to_do_with_the_motion_is_told() {
        let fit = |relative_percent: Vec<f64>| Residual {
            rms_nm: vec![1.0; relative_percent.len()],
            torque_rms_nm: relative_percent.iter().map(|percent| 100.0 / percent).collect(),
            relative_percent,
            e_n: 0.1,
        };
        assert_eq!(unrelated(&fit(vec![5.0, 45.0])), None);
        let told = unrelated(&fit(vec![5.0, 96.4])).unwrap();
        assert!(told.contains("joint 2 (96 %)") && !told.contains("joint 1"), "{told}");
    }
}
