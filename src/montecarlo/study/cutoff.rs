//! Cut-off study: bias and scatter against the cut-off frequency, predicted and measured.

use std::ops::Range;

use rayon::prelude::*;
use serde::Serialize;

use super::error::StudyError;
use super::noisy_regressor::{LogNoise, NoisyRegressor, Treatment};
use super::paper_equations::PaperEquations;
use super::paper_sigma::{SigmaCase, paper_sigma};
use super::record_length::{RecordLength, record_length};
use crate::dynamics::{Model, Motion};
use crate::identify::covariance::CovarianceKind;
use crate::identify::{Estimator, Fitter, Identifier, Measurement, Options, Repetition, Weighting};
use crate::montecarlo::scenario::Scenario;
use crate::montecarlo::simulation::Simulation;
use crate::plant::{Measured, PerJoint, SensorConfig};
use crate::robot::JointSignals;
use crate::signal::ZeroPhase;

/// Cut-off frequencies, Hz.
const CUTOFFS_HZ: [f64; 12] = [0.75, 1.0, 1.5, 2.0, 3.0, 5.0, 7.0, 10.0, 15.0, 20.0, 30.0, 40.0];
/// Noise of the velocity reading, rad/s.
const VELOCITY_SD_RAD_S: [f64; 4] = [3e-4, 1e-3, 3e-3, 1e-2];
/// Periods of the record. One more period on either side absorbs the end effects of the filters.
pub(super) const RECORD_PERIODS: usize = 2;

/// Results of the cut-off study.
#[derive(Debug, Clone, Serialize)]
pub struct CutoffStudy {
    /// Name of the scenario.
    pub scenario: String,
    /// Description of the scenario, in a sentence.
    pub description: String,
    /// Number of trials behind every point.
    pub trials: u64,
    /// Length of the record, s.
    pub record_s: f64,
    /// One curve per processing and velocity noise.
    pub curves: Vec<Curve>,
    /// e_N and rms error against the length of the record.
    pub lengths: Vec<RecordLength>,
    /// σ of (20) under several kinds of noise.
    pub sigmas: Vec<SigmaCase>,
}

/// How the log is processed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// By the paper's section IV-B: accelerations by (33), plain least squares.
    Paper,
    /// By this program for a single run: the same low-pass of order 4 on the torque and on every column of the
    /// regressor, weighted least squares.
    Parallel,
}

/// Error against the cut-off.
#[derive(Debug, Clone, Serialize)]
pub struct Curve {
    /// The processing.
    pub method: Method,
    /// Noise σ_v of the velocity reading, rad/s.
    pub velocity_sd_rad_s: f64,
    /// Points in the order of rising cut-off.
    pub points: Vec<Point>,
    /// Measured error of this program if it averages the periods, for which it needs no cut-off.
    pub averaged_error: f64,
}

/// Errors at one cut-off. All errors are root mean squares over the parameters, each in units of the smallest σ that
/// the record's torque noise allows.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Point {
    /// Cut-off, Hz.
    pub cutoff_hz: f64,
    /// Bias due to the filter alone, by formula.
    pub filter_bias: f64,
    /// Bias due to the encoder noise alone, by formula.
    pub noise_bias: f64,
    /// Scatter, by formula.
    pub scatter: f64,
    /// Total error from both biases and the scatter, by formula.
    pub predicted: f64,
    /// Total error of the estimates, measured.
    pub measured: f64,
    /// Bias, measured; the contribution of chance is subtracted, with zero as the lower limit.
    pub measured_bias: f64,
    /// Scatter, measured.
    pub measured_scatter: f64,
}

/// Everything that the trials of one scenario share.
pub(super) struct Bench {
    pub simulation: Simulation,
    pub model: Model,
    pub theta: Vec<f64>,
    /// Number of samples of one period.
    pub period: usize,
    /// Range of samples of the record.
    pub record: Range<usize>,
}

impl Bench {
    pub(super) fn new(scenario: Scenario) -> Result<Self, StudyError> {
        let needed = RECORD_PERIODS + 2;
        let found = scenario.excitation.periods();
        if found < needed {
            let why = "one before and one behind the record take up the filters' ends";
            return Err(StudyError::Periods { scenario: scenario.name, found, needed, why });
        }
        let rate_hz = scenario.plant.log_rate_hz;
        let period_s = scenario.excitation.series().period_s;
        let period = (period_s * rate_hz).round() as usize;
        if (period as f64 - period_s * rate_hz).abs() > 1e-6 {
            return Err(StudyError::UnevenPeriod { scenario: scenario.name, period_s, rate_hz });
        }
        let model = Model::new(&scenario.arm);
        let theta = scenario.set.values(&model.standard_parameters());
        let begin_s = scenario.excitation.periodic_window_s()[0];
        let simulation = Simulation::run(scenario)?;
        let begin = simulation.recording.time_s.partition_point(|t| *t < begin_s - 1e-9);
        let record = begin + period..begin + (1 + RECORD_PERIODS) * period;
        Ok(Self { simulation, model, theta, period, record })
    }

