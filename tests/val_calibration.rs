//! The claimed σ against the truth in a small Monte Carlo; the full ones are in `reports/noise.md`.
//!
//! A check fails only beyond 5 standard errors of what is claimed (two-sided normal tail 6e-7), so
//! that a true claim fails less than once in a million seeds; the seeds are fixed.

use armid::montecarlo::tally::Tally;
use armid::montecarlo::{Experiment, Scenario};

const STANDARD_ERRORS: f64 = 5.0;
const TRIALS: u64 = 48;

fn experiment(toml: &str) -> Experiment {
    let scenario = Scenario::from_toml(toml, "test", std::path::Path::new("")).unwrap();
    Experiment::prepare(scenario).unwrap()
}

/// The tally of `trials` trials, and how many of them had their intervals withheld.
fn run(toml: &str, trials: u64) -> (Tally, usize) {
    let experiment = experiment(toml);
    let mut worker = experiment.worker();
    let mut tally = Tally::new(experiment.truth.len());
    let mut withheld = 0;
    for trial in 0..trials {
        let found = worker.identify(trial).unwrap();
        let quantile = found.covariance.quantile_95();
        let outcomes = experiment.outcomes(&found.fit.theta, &found.sigma(), quantile);
        tally.add(&outcomes.unwrap());
        withheld += usize::from(found.lack_of_fit.is_some_and(|lack| !lack.fits()));
    }
    (tally, withheld)
}

fn assert_calibrated(toml: &str) {
    let (tally, withheld) = run(toml, TRIALS);
    // At the test's level of 1e-3, five alarms in 48 trials have a chance of 2e-9.
    assert!(withheld < 5, "{withheld} of {TRIALS} withheld although the model is right");
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

#[test]
fn intervals_are_withheld_where_the_model_is_wrong() {
    // Joint 2's Coulomb friction is off by more than 30 σ, so that no noise hides the misfit.
    let trials = 6;
    let (_, withheld) = run(include_str!("../sims/noise_model_error.toml"), trials);
    assert_eq!(withheld, trials as usize);
}

/// What is left when the noise is taken away is what the processing does: sampling friction that reverses
/// within a sample, ending the series of the motion. Nothing of it may show in the σ of the noise.
#[test]
fn the_processing_biases_no_parameter_by_a_fifth_of_its_sigma() {
    const QUIETER: f64 = 100.0;
    for toml in [include_str!("../sims/default.toml"), include_str!("../sims/noise_ar1.toml")] {
        let sigma = experiment(toml).scale;
        let loud =
            "torque_sd_nm = [1.0, 1.0, 0.7, 0.15, 0.15, 0.15]\nq_sd_rad = 2e-5\nqd_sd_rad_s = 1e-3";
        assert!(toml.contains(loud));
        let quiet =
            toml.replace(loud, "torque_sd_nm = [0.01, 0.01, 0.007, 0.0015, 0.0015, 0.0015]");
        let quiet = experiment(&quiet);
        let found = quiet.worker().identify(0).unwrap();
        let set = &quiet.simulation.scenario.set;
        for (k, (theta, truth)) in found.fit.theta.iter().zip(&quiet.truth).enumerate() {
            let bias = (theta - truth) / sigma[k];
            // The noise that is left moves an estimate by 1/100 σ; 5 of that.
            assert!(bias.abs() < 0.2 + 5.0 / QUIETER, "{}: {bias:.2} σ", set.name(k));
        }
    }
}
