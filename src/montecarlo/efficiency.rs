//! Efficiency: how close the estimates come to the best possible ones.

use serde::{Deserialize, Serialize};

use super::experiment::{Experiment, TrialError};
use super::simulation::Simulation;
use crate::identify::{Identifier, KnownNoise, Measurement, Options, Repetition, cramer_rao};

/// Noise whose power falls below this share of its largest power has been filtered out: no sensor is that quiet.
const FILTERED_OUT: f64 = 1e-9;

/// Empirical σ over the Cramér–Rao bound.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Efficiency {
    /// Root mean square over the parameters; no unbiased estimator gets below 1.
    pub rms: f64,
    /// Largest ratio of any parameter.
    pub worst: f64,
    /// Name of that parameter.
    pub worst_of: String,
}

impl Efficiency {
    /// Compares the empirical `sigma` with the Cramér–Rao `bound`; parameter k is called `name(k)`.
    pub fn of(sigma: &[f64], bound: &[f64], name: impl Fn(usize) -> String) -> Self {
        let ratios: Vec<f64> = sigma.iter().zip(bound).map(|(s, b)| s / b).collect();
        let worst = (0..ratios.len()).max_by(|a, b| ratios[*a].total_cmp(&ratios[*b])).unwrap_or(0);
        let squares: f64 = ratios.iter().map(|r| r * r).sum();
        Self {
            rms: (squares / ratios.len() as f64).sqrt(),
            worst: ratios.get(worst).copied().unwrap_or(f64::NAN),
            worst_of: name(worst),
        }
    }
}

impl Experiment {
    /// The smallest σ that an unbiased estimator can have for every parameter: the Cramér–Rao bound.
    ///
    /// The bound holds for the whole periods of the noise-free motion, which counts as exactly known, under the
    /// scenario's torque noise at all frequencies that the processing keeps. `None` where that noise has no known law
    /// (rounded readings), where it is filtered out of some frequencies (the torque there would count as known without
    /// error), where the motion does not repeat, or where every trial has a motion of its own (sensors in the loop).
    pub(super) fn cramer_rao_bound(&self) -> Result<Option<Vec<f64>>, TrialError> {
        let Simulation { scenario, recording, .. } = &self.simulation;
        let Some(torque) = self.simulation.known_torque_noise() else { return Ok(None) };
        if scenario.controller_reads_sensors || torque.sd_nm.iter().any(|sd| *sd <= 0.0) {
            return Ok(None);
        }
        let options = Options { repetition: Repetition::Found, ..scenario.processing.clone() };
        let regression =
            Identifier::new(&self.model, &scenario.set, options).regression(&Measurement {
                source: "noise-free log",
                time_s: &recording.time_s,
                q_rad: &recording.q_rad,
                qd_rad_s: &recording.qd_rad_s,
                torque_nm: &recording.torque_nm,
            })?;
        if regression.prepared.replicates.is_none() {
            return Ok(None);
        }
        let rate_hz = regression.problem.rate_hz;
        let harmonics = regression.problem.samples;
        // Resampling to a lower rate reduces the noise power per harmonic by the ratio of the rates.
        let logged_hz = scenario.plant.log_rate_hz;
        let spectrum = torque.model.spectrum(logged_hz);
        let power = |frequency_hz| spectrum(frequency_hz) * rate_hz / logged_hz;
        let powers = (1..=harmonics / 2).map(|k| power(k as f64 * rate_hz / harmonics as f64));
        let (least, most) =
            powers.fold((f64::INFINITY, 0.0f64), |(least, most), p| (least.min(p), most.max(p)));
        if least < FILTERED_OUT * most {
            return Ok(None);
        }
        let noise = KnownNoise {
            torque_sd_nm: torque.sd_nm,
            correlation: torque.model.cross_joint_correlation,
            power: &power,
        };
        let bound = cramer_rao(&regression.problem, &scenario.set, &noise, harmonics)
            .map_err(|e| TrialError::Identify(e.into()))?;
        // Without noise even the last traces of the run-in make a period differ from the others, so that fewer
        // periods are kept here than in the logs of the trials, which keep all of them.
        let found = regression.problem.periods as f64;
        let more = (found / scenario.excitation.periods() as f64).sqrt();
        Ok(Some(bound.into_iter().map(|sigma| sigma * more).collect()))
    }
}
