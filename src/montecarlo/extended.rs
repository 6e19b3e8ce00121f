//! Turns the diagnosis of a log into a scenario: the arm with the effects found, the log's motion and its noise.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::scenario::{Scenario, ScenarioError, fingerprint};
use crate::base::BaseSet;
use crate::diagnose::Finding;
use crate::diagnose::replay::ExtendedSimulation;
use crate::excitation::{Excitation, ExcitationError, FourierSeries, Requirements};
use crate::identify::{Measurement, Options};
use crate::output::{OutputError, write_text};
use crate::plant::faults::Effect;
use crate::plant::{PerJoint, PlantConfig, SensorConfig};
use crate::robot::{Arm, JointSignals};
use crate::signal::replicate_noise;

/// Number of trials of a scenario that is made from a log.
const TRIALS: u64 = 100;
/// Seed of a scenario that is made from a log.
const SEED: u64 = 1;

/// A scenario as it is written to a file.
#[derive(Serialize)]
struct ScenarioText<'a> {
    name: &'a str,
    description: &'a str,
    robot: &'a str,
    seed: u64,
    trials: u64,
    controller_reads_sensors: bool,
    motion: MotionText<'a>,
    plant: &'a PlantConfig,
    sensors: &'a SensorConfig,
    processing: &'a Options,
    effect: &'a [Effect],
}

#[derive(Serialize)]
struct MotionText<'a> {
    trajectory: &'a str,
    periods: usize,
    run_in_s: f64,
}

impl Scenario {
    /// The scenario behind `log`, whose diagnosis is `finding`.
    ///
    /// It consists of the arm and the effects of `simulation` (faults of the record included), the mean motion of the
    /// log up to the cut-off as a Fourier series, and white noise of the size that the scatter between the log's
    /// periods shows. `set` are the base parameters that were identified.
    ///
    /// # Errors
    /// [`ScenarioError::OnePeriod`] if the motion does not repeat.
    pub fn of_diagnosis(
        simulation: &ExtendedSimulation,
        finding: &Finding,
        log: &Measurement,
        set: &BaseSet,
        processing: &Options,
    ) -> Result<Self, ScenarioError> {
        let scene = &finding.scene;
        let Some(replicates) =
            finding.identification.replicates.as_ref().filter(|_| scene.periodic)
        else {
            return Err(ScenarioError::OnePeriod { log: log.source.to_owned() });
        };
        let series =
            FourierSeries::of_period(&scene.motion.q_rad, scene.rate_hz, processing.cutoff_hz)?;
        let arm = simulation.extended.arm.clone();
        let run_in_s = run_in_s(&arm, &series, simulation.plant.log_rate_hz)?;
        let excitation = Excitation::new(series, run_in_s, scene.periods)?;
        let (effects, further) = (&simulation.effects, &simulation.of_the_record);
        let effects = simulation.extended.offsets.iter().chain(effects).chain(further);
        let mut scenario = Self {
            name: "extended".to_owned(),
            description: format!("{} with what was found in {}", arm.name, log.source),
            sha256: String::new(),
            files: Vec::new(),
            robot: String::new(),
            set: set.clone(),
            trajectory: String::new(),
            excitation,
            plant: simulation.plant.clone(),
            sensors: SensorConfig {
                torque_sd_nm: PerJoint::Each(replicates.sigma.clone()),
                q_sd_rad: PerJoint::Each(scatter(finding, log, log.q_rad)),
                qd_sd_rad_s: PerJoint::Each(scatter(finding, log, log.qd_rad_s)),
                ..SensorConfig::default()
            },
            effects: effects.cloned().collect(),
            controller_reads_sensors: false,
            processing: processing.clone(),
            seed: SEED,
            trials: TRIALS,
            reduced: None,
            arm,
        };
        let (robot, motion) = (scenario.arm.to_toml(), scenario.excitation.series().to_json());
        scenario.sha256 = fingerprint([&scenario.text("", ""), &robot, &motion]);
        Ok(scenario)
    }