    /// Exact motion of one period of the record.
    pub(super) fn exact_motion(&self) -> Result<Motion, StudyError> {
        let excitation = &self.scenario().excitation;
        let (recording, qdd) = self.simulation.plant.run_with_acceleration(excitation)?;
        let one = self.record.start..self.record.start + self.period;
        Ok(Motion {
            q_rad: recording.q_rad.slice(one.clone()),
            qd_rad_s: recording.qd_rad_s.slice(one.clone()),
            qdd_rad_s2: qdd.slice(one),
        })
    }

    /// The same run, read by other sensors.
    pub(super) fn read_by(&self, sensors: SensorConfig) -> Result<Self, StudyError> {
        Ok(Self {
            simulation: self.simulation.read_by(sensors)?,
            model: Model::new(&self.scenario().arm),
            theta: self.theta.clone(),
            record: self.record.clone(),
            period: self.period,
        })
    }

    pub(super) fn scenario(&self) -> &Scenario {
        &self.simulation.scenario
    }

    pub(super) fn rate_hz(&self) -> f64 {
        self.scenario().plant.log_rate_hz
    }

    pub(super) fn torque_sd_nm(&self) -> Result<Vec<f64>, StudyError> {
        Ok(self.scenario().sensors.torque_sd_per_joint_nm(self.model.dof())?)
    }

    /// The formulas for the error along `motion`, the result of [`Self::exact_motion`].
    pub(super) fn formulas(&self, motion: &Motion) -> NoisyRegressor<'_> {
        let scenario = self.scenario();
        NoisyRegressor::new(
            &self.model,
            &scenario.set,
            self.theta.clone(),
            scenario.arm.friction_epsilon_rad_s,
            motion.clone(),
            self.rate_hz(),
        )
    }

    /// Estimate θ̂ by the method of the paper's section IV-B.
    pub(super) fn paper_estimate(
        &self,
        equations: &PaperEquations,
        log: &Measured,
    ) -> Result<crate::identify::Fit, StudyError> {
        let set = &self.scenario().set;
        let begin = self.record.start - self.period;
        let filtered = begin..self.record.end + self.period;
        let kept = self.period..self.period + self.record.len();
        let problem = equations.assemble(&self.model, set, log, self.rate_hz(), filtered, kept)?;
        Ok(Fitter::new(&problem).fit(&problem, set, Weighting::Equal)?)
    }
}

/// A(f) of the fourth-order central difference, whose frequency response is jA, in rad/s. An ideal derivative has A =
/// ω.
pub(super) fn central_difference(frequency_hz: f64, rate_hz: f64) -> f64 {
    let x = std::f64::consts::TAU * frequency_hz / rate_hz;
    rate_hz * (8.0 * x.sin() - (2.0 * x).sin()) / 6.0
}

/// Number of ends of the low-pass that a period must be long. Identification cuts off an end at either side of a single
/// run, but no more than an eighth of its samples: the record with both ends must be eight of them long, and its
/// periods six.
const ENDS_PER_PERIOD: f64 = 6.0 / RECORD_PERIODS as f64;

/// Refuses a scenario whose period is too short for [`around`] at the lowest cut-off.
fn check_period(scenario: &Scenario) -> Result<(), StudyError> {
    let cutoff_hz = CUTOFFS_HZ.into_iter().fold(f64::INFINITY, f64::min);
    let Options { order, .. } = parallel_options(cutoff_hz);
    let rate_hz = scenario.plant.log_rate_hz;
    let filter = ZeroPhase::new(cutoff_hz, order, rate_hz)?;
    let needed_s = ENDS_PER_PERIOD * filter.edge_samples() as f64 / rate_hz;
    let period_s = scenario.excitation.series().period_s;
    if period_s < needed_s {
        let scenario = scenario.name.clone();
        return Err(StudyError::ShortPeriod { scenario, period_s, needed_s, cutoff_hz });
    }
    Ok(())
}

/// The part of `log` that yields equations for exactly the samples of the record, given that a processing loses `edge`
/// samples at either end.
fn around(bench: &Bench, log: &Measured, edge: usize) -> [JointSignals; 3] {
    let range = bench.record.start - edge..bench.record.end + edge;
    [&log.q_rad, &log.qd_rad_s, &log.torque_nm].map(|signals| signals.slice(range.clone()))
}

