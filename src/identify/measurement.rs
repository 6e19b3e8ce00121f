//! The channels of a log, as identification reads them.

use super::error::IdentifyError;
use super::prediction::MOVING_RAD_S;
use crate::robot::JointSignals;

/// Fewer samples than this are no experiment.
pub(super) const FEWEST_SAMPLES: usize = 64;

/// The channels identification needs of a log, borrowed.
#[derive(Debug, Clone, Copy)]
pub struct Measurement<'a> {
    /// Where the log comes from, for messages.
    pub source: &'a str,
    /// Increasing time stamps, s.
    pub time_s: &'a [f64],
    /// Joint angles, rad.
    pub q_rad: &'a JointSignals,
    /// Joint velocities, rad/s.
    pub qd_rad_s: &'a JointSignals,
    /// Drive torque at the joint i_G k I, Nm.
    pub torque_nm: &'a JointSignals,
}

impl Measurement<'_> {
    /// Refuses a log that is too short to be an experiment.
    ///
    /// # Errors
    /// [`IdentifyError::TooShort`].
    pub(crate) fn require_rows(&self) -> Result<(), IdentifyError> {
        let samples = self.time_s.len();
        if samples < FEWEST_SAMPLES {
            let log = self.source.to_owned();
            return Err(IdentifyError::TooShort { log, samples, needed: FEWEST_SAMPLES });
        }
        Ok(())
    }

    /// Whether joint `j` moves and its torque never changes.
    pub(super) fn is_dead(&self, j: usize) -> bool {
        let torque = self.torque_nm.joint(j);
        let moves = self.qd_rad_s.joint(j).iter().any(|qd| qd.abs() > MOVING_RAD_S);
        moves && torque.iter().all(|t| *t == torque[0])
    }
}