    /// The files that [`Self::save`] writes to `path`.
    pub fn files_of(path: &Path) -> [PathBuf; 3] {
        let beside = |extension: &str| path.with_extension(extension);
        [path.to_owned(), beside("robot.toml"), beside("trajectory.json")]
    }

    /// Writes the scenario to `path`, and next to it the two files that it refers to: the robot `NAME.robot.toml` and
    /// the trajectory `NAME.trajectory.json`. (A reduced set of parameters is not written.)
    pub fn save(&self, path: &Path) -> Result<(), OutputError> {
        let [_, robot, trajectory] = Self::files_of(path);
        let name = |path: &Path| path.file_name().unwrap_or_default().display().to_string();
        let text = self.text(&name(&robot), &name(&trajectory));
        write_text(&robot, &self.arm.to_toml())?;
        write_text(&trajectory, &self.excitation.series().to_json())?;
        write_text(path, &text)
    }

    fn text(&self, robot: &str, trajectory: &str) -> String {
        let text = ScenarioText {
            name: &self.name,
            description: &self.description,
            robot,
            seed: self.seed,
            trials: self.trials,
            controller_reads_sensors: self.controller_reads_sensors,
            motion: MotionText {
                trajectory,
                periods: self.excitation.periods(),
                run_in_s: self.excitation.run_in_s(),
            },
            plant: &self.plant,
            sensors: &self.sensors,
            processing: &self.processing,
            effect: &self.effects,
        };
        // Strings, numbers and tables of them always serialise: the default is never used.
        toml::to_string(&text).unwrap_or_default()
    }
}

/// Length of the run-in, s. The log does not say how its motion was started from rest: this one keeps the limits of the
/// arm, or exceeds them least. It has whole rows, so that each period begins exactly at a row, as in the log.
fn run_in_s(arm: &Arm, series: &FourierSeries, rate_hz: f64) -> Result<f64, ExcitationError> {
    let requirements = Requirements::default();
    let fitted = Excitation::fitted_without_limits(arm, &requirements, series.clone(), 1)?;
    Ok((fitted.run_in_s() * rate_hz - 1e-6).ceil() / rate_hz)
}

/// Standard deviation of one sample, per joint, from the scatter between the periods of `signals`. Zero if the log was
/// resampled to another clock before it was used.
fn scatter(finding: &Finding, log: &Measurement, signals: &JointSignals) -> Vec<f64> {
    let processing = &finding.identification.processing;
    let (n, periods) = (finding.scene.samples(), finding.scene.periods);
    let start = (processing.window_s[0] - log.time_s[0]) * processing.rate_hz;
    let window = start.round() as usize..start.round() as usize + n * periods;
    let spacing =
        (log.time_s.len() - 1) as f64 / (log.time_s[log.time_s.len() - 1] - log.time_s[0]);
    let same_clock = !processing.resampled && (spacing / processing.rate_hz - 1.0).abs() < 1e-6;
    if !same_clock || window.end > signals.samples() {
        return vec![0.0; signals.joints()];
    }
    let noise = replicate_noise(&signals.slice(window), n);
    noise.map_or(vec![0.0; signals.joints()], |noise| noise.sigma)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Joint 1 is fastest where the period begins, and moves by all but 5 % of its range: a run-in of T starts v T/2
    /// away, beyond the range, and the shortest of 0.5 s least. At 125 Hz, 63 rows hold it.
    #[test]
    fn the_run_in_of_a_motion_without_any_is_the_one_that_passes_the_limits_least() {
        let mut arm = Arm::built_in("ur5").unwrap();
        arm.joints[0].limits.position_rad = [-0.105, 0.105];
        let mut a = vec![vec![0.0]; 6];
        a[0] = vec![0.1 * std::f64::consts::TAU];
        let q0 = vec![0.0, -1.2, 0.0, -1.5, 0.3, 0.0];
        let series = FourierSeries::new(1.0, q0, a, vec![vec![0.0]; 6]).unwrap();
        assert_eq!(run_in_s(&arm, &series, 125.0).unwrap(), 63.0 / 125.0);
    }
}
