//! What an earlier identification already knows: the σ of its base parameters.

use std::path::Path;

use serde::Deserialize;

use super::robot::SavedRobot;
use crate::base::BaseSet;
use crate::excitation::design::DesignError;
use crate::report::identify::IDENTIFY_SCHEMA;
use crate::report::saved::load;
use crate::robot::Arm;

/// The part of a result file that is read; its other fields are for others.
#[derive(Deserialize)]
struct ResultFile {
    #[serde(flatten)]
    about: SavedRobot,
    base_parameters: Vec<Known>,
}

#[derive(Deserialize)]
struct Known {
    name: String,
    sigma: Option<f64>,
}

/// σ of every base parameter of `base` from the result file; ∞ where the file does not know it.
pub fn sigmas(path: &Path, arm: &Arm, base: &BaseSet) -> Result<Vec<f64>, DesignError> {
    let file = path.display().to_string();
    let fault = |message: String| DesignError::Prior { file: file.clone(), message };
    let result: ResultFile =
        load(path, IDENTIFY_SCHEMA).map_err(|error| fault(error.fault.to_string()))?;
    result.about.check(arm).map_err(|other| fault(other.to_string()))?;
    let mut sigma = vec![f64::INFINITY; base.rank()];
    let mut used = 0;
    for (k, sigma) in sigma.iter_mut().enumerate() {
        // A combination is named after its kept parameter, alone or with its other terms behind it.
        let same = |known: &&Known| known.name == base.name(k) || known.name == base.formula(k);
        let Some(known) = result.base_parameters.iter().find(same) else { continue };
        match known.sigma {
            Some(s) if s > 0.0 && s.is_finite() => (*sigma, used) = (s, used + 1),
            Some(s) => {
                return Err(fault(format!("sigma = {s} of \"{}\" must be positive", known.name)));
            }
            None => {}
        }
    }
    if used == 0 {
        return Err(fault("none of its parameters is a base parameter of this arm".into()));
    }
    Ok(sigma)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::Parameterisation;

    fn read(text: &str) -> Result<Vec<f64>, DesignError> {
        let arm = Arm::built_in("ur5").unwrap();
        let base = BaseSet::find(&arm, Parameterisation::full(6, false)).unwrap();
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        sigmas(file.path(), &arm, &base)
    }

    #[test]
    fn known_parameters_get_their_sigma_and_others_none() {
        let sigma = read(
            r#"{"schema": "armid.identify/1", "robot": "ur5", "verdict": "ok", "base_parameters":
               [{"name": "rv1", "value": 12.0, "unit": "Nm s/rad", "sigma": 0.5, "ci95": [11.0, 13.0]}]}"#,
        )
        .unwrap();
        assert_eq!(sigma.iter().filter(|s| s.is_finite()).count(), 1);
        assert!(sigma.contains(&0.5));
    }

    #[test]
    fn files_that_do_not_fit_are_refused() {
        let message = |text: &str| read(text).unwrap_err().to_string();
        let other = r#"{"schema": "armid.identify/1", "robot": "ur10e", "base_parameters": []}"#;
        assert!(message(other).contains("ur10e"));
        assert!(message(&other.replace("ur10e", "ur5")).contains("none of its parameters"));
        assert!(message(&other.replace("identify/1", "identify/0")).contains("identify/0"));
        assert!(message("{").contains("EOF"));
    }
}
