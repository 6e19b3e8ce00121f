//! The claimed σ against the truth in a small Monte Carlo; the full ones are in `reports/noise.md`.
//!
//! A check fails only beyond 5 standard errors of what is claimed (two-sided normal tail 6e-7), so
//! that a true claim fails less than once in a million seeds; the seeds are fixed.

use armid::montecarlo::tally::Tally;
use armid::montecarlo::{Experiment, Scenario};

const STANDARD_ERRORS: f64 = 5.0;
const TRIALS: u64 = 48;

fn tally(toml: &str) -> Tally {
    let scenario = Scenario::from_toml(toml, "test", std::path::Path::new("")).unwrap();
    let experiment = Experiment::prepare(scenario).unwrap();
    let mut worker = experiment.worker();
    let mut tally = Tally::new(experiment.truth.len());
    for trial in 0..TRIALS {
        tally.add(&worker.trial(trial).unwrap());
    }
    tally
}

fn assert_calibrated(toml: &str) {
    let tally = tally(toml);
    let (coverage, error) = tally.mean_coverage();
    assert!((coverage - 0.95).abs() < 0.015 + STANDARD_ERRORS * error, "{coverage} ± {error}");
    let (ratio, error) = tally.pooled_ratio();
    assert!((ratio - 1.0).abs() < 0.05 + STANDARD_ERRORS * error, "{ratio} ± {error}");
}

#[test]
fn white_noise_of_its_own_size_on_every_joint() {
    assert_calibrated(include_str!("../sims/default.toml"));
}

#[test]
fn noise_of_a_real_arms_colour() {
    assert_calibrated(include_str!("../sims/noise_real_arm.toml"));
}
