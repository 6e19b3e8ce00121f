//! A log that gives no estimate at all.

use serde::Serialize;

use super::{BaseParameter, NOT_IDENTIFIED};
use crate::identify::{Processing, Regression};
use crate::log::Log;
use crate::report::json::Program;
use crate::report::rows::{Rows, names};
use crate::report::{Page, Status, Verdict};
use crate::robot::Arm;

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
        let facts = vec![self.rows.in_words()];
        let verdict = Verdict { status: Status::Bad, sentence: self.sentence(), facts };
        let subtitle = format!("{} from {}", self.robot, self.log);
        Page::new("Identified parameters", subtitle, verdict, program)
    }
}
