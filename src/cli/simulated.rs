//! The simulation that a log is compared with: a scenario, or what was identified from another log.

use std::path::Path;

use nalgebra::{DMatrix, DVector};
use serde::Deserialize;

use super::robot::SavedRobot;
use crate::base::BaseSet;
use crate::diagnose::Nominal;
use crate::dynamics::Model;
use crate::montecarlo::Scenario;
use crate::report::identify::{CONTRADICTED, IDENTIFY_SCHEMA};
use crate::report::saved::{SavedFault, load};
use crate::robot::{Arm, Kinematics};

/// A simulation that a log is compared with.
pub(super) struct Simulated {
    /// Base parameters.
    theta: Vec<f64>,
    /// Their covariance, where they were identified.
    covariance: Option<DMatrix<f64>>,
    /// Why they are doubtful, if they are.
    doubt: Option<String>,
    /// What else should be known of it.
    pub(super) warning: Option<String>,
}

impl Simulated {
    /// The simulation of `arm` that `file` describes, its parameters in the order of `set`; not a result of the log that is
    /// compared with it, whose file has the hash `sha256`.
    pub(super) fn load(
        file: &Path,
        (arm, set): (&Arm, &BaseSet),
        sha256: &str,
    ) -> Result<Self, Box<dyn std::error::Error>> {
        let name = file.display();
        if file.extension().is_some_and(|e| e == "toml") {
            let scenario = Scenario::load(Some(file))?;
            if let Some(difference) = Kinematics::of(&scenario.arm).difference(arm) {
                let arm = &arm.name;
                let message =
                    format!("{name}: it simulates another arm than \"{arm}\": {difference}");
                return Err(message.into());
            }
            let has_effects = !scenario.effects.is_empty();
            return Ok(Self {
                doubt: None,
                covariance: None,
                theta: set.values(&Model::new(&scenario.arm).standard_parameters()),
                warning: has_effects.then(|| {
                    format!("{name}: its arm alone is compared with, not its [[effect]] tables")
                }),
            });
        }
        let result: IdentifiedParameters =
            load(file, IDENTIFY_SCHEMA).map_err(|error| match error.fault {
                SavedFault::Read(_) => error.to_string(),
                fault => not_a_simulation(file, &fault),
            })?;
        result.about.check(arm).map_err(|other| format!("{name}: {other}"))?;
        let is_itself = |input: &SavedInput| input.sha256 == sha256 && input.path == result.log;
        if result.program.inputs.iter().any(is_itself) {
            let message = "it was identified from the log that is diagnosed: nothing could differ but what the model gets wrong; \
                           compare another log with it, or leave --sim out";
            return Err(format!("{name}: {message}").into());
        }
        let doubt = if result.verdict == CONTRADICTED {
            Some(format!(
                "No arm has what was identified in {name}, and nothing that differs from it says what changed."
            ))
        } else if result.intervals.trusted == Some(false) {
            Some(format!(
                "The model is wrong along the log of which {name} is, so that what differs from it here may have been wrong there; \
                 `armid diagnose` of that log names the cause."
            ))
        } else {
            None
        };
        let place = |k: usize| {
            let parameter = set.name(k);
            let found = result.base_parameters.iter().position(|p| p.name == parameter);
            found.ok_or_else(|| format!("{name}: no base parameter {parameter}"))
        };
        let places: Vec<usize> = (0..set.rank()).map(place).collect::<Result<_, _>>()?;
        let covariance = result.covariance(&places).map_err(|fault| format!("{name}: {fault}"))?;
        let warning = result.base_covariance.is_none().then(|| {
            format!(
                "{name}: it has σ but no covariance of the base parameters (base_covariance), as results of older programs; \
                 small changes are not told until it is identified again"
            )
        });
        let theta = places.iter().map(|&k| result.base_parameters[k].value).collect();
        Ok(Self { theta, covariance: Some(covariance), doubt, warning })
    }

    /// What a diagnosis compares with.
    pub(super) fn nominal(&self) -> Nominal<'_> {
        Nominal {
            theta: &self.theta,
            covariance: self.covariance.as_ref(),
            doubt: self.doubt.as_deref(),
        }
    }
}

/// Why `file` cannot be compared with.
fn not_a_simulation(file: &Path, why: &dyn std::fmt::Display) -> String {
    let file = file.display();
    format!(
        "{file}: neither a scenario (.toml) nor a result of `armid identify --json` ({why}); a second log goes \
         behind the first, without --sim"
    )
}

