//! Closed loop from plant to simulation: an effect hidden in the plant and found in a log goes back into the
//! simulation, whose torque must then agree with the truth to within the effect of the log's noise.
//!
//! # Tolerance
//! With covariance V of p parameters, the torque along a motion with regressor X is known to E Σ_j e_j²/σ_j² = Σ_j
//! mean_k (x_jk V x_jkᵀ)/σ_j², and the sum scatters about its expectation like χ²_p/p: it exceeds 1 + 4 √(2/p) times
//! the expectation once in 20 000 logs. The k parameters of the effect add k/p. The replayed motion is the mean of
//! noisy readings up to 10 Hz: for a velocity with noise s per sample at f_s = 125 Hz, the mean of P periods has an
//! acceleration noise of √(2 s²/(P f_s) · 4π² f³/3) = 0.006 rad/s² at 10 Hz. The inertias of the links (4 kg m² at the
//! shoulder, where σ = 1 Nm; smaller in proportion to σ further out) turn that into 0.02 σ per joint: 6 · 0.02² =
//! 0.0025.
//!
//! Above 10 Hz the simulated arm does not follow the log. Where a friction unknown to the controller reverses by Δ
//! (Nm), log and simulation settle differently within τ = 1/(2π · 10 Hz), which costs at most Δ² τ/4 per reversal.

use armid::diagnose::replay::{Replay, ReplayedLog};
use armid::diagnose::{Diagnoser, Finding, Kind, Validation};
use armid::dynamics::Model;
use armid::excitation::FourierSeries;
use armid::identify::{Identifier, Options};
use armid::montecarlo::Scenario;
use armid::plant::faults::{Effect, FaultyPlant};
use armid::plant::{Measured, PerJoint, PlantConfig, Recording, SensorConfig, Sensors};
use armid::random::TrialStreams;
use armid::robot::JointSignals;

use crate::simulated::{Periodic, SIGMA_NM};

const RATE_HZ: f64 = 125.0;
const PERIOD: usize = 1250;
const LEAD: usize = 125;
const PERIODS: usize = 6;
const MOTION_NOISE: f64 = 0.0025;

/// A log of the UR5 with hidden effects, and its torque without noise.
struct Hidden {
    log: Measured,
    truth: Recording,
}

/// Simulates a log with `effects`, written as in a scenario.
fn hide(trajectory: &str, effects: &str, seed: u64) -> Hidden {
    let scenario = crate::simulated::scenario(("replay", 1), (trajectory, 1), "", effects);
    let series = FourierSeries::built_in(trajectory).unwrap();
    // One period is integrated, entered a second before it begins, and then repeated.
    let periodic = Periodic { series, lead_s: LEAD as f64 / RATE_HZ, periods: 1 };
    let config = PlantConfig::default();
    let plant = FaultyPlant::new(&scenario.arm, &scenario.effects, &config).unwrap();
    let known = LEAD + PERIOD;
    let truth = plant.run(&periodic, None).unwrap().repeated(
        known,
        PERIOD,
        LEAD + PERIODS * PERIOD,
        RATE_HZ,
    );
    let sensors = SensorConfig {
        torque_sd_nm: PerJoint::Each(SIGMA_NM.to_vec()),
        q_sd_rad: PerJoint::All(2e-5),
        qd_sd_rad_s: PerJoint::All(1e-3),
        ..SensorConfig::default()
    };
    let sensors = Sensors::new(&sensors, &scenario.arm, RATE_HZ).unwrap();
    let mut log = Measured::like(&truth);
    sensors.measure(&truth, &TrialStreams::new(seed, trajectory.as_bytes(), 0), &mut log);
    Hidden { log, truth }
}

/// Σ_j (rms of simulated minus true torque / σ_j)² along one period of `log`.
fn off(simulated_nm: &JointSignals, hidden: &Hidden, start_s: f64) -> f64 {
    let first = (start_s * RATE_HZ).round() as usize;
    (0..6)
        .map(|j| {
            let simulated = simulated_nm.joint(j);
            let truth = &hidden.truth.torque_nm.joint(j)[first..first + PERIOD];
            let pairs = simulated.iter().zip(truth);
            let mean = pairs.map(|(s, t)| (s - t).powi(2)).sum::<f64>() / PERIOD as f64;
            mean / SIGMA_NM[j].powi(2)
        })
        .sum()
}

