//! Logs of the simulated UR5 with hidden effects.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::{Arc, Mutex, OnceLock};

use armid::base::BaseSet;
use armid::diagnose::candidates::Candidate;
use armid::diagnose::{Cause, Diagnoser};
use armid::dynamics::Model;
use armid::excitation::{FourierSeries, Reference};
use armid::identify::Options;
use armid::montecarlo::{Scenario, Simulation};
use armid::plant::Measured;
use armid::plant::faults::Effect;
use armid::robot::Arm;

/// Standard deviation of a UR5's torque noise, Nm.
pub const SIGMA_NM: [f64; 6] = [1.0, 1.0, 0.7, 0.15, 0.15, 0.15];
/// Torque sensors with white noise of this size.
pub const TORQUE_NOISE: &str = "torque_sd_nm = [1.0, 1.0, 0.7, 0.15, 0.15, 0.15]\n";
/// The same with encoder noise.
pub const NOISE: &str =
    "torque_sd_nm = [1.0, 1.0, 0.7, 0.15, 0.15, 0.15]\nq_sd_rad = 2e-5\nqd_sd_rad_s = 1e-3\n";

/// Name of a built-in trajectory, and number of periods.
pub type Along<'a> = (&'a str, usize);

/// A Fourier series for `periods` periods after a lead.
pub struct Periodic {
    pub series: FourierSeries,
    pub lead_s: f64,
    pub periods: usize,
}

impl Reference for Periodic {
    fn joints(&self) -> usize {
        self.series.joints()
    }

    fn duration_s(&self) -> f64 {
        self.lead_s + self.periods as f64 * self.series.period_s
    }

    fn sample(&self, t_s: f64, q_rad: &mut [f64], qd_rad_s: &mut [f64], qdd_rad_s2: &mut [f64]) {
        self.series.sample(t_s - self.lead_s, q_rad, qd_rad_s, qdd_rad_s2);
    }
}

/// Parses the `[[effect]]` tables of a scenario.
pub fn effects(tables: &str) -> Vec<Effect> {
    #[derive(serde::Deserialize)]
    struct File {
        #[serde(default)]
        effect: Vec<Effect>,
    }
    toml::from_str::<File>(tables).unwrap_or_else(|e| panic!("{tables}: {e}")).effect
}

/// Scenario `name`, with noise that depends on `name` and `seed`. `sensors` is its sensor table; `rest` is the rest of
/// its file, effects first.
pub fn scenario(
    (name, seed): (&str, u64),
    (trajectory, periods): Along,
    sensors: &str,
    rest: &str,
) -> Scenario {
    let text = format!(
        "name = \"{name}\"\nrobot = \"ur5\"\nseed = {seed}\ntrials = 1\n[motion]\ntrajectory = \"{trajectory}\"\n\
         periods = {periods}\n[sensors]\n{sensors}\n{rest}"
    );
    Scenario::from_toml(&text, name, Path::new(".")).unwrap()
}

/// Runs the plant of the scenario. Tests with the same motion of the arm share one integration, because sensors and
/// noise do not affect the motion.
pub fn simulation(scenario: Scenario) -> Simulation {
    static RUNS: Mutex<BTreeMap<String, Arc<OnceLock<Simulation>>>> = Mutex::new(BTreeMap::new());
    assert!(!scenario.controller_reads_sensors, "such an arm moves differently in every trial");
    let Scenario { arm, excitation, plant, effects, .. } = &scenario;
    let what_moves = format!("{arm:?} {excitation:?} {plant:?} {effects:?}");
    let run = Arc::clone(RUNS.lock().unwrap().entry(what_moves).or_default());
    let run = run.get_or_init(|| Simulation::run(scenario.clone()).unwrap());
    let mut simulation = run.read_by(scenario.sensors.clone()).unwrap();
    simulation.scenario = scenario;
    simulation
}

/// Asserts that the log determines parameter `name` of `cause`: half its 95 % interval is shorter than the magnitude of
/// `truth`, and the interval, doubled, holds `truth`. 3.9 σ are exceeded by chance once in 10⁴ logs.
pub fn assert_holds(cause: &Cause, name: &str, truth: f64) {
    let e = &cause.parameters[name];
    let [low, high] = e.ci95;
    println!(
        "{} {:?} {name}: {} in {low} … {high}, truth {truth}",
        cause.kind, cause.joint, e.value
    );
    let half = 0.5 * (high - low);
    assert!(0.0 < half && half < truth.abs(), "{name}: {e:?} says little of {truth}");
    assert!((e.value - truth).abs() < 2.0 * half, "{name}: {e:?}, truth {truth}");
}

/// An arm and one log of it.
pub struct Run {
    pub arm: Arm,
    pub model: Model,
    pub set: BaseSet,
    pub options: Options,
    pub log: Measured,
}

impl Run {
    pub fn new(scenario: Scenario) -> Self {
        Self::of(&simulation(scenario), 0)
    }

    /// The log of one trial of a simulated plant.
    pub fn of(simulation: &Simulation, trial: u64) -> Self {
        let Scenario { arm, set, processing, .. } = &simulation.scenario;
        let (arm, set, options) = (arm.clone(), set.clone(), processing.clone());
        Self { model: Model::new(&arm), arm, set, options, log: simulation.log(trial).unwrap() }
    }

    /// A diagnoser with all families.
    pub fn diagnoser(&self) -> Diagnoser<'_> {
        Diagnoser::new(&self.arm, &self.model, &self.set, self.options.clone())
    }

    /// A diagnoser with only these families.
    pub fn diagnoser_with(&self, families: Vec<Box<dyn Candidate>>) -> Diagnoser<'_> {
        let Self { arm, model, set, options, .. } = self;
        Diagnoser::with_families(arm, model, set, options.clone(), families)
    }
}
