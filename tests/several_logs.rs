//! One estimate from several logs: its σ is true and smaller than that of each log, and logs of different arms are
//! detected.

use armid::dynamics::Model;
use armid::identify::covariance::Covariance;
use armid::identify::{
    Identification, Identifier, Measurement, Options, Regression, Repetition, SeveralLogs,
};
use armid::montecarlo::{Scenario, Simulation};
use armid::plant::Measured;
use armid::robot::JointSignals;

use crate::simulated::{SIGMA_NM, scenario};

/// Four periods of `trajectory`, with noise that is correlated in time and between joints, `times` as large as on the
/// UR5.
fn simulation(trajectory: &str, times: f64, effects: &str) -> Simulation {
    let sd_nm = SIGMA_NM.map(|sd| times * sd);
    let sensors = format!("torque_sd_nm = {sd_nm:?}\nq_sd_rad = 2e-5\nqd_sd_rad_s = 1e-3");
    let rest = format!(
        "[sensors.torque_noise]\ncomponents = [{{ share = 0.5, colour = \"white\" }}, \
         {{ share = 0.5, colour = {{ ar1 = {{ time_constant_s = 0.1 }} }} }}]\ncross_joint_correlation = 0.3\n{effects}"
    );
    Simulation::run(scenario(("several", 11), (trajectory, 4), &sensors, &rest)).unwrap()
}

fn laid_out(identifier: &mut Identifier, log: &Measured) -> Regression {
    identifier.regression(&log.measurement("several")).unwrap()
}

/// The identification of each log alone, and of all logs together.
fn identified(
    identifier: &mut Identifier,
    logs: &[Measured],
) -> (Vec<Identification>, Identification) {
    let logs: Vec<Measurement> = logs.iter().map(|log| log.measurement("several")).collect();
    let each = SeveralLogs::each(identifier, &logs).unwrap();
    let alone = each.iter().map(|log| identifier.identify_regression(log).unwrap()).collect();
    let whole =
        SeveralLogs::together(identifier, &logs, each).unwrap().identify(identifier).unwrap();
    assert!(whole.agreement.is_some(), "all repeat");
    (alone, whole)
}

/// Two and a half seconds more than a period do not repeat. The rows of the other log, a mean over four periods,
/// scatter less than filtered ones: weighted together they have to be filtered as well.
#[test]
fn a_log_beside_a_single_run_counts_as_one() {
    let simulation = simulation("ur5_identification", 1.0, "");
    let Scenario { arm, set, processing, .. } = &simulation.scenario;
    let model = Model::new(arm);
    let mut identifier = Identifier::new(&model, set, processing.clone());
    let whole = simulation.log(0).unwrap();
    let rows = 1250 + 312;
    let mut short = whole.clone();
    short.time_s.truncate(rows);
    for signals in [&mut short.q_rad, &mut short.qd_rad_s, &mut short.torque_nm] {
        *signals = signals.map_joints(|_, y| y[..rows].to_vec());
    }
    let logs = [whole.measurement("whole.csv"), short.measurement("short.csv")];
    let each = SeveralLogs::each(&mut identifier, &logs).unwrap();
    let periods = [0, 1].map(|k| each[k].prepared.processing.period_s.is_some());
    assert_eq!(periods, [true, false]);
    let together = SeveralLogs::together(&mut identifier, &logs, each).unwrap();
    let processing = &together.regression.prepared.processing;
    assert!(processing.period_s.is_none() && processing.cutoff_hz.is_some(), "{processing:?}");
    let warnings = &together.regression.prepared.warnings;
    let is_told = |text: &str| warnings.iter().any(|warning| warning.contains(text));
    assert!(is_told("because short.csv cannot stand alone"), "{warnings:?}");
    let found = together.identify(&mut identifier).unwrap();
    let truth = set.values(&model.standard_parameters());
    let covered = coverage(&found.fit.theta, &found.covariance, &truth);
    // 52 intervals that hold at 95 %: fewer than 43 hold once in 4500 if they are independent.
    assert!(covered > 42.5 / 52.0, "{covered}");
}

/// Share of the base parameters whose 95 % interval holds the truth.
fn coverage(theta: &[f64], covariance: &Covariance, truth: &[f64]) -> f64 {
    let half = covariance.sigma().into_iter().map(|sigma| covariance.quantile_95() * sigma);
    let errors = theta.iter().zip(truth).map(|(theta, truth)| (theta - truth).abs());
    let held = errors.zip(half).filter(|(error, half)| error <= half).count();
    held as f64 / truth.len() as f64
}

const PAIRS: u64 = 24;

