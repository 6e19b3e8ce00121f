//! Prior knowledge of the base parameters from an earlier identification.

use std::path::Path;

use faer::Mat;

use super::earlier::{Doubt, EarlierResult};
use crate::base::BaseSet;
use crate::excitation::design::DesignError;
use crate::identify::covariance::precision;
use crate::robot::Arm;

/// What a design assumes to be known about the parameters.
pub(super) struct Prior {
    /// Inverse covariance of the base parameters, b × b; zero for unknown parameters.
    pub(super) information: Mat<f64>,
    /// Remarks for the user.
    pub(super) notes: Vec<String>,
}

impl Prior {
    /// Reads the result in `path` for the parameters of `base`.
    ///
    /// # Errors
    /// [`DesignError::Prior`] if the result cannot be read, is about another arm or has none of the parameters, or if
    /// its covariance is not positive definite.
    pub(super) fn load(path: &Path, arm: &Arm, base: &BaseSet) -> Result<Self, DesignError> {
        let file = path.display().to_string();
        let fault = |message: String| DesignError::Prior { file: file.clone(), message };
        let result = EarlierResult::load(path).map_err(|error| fault(error.fault.to_string()))?;
        result.check(arm).map_err(|other| fault(other.to_string()))?;
        // A parameter without σ counts as unknown.
        let known: Vec<(usize, usize)> = (0..base.rank())
            .filter_map(|k| Some((k, result.place(base, k)?)))
            .filter(|&(_, place)| result.parameters()[place].sigma.is_some())
            .collect();
        if known.is_empty() {
            return Err(fault("none of its parameters is a base parameter of this arm".into()));
        }
        let places: Vec<usize> = known.iter().map(|&(_, place)| place).collect();
        let covariance = result.covariance(&places).map_err(&fault)?;
        let variances = covariance.diagonal();
        if let Some(k) = variances.iter().position(|v| !(*v > 0.0 && v.is_finite())) {
            let name = &result.parameters()[places[k]].name;
            return Err(fault(format!("the variance of \"{name}\" is {}", variances[k])));
        }
        let inverse = precision(&covariance)
            .ok_or_else(|| fault("its base_covariance is not positive definite".into()))?;
        let mut information = Mat::zeros(base.rank(), base.rank());
        for (i, &(row, _)) in known.iter().enumerate() {
            for (k, &(column, _)) in known.iter().enumerate() {
                information[(row, column)] = inverse[(i, k)];
            }
        }
        let mut notes = Vec::new();
        if known.len() < base.rank() {
            let (used, all) = (known.len(), base.rank());
            notes.push(format!(
                "{file}: it knows {used} of the {all} base parameters; nothing is taken for known of the others"
            ));
        }
        notes.extend(result.doubt().map(|doubt| match doubt {
            Doubt::Contradicted => {
                format!("{file}: its log contradicts the arm, and its parameters and their σ do not hold")
            }
            Doubt::WrongModel => format!(
                "{file}: its σ count the noise alone, and the model was wrong along its log: less is known than they say"
            ),
        }));
        if result.lacks_covariance() {
            notes.push(format!(
                "{file}: it has σ but no correlations (base_covariance); identify again for a prior that has both"
            ));
        }
        Ok(Self { information, notes })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::Parameterisation;

    fn base() -> (Arm, BaseSet) {
        let arm = Arm::built_in("ur5").unwrap();
        let base = BaseSet::find(&arm, Parameterisation::full(6, false)).unwrap();
        (arm, base)
    }

    fn read(text: &str) -> Result<Prior, DesignError> {
        let (arm, base) = base();
        let file = tempfile::NamedTempFile::new().unwrap();
        std::fs::write(file.path(), text).unwrap();
        Prior::load(file.path(), &arm, &base)
    }

    #[test]
    fn known_parameters_are_known_and_others_are_not() {
        let prior = read(
            r#"{"schema": "armid.identify/1", "robot": "ur5", "verdict": "ok", "base_parameters":
               [{"name": "rv1", "value": 12.0, "unit": "Nm s/rad", "sigma": 0.5, "ci95": [11.0, 13.0]}]}"#,
        )
        .unwrap();
        let (_, base) = base();
        let rv1 = (0..base.rank()).find(|&k| base.name(k) == "rv1").unwrap();
        for i in 0..base.rank() {
            for k in 0..base.rank() {
                let expected = if (i, k) == (rv1, rv1) { 4.0 } else { 0.0 };
                assert_eq!(prior.information[(i, k)], expected);
            }
        }
        let notes = prior.notes.join("\n");
        assert!(notes.contains("1 of the") && notes.contains("no correlations"), "{notes}");
    }

    /// For two parameters with positively correlated errors, the difference is known well and the sum badly.
    #[test]
    fn correlations_are_part_of_what_is_known() {
        let text = r#"{"schema": "armid.identify/1", "robot": "ur5", "verdict": "ok", "base_parameters":
               [{"name": "rv1", "value": 12.0, "sigma": 0.5}, {"name": "rc1", "value": 9.0, "sigma": 2.0}],
               "base_covariance": [[0.25, 0.99], [0.99, 4.0]]}"#;
        let information = read(text).unwrap().information;
        let (_, base) = base();
        let at = |name: &str| (0..base.rank()).find(|&k| base.name(k) == name).unwrap();
        let (v, c) = (at("rv1"), at("rc1"));
        // [0.25 0.99; 0.99 4]⁻¹ = [4 −0.99; −0.99 0.25]/(1 − 0.9801).
        let determinant = 1.0 - 0.99 * 0.99;
        for (i, k, expected) in [(v, v, 4.0), (v, c, -0.99), (c, v, -0.99), (c, c, 0.25)] {
            let expected = expected / determinant;
            assert!((information[(i, k)] - expected).abs() < 1e-10 * expected.abs(), "{i} {k}");
        }
        let alike = text.replace("0.99", "1.01");
        let error = read(&alike).err().unwrap().to_string();
        assert!(error.contains("not positive definite"), "{error}");
    }

    #[test]
    fn files_that_do_not_fit_are_refused() {
        let message = |text: &str| read(text).err().unwrap().to_string();
        let other = r#"{"schema": "armid.identify/1", "robot": "ur10e", "base_parameters": []}"#;
        assert!(message(other).contains("ur10e"));
        let ur5 = other.replace("ur10e", "ur5");
        assert!(message(&ur5).contains("none of its parameters"));
        assert!(message(&other.replace("identify/1", "identify/0")).contains("identify/0"));
        assert!(message("{").contains("EOF"));
        let reduced = ur5.replace("\"base_", "\"reduced\": \"paper\", \"base_");
        assert!(message(&reduced).contains("--reduced paper"));
        let exact = ur5.replace("[]", r#"[{"name": "rv1", "value": 12.0, "sigma": 0.0}]"#);
        assert!(message(&exact).contains("variance of \"rv1\" is 0"));
    }
}
