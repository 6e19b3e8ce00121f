//! An earlier result of `armid identify`, read back: base parameters and their uncertainty.

use std::path::Path;

use nalgebra::{DMatrix, DVector};
use serde::Deserialize;

use super::robot::{OtherRobot, SavedRobot};
use crate::base::BaseSet;
use crate::report::identify::{CONTRADICTED, IDENTIFY_SCHEMA, NOT_IDENTIFIED};
use crate::report::saved::{SavedError, load};
use crate::robot::Arm;

/// The fields that are needed from the JSON of an identification.
#[derive(Deserialize)]
pub(super) struct EarlierResult {
    #[serde(flatten)]
    about: SavedRobot,
    /// Path of the log; for several logs all paths, separated by commas as `identify` writes them.
    #[serde(default)]
    log: String,
    #[serde(default)]
    verdict: String,
    /// Name of the reduced parameter set; `None` for the full one.
    #[serde(default)]
    reduced: Option<String>,
    base_parameters: Vec<EarlierParameter>,
    base_covariance: Option<Vec<Vec<Option<f64>>>>,
    /// Missing in results of older versions.
    degrees_of_freedom: Option<f64>,
    #[serde(default)]
    intervals: Intervals,
    #[serde(default)]
    program: SavedProgram,
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

/// A base parameter of the result.
#[derive(Deserialize)]
pub(super) struct EarlierParameter {
    pub(super) name: String,
    /// Missing in results of older versions.
    formula: Option<String>,
    pub(super) value: f64,
    pub(super) sigma: Option<f64>,
}

/// Why the numbers of a result must not be used as they are.
pub(super) enum Doubt {
    /// The log of the result contradicts the arm: no arm can have these parameters, or the log is not of this arm.
    Contradicted,
    /// The model was wrong along the log of the result.
    WrongModel,
}

impl EarlierResult {
    /// Reads the result in `path`.
    pub(super) fn load(path: &Path) -> Result<Self, SavedError> {
        load(path, IDENTIFY_SCHEMA)
    }

    /// Refuses an `arm` that the result is not about, and a result for a reduced parameter set.
    pub(super) fn check(&self, arm: &Arm) -> Result<(), OtherRobot> {
        if let Some(set) = &self.reduced {
            return Err(OtherRobot::Reduced { set: set.clone() });
        }
        self.about.check(arm)
    }

    /// Whether the result was identified from the log with the hash `sha256`, alone or together with others. The path
    /// must match as well, because the inputs of a result also include its validation logs.
    pub(super) fn is_of(&self, sha256: &str) -> bool {
        let logs = format!(", {}, ", self.log);
        let is_its_log = |input: &SavedInput| {
            input.sha256 == sha256 && logs.contains(&format!(", {}, ", input.path))
        };
        self.program.inputs.iter().any(is_its_log)
    }

    /// The doubt that the result states about itself.
    pub(super) fn doubt(&self) -> Option<Doubt> {
        if self.verdict == CONTRADICTED {
            Some(Doubt::Contradicted)
        } else if self.intervals.trusted == Some(false) {
            Some(Doubt::WrongModel)
        } else {
            None
        }
    }

    /// Whether parameters stay open that its log does not tell.
    pub(super) fn is_not_identified(&self) -> bool {
        self.verdict == NOT_IDENTIFIED
    }

    /// Whether the result states only σ and no covariance, as results of older versions do.
    pub(super) fn lacks_covariance(&self) -> bool {
        self.base_covariance.is_none()
    }

    /// Degrees of freedom of the covariance; infinite if the result does not state them.
    pub(super) fn degrees_of_freedom(&self) -> f64 {
        self.degrees_of_freedom.unwrap_or(f64::INFINITY)
    }

    /// The base parameters of the result.
    pub(super) fn parameters(&self) -> &[EarlierParameter] {
        &self.base_parameters
    }

    /// Index in the result of base parameter `k` of `set`. The whole combination must match: the same leading column
    /// combined with other dependent columns is a different parameter.
    pub(super) fn place(&self, set: &BaseSet, k: usize) -> Option<usize> {
        let (name, formula) = (set.name(k), set.formula(k));
        let is_it = |known: &EarlierParameter| match &known.formula {
            Some(known) => *known == formula,
            None => known.name == name || known.name == formula,
        };
        self.base_parameters.iter().position(is_it)
    }

    /// Index in the result of every base parameter of `set`; the error says which one it lacks.
    pub(super) fn places(&self, set: &BaseSet) -> Result<Vec<usize>, String> {
        let place = |k: usize| {
            let found = self.place(set, k);
            found.ok_or_else(|| format!("no base parameter {}", set.formula(k)))
        };
        (0..set.rank()).map(place).collect()
    }