/// Two motions, the second with three times the noise: 24 pairs of logs. The coverage is 95 % within five standard
/// errors of its mean over the pairs (Student's t with 23 degrees of freedom exceeds them once in 2e4). The agreement
/// statistic is F with 52 and 312 degrees of freedom, with mean 1.006 and standard deviation 0.21: the mean of 24
/// deviates by more than five of its own standard deviations, 0.043, once in 2e6, and two p-values below 1e-3 occur
/// once in 3600.
#[test]
fn the_sigma_of_two_logs_is_true_and_smaller_than_that_of_each() {
    let simulations =
        [simulation("ur5_identification", 1.0, ""), simulation("ur5_validation", 3.0, "")];
    let scenario = &simulations[0].scenario;
    let model = Model::new(&scenario.arm);
    let truth = scenario.set.values(&model.standard_parameters());
    let mut identifier = Identifier::new(&model, &scenario.set, scenario.processing.clone());
    let mut covered = Vec::new();
    let (mut differing, mut statistics) = (0, 0.0);
    let mut worse = 0.0;
    for trial in 0..PAIRS {
        let logs = [0, 1].map(|k| simulations[k].log(2 * trial + k as u64).unwrap());
        let (parts, whole) = identified(&mut identifier, &logs);
        covered.push(coverage(&whole.fit.theta, &whole.covariance, &truth));
        let agreement = whole.agreement.unwrap();
        println!("{:.3} {agreement:?}", covered[covered.len() - 1]);
        differing += usize::from(!agreement.holds());
        statistics += agreement.statistic / PAIRS as f64;
        let [first, second] = [0, 1].map(|k| parts[k].covariance.sigma());
        let together = whole.covariance.sigma();
        let best = first.iter().zip(&second).map(|(a, b)| a.min(*b));
        let larger = together.iter().zip(best).filter(|(sigma, best)| *sigma > best).count();
        worse += larger as f64 / (truth.len() as f64 * PAIRS as f64);
    }
    let mean = covered.iter().sum::<f64>() / PAIRS as f64;
    let square: f64 = covered.iter().map(|c| (c - mean).powi(2)).sum();
    let error = (square / (PAIRS * (PAIRS - 1)) as f64).sqrt();
    println!(
        "coverage {mean:.4} ± {error:.4}, statistic {statistics:.3}, {differing} differ, {worse:.3} have a larger σ"
    );
    assert!((mean - 0.95).abs() < 5.0 * error, "{mean} ± {error}");
    assert!((statistics - 1.006).abs() < 5.0 * 0.043, "{statistics}");
    assert!(differing < 2, "{differing} of {PAIRS}");
    // The stated σ of a log is itself uncertain, but both σ share that scatter, so that the small gain from the loud
    // log still shows.
    assert!(worse < 0.25, "{worse}");
}

/// Rotor inertias and frictions stay the same; a body of 300 g is detected, and it shows most in a gravity or inertia
/// parameter, not in friction.
#[test]
fn logs_of_an_arm_that_was_loaded_between_them_do_not_agree() {
    let payload = "[[effect]]\nkind = \"payload\"\nmass_kg = 0.3\ncom_x_m = 0.0\ncom_y_m = 0.0\ncom_z_m = 0.06\n";
    let simulations =
        [simulation("ur5_identification", 1.0, ""), simulation("ur5_validation", 1.0, payload)];
    let scenario = &simulations[0].scenario;
    let model = Model::new(&scenario.arm);
    let mut identifier = Identifier::new(&model, &scenario.set, scenario.processing.clone());
    let logs = [0, 1].map(|k| simulations[k].log(k as u64).unwrap());
    let (_, whole) = identified(&mut identifier, &logs);
    let agreement = whole.agreement.unwrap();
    let name = scenario.set.name(agreement.parameter);
    println!("{agreement:?} {name}");
    assert!(agreement.p_value < 1e-9, "{agreement:?}");
    assert!(!name.starts_with('r') && !name.starts_with("Ia"), "{name}");
}

/// A run of 14 minutes is thinned behind its low-pass, one of 40 s is not: together they have the rows of the longer
/// one's rate.
#[test]
fn a_long_run_and_a_short_one_are_used_together() {
    let simulation = simulation("ur5_identification", 1.0, "");
    let Scenario { arm, set, .. } = &simulation.scenario;
    let model = Model::new(arm);
    let options = Options { repetition: Repetition::Never, ..Options::default() };
    let mut identifier = Identifier::new(&model, set, options);
    let short = simulation.log(0).unwrap();
    let rows = short.time_s.len();
    // Whole periods, so that the arm goes on without a jump.
    let repeated = rows - rows % 1250;
    let copies = 102_000 / repeated + 1;
    let tiled = |y: &JointSignals| {
        y.map_joints(|_, y| {
            y[rows - repeated..].iter().copied().cycle().take(copies * repeated).collect()
        })
    };
    let mut long = short.clone();
    long.time_s = (0..copies * repeated).map(|k| 0.008 * k as f64).collect();
    for signals in [&mut long.q_rad, &mut long.qd_rad_s, &mut long.torque_nm] {
        *signals = tiled(signals);
    }
    let both = [&long, &short].map(|log| laid_out(&mut identifier, log));
    let every = both[0].every;
    assert_eq!((every > 1, both[1].every), (true, 1));
    let (long_rows, short_rows) = (both[0].problem.samples, both[1].problem.samples);
    let last = both[1].problem.panels[2].y[(short_rows - 1) / every * every];
    let joined = Regression::joined(both.into()).unwrap();
    let count = long_rows + short_rows.div_ceil(every);
    assert_eq!((joined.problem.samples, joined.course().time_s.len()), (count, count));
    assert_eq!(joined.problem.panels[2].y.last(), Some(&last));
    assert_eq!(joined.problem.panels[0].x.len() % count, 0);
}
