//! A log prepared for the search for physical causes: the faults of its record and the contacts with the arm are taken
//! out.

use super::contact::{Compared, WithoutContacts, between_periods};
use super::data_faults::{self, Faults, coarse_joints};
use super::error::DiagnoseError;
use super::kind::Kind;
use super::record::Record;
use super::verdict::Cause;
use crate::identify::{Identifier, Measurement, Options, Regression, Untorn};

/// A cleaned log, with what was found while cleaning it.
pub struct Cleaned {
    record: Record,
    /// Time of the log before the record, which is its longest run between jumps of the angles, s.
    before_s: f64,
    /// The faults of the record, as causes.
    pub faults: Vec<Cause>,
    /// Joints (0-based) whose torque readings are not reliable.
    pub unreadable: Vec<usize>,
    /// Whether time lost in stalls of the clock was given back.
    pub is_mended: bool,
    /// What the comparison of repetitions shows of contacts.
    pub compared: Compared,
    /// Remarks for the user.
    pub warnings: Vec<String>,
}

impl Cleaned {
    /// Cleans the log `m`.
    ///
    /// # Errors [`DiagnoseError`] if the rows are invalid or the signals cannot be processed.
    pub fn of(m: &Measurement, options: &Options) -> Result<Self, DiagnoseError> {
        m.require_rows()?;
        let untorn = Untorn::of(m);
        let m = &untorn.as_ref().map_or(*m, |run| run.measurement(m.source));
        let Faults { causes: faults, record, mut warnings, unreadable: mut hanging } =
            data_faults::find(m, options.is_single_run())?;
        let mut unreadable = coarse_joints(&faults);
        unreadable.append(&mut hanging);
        // Across a short stall that was mended, the torque is a straight line that differs from period to period, so
        // repetitions cannot be compared.
        let is_mended = faults.iter().any(|fault| fault.kind == Kind::ClockFault);
        let compared = match is_mended {
            true => Compared::TooFew,
            false => between_periods(&record.measurement(m.source), &unreadable)?,
        };
        let before_s = untorn.as_ref().map_or(0.0, |run| run.before_s);
        warnings.extend(untorn.map(|run| run.warning));
        Ok(Self { record, before_s, faults, unreadable, is_mended, compared, warnings })
    }

    /// The contacts found, and the torque without them, if the comparison of repetitions shows any.
    pub fn touched(&self) -> Option<&WithoutContacts> {
        match &self.compared {
            Compared::Touched(touched) => Some(touched),
            Compared::TooFew | Compared::Alike => None,
        }
    }

    /// The log as a measurement, with the torque of contacts taken out.
    pub fn measurement<'a>(&'a self, source: &'a str) -> Measurement<'a> {
        let m = self.record.measurement(source);
        let torque_nm = self.touched().map_or(m.torque_nm, |touched| &touched.torque_nm);
        Measurement { torque_nm, ..m }
    }

    /// The log laid out for regression. Rows that were filled in from other periods are counted as such.
    ///
    /// # Errors [`DiagnoseError`] if nothing can be identified from the log.
    pub fn regression(
        &self,
        identifier: &mut Identifier,
        source: &str,
    ) -> Result<Regression, DiagnoseError> {
        let mut regression = identifier.regression(&self.measurement(source))?;
        regression.prepared.count_filled(&self.record.filled);
        regression.prepared.lead_in_s += self.before_s;
        Ok(regression)
    }
}
