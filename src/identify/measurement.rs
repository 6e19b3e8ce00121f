//! The channels of a log, as identification reads them.

use super::error::IdentifyError;
use super::prediction::MOVING_RAD_S;
use crate::robot::JointSignals;
use crate::signal::{Tears, reading_noise};

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

    /// The places at which rows of another recording follow.
    pub fn tears(&self) -> Tears {
        let joints: Vec<&[f64]> = (0..self.q_rad.joints()).map(|j| self.q_rad.joint(j)).collect();
        Tears::of(self.time_s, &joints)
    }

    /// Whether joint `j` ever moves faster than [`MOVING_RAD_S`] beyond its noise: σ √(2 ln N) is hardly exceeded by
    /// the largest of N noise values.
    pub(super) fn moves(&self, j: usize) -> bool {
        let qd_rad_s = self.qd_rad_s.joint(j);
        let peak = (2.0 * (qd_rad_s.len() as f64).ln()).sqrt();
        let threshold_rad_s = MOVING_RAD_S + peak * reading_noise(qd_rad_s);
        qd_rad_s.iter().any(|qd| qd.abs() > threshold_rad_s)
    }

    /// Whether joint `j` moves and its torque never changes.
    pub(super) fn is_dead(&self, j: usize) -> bool {
        let torque = self.torque_nm.joint(j);
        let moves = self.qd_rad_s.joint(j).iter().any(|qd| qd.abs() > MOVING_RAD_S);
        moves && torque.iter().all(|t| *t == torque[0])
    }
}
