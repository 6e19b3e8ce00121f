//! The result for a log from which nothing can be estimated.

use serde::Serialize;

use super::{BaseParameter, NOT_IDENTIFIED};
use crate::identify::{Lowered, Processing, Regression, Rest};
use crate::log::Log;
use crate::number::significant;
use crate::report::json::Program;
use crate::report::rows::{Rows, log_warnings, names};
use crate::report::{Page, Status, Verdict};
use crate::robot::Arm;

/// What is said of a log at rest, behind the word that it is declined.
pub const NOTHING_MOVES: &str =
    "no joint moves. Record a motion that excites all parameters (armid excite).";

/// Sentences on the joints whose motion is missing, with a blank behind each; empty if there are none.
pub(super) fn rest_in_words(rest: &Rest) -> String {
    let listed = |joints: &[usize]| {
        joints.iter().map(|j| (j + 1).to_string()).collect::<Vec<_>>().join(", ")
    };
    let still = match &rest.still[..] {
        [] => String::new(),
        [joint] => format!("Joint {} does not move. ", joint + 1),
        joints => format!("Joints {} do not move. ", listed(joints)),
    };
    let outpaced = match &rest.outpaced[..] {
        [] => String::new(),
        joints => format!(
            "At {} Hz (--rate) less than half of the motion of joint {} is left. ",
            significant(rest.rate_hz, 3),
            listed(joints)
        ),
    };
    still + &outpaced
}

/// What helps where a motion does not identify the arm.
pub(super) fn remedy(rest: &Rest) -> String {
    if !rest.outpaced.is_empty() {
        return "The rate is too low for this motion: give a higher one, or none.".to_owned();
    }
    match Lowered::in_words(&rest.lowered) {
        None => "Record a motion that excites them (armid excite).".to_owned(),
        Some(lowered) => format!(
            "{lowered}: leave that out first. If it is not the reason, record a motion that excites them (armid excite)."
        ),
    }
}

/// The JSON of a log whose motion leaves parameters without any effect on the torque. It uses the schema of a normal
/// result, without estimates.
#[derive(Debug, Clone, Serialize)]
pub struct Declined {
    robot: String,
    log: String,
    /// `None` where nothing moves.
    processing: Option<Processing>,
    base_parameters: Vec<BaseParameter>,
    standard_parameters: Option<Vec<()>>,
    not_identified: Vec<String>,
    /// Remarks for the user about the log and its processing.
    pub warnings: Vec<String>,
    rows: Rows,
    /// Joints whose motion is missing.
    #[serde(skip)]
    rest: Rest,
    #[serde(skip)]
    joints: usize,
    verdict: &'static str,
}

impl Declined {
    /// Declines the estimate; `parameters` are the names of base parameters whose columns vanish or depend on the
    /// others.
    pub fn new(arm: &Arm, logs: &[&Log], regression: &Regression, parameters: Vec<String>) -> Self {
        let mut declined = Self::at_rest(arm, logs, parameters);
        declined.processing = Some(regression.prepared.processing.clone());
        declined.warnings.extend(regression.prepared.warnings.iter().cloned());
        declined.rest = Rest::of(regression);
        declined
    }

    /// Declines the estimate from logs in which no joint moves; `parameters` are the names of all base parameters.
    pub fn at_rest(arm: &Arm, logs: &[&Log], parameters: Vec<String>) -> Self {
        Self {
            robot: arm.name.clone(),
            log: names(logs),
            processing: None,
            base_parameters: Vec::new(),
            standard_parameters: None,
            not_identified: parameters,
            warnings: logs.iter().flat_map(|log| log_warnings(log)).collect(),
            rows: Rows::of(logs),
            rest: Rest { still: (0..arm.dof()).collect(), ..Rest::default() },
            joints: arm.dof(),
            verdict: NOT_IDENTIFIED,
        }
    }

