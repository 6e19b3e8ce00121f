//! Fast runs of motions that repeat: little more than one period is integrated.

use super::{PlantConfig, PlantError, Recording};
use crate::excitation::{Excitation, Reference};

/// Time after the run-in within which most arms forget how they started, s. Arms with soft, weakly damped gears do not;
/// [`has_forgotten`] detects them.
const SETTLING_S: f64 = 2.0;
/// Time at the end of a run whose rows may be incomplete, s: a delayed channel needs samples from after the end. Equals
/// the longest delay allowed.
const UNSETTLED_END_S: f64 = 0.5;
/// Length of the stretch at the end of the settled rows that is compared with the stretch one period earlier, s: two
/// oscillations of a gear at 4 Hz.
const COMPARED_S: f64 = 0.5;
/// Largest effect of the start that may remain in a signal, as a share of the signal's largest value. For 3 rad, 2
/// rad/s and 100 Nm it is a seventieth, a five-thousandth and a hundred-thousandth of the usual noise (2e-5 rad, 1e-3
/// rad/s, 1 Nm).
const FORGOTTEN: f64 = 1e-7;

/// Recording of an arm that follows `excitation`, where `run` performs the runs. For arms in which nothing drifts.
///
/// Once the arm has forgotten how it started, its log repeats with every period, so that further periods are copied.
/// The whole motion is run instead if copying saves nothing, if the period is not a whole number of log rows and of
/// controller decisions, or if the arm has not forgotten its start in time.
///
/// # Errors
/// The errors of `run`.
pub fn run_repeating(
    excitation: &Excitation,
    config: &PlantConfig,
    mut run: impl FnMut(&dyn Reference) -> Result<Recording, PlantError>,
) -> Result<Recording, PlantError> {
    let period_s = excitation.series().period_s;
    let is_whole = |rate_hz: f64| {
        let count = period_s * rate_hz;
        (count - count.round()).abs() < 1e-6
    };
    let [begin_s, end_s] = excitation.periodic_window_s();
    let duration_s = begin_s + period_s + SETTLING_S + UNSETTLED_END_S;
    let is_worth_it = duration_s < end_s && end_s == excitation.duration_s();
    if !is_worth_it || !is_whole(config.log_rate_hz) || !is_whole(config.control_rate_hz) {
        return run(excitation);
    }
    let rows = |time_s: f64| (time_s * config.log_rate_hz).round() as usize;
    let begun = run(&Begin { of: excitation, duration_s })?;
    let known = begun.time_s.len() - rows(UNSETTLED_END_S);
    if !has_forgotten(&begun, known, rows(period_s), rows(COMPARED_S)) {
        return run(excitation);
    }
    let samples = (excitation.duration_s() * config.log_rate_hz + 1e-6).floor() as usize + 1;
    Ok(begun.repeated(known, rows(period_s), samples, config.log_rate_hz))
}

/// Whether the last `compared` of the first `known` rows agree with those one `period` earlier, to [`FORGOTTEN`].
fn has_forgotten(begun: &Recording, known: usize, period: usize, compared: usize) -> bool {
    [&begun.q_rad, &begun.qd_rad_s, &begun.torque_nm].into_iter().all(|signals| {
        (0..signals.joints()).all(|j| {
            let y = &signals.joint(j)[..known];
            let most = y.iter().fold(0.0f64, |most, y| most.max(y.abs()));
            let first = known - compared.min(known - period);
            (first..known).all(|k| (y[k] - y[k - period]).abs() <= FORGOTTEN * most)
        })
    })
}

/// The first `duration_s` of a motion.
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