/// Σ_j mean_k (x V xᵀ)/σ_j² along `log`, and the start of its periods, s.
fn known_to(finding: &Finding, identifier: &mut Identifier, log: &Measured) -> (f64, f64) {
    let regression = identifier.regression(&log.measurement("known")).unwrap();
    let problem = &regression.problem;
    let factor = finding.identification.covariance.matrix.clone().cholesky().unwrap().l();
    let mut sum = 0.0;
    for column in factor.column_iter() {
        let direction: Vec<f64> = column.iter().copied().collect();
        for (j, sigma_nm) in SIGMA_NM.iter().enumerate() {
            let mut torque = vec![0.0; problem.samples];
            problem.predict(j, &direction, &mut torque);
            let square: f64 = torque.iter().map(|t| t * t).sum();
            sum += square / problem.samples as f64 / sigma_nm.powi(2);
        }
    }
    (sum, regression.prepared.processing.window_s[0])
}

/// Mean of Δ² τ/4 over the reversals of joint `j` (from 0), for friction `mu` |torque| that the controller does not
/// know, in units of the noise.
fn reversals(hidden: &Hidden, j: usize, mu: f64) -> f64 {
    let settling_s = 1.0 / (std::f64::consts::TAU * 10.0);
    let speed = &hidden.truth.qd_rad_s.joint(j)[LEAD..LEAD + PERIOD];
    let torque = &hidden.truth.torque_nm.joint(j)[LEAD..LEAD + PERIOD];
    let square: f64 = (1..PERIOD)
        .filter(|&k| speed[k - 1] * speed[k] < 0.0)
        .map(|k| (2.0 * mu * torque[k]).powi(2) * settling_s / 4.0)
        .sum();
    square * RATE_HZ / PERIOD as f64 / SIGMA_NM[j].powi(2)
}

fn show(log: &ReplayedLog, before: f64, after: f64, tolerance: f64) {
    println!(
        "{}: Σ (e/σ)² {before:.4} before, {after:.4} after, tolerance {tolerance:.4}; removed {:?}",
        log.log, log.removed_fraction
    );
}

/// A hidden effect and its test.
struct Case {
    kind: Kind,
    joint: usize,
    /// Its table, as in a scenario.
    effect: &'static str,
    /// Number of its parameters.
    parameters: usize,
    /// Friction per torque that reverses with the motion.
    mu: f64,
    /// Whether another motion is replayed as well.
    elsewhere: bool,
}

/// Hides the effect, diagnoses it as the only cause, replays it, and compares with the truth.
fn close(case: &Case) -> Replay {
    let hidden = hide("ur5_identification", case.effect, 3);
    let other = case.elsewhere.then(|| hide("ur5_validation", case.effect, 4));
    let arm = armid::robot::Arm::built_in("ur5").unwrap();
    let model = Model::new(&arm);
    let full = armid::base::Parameterisation::full(6, false);
    let set = armid::base::BaseSet::find(&arm, full).unwrap();
    let mut diagnoser = Diagnoser::new(&arm, &model, &set, Options::default());
    let finding = diagnoser.diagnose(&hidden.log.measurement("log"), &[], None).unwrap();
    println!("{:#?}", finding.diagnosis.sentences);
    let named: Vec<_> = finding.diagnosis.causes.iter().map(|c| (c.kind, c.joint)).collect();
    assert_eq!(named, [(case.kind, Some(case.joint))]);
    println!("√λ {:.0}", finding.diagnosis.causes[0].strength);
    let validations: Vec<Validation> = other
        .iter()
        .map(|h| Validation { measurement: h.log.measurement("other"), manufacturer_nm: None })
        .collect();
    let replay = diagnoser.replay(&finding, &validations).unwrap();
    println!("{:#?} {:?}", replay.sentences(), replay.arm_distance);
    assert!(replay.not_replayed.is_empty());
    let [effect] = &replay.effects[..] else { panic!("{:?}", replay.effects) };
    assert_eq!((effect.kind(), effect.joint()), (case.kind.name(), Some(case.joint)));

    let mut identifier = Identifier::new(&model, &set, Options::default());
    let p = set.rank() as f64;
    let logs = std::iter::once((&replay.log, &hidden)).chain(replay.held_out.iter().zip(&other));
    for (log, hidden) in logs {
        let (expected, start_s) = known_to(&finding, &mut identifier, &hidden.log);
        let chance = 1.0 + 4.0 * (2.0 / p).sqrt();
        let tolerance = expected * (1.0 + case.parameters as f64 / p) * chance
            + MOTION_NOISE
            + reversals(hidden, case.joint - 1, case.mu);
        let before = off(&log.course.before_nm, hidden, start_s);
        let after = off(&log.course.after_nm, hidden, start_s);
        show(log, before, after, tolerance);
        assert!(after < tolerance, "{}: {after} of at most {tolerance}", log.log);
        assert!(before > 5.0 * after, "{}: {before} before, {after} after", log.log);
    }
    // In units of the noise of the mean, λ has a random error of √(2 · 6 · 1250) from the square of the noise and of 2
    // √λ from its product with the effect: at √λ = 30 at most 20 % (3 σ).
    let removed = replay.log.removed_fraction.unwrap();
    assert!((removed - 1.0).abs() < 0.2, "{removed}");
    replay
}