    /// The verdict in a sentence.
    pub fn sentence(&self) -> String {
        if self.rest.still.len() == self.joints {
            return format!("Declined: {NOTHING_MOVES}");
        }
        format!(
            "Declined: this motion does not identify the arm. {}Along it the columns of {} vanish or \
             depend on the others to within rounding. {}",
            rest_in_words(&self.rest),
            self.not_identified.join(", "),
            remedy(&self.rest)
        )
    }

    /// A page with the verdict and the warnings.
    pub fn page(&self, program: Program) -> Page {
        let facts = vec![self.rows.in_words()];
        let verdict = Verdict { status: Status::Bad, sentence: self.sentence(), facts };
        let subtitle = format!("{} from {}", self.robot, self.log);
        Page::new("Identified parameters", subtitle, verdict, program).with_warnings(&self.warnings)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::{BaseSet, Parameterisation};
    use crate::dynamics::Model;
    use crate::identify::{Identifier, Measurement, Options, Repetition};
    use crate::log::{Effort, LogWarning};
    use crate::robot::JointSignals;

    /// Remarks about a faulty file matter most where nothing could be identified from it.
    #[test]
    fn warnings_about_log_and_processing_are_kept() {
        let arm = Arm::built_in("ur5").unwrap();
        let set = BaseSet::find(&arm, Parameterisation::full(6, false)).unwrap();
        let model = Model::new(&arm);
        let time_s: Vec<f64> = (0..1250).map(|k| 0.008 * f64::from(k)).collect();
        let signal = |f: fn(f64, f64) -> f64| {
            let omega = |j: usize| 1.0 + j as f64;
            JointSignals::from_fn(6, time_s.len(), |j, k| f(omega(j), omega(j) * time_s[k]))
        };
        let (q_rad, qd_rad_s) =
            (signal(|_, phase| phase.sin()), signal(|omega, phase| omega * phase.cos()));
        let torque_nm = signal(|_, phase| 5.0 * phase.sin());
        let effort = Effort::Torque(torque_nm.clone());
        let mut log = Log::new("a.csv", time_s.clone(), q_rad, qd_rad_s, effort).unwrap();
        log.rows.warnings.push(LogWarning::ManySetAside { set_aside: 7, read: 9 });
        let options = Options { repetition: Repetition::Never, ..Options::default() };
        let measurement = Measurement {
            source: &log.source,
            time_s: &log.time_s,
            q_rad: &log.q_rad,
            qd_rad_s: &log.qd_rad_s,
            torque_nm: &torque_nm,
        };
        let mut regression =
            Identifier::new(&model, &set, options).regression(&measurement).unwrap();
        regression.prepared.warnings = vec!["resampled".to_owned()];
        let declined = Declined::new(&arm, &[&log], &regression, vec!["mx2".to_owned()]);
        let [of_the_file, processing] = &declined.warnings[..] else { panic!("two warnings") };
        assert!(of_the_file.starts_with("a.csv: 7 of 9 rows"), "{of_the_file}");
        assert_eq!(processing, "resampled");
        assert!(declined.sentence().contains("the arm. Along it"), "{}", declined.sentence());
        let still = Rest { still: vec![0, 3], ..Rest::default() };
        let told = Declined { rest: still, ..declined.clone() }.sentence();
        assert!(told.contains("Joints 1, 4 do not move.") && told.contains("excite)."), "{told}");
        let fast = Rest { outpaced: vec![1, 4], rate_hz: 2.0, ..Rest::default() };
        let told = Declined { rest: fast, ..declined.clone() }.sentence();
        assert!(told.contains("less than half of the motion of joint 2, 5 is left"), "{told}");
        assert!(!told.contains("not move") && told.ends_with("or none."), "{told}");
        let html = declined.page(Program::new(["armid"], None, Vec::new())).to_html().unwrap();
        assert!(html.contains("7 of 9 rows") && html.contains("resampled"), "{html}");
    }
}