    /// Values of the base parameters at `places`.
    pub(super) fn values(&self, places: &[usize]) -> Vec<f64> {
        places.iter().map(|&place| self.base_parameters[place].value).collect()
    }

    /// Covariance of the base parameters at `places`; diagonal from σ if no covariance was saved. The error says what
    /// is wrong with it.
    pub(super) fn covariance(&self, places: &[usize]) -> Result<DMatrix<f64>, String> {
        let count = self.base_parameters.len();
        let Some(rows) = &self.base_covariance else {
            let variance = |&place: &usize| {
                let EarlierParameter { name, sigma, .. } = &self.base_parameters[place];
                sigma.map(|sigma| sigma * sigma).ok_or_else(|| format!("no sigma of {name}"))
            };
            let variances: Vec<f64> = places.iter().map(variance).collect::<Result<_, _>>()?;
            return Ok(DMatrix::from_diagonal(&DVector::from_vec(variances)));
        };
        // Entries of parameters that are not asked for may be unknown.
        let is_variance = |&place: &usize| {
            let row: &Vec<Option<f64>> = &rows[place];
            places.iter().all(|&other| row[other].is_some())
                && row[place].is_some_and(|variance| variance >= 0.0)
        };
        let is_square = rows.len() == count && rows.iter().all(|row| row.len() == count);
        if !is_square || !places.iter().all(is_variance) {
            let message = "base_covariance is no covariance of its base parameters";
            return Err(format!("{message} ({count} × {count} numbers)"));
        }
        let entry = |i: usize, k: usize| rows[places[i]][places[k]].unwrap_or_default();
        Ok(DMatrix::from_fn(places.len(), places.len(), entry))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::base::Parameterisation;

    /// Covariance, in the order b, a, from a result with the parameters `a` and `b` and this `base_covariance`.
    fn covariance(rows: &str) -> Result<DMatrix<f64>, String> {
        let result = serde_json::json!({
            "robot": "ur5",
            "base_parameters": [
                {"name": "a", "value": 1.0, "sigma": 2.0},
                {"name": "b", "value": 1.0, "sigma": 3.0},
            ],
            "base_covariance": serde_json::from_str::<serde_json::Value>(rows).unwrap(),
        });
        serde_json::from_value::<EarlierResult>(result).unwrap().covariance(&[1, 0])
    }

    #[test]
    fn a_covariance_is_put_in_the_order_of_the_parameters() {
        let found = covariance("[[4.0, 1.5], [1.5, 9.0]]").unwrap();
        assert_eq!(found, DMatrix::from_row_slice(2, 2, &[9.0, 1.5, 1.5, 4.0]));
        // Results of older versions have only σ.
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

    /// A pooled result names its logs in one string; its validation log does not count.
    #[test]
    fn every_log_of_several_is_its_log() {
        let input = |path: &str, sha256: &str| serde_json::json!({"path": path, "sha256": sha256});
        let result = |log: &str| {
            let inputs = [
                input("arm.toml", "0"),
                input("a.csv", "1"),
                input("b.csv", "2"),
                input("v.csv", "3"),
            ];
            let program = serde_json::json!({"inputs": inputs});
            let result = serde_json::json!({
                "robot": "ur5", "log": log, "base_parameters": [], "program": program,
            });
            serde_json::from_value::<EarlierResult>(result).unwrap()
        };
        let of = |log: &str| ["0", "1", "2", "3"].map(|sha256| result(log).is_of(sha256));
        assert_eq!(of("a.csv"), [false, true, false, false]);
        assert_eq!(of("a.csv, b.csv"), [false, true, true, false]);
        // A part of a path does not match.
        assert_eq!(of("runs/a.csv, b.csv"), [false, false, true, false]);
    }

    /// The whole combination identifies a parameter: its leading column also leads other combinations.
    #[test]
    fn a_combination_is_not_told_by_its_first_column() {
        let arm = Arm::built_in("ur5").unwrap();
        let set = BaseSet::find(&arm, Parameterisation::full(6, false)).unwrap();
        let k = (0..set.rank()).find(|&k| set.formula(k) != set.name(k)).unwrap();
        let place = |parameter: serde_json::Value| {
            let result = serde_json::json!({"robot": "ur5", "base_parameters": [parameter]});
            serde_json::from_value::<EarlierResult>(result).unwrap().place(&set, k)
        };
        let (name, formula) = (set.name(k), set.formula(k));
        let same = serde_json::json!({"name": name, "formula": formula, "value": 1.0});
        assert_eq!(place(same), Some(0));
        let other = serde_json::json!({"name": name, "formula": name, "value": 1.0});
        assert_eq!(place(other), None);
        // Results of older versions have only names.
        assert_eq!(place(serde_json::json!({"name": name, "value": 1.0})), Some(0));
    }
}