/// What is needed of an identification's JSON.
#[derive(Deserialize)]
struct IdentifiedParameters {
    #[serde(flatten)]
    about: SavedRobot,
    #[serde(default)]
    log: String,
    #[serde(default)]
    verdict: String,
    base_parameters: Vec<IdentifiedParameter>,
    base_covariance: Option<Vec<Vec<Option<f64>>>>,
    #[serde(default)]
    intervals: Intervals,
    #[serde(default)]
    program: SavedProgram,
}

impl IdentifiedParameters {
    /// The covariance of the base parameters at `places`, by σ alone where it was not saved; or what is wrong with it.
    fn covariance(&self, places: &[usize]) -> Result<DMatrix<f64>, String> {
        let count = self.base_parameters.len();
        let Some(rows) = &self.base_covariance else {
            let variance = |&place: &usize| {
                let IdentifiedParameter { name, sigma, .. } = &self.base_parameters[place];
                sigma.map(|sigma| sigma * sigma).ok_or_else(|| format!("no sigma of {name}"))
            };
            let variances: Vec<f64> = places.iter().map(variance).collect::<Result<_, _>>()?;
            return Ok(DMatrix::from_diagonal(&DVector::from_vec(variances)));
        };
        let is_variance = |(i, row): (usize, &Vec<Option<f64>>)| {
            row.len() == count
                && row.iter().all(Option::is_some)
                && row[i].is_some_and(|variance| variance >= 0.0)
        };
        if rows.len() != count || !rows.iter().enumerate().all(is_variance) {
            let message = "base_covariance is no covariance of its base parameters";
            return Err(format!("{message} ({count} × {count} numbers)"));
        }
        let entry = |i: usize, k: usize| rows[places[i]][places[k]].unwrap_or_default();
        Ok(DMatrix::from_fn(places.len(), places.len(), entry))
    }
}

#[derive(Default, Deserialize)]
struct SavedProgram {
    inputs: Vec<SavedInput>,
}

#[derive(Deserialize)]
struct SavedInput {
    path: String,
    sha256: String,
}

#[derive(Default, Deserialize)]
struct Intervals {
    trusted: Option<bool>,
}

#[derive(Deserialize)]
struct IdentifiedParameter {
    name: String,
    value: f64,
    sigma: Option<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::Parameterisation;

    /// Of a result with the two parameters `a` and `b` and this `base_covariance`, taken in the order b, a.
    fn covariance(rows: &str) -> Result<DMatrix<f64>, String> {
        let result = serde_json::json!({
            "robot": "ur5",
            "base_parameters": [
                {"name": "a", "value": 1.0, "sigma": 2.0},
                {"name": "b", "value": 1.0, "sigma": 3.0},
            ],
            "base_covariance": serde_json::from_str::<serde_json::Value>(rows).unwrap(),
        });
        serde_json::from_value::<IdentifiedParameters>(result).unwrap().covariance(&[1, 0])
    }

    #[test]
    fn a_covariance_is_put_in_the_order_of_the_parameters() {
        let found = covariance("[[4.0, 1.5], [1.5, 9.0]]").unwrap();
        assert_eq!(found, DMatrix::from_row_slice(2, 2, &[9.0, 1.5, 1.5, 4.0]));
        // Results of older programs have σ alone.
        let found = covariance("null").unwrap();
        assert_eq!(found, DMatrix::from_row_slice(2, 2, &[9.0, 0.0, 0.0, 4.0]));
    }

    #[test]
    fn what_is_no_covariance_is_refused() {
        let not_square = ["[[4.0, 1.5]]", "[[4.0], [1.5, 9.0]]", "[]"];
        let no_numbers = ["[[4.0, null], [1.5, 9.0]]", "[[-4.0, 1.5], [1.5, 9.0]]"];
        for rows in not_square.iter().chain(&no_numbers) {
            let error = covariance(rows).unwrap_err();
            assert!(error.contains("no covariance of its base parameters (2 × 2"), "{error}");
        }
    }

    /// The JSON of a diagnosis has base parameters as well, but no simulation is described by what is left beside its causes.
    #[test]
    fn a_diagnosis_is_no_simulation() {
        let arm = Arm::built_in("ur5").unwrap();
        let set = BaseSet::find(&arm, Parameterisation::full(arm.dof(), true)).unwrap();
        let file = tempfile::Builder::new().suffix(".json").tempfile().unwrap();
        let diagnosis = r#"{"schema": "armid.diagnose/1", "base_parameters": []}"#;
        std::fs::write(file.path(), diagnosis).unwrap();
        let error = Simulated::load(file.path(), (&arm, &set), "").err().unwrap().to_string();
        assert!(error.contains("its schema is \"armid.diagnose/1\""), "{error}");
    }
}
