//! A log as physics is looked for in it: without the faults of its record, and without what touched the arm.

use super::contact::{Compared, WithoutContacts, between_periods};
use super::data_faults::{self, Faults, coarse_joints};
use super::error::DiagnoseError;
use super::kind::Kind;
use super::record::Record;
use super::verdict::Cause;
use crate::identify::{Identifier, Measurement, Options, Regression};

/// See the module.
pub struct Cleaned {
    record: Record,
    /// The faults of the record, as causes.
    pub faults: Vec<Cause>,
    /// Joints (0-based) whose torque is not to be believed.
    pub unreadable: Vec<usize>,
    /// Whether the clock was mended.
    pub is_mended: bool,
    /// What repetitions beside each other say of contacts.
    pub compared: Compared,
    /// What a user should know of it.
    pub warning: Option<String>,
}

impl Cleaned {
    /// Of `m`.
    ///
    /// # Errors
    /// [`DiagnoseError`] where its signals make no record.
    pub fn of(m: &Measurement, options: &Options) -> Result<Self, DiagnoseError> {
        m.require_rows()?;
        let Faults { causes: faults, record, warning, unreadable: mut hanging } =
            data_faults::find(m, options.is_single_run())?;
        let mut unreadable = coarse_joints(&faults);
        unreadable.append(&mut hanging);
        // Across a short mended stall torques are straight lines, which differ from period to period.
        let is_mended = faults.iter().any(|fault| fault.kind == Kind::ClockFault);
        let compared = match is_mended {
            true => Compared::TooFew,
            false => between_periods(&record.measurement(m.source), &unreadable)?,
        };
        Ok(Self { record, faults, unreadable, is_mended, compared, warning })
    }

    /// What touched the arm, where repetitions show that.
    pub fn touched(&self) -> Option<&WithoutContacts> {
        match &self.compared {
            Compared::Touched(touched) => Some(touched),
            Compared::TooFew | Compared::Alike => None,
        }
    }

    /// As a measurement.
    pub fn measurement<'a>(&'a self, source: &'a str) -> Measurement<'a> {
        let m = self.record.measurement(source);
        let torque_nm = self.touched().map_or(m.torque_nm, |touched| &touched.torque_nm);
        Measurement { torque_nm, ..m }
    }

    /// Laid out for regression.
    ///
    /// # Errors
    /// [`DiagnoseError`] where nothing can be identified from it.
    pub fn regression(
        &self,
        identifier: &mut Identifier,
        source: &str,
    ) -> Result<Regression, DiagnoseError> {
        let mut regression = identifier.regression(&self.measurement(source))?;
        regression.prepared.count_filled(&self.record.filled);
        Ok(regression)
    }
}