#[test]
fn friction_that_grows_with_load() {
    let effect = "[[effect]]\nkind = \"load_friction\"\njoint = 2\nmu = 0.02";
    let kind = Kind::LoadFriction;
    let replay = close(&Case { kind, joint: 2, effect, parameters: 1, mu: 0.02, elsewhere: true });
    // In the run whose torque is compared, the arm follows the log far better than the controller alone makes it.
    let after = &replay.log.after;
    assert!(after.motion_rms_rad[1] < 0.05 * after.tracking_rms_rad[1], "{after:?}");
}

#[test]
fn torque_ripple() {
    let effect = "[[effect]]\nkind = \"ripple\"\njoint = 5\namplitude_nm = 0.15\norder_per_turn = \
                  100.0\nphase_rad = 0.7";
    let kind = Kind::Ripple;
    close(&Case { kind, joint: 5, effect, parameters: 3, mu: 0.0, elsewhere: false });
}

#[test]
fn a_gear_that_gives_way() {
    let effect = "[[effect]]\nkind = \"elasticity\"\njoint = 2\nstiffness_nm_rad = 10000.0";
    let kind = Kind::Elasticity;
    close(&Case { kind, joint: 2, effect, parameters: 1, mu: 0.0, elsewhere: false });
}

/// The written scenario can be loaded and simulated, and its torque is that of the original log to within the reversals
/// of friction and the uncertainty of the parameters.
#[test]
fn the_extended_simulation_is_a_scenario() {
    let effect = "[[effect]]\nkind = \"torque_gain\"\njoint = 2\nerror_fraction = 0.06";
    let hidden = hide("ur5_identification", effect, 5);
    let arm = armid::robot::Arm::built_in("ur5").unwrap();
    let model = Model::new(&arm);
    let full = armid::base::Parameterisation::full(6, false);
    let set = armid::base::BaseSet::find(&arm, full).unwrap();
    let options = Options::default();
    let mut diagnoser = Diagnoser::new(&arm, &model, &set, options.clone());
    let log = hidden.log.measurement("log");
    let finding = diagnoser.diagnose(&log, &[], None).unwrap();
    println!("{:#?}", finding.diagnosis.sentences);
    let simulation = diagnoser.extended_simulation(&finding).unwrap();
    let folder = std::env::temp_dir().join(format!("armid-replay-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("extended.toml");
    let written = Scenario::of_diagnosis(&simulation, &finding, &log, &set, &options).unwrap();
    written.save(&path).unwrap();
    println!("{}", std::fs::read_to_string(&path).unwrap());
    let mut scenario = Scenario::load(Some(&path)).unwrap();
    std::fs::remove_dir_all(&folder).unwrap();
    assert_eq!(scenario.effects, simulation.effects);
    assert_eq!(scenario.excitation.periods(), PERIODS);
    let PerJoint::Each(sd) = &scenario.sensors.qd_sd_rad_s else { panic!("one per joint") };
    // From 7500 samples, a standard deviation is known to 1 %.
    assert!(sd.iter().all(|sd| (sd / 1e-3 - 1.0).abs() < 0.05), "{sd:?}");
    // One period suffices to show that it is the same arm.
    scenario.excitation = scenario.excitation.with_periods(1);
    let again = armid::montecarlo::Simulation::run(scenario).unwrap();
    let first = (again.scenario.excitation.run_in_s() * RATE_HZ).round() as usize;
    let start = (finding.identification.processing.window_s[0] * RATE_HZ).round() as usize;
    for (j, sigma_nm) in SIGMA_NM.iter().enumerate() {
        let simulated = &again.recording.torque_nm.joint(j)[first..first + PERIOD];
        let truth = &hidden.truth.torque_nm.joint(j)[start..start + PERIOD];
        let square: f64 = simulated.iter().zip(truth).map(|(s, t)| (s - t).powi(2)).sum();
        let rms = (square / PERIOD as f64).sqrt();
        println!("joint {}: {rms:.3} Nm", j + 1);
        // The parameters contribute 0.05 σ; the remainder comes from the reversals of friction, where the two motions
        // differ by the tracking error of the controller.
        assert!(rms < 0.5 * sigma_nm, "joint {}: {rms} Nm", j + 1);
    }
}

/// A drive without feed-forward may be found to feed forward less than nothing, and the simulated sensors cannot have
/// an early velocity, which delayed angles make it appear to be. Neither prevents the other causes from being
/// simulated.
#[test]
fn what_no_simulation_has_does_not_take_the_rest_along() {
    let drive = "[[effect]]\nkind = \"feed_forward\"\njoint = 1\nshare_less = 0.9\n";
    let gain = "[[effect]]\nkind = \"torque_gain\"\njoint = 2\nerror_fraction = 0.06";
    let mut hidden = hide("ur5_identification", gain, 3);
    let early = hidden.log.qd_rad_s.map_joints(|_, qd| {
        let next = qd[1..].iter().chain(qd.last());
        qd.iter().zip(next).map(|(now, next)| 0.5 * (now + next)).collect()
    });
    hidden.log.qd_rad_s = early;
    let arm = armid::robot::Arm::built_in("ur5").unwrap();
    let model = Model::new(&arm);
    let full = armid::base::Parameterisation::full(6, false);
    let set = armid::base::BaseSet::find(&arm, full).unwrap();
    let mut diagnoser = Diagnoser::new(&arm, &model, &set, Options::default());
    let mut found = |hidden: &Hidden| {
        let finding = diagnoser.diagnose(&hidden.log.measurement("log"), &[], None).unwrap();
        println!("{:#?}", finding.diagnosis.sentences);
        let simulation = diagnoser.extended_simulation(&finding).unwrap();
        FaultyPlant::new(&arm, &simulation.effects, &simulation.plant).unwrap();
        (finding, simulation)
    };
    let (_, simulation) = found(&hide("ur5_identification", drive, 3));
    let [Effect::FeedForward(fed)] = &simulation.effects[..] else {
        panic!("{:?}", simulation.effects)
    };
    assert!((0.8..=0.9).contains(&fed.share_less), "{fed:?}");

    let (mut finding, simulation) = found(&hidden);
    let lag = finding.diagnosis.causes.iter().find(|c| c.kind == Kind::VelocityLag).unwrap();
    assert!((lag.parameters["delay_s"].value + 0.004).abs() < 2e-4, "{lag:?}");
    let kinds: Vec<&str> = simulation.effects.iter().map(|effect| effect.kind()).collect();
    assert_eq!(kinds, ["torque_gain"]);
    assert!(simulation.of_the_record.is_empty());
    let [not] = &simulation.not_replayed[..] else { panic!("{:?}", simulation.not_replayed) };
    assert_eq!(not.kind, Kind::VelocityLag);
    assert!(not.reason.contains("cannot have delay_s = -0.0040"), "{}", not.reason);

    // A law that no friction can have, beside the gain: it is left out of the simulation, and the part of it that the
    // parameters had absorbed is given back to them.
    let mut lawless = finding.extension.effects[0].clone();
    lawless.family = armid::diagnose::candidates::all()
        .iter()
        .position(|family| family.kind() == Kind::NonlinearViscous)
        .unwrap();
    (lawless.site, lawless.shape.value, lawless.coefficients) = (Some(3), 0.5, vec![-100.0]);
    lawless.absorbed.fill(0.0);
    let viscous = (0..set.rank()).find(|&k| set.name(k) == "rv4").unwrap();
    lawless.absorbed[viscous] = 1.0;
    finding.extension.effects.insert(0, lawless);
    let diagnoser = Diagnoser::new(&arm, &model, &set, Options::default());
    let again = diagnoser.extended_simulation(&finding).unwrap();
    assert_eq!(again.effects, simulation.effects);
    let not = &again.not_replayed[0];
    assert_eq!((not.kind, not.joint), (Kind::NonlinearViscous, Some(4)));
    assert!(not.reason.contains("cannot have it: joint 4"), "{}", not.reason);
    let viscous = |arm: &armid::robot::Arm| arm.joints[3].drive.viscous_nm_s_rad;
    let more = viscous(&again.extended.arm) - viscous(&simulation.extended.arm);
    assert!((more - 1.0).abs() < 0.05, "{more}");
}
