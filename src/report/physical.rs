//! Physically consistent standard parameters: JSON and section of the page.

use serde::{Deserialize, Serialize};

use super::{Column, Section, Status, Table};
use crate::dynamics::ParameterLayout;
use crate::identify::Problem;
use crate::identify::physical::{Certificate, CrossValidation, PhysicalEstimate, PriorMetric};
use crate::number::{significant, with_sigma};
use crate::robot::Arm;

/// One standard parameter.
#[derive(Debug, Clone, Serialize)]
pub struct StandardParameter {
    name: String,
    value: f64,
    unit: &'static str,
    decided_by: DecidedBy,
    /// `None` where the data do not decide the value. It then does not scatter with the noise, and no log tells the
    /// error of the robot file.
    sigma: Option<f64>,
}

/// Where the value of a standard parameter comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum DecidedBy {
    /// The measured data.
    Data,
    /// The robot file, because the log determines only combinations with other parameters.
    Prior,
    /// The parametrisation: it is fixed at zero (torque offsets, and whatever a reduced set leaves out).
    NotFitted,
}

impl DecidedBy {
    fn of(estimate: &PhysicalEstimate, k: usize) -> Self {
        match estimate.is_prior(k) {
            true => Self::Prior,
            false if estimate.scatter.released.standard[k] > 0.0 => Self::Data,
            false => Self::NotFitted,
        }
    }
}

/// All standard parameters; torque offsets are zero where they were not fitted.
pub fn standard_parameters(estimate: &PhysicalEstimate, arm: &Arm) -> Vec<StandardParameter> {
    let layout = ParameterLayout::new(arm.dof());
    let values = estimate.standard.iter().zip(&estimate.scatter.released.standard).enumerate();
    values
        .map(|(k, (&value, &sigma))| {
            let decided_by = DecidedBy::of(estimate, k);
            StandardParameter {
                name: layout.name(k),
                value,
                unit: layout.unit(k),
                decided_by,
                sigma: (decided_by == DecidedBy::Data).then_some(sigma),
            }
        })
        .collect()
}

/// How the standard parameters were found, and whether they fit the data.
#[derive(Debug, Clone, Serialize)]
pub struct Physical {
    sentence: String,
    realisable_share: f64,
    distance: f64,
    p_value: Option<f64>,
    model_is_wrong: bool,
    prior_metric: PriorMetric,
    prior_weight: f64,
    /// Number of standard parameters that the robot file decides: more than half of an error of the file stays in them,
    /// or a relative error of `file_error` shifts them by more than σ.
    prior_decides: usize,
    file_error: f64,
    cross_validation: Option<Vec<TriedWeight>>,
    active: Vec<String>,
    objective: f64,
    duality_gap: f64,
    kkt_residual: f64,
    iterations: usize,
    residual_rms_nm: Vec<f64>,
    unconstrained_rms_nm: Vec<f64>,
}

#[derive(Debug, Clone, Serialize)]
struct TriedWeight {
    weight: f64,
    prediction_error: f64,
}

impl Physical {
    /// Summarises an estimate from `problem`.
    pub fn of(estimate: &PhysicalEstimate, problem: &Problem) -> Self {
        let PhysicalEstimate { evidence, certificate, .. } = estimate;
        let Certificate { objective, duality_gap, kkt_residual, iterations } = *certificate;
        let samples = (problem.samples * problem.periods) as f64;
        let rms = |theta: &[f64]| -> Vec<f64> {
            problem.residual_squares(theta).iter().map(|e| (e / samples).sqrt()).collect()
        };
        let tried = |cv: &CrossValidation| -> Vec<TriedWeight> {
            let pairs = cv.tried.iter();
            pairs
                .map(|&(weight, prediction_error)| TriedWeight { weight, prediction_error })
                .collect()
        };
        Self {
            sentence: evidence.sentence(),
            realisable_share: evidence.realisable,
            distance: evidence.distance,
            p_value: evidence.p_value(),
            model_is_wrong: evidence.model_is_wrong(),
            prior_metric: estimate.prior.metric,
            prior_weight: estimate.prior.weight,
            prior_decides: (0..estimate.standard.len()).filter(|&k| estimate.is_prior(k)).count(),
            file_error: estimate.file_error(),
            cross_validation: estimate.cross_validation.as_ref().map(tried),
            active: estimate.active.iter().map(ToString::to_string).collect(),
            objective,
            duality_gap,
            kkt_residual,
            iterations,
            residual_rms_nm: rms(&estimate.base),
            unconstrained_rms_nm: rms(&estimate.unconstrained),
        }
    }

    /// What the terminal prints, line by line.
    pub fn facts(&self) -> Vec<String> {
        let list = |values: &[f64]| -> String {
            let cells: Vec<String> = values.iter().map(|v| significant(*v, 4)).collect();
            cells.join(", ")
        };
        let mut facts = vec![
            format!("Physical consistency: {}.", self.sentence),
            format!(
                "Optimal to {:.1e} of an objective of {} (duality gap; KKT residual {:.1e}, {} Newton \
                 steps).",
                self.duality_gap,
                significant(self.objective, 5),
                self.kkt_residual,
                self.iterations
            ),
            format!(
                "Residual per joint {} Nm; unconstrained {} Nm.",
                list(&self.residual_rms_nm),
                list(&self.unconstrained_rms_nm)
            ),
            format!(
                "The robot file's values are the prior ({}, weight {}{}): they fix the combinations that no torque depends on, and \
                 with them {} standard parameters, which come without σ (more than half of an error of the file would stay in them, or an \
                 error of {:.0} % would shift them by more than σ).",
                self.prior_metric,
                self.prior_weight,
                if self.cross_validation.is_some() { " chosen by cross-validation" } else { "" },
                self.prior_decides,
                100.0 * self.file_error
            ),
        ];
        if !self.active.is_empty() {
            facts.push(format!(
                "On the boundary of what can exist: {}. σ is stated as if no bound were there: the \
                 estimate scatters less, but it may be as far from the truth.",
                self.active.join(", ")
            ));
        }
        facts
    }

    /// The section for the page.
    pub fn section(&self, standard: &[StandardParameter]) -> Section {
        let mut section = Section::new("Standard parameters that an arm can have");
        let status = if self.model_is_wrong { Status::Bad } else { Status::Good };
        let facts = self.facts();
        section = section.note(status, facts[0].as_str()).list(facts[1..].iter().cloned());
        if let Some(tried) = &self.cross_validation {
            let mut table = Table::new([
                Column::number("weight of the prior", ""),
                Column::number("error of predicted left-out periods", ""),
            ]);
            for TriedWeight { weight, prediction_error } in tried {
                let best = (*weight == self.prior_weight).then_some(Status::Good);
                table.push_judged(
                    best,
                    [format!("{weight:.0e}"), significant(*prediction_error, 6)],
                );
            }
            section = section.table(table, "Squared error per parameter in units of the noise");
        }
        let mut table = Table::new([
            Column::text("parameter"),
            Column::text("unit"),
            Column::number("estimate ± σ", ""),
        ]);
        for p in standard {
            let alone = significant(p.value, 4);
            let value = match (p.sigma, p.decided_by) {
                (Some(sigma), _) => with_sigma(p.value, sigma),
                (None, DecidedBy::NotFitted) => format!("{alone} (not fitted)"),
                (None, _) => format!("{alone} (prior)"),
            };
            table.push([p.name.clone(), p.unit.to_owned(), value]);
        }
        section.details(Section::new("All standard parameters").table(table, ""))
    }
}
