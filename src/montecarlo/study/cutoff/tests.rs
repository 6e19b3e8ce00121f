use super::*;
use crate::excitation::Excitation;
use std::path::Path;

fn scenario() -> Scenario {
    let text = include_str!("../../../../sims/cutoff.toml");
    Scenario::from_toml(text, "sims/cutoff.toml", Path::new("sims")).unwrap()
}

/// With the slowest pole of order 4 at 0.837 Hz cos 67.5°, an end takes ln 100/(2π · 0.32 Hz) = 2.29 s at 0.75 Hz,
/// and three of them 6.9 s.
#[test]
fn a_period_that_the_ends_of_the_filter_fill_is_refused() {
    let with_period = |period_s: f64| {
        let scenario = scenario();
        let mut series = scenario.excitation.series().clone();
        series.period_s = period_s;
        let excitation = Excitation::new(series, 0.5, RECORD_PERIODS + 2).unwrap();
        Scenario { excitation, ..scenario }
    };
    check_period(&with_period(10.0)).unwrap();
    match cutoff_study(&with_period(5.0), 2, &|_| ()) {
        Err(StudyError::ShortPeriod { period_s, needed_s, cutoff_hz, .. }) => {
            assert_eq!((period_s, cutoff_hz), (5.0, 0.75));
            assert!((needed_s - 6.87).abs() < 0.1, "{needed_s}");
            check_period(&with_period(needed_s)).unwrap();
        }
        other => panic!("{other:?}"),
    }
}

/// Both ends of the U-shaped curve, parameter by parameter: the mean error of the paper's processing at 2 Hz
/// (filter branch) and at 30 Hz with 1e-2 rad/s (noise branch) is compared with the formula.
///
/// With T trials the mean is known to √(V/T), with V by formula. The deviation from the formula, as a root mean
/// square over the parameters in these units, must stay below 3 plus 5 % of the bias. Even if all parameters were
/// perfectly correlated, chance alone would exceed 3 for less than 0.3 % of seeds (the seed is fixed). The 5 %
/// allow for the formula being of first order in the covariance of the regressor's noise, which fluctuates by
/// 1/√(samples of a correlation time) ≈ 3 %.
#[test]
fn both_branches_are_those_of_the_formula() {
    const TRIALS: u64 = 10;
    let scenario = scenario();
    let run = Bench::new(scenario.clone()).unwrap();
    let motion = run.exact_motion().unwrap();
    for (cutoff_hz, velocity_sd_rad_s, least_bias) in [(2.0, 1e-3, 5.0), (30.0, 1e-2, 5.0)] {
        let qd_sd_rad_s = PerJoint::All(velocity_sd_rad_s);
        let sensors = SensorConfig { qd_sd_rad_s, ..scenario.sensors.clone() };
        let bench = run.read_by(sensors).unwrap();
        let formulas = bench.formulas(&motion);
        let torque_sd_nm = bench.torque_sd_nm().unwrap();
        let filter = ZeroPhase::with_single_pass_cutoff(cutoff_hz, 1, bench.rate_hz()).unwrap();
        let differentiator = |f: f64| central_difference(f, bench.rate_hz()) * filter.response(f);
        let one = |_: f64| 1.0;
        let treatment = Treatment {
            differentiator: &differentiator,
            velocity: &one,
            regressor: &one,
            torque: &one,
            weights: &[1.0; 6],
        };
        let noise = LogNoise {
            velocity_sd_rad_s: &[velocity_sd_rad_s; 6],
            torque_sd_nm: &torque_sd_nm,
            torque_power: &one,
            torque_correlation: 0.0,
        };
        let predicted = formulas.outcome(&treatment, &noise, RECORD_PERIODS as f64);
        let equations = PaperEquations { cutoff_hz, ..PaperEquations::PAPER };
        let thetas: Vec<Vec<f64>> = (0..TRIALS)
            .map(|trial| {
                let log = bench.simulation.log(trial).unwrap();
                bench.paper_estimate(&equations, &log).unwrap().theta
            })
            .collect();
        let error = |k: usize| {
            let mean = thetas.iter().map(|theta| theta[k]).sum::<f64>() / TRIALS as f64;
            mean - bench.theta[k]
        };
        let chance: Vec<f64> =
            predicted.variance.iter().map(|v| (v / TRIALS as f64).sqrt()).collect();
        let bias = rms_in(&chance, |k| predicted.bias[k]);
        let off = rms_in(&chance, |k| error(k) - predicted.bias[k]);
        assert!(bias > least_bias, "no branch to see at {cutoff_hz} Hz: {bias}");
        assert!(off < 3.0 + 0.05 * bias, "{cutoff_hz} Hz: off by {off}, bias {bias}");
    }
}