fn identify(
    bench: &Bench,
    log: &Measured,
    options: Options,
    edge: usize,
) -> Result<Vec<f64>, StudyError> {
    let set = &bench.scenario().set;
    let [q_rad, qd_rad_s, torque_nm] = around(bench, log, edge);
    let time_s: Vec<f64> = (0..q_rad.samples()).map(|k| k as f64 / bench.rate_hz()).collect();
    let options = Options {
        estimator: Some(Estimator::Wls),
        covariance: Some(CovarianceKind::Wls),
        ..options
    };
    let measurement = Measurement {
        source: "simulated log",
        time_s: &time_s,
        q_rad: &q_rad,
        qd_rad_s: &qd_rad_s,
        torque_nm: &torque_nm,
    };
    Ok(Identifier::new(&bench.model, set, options).identify(&measurement)?.fit.theta)
}

/// Processing options for a single run with a cut-off.
fn parallel_options(cutoff_hz: f64) -> Options {
    Options { cutoff_hz, repetition: Repetition::Never, ..Options::default() }
}

/// Estimates of one trial: by the paper's method and by this program at every cut-off, and by this program from
/// averaged periods.
struct Estimates {
    paper: Vec<Vec<f64>>,
    parallel: Vec<Vec<f64>>,
    averaged: Vec<f64>,
}

fn estimates(bench: &Bench, trial: u64) -> Result<Estimates, StudyError> {
    let log = bench.simulation.log(trial)?;
    let paper = |cutoff_hz: &f64| {
        let equations = PaperEquations { cutoff_hz: *cutoff_hz, ..PaperEquations::PAPER };
        Ok(bench.paper_estimate(&equations, &log)?.theta)
    };
    let parallel = |cutoff_hz: &f64| {
        let options = parallel_options(*cutoff_hz);
        let filter = ZeroPhase::new(options.cutoff_hz, options.order, bench.rate_hz())?;
        identify(bench, &log, options, filter.edge_samples())
    };
    Ok(Estimates {
        paper: CUTOFFS_HZ.iter().map(paper).collect::<Result<_, StudyError>>()?,
        parallel: CUTOFFS_HZ.iter().map(parallel).collect::<Result<_, StudyError>>()?,
        averaged: identify(bench, &log, Options::default(), 0)?,
    })
}

/// Runs the study with `trials` trials per point; `progress` is called with the number of trials done.
pub fn cutoff_study(
    scenario: &Scenario,
    trials: u64,
    progress: &(dyn Fn(u64) + Sync),
) -> Result<CutoffStudy, StudyError> {
    let done = std::sync::atomic::AtomicU64::new(0);
    let count = || progress(done.fetch_add(1, std::sync::atomic::Ordering::Relaxed) + 1);
    check_period(scenario)?;
    let run = Bench::new(scenario.clone())?;
    let motion = run.exact_motion()?;
    let mut curves = Vec::new();
    for velocity_sd_rad_s in VELOCITY_SD_RAD_S {
        let qd_sd_rad_s = PerJoint::All(velocity_sd_rad_s);
        let bench = run.read_by(SensorConfig { qd_sd_rad_s, ..scenario.sensors.clone() })?;
        let formulas = bench.formulas(&motion);
        let torque_sd_nm = bench.torque_sd_nm()?;
        let unit = formulas.least_sigma(&torque_sd_nm, RECORD_PERIODS as f64);
        let all: Vec<Estimates> = (0..trials)
            .into_par_iter()
            .map(|trial| {
                let estimates = estimates(&bench, trial);
                count();
                estimates
            })
            .collect::<Result<_, _>>()?;
        let averaged: Vec<&[f64]> = all.iter().map(|e| e.averaged.as_slice()).collect();
        let averaged_error = Errors::of(&averaged, &bench.theta, &unit).total;
        for method in [Method::Paper, Method::Parallel] {
            let points = CUTOFFS_HZ
                .into_par_iter()
                .enumerate()
                .map(|(at, cutoff_hz)| {
                    let thetas: Vec<&[f64]> = all
                        .iter()
                        .map(|e| match method {
                            Method::Paper => e.paper[at].as_slice(),
                            Method::Parallel => e.parallel[at].as_slice(),
                        })
                        .collect();
                    let measured = Errors::of(&thetas, &bench.theta, &unit);
                    point(&formulas, &bench, method, cutoff_hz, velocity_sd_rad_s, &unit, measured)
                })
                .collect::<Result<_, StudyError>>()?;
            curves.push(Curve { method, velocity_sd_rad_s, points, averaged_error });
        }
    }
    Ok(CutoffStudy {
        scenario: scenario.name.clone(),
        description: scenario.description.clone(),
        trials,
        record_s: run.record.len() as f64 / run.rate_hz(),
        curves,
        lengths: record_length(scenario)?,
        sigmas: paper_sigma(&run, &motion, trials, &count)?,
    })
}

