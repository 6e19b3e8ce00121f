use super::*;
use crate::base::Parameterisation;
use crate::excitation::{FourierSeries, Reference};
use crate::montecarlo::study::cutoff::central_difference;
use crate::robot::Arm;
use crate::signal::ZeroPhase;

const RATE_HZ: f64 = 125.0;

/// Exact motion of one period of the identification trajectory.
fn motion() -> Motion {
    let series = FourierSeries::built_in("ur5_identification").unwrap();
    let samples = (series.period_s * RATE_HZ).round() as usize;
    let mut motion = Motion::at_rest(6, samples);
    let [mut q, mut qd, mut qdd] = [[0.0; 6]; 3];
    for k in 0..samples {
        series.sample(k as f64 / RATE_HZ, &mut q, &mut qd, &mut qdd);
        motion.q_rad.set_sample(k, &q);
        motion.qd_rad_s.set_sample(k, &qd);
        motion.qdd_rad_s2.set_sample(k, &qdd);
    }
    motion
}

fn with_formulas(check: impl Fn(&NoisyRegressor)) {
    let arm = Arm::load("ur5").unwrap();
    let model = Model::new(&arm);
    let set = BaseSet::find(&arm, Parameterisation::full(6, false)).unwrap();
    let theta = set.values(&model.standard_parameters());
    let epsilon = arm.friction_epsilon_rad_s;
    check(&NoisyRegressor::new(&model, &set, theta, epsilon, motion(), RATE_HZ));
}

fn outcome(formulas: &NoisyRegressor, cutoff_hz: f64, velocity_sd_rad_s: f64) -> Outcome {
    of_noise(formulas, cutoff_hz, [velocity_sd_rad_s; 6], 1.0)
}

/// Outcome with velocity noise of its own on every joint, and the same torque noise on all of them.
fn of_noise(
    formulas: &NoisyRegressor,
    cutoff_hz: f64,
    velocity_sd_rad_s: [f64; 6],
    torque_sd_nm: f64,
) -> Outcome {
    let filter = ZeroPhase::with_single_pass_cutoff(cutoff_hz, 1, RATE_HZ).unwrap();
    let differentiator = |f: f64| central_difference(f, RATE_HZ) * filter.response(f);
    let one = |_: f64| 1.0;
    let treatment = Treatment {
        differentiator: &differentiator,
        velocity: &one,
        regressor: &one,
        torque: &one,
        weights: &[1.0; 6],
    };
    let noise = LogNoise {
        velocity_sd_rad_s: &velocity_sd_rad_s,
        torque_sd_nm: &[torque_sd_nm; 6],
        torque_power: &one,
        torque_correlation: 0.0,
    };
    formulas.outcome(&treatment, &noise, 1.0)
}

fn norm(values: &[f64]) -> f64 {
    values.iter().map(|v| v * v).sum::<f64>().sqrt()
}

/// To leading order the filter removes the share tan²(πf/f_s)/tan²(πf_c/f_s) of the acceleration. The relative
/// error of this approximation is the same share again, at most (0.5/20)² = 6e-4. The central difference adds
/// (2πf/f_s)⁴/30 < 1e-8.
#[test]
fn the_filter_branch_falls_with_the_square_of_the_cutoff() {
    with_formulas(|formulas| {
        let [low, high] = [20.0, 40.0].map(|hz| norm(&outcome(formulas, hz, 0.0).bias));
        let warped = |hz: f64| (std::f64::consts::PI * hz / RATE_HZ).tan();
        let expected = (warped(40.0) / warped(20.0)).powi(2);
        assert!((low / high / expected - 1.0).abs() < 2e-3, "{low} {high} {expected}");
    });
}

