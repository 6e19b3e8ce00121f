//! The simulation that a log is compared with: a scenario, or the result for another log.

use std::path::{Path, PathBuf};

use nalgebra::DMatrix;

use super::earlier::{Doubt, EarlierResult};
use crate::base::BaseSet;
use crate::diagnose::Nominal;
use crate::dynamics::Model;
use crate::montecarlo::Scenario;
use crate::report::saved::SavedFault;
use crate::robot::{Arm, Kinematics};

/// A simulation that a log is compared with.
pub(super) struct Simulated {
    /// Base parameters.
    theta: Vec<f64>,
    /// Covariance of these parameters; `None` if they are exact.
    covariance: Option<DMatrix<f64>>,
    /// Degrees of freedom of the covariance.
    freedom: f64,
    /// Why the parameters are doubtful, if they are.
    doubt: Option<String>,
    /// Remark for the user.
    pub(super) warning: Option<String>,
    /// All input files of the simulation.
    pub(super) files: Vec<PathBuf>,
}

impl Simulated {
    /// Loads the simulation of `arm` that `file` describes, with parameters in the order of `set`. Refuses a result of
    /// the very log that is to be compared with it, identified by the hash `sha256` of its file.
    pub(super) fn load(
        file: &Path,
        (arm, set): (&Arm, &BaseSet),
        sha256: &str,
    ) -> Result<Self, Box<dyn std::error::Error>> {
        let name = file.display();
        if file.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml")) {
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
                freedom: f64::INFINITY,
                files: scenario.sources(file),
                theta: set.values(&Model::new(&scenario.arm).standard_parameters()),
                warning: has_effects.then(|| {
                    format!("{name}: its arm alone is compared with, not its [[effect]] tables")
                }),
            });
        }
        let result = EarlierResult::load(file).map_err(|error| match error.fault {
            SavedFault::Read(_) => error.to_string(),
            fault => not_a_simulation(file, &fault),
        })?;
        result.check(arm).map_err(|other| format!("{name}: {other}"))?;
        if result.is_of(sha256) {
            let message = "it was identified from the log that is diagnosed: nothing could differ but what the model gets wrong; \
                           compare another log with it, or leave --sim out";
            return Err(format!("{name}: {message}").into());
        }
        let doubt = result.doubt().map(|doubt| match doubt {
            Doubt::Contradicted => format!(
                "The log of {name} contradicts the arm, and a difference from its parameters does not say what changed."
            ),
            Doubt::WrongModel => format!(
                "The model is wrong along the log from which {name} was identified, and what differs from it here may be an error of \
                 that result: run `armid diagnose` on that log first."
            ),
        });
        let places = result.places(set).map_err(|fault| format!("{name}: {fault}"))?;
        let covariance = result.covariance(&places).map_err(|fault| format!("{name}: {fault}"))?;
        let warning = result.lacks_covariance().then(|| {
            format!(
                "{name}: it has σ but no covariance of the base parameters (base_covariance), as results of older programs; \
                 small changes are not told until it is identified again"
            )
        });
        Ok(Self {
            theta: result.values(&places),
            covariance: Some(covariance),
            freedom: result.degrees_of_freedom(),
            doubt,
            warning,
            files: vec![file.to_owned()],
        })
    }

    /// The parameters that a diagnosis compares with.
    pub(super) fn nominal(&self) -> Nominal<'_> {
        Nominal {
            theta: &self.theta,
            covariance: self.covariance.as_ref(),
            freedom: self.freedom,
            doubt: self.doubt.as_deref(),
        }
    }
}

/// Message that `file` is not a simulation to compare with.
fn not_a_simulation(file: &Path, why: &dyn std::fmt::Display) -> String {
    let file = file.display();
    format!(
        "{file}: neither a scenario (.toml) nor a result of `armid identify --json` ({why}); a second log goes \
         behind the first, without --sim"
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::Parameterisation;

    /// The JSON of a diagnosis also has base parameters, but they describe the arm without its causes and thus no
    /// simulation.
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
