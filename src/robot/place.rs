//! Numbers of the files that describe an arm, checked.

use std::collections::HashSet;
use std::fmt::Display;

use super::arm::LinkBounds;
use super::error::RobotError;

/// Where in a file something stands: what is wrong there is told with it.
#[derive(Debug)]
pub(super) struct Place {
    file: String,
    /// Such as `joint "elbow": `; empty of what is said of the whole arm.
    table: String,
}

impl Place {
    /// What `file` says of the whole arm.
    pub(super) fn of_arm(file: &str) -> Self {
        Self { file: file.to_owned(), table: String::new() }
    }

    /// The table of the `kind` called `name` in the same file.
    pub(super) fn table(&self, kind: &str, name: &str) -> Self {
        Self { file: self.file.clone(), table: format!("{kind} \"{name}\": ") }
    }

    /// Something that is wrong there.
    pub(super) fn fault(&self, what: impl Display) -> RobotError {
        RobotError::Invalid { file: self.file.clone(), what: format!("{}{what}", self.table) }
    }

    /// Refuses values that are no numbers to calculate with.
    pub(super) fn finite(&self, key: &str, values: &[f64]) -> Result<(), RobotError> {
        match values.iter().find(|value| !value.is_finite()) {
            Some(value) => Err(self.fault(format!("{key}: {value} is not a finite number"))),
            None => Ok(()),
        }
    }

    /// Refuses what is not a finite number above 0.
    pub(super) fn positive(&self, key: &str, value: f64) -> Result<(), RobotError> {
        if value > 0.0 && value.is_finite() {
            return Ok(());
        }
        Err(self.fault(format!("{key} = {value} must be positive")))
    }

    /// Refuses what is not a finite number from 0 on.
    pub(super) fn not_negative(&self, key: &str, value: f64) -> Result<(), RobotError> {
        if value >= 0.0 && value.is_finite() {
            return Ok(());
        }
        Err(self.fault(format!("{key} = {value} must not be negative")))
    }

    /// Refuses what is no range.
    fn range(&self, key: &str, [low, high]: [f64; 2]) -> Result<(), RobotError> {
        if low < high && low.is_finite() && high.is_finite() {
            return Ok(());
        }
        Err(self.fault(format!("{key}: [{low}, {high}] must be [low, high]")))
    }

    /// What is known of a link's mass (kg) and centre of mass (m).
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

    /// Refuses two tables of one `kind` and one name.
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