/// With white noise of 1 Nm on every joint and an exact regressor the scatter equals the paper's (20). The
/// regressor is nearly exact: at 40 Hz the filter removes (0.5/40)² = 1.6e-4 of the acceleration.
#[test]
fn without_encoder_noise_and_for_unit_noise_the_scatter_is_the_papers_sigma() {
    with_formulas(|formulas| {
        let scatter = outcome(formulas, 40.0, 0.0).variance;
        for (variance, sigma) in scatter.iter().zip(formulas.paper_sigma(1.0)) {
            assert!((variance.sqrt() / sigma - 1.0).abs() < 2e-3);
        }
    });
}

/// Without torque noise, the scatter by the noise of all encoders is the sum of those by each of them. What is not
/// additive is the attenuation by N. It is σ_i²/ε² = 1e-7 of the mean square of the friction columns at most, and, with
/// σ_ai = 22/s σ_i at 10 Hz, 2e-8 of a mean square of the accelerations of 1 rad²/s⁴. The tolerance allows for columns
/// of which other columns leave no more than a hundredth.
#[test]
fn every_encoder_brings_its_own_noise() {
    const SD_RAD_S: [f64; 6] = [1e-6, 2e-6, 6e-6, 3e-6, 5e-6, 4e-6];
    with_formulas(|formulas| {
        let together = of_noise(formulas, 10.0, SD_RAD_S, 0.0).variance;
        let mut sum = vec![0.0; together.len()];
        for (i, sd_rad_s) in SD_RAD_S.into_iter().enumerate() {
            let only = std::array::from_fn(|j| if j == i { sd_rad_s } else { 0.0 });
            let alone = of_noise(formulas, 10.0, only, 0.0).variance;
            sum.iter_mut().zip(alone).for_each(|(sum, alone)| *sum += alone);
        }
        for (k, (sum, together)) in sum.iter().zip(&together).enumerate() {
            assert!((sum / together - 1.0).abs() < 1e-3, "{k}: {sum} {together}");
        }
    });
}

/// σ_a agrees with the formula for fast sampling, and the noise branch grows in proportion to σ_a².
#[test]
fn the_noise_branch_grows_with_the_variance_of_the_acceleration() {
    let gain = |cutoff_hz: f64| {
        let filter = ZeroPhase::with_single_pass_cutoff(cutoff_hz, 1, RATE_HZ).unwrap();
        let periodic = Periodic::new(12_500, RATE_HZ);
        periodic.noise_gain(|f| central_difference(f, RATE_HZ) * filter.response(f))
    };
    // σ_a² = σ_v² ω_c³ / (4 f_s) for f_c ≪ f_s. Above 10 Hz the central difference falls short of the
    // derivative; these frequencies hold 4 f_c/(π · 10 Hz) = 3 % of σ_a² at f_c = 0.25 Hz, or 1.6 % of σ_a.
    let sigma = gain(0.25).sqrt();
    let expected = ((std::f64::consts::TAU * 0.25).powi(3) / (4.0 * RATE_HZ)).sqrt();
    assert!((sigma / expected - 1.0).abs() < 0.016, "{sigma}");
    with_formulas(|formulas| {
        // At 2e-5 rad/s the attenuation is linear in σ_a². The contribution of the friction columns does not
        // depend on the cut-off; differences to a third cut-off remove it.
        let bias = |hz: f64| {
            let [with, without] = [2e-5, 0.0].map(|sd| outcome(formulas, hz, sd).bias);
            with.iter().zip(without).map(|(a, b)| a - b).collect::<Vec<f64>>()
        };
        let [five, ten, twenty] = [5.0, 10.0, 20.0].map(bias);
        let less =
            |a: &[f64], b: &[f64]| -> Vec<f64> { a.iter().zip(b).map(|(a, b)| a - b).collect() };
        let ratio = norm(&less(&twenty, &five)) / norm(&less(&ten, &five));
        let expected = (gain(20.0) - gain(5.0)) / (gain(10.0) - gain(5.0));
        assert!((ratio / expected - 1.0).abs() < 0.02, "{ratio} {expected}");
    });
}
