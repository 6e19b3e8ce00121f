//! Runs of a motion that repeats, of which little more than one period is integrated.

use super::{PlantError, Recording};
use crate::excitation::{Excitation, Reference};

/// Time after the run-in in which an arm forgets how it started, s: the slowest to forget is a soft gear
/// (8000 Nm/rad, 5 % damping: it swings on with exp(−3.5 t)).
const SETTLING_S: f64 = 2.0;
/// The last rows of a run may lack what comes after them (a channel that is read late), by at most the
/// longest delay there is, s.
const UNSETTLED_END_S: f64 = 0.5;

/// The recording of an arm that follows `excitation`, its beginning made by `run`: what the log of `log_rate_hz` shows when the arm has
/// forgotten how it started repeats from then on, and is copied. For arms in which nothing drifts. Where a period is no whole number
/// of rows, or is the only one, `run` is asked for all of it.
///
/// # Errors
/// Those of `run`.
pub fn run_repeating(
    excitation: &Excitation,
    log_rate_hz: f64,
    run: impl FnOnce(&dyn Reference) -> Result<Recording, PlantError>,
) -> Result<Recording, PlantError> {
    let period_s = excitation.series().period_s;
    let rows = period_s * log_rate_hz;
    if excitation.periods() == 1 || (rows - rows.round()).abs() > 1e-6 {
        return run(excitation);
    }
    let begin_s = excitation.periodic_window_s()[0];
    let duration_s = begin_s + period_s + SETTLING_S + UNSETTLED_END_S;
    let begun = run(&Begin { of: excitation, duration_s })?;
    let samples = (excitation.duration_s() * log_rate_hz + 1e-6).floor() as usize + 1;
    let known = begun.time_s.len() - (UNSETTLED_END_S * log_rate_hz).ceil() as usize;
    Ok(begun.repeated(known, rows.round() as usize, samples))
}

/// The beginning of a motion.
struct Begin<'a> {
    of: &'a Excitation,
    duration_s: f64,
}

impl Reference for Begin<'_> {
    fn joints(&self) -> usize {
        self.of.joints()
    }

    fn duration_s(&self) -> f64 {
        self.duration_s
    }

    fn sample(&self, t_s: f64, q_rad: &mut [f64], qd_rad_s: &mut [f64], qdd_rad_s2: &mut [f64]) {
        self.of.sample(t_s, q_rad, qd_rad_s, qdd_rad_s2);
    }
}
