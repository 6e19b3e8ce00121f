//! Checks of the names and numbers in files that describe an arm.

use std::collections::HashSet;
use std::fmt::Display;

use super::arm::LinkBounds;
use super::error::RobotError;
use super::urdf::plain_name;

/// A place in a file, which error messages name.
#[derive(Debug)]
pub(super) struct Place {
    file: String,
    /// Prefix such as `joint "elbow": `; empty for statements about the whole arm.
    table: String,
}

impl Place {
    /// The place of statements about the whole arm in `file`.
    pub(super) fn of_arm(file: &str) -> Self {
        Self { file: file.to_owned(), table: String::new() }
    }

    /// The table of this `kind` and `name` in the same file.
    pub(super) fn table(&self, kind: &str, name: &str) -> Self {
        Self { file: self.file.clone(), table: format!("{kind} \"{name}\": ") }
    }

    /// An error at this place.
    pub(super) fn fault(&self, what: impl Display) -> RobotError {
        RobotError::Invalid { file: self.file.clone(), what: format!("{}{what}", self.table) }
    }

    /// Refuses a `name` with control characters.
    pub(super) fn plain_name(&self, kind: &'static str, name: &str) -> Result<(), RobotError> {
        plain_name(kind, name).map_err(|fault| self.fault(fault))
    }

    /// Refuses NaN and infinite values.
    pub(super) fn finite(&self, key: &str, values: &[f64]) -> Result<(), RobotError> {
        match values.iter().find(|value| !value.is_finite()) {
            Some(value) => Err(self.fault(format!("{key}: {value} is not a finite number"))),
            None => Ok(()),
        }
    }

    /// Refuses anything but a finite number above 0.
    pub(super) fn positive(&self, key: &str, value: f64) -> Result<(), RobotError> {
        if value > 0.0 && value.is_finite() {
            return Ok(());
        }
        Err(self.fault(format!("{key} = {value} must be positive and finite")))
    }

    /// Refuses anything but a positive number or infinity, which stands for a limit that is not known.
    pub(super) fn limit(&self, key: &str, value: f64) -> Result<(), RobotError> {
        if value > 0.0 {
            return Ok(());
        }
        Err(self.fault(format!("{key} = {value} must be positive, inf if unknown")))
    }

    /// Refuses anything but a finite number of at least 0.
    pub(super) fn not_negative(&self, key: &str, value: f64) -> Result<(), RobotError> {
        if value >= 0.0 && value.is_finite() {
            return Ok(());
        }
        let requirement = if value < 0.0 { "must not be negative" } else { "must be finite" };
        Err(self.fault(format!("{key} = {value} {requirement}")))
    }

    /// Refuses anything but a finite range with low < high.
    fn range(&self, key: &str, [low, high]: [f64; 2]) -> Result<(), RobotError> {
        if low < high && low.is_finite() && high.is_finite() {
            return Ok(());
        }
        Err(self.fault(format!("{key}: [{low}, {high}] must be [low, high]")))
    }

    /// Bounds of a link's mass (kg) and centre of mass (m), checked.
    pub(super) fn bounds(
        &self,
        mass_bounds_kg: Option<[f64; 2]>,
        com_bounds_m: Option<[[f64; 2]; 3]>,
    ) -> Result<LinkBounds, RobotError> {
        if let Some([low, high]) = mass_bounds_kg {
            self.range("mass_bounds_kg", [low, high])?;
            self.not_negative("mass_bounds_kg", low)?;
        }
        for range in com_bounds_m.iter().flatten() {
            self.range("com_bounds_m", *range)?;
        }
        Ok(LinkBounds { mass_kg: mass_bounds_kg, com_m: com_bounds_m })
    }

    /// Refuses two tables of the same `kind` with the same name.
    pub(super) fn unique<'a>(
        &self,
        kind: &str,
        mut names: impl Iterator<Item = &'a str>,
    ) -> Result<(), RobotError> {
        let mut seen = HashSet::new();
        match names.find(|name| !seen.insert(*name)) {
            Some(name) => {
                Err(self.fault(format!("the {kind} \"{name}\" is there twice; names must differ")))
            }
            None => Ok(()),
        }
    }
}
