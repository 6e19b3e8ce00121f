//! Whether a validation log is described by what was identified.

use super::Validation;
use crate::identify::{MOVING_RAD_S, Prediction, Processing, Residual};
use crate::signal::{Scratch, ZeroPhase};

/// Ratio of validation error to fit error above which a log is said to come from another arm. Along another motion, an
/// incomplete model of the same arm is wrong by up to twice its fit error.
const FOREIGN: f64 = 3.0;
/// Cut-off below which both errors are compared, Hz, unless a single run was already filtered below it. Torque readings
/// carry noise up to half their rate, arms move below a few hertz.
const COMPARED_HZ: f64 = 10.0;
/// Order of the low-pass.
const ORDER: usize = 4;

/// A remark on a `validation` log that the identified parameters do not describe. Only moving samples count: at rest,
/// friction can take any value up to Coulomb friction, in any log of any arm.
///
/// A single run is filtered, the samples of a motion that repeats are not; both errors are therefore compared below the
/// same cut-off.
pub fn remark(
    validation: &Validation,
    (fit, processing): (&Prediction, &Processing),
) -> Option<String> {
    let cutoffs_hz = [processing.cutoff_hz, validation.processing.cutoff_hz];
    let cutoff_hz = cutoffs_hz.into_iter().flatten().reduce(f64::min).unwrap_or(COMPARED_HZ);
    let found = slow_rms_nm(&validation.prediction, &validation.processing, cutoff_hz);
    let usual = slow_rms_nm(fit, processing, cutoff_hz);
    let joint = |(j, (found, usual)): (usize, (&f64, &f64))| {
        // A joint that rested when the arm was identified has no usual error.
        (*usual > 0.0 && *found > FOREIGN * usual).then(|| {
            format!(
                "joint {} by {found:.3} Nm, {:.0} times the error of the fit",
                j + 1,
                found / usual
            )
        })
    };
    let joints: Vec<String> = found.iter().zip(&usual).enumerate().filter_map(joint).collect();
    (!joints.is_empty()).then(|| {
        format!(
            "{}: what was identified does not describe this log (off on {}; errors below {cutoff_hz} Hz): another load, arm or \
             mounting, or channels that were recorded otherwise",
            validation.log.display(),
            joints.join(", ")
        )
    })
}

/// Rms error of `prediction` below `cutoff_hz` in moving samples, per joint, Nm. Of a log that is too short or too slow
/// for the low-pass, that of all frequencies.
fn slow_rms_nm(prediction: &Prediction, processing: &Processing, cutoff_hz: f64) -> Vec<f64> {
    let mut error_nm = prediction.error_nm();
    // A single run keeps only as many samples as its low-pass needs.
    if processing.cutoff_hz.is_none()
        && let Ok(low_pass) = ZeroPhase::new(cutoff_hz, ORDER, processing.rate_hz)
        && low_pass.least_samples() <= error_nm.samples()
    {
        let mut scratch = Scratch::default();
        for j in 0..error_nm.joints() {
            // The length was checked.
            let _ = low_pass.filter_in_place(error_nm.joint_mut(j), &mut scratch);
        }
    }
    let moves = |j: usize, k: usize| prediction.qd_rad_s.joint(j)[k].abs() > MOVING_RAD_S;
    Residual::of(&error_nm, &prediction.measured_nm, moves).rms_nm
}