/// Total number of trials that the study runs, for its progress.
pub fn cutoff_study_trials(trials: u64) -> u64 {
    trials * (VELOCITY_SD_RAD_S.len() + super::paper_sigma::CASES) as u64
}

/// Rms of `value(k)` over the parameters k, each in units of `unit[k]`.
pub(super) fn rms_in(unit: &[f64], value: impl Fn(usize) -> f64) -> f64 {
    let sum: f64 = (0..unit.len()).map(|k| (value(k) / unit[k]).powi(2)).sum();
    (sum / unit.len() as f64).sqrt()
}

/// Measured errors at one cut-off.
struct Errors {
    total: f64,
    bias: f64,
    scatter: f64,
}

impl Errors {
    fn of(thetas: &[&[f64]], truth: &[f64], unit: &[f64]) -> Self {
        let count = thetas.len() as f64;
        let mean = |k: usize| thetas.iter().map(|theta| theta[k]).sum::<f64>() / count;
        let variance = |k: usize| {
            let mean = mean(k);
            thetas.iter().map(|theta| (theta[k] - mean).powi(2)).sum::<f64>() / (count - 1.0)
        };
        let scatter = rms_in(unit, |k| variance(k).sqrt());
        let apparent = rms_in(unit, |k| mean(k) - truth[k]);
        // The mean of `count` trials deviates by chance: the part scatter²/count of its squared deviation is not bias.
        let bias = (apparent * apparent - scatter * scatter / count).max(0.0).sqrt();
        Self { total: bias.hypot(scatter), bias, scatter }
    }
}

fn point(
    formulas: &NoisyRegressor,
    bench: &Bench,
    method: Method,
    cutoff_hz: f64,
    velocity_sd_rad_s: f64,
    unit: &[f64],
    measured: Errors,
) -> Result<Point, StudyError> {
    let rate_hz = bench.rate_hz();
    let torque_sd_nm = bench.torque_sd_nm()?;
    let (equal, own): (Vec<f64>, Vec<f64>) = torque_sd_nm.iter().map(|s| (1.0, 1.0 / s)).unzip();
    let options = parallel_options(cutoff_hz);
    let (derivative, both, weights) = match method {
        Method::Paper => (ZeroPhase::with_single_pass_cutoff(cutoff_hz, 1, rate_hz)?, None, &equal),
        Method::Parallel => {
            let smooth_hz = options.derivative_cutoff_hz(rate_hz);
            let derivative = ZeroPhase::new(smooth_hz, options.order, rate_hz)?;
            let both = ZeroPhase::new(cutoff_hz, options.order, rate_hz)?;
            let velocity = ZeroPhase::new(Options::VELOCITY_END * rate_hz, options.order, rate_hz)?;
            (derivative, Some((velocity, both)), &own)
        }
    };
    let differentiator = |f: f64| central_difference(f, rate_hz) * derivative.response(f);
    let ideal = |f: f64| central_difference(f, rate_hz);
    let equations = |f: f64| both.as_ref().map_or(1.0, |(_, both)| both.response(f));
    let velocity = |f: f64| both.as_ref().map_or(1.0, |(velocity, _)| velocity.response(f));
    let white = |_: f64| 1.0;
    let (noisy, exact) =
        (vec![velocity_sd_rad_s; torque_sd_nm.len()], vec![0.0; torque_sd_nm.len()]);
    let noise = |velocity_sd_rad_s| LogNoise {
        velocity_sd_rad_s,
        torque_sd_nm: &torque_sd_nm,
        torque_power: &white,
        torque_correlation: 0.0,
    };
    let treatment = Treatment {
        differentiator: &differentiator,
        velocity: &velocity,
        regressor: &equations,
        torque: &equations,
        weights,
    };
    let periods = RECORD_PERIODS as f64;
    let whole = formulas.outcome(&treatment, &noise(&noisy), periods);
    let filter = formulas.outcome(&treatment, &noise(&exact), periods);
    let plain = Treatment { differentiator: &ideal, ..treatment };
    let unfiltered = formulas.outcome(&plain, &noise(&exact), periods);
    let scatter = rms_in(unit, |k| whole.variance[k].sqrt());
    // The bias that the sampled motion leaves even without a filter belongs to neither branch.
    let filter_bias = rms_in(unit, |k| filter.bias[k] - unfiltered.bias[k]);
    Ok(Point {
        cutoff_hz,
        filter_bias,
        noise_bias: rms_in(unit, |k| whole.bias[k] - filter.bias[k]),
        scatter,
        predicted: rms_in(unit, |k| whole.bias[k]).hypot(scatter),
        measured: measured.total,
        measured_bias: measured.bias,
        measured_scatter: measured.scatter,
    })
}

#[cfg(test)]
mod tests;
