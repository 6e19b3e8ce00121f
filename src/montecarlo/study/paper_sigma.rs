//! Under which noise the paper's σ, its (20), is wrong, and by how much.

use rayon::prelude::*;
use serde::Serialize;

use super::cutoff::{Bench, RECORD_PERIODS, central_difference};
use super::error::StudyError;
use super::noisy_regressor::{LogNoise, Treatment};
use super::paper_equations::PaperEquations;
use crate::dynamics::Motion;
use crate::identify::covariance::Z_95;
use crate::plant::{Colour, Component, NoiseModel, PerJoint, SensorConfig};
use crate::signal::ZeroPhase;

/// Comparison of the σ of (20) with the true σ under one kind of noise.
#[derive(Debug, Clone, Serialize)]
pub struct SigmaCase {
    /// The torque noise, in words.
    pub noise: &'static str,
    /// Whether the torque went through the same low-pass as the acceleration.
    pub torque_filtered: bool,
    /// True σ over the σ of (20), by formula: smallest, rms and largest over the parameters.
    pub predicted: [f64; 3],
    /// The same, measured.
    pub measured: [f64; 3],
    /// Share of the intervals ±1.96 σ of (20) that hold the true value, mean over the parameters.
    pub coverage: f64,
}

/// Number of cases.
pub(super) const CASES: usize = 7;

struct Case {
    noise: &'static str,
    torque_filtered: bool,
    sd_nm: PerJoint,
    model: NoiseModel,
}

fn cases(own: &PerJoint) -> [Case; CASES] {
    let case = |noise, torque_filtered, sd_nm: &PerJoint, model| Case {
        noise,
        torque_filtered,
        sd_nm: sd_nm.clone(),
        model,
    };
    let ar1 = NoiseModel {
        components: vec![Component { share: 1.0, colour: Colour::Ar1 { time_constant_s: 0.076 } }],
        cross_joint_correlation: 0.3,
    };
    let all = PerJoint::All;
    [
        case("white, 1 Nm on every joint", false, &all(1.0), NoiseModel::white()),
        case("white, 0.3 Nm on every joint", false, &all(0.3), NoiseModel::white()),
        case("white, every joint its own", false, own, NoiseModel::white()),
        case("white, 1 Nm on every joint", true, &all(1.0), NoiseModel::white()),
        case("white, every joint its own", true, own, NoiseModel::white()),
        case("76 ms memory, joints correlated", false, own, ar1),
        case("as on a real arm", false, own, NoiseModel::real_arm()),
    ]
}

/// Runs `trials` trials of every case. `motion` is the exact motion of one period.
pub(super) fn paper_sigma(
    bench: &Bench,
    motion: &Motion,
    trials: u64,
    count: &(dyn Fn() + Sync),
) -> Result<Vec<SigmaCase>, StudyError> {
    let scenario = bench.scenario();
    let rate_hz = bench.rate_hz();
    let formulas = bench.formulas(motion);
    let periods = RECORD_PERIODS as f64;
    let claimed = formulas.paper_sigma(periods);
    let smooth = ZeroPhase::with_single_pass_cutoff(PaperEquations::PAPER.cutoff_hz, 1, rate_hz)?;
    let differentiator = |f: f64| central_difference(f, rate_hz) * smooth.response(f);
    let velocity_sd_rad_s = scenario.sensors.qd_sd_per_joint_rad_s(motion.joints())?;
    let mut results = Vec::new();
    for case in cases(&scenario.sensors.torque_sd_nm) {
        let own = bench.read_by(SensorConfig {
            torque_sd_nm: case.sd_nm,
            torque_noise: case.model.clone(),
            ..scenario.sensors.clone()
        })?;
        let equations =
            PaperEquations { torque_filtered: case.torque_filtered, ..PaperEquations::PAPER };
        let torque_sd_nm = own.torque_sd_nm()?;
        let predicted = formulas.outcome(
            &Treatment {
                differentiator: &differentiator,
                velocity: &|_| 1.0,
                regressor: &|_| 1.0,
                torque: &|f| if case.torque_filtered { smooth.response(f) } else { 1.0 },
                weights: &vec![1.0; torque_sd_nm.len()],
            },
            &LogNoise {
                velocity_sd_rad_s: &velocity_sd_rad_s,
                torque_sd_nm: &torque_sd_nm,
                torque_power: &case.model.spectrum(rate_hz),
                torque_correlation: case.model.cross_joint_correlation,
            },
            periods,
        );
        let fits = (0..trials)
            .into_par_iter()
            .map(|trial| {
                let fit = own.paper_estimate(&equations, &own.simulation.log(trial)?)?;
                count();
                let sigma = (0..fit.theta.len()).map(|k| fit.inverse.row(k).norm()).collect();
                Ok((fit.theta, sigma))
            })
            .collect::<Result<Vec<(Vec<f64>, Vec<f64>)>, StudyError>>()?;
        let number = trials as f64;
        let measured = |k: usize| {
            let mean = fits.iter().map(|(theta, _)| theta[k]).sum::<f64>() / number;
            let square: f64 = fits.iter().map(|(theta, _)| (theta[k] - mean).powi(2)).sum();
            let sigma = fits.iter().map(|(_, sigma)| sigma[k]).sum::<f64>() / number;
            (square / (number - 1.0)).sqrt() / sigma
        };
        let held = |(theta, sigma): &(Vec<f64>, Vec<f64>)| {
            let within = |k: &usize| (theta[*k] - own.theta[*k]).abs() <= Z_95 * sigma[*k];
            (0..theta.len()).filter(within).count() as f64 / theta.len() as f64
        };
        results.push(SigmaCase {
            noise: case.noise,
            torque_filtered: case.torque_filtered,
            predicted: spread(claimed.len(), |k| predicted.variance[k].sqrt() / claimed[k]),
            measured: spread(claimed.len(), measured),
            coverage: fits.iter().map(held).sum::<f64>() / number,
        });
    }
    Ok(results)
}

/// Smallest, rms and largest of `count` values.
fn spread(count: usize, value: impl Fn(usize) -> f64) -> [f64; 3] {
    let values: Vec<f64> = (0..count).map(value).collect();
    let rms = (values.iter().map(|v| v * v).sum::<f64>() / count as f64).sqrt();
    let least = values.iter().copied().fold(f64::INFINITY, f64::min);
    [least, rms, values.iter().copied().fold(0.0, f64::max)]
}
