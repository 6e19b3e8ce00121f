//! Where a Monte Carlo trial's time goes, on one thread, as JSON for `benches/numpy_trial.py` (Linux):
//! `cargo run --release --example trial_profile -- [REPEATS]`
//!
//! The stages are the calls that `Identifier::identify` makes, timed one by one on the log of trial 0 of the default
//! scenario, with the work that each of them does. Times are those of the thread's own clock: what other programs take of the
//! core does not count.

use std::error::Error;
use std::hint::black_box;

use armid::base::ColumnPlan;
use armid::dynamics::Motion;
use armid::identify::covariance::CovarianceKind;
use armid::identify::{Assembler, Estimator, Fitter, Identifier, Options, Problem, Weighting};
use armid::montecarlo::{Scenario, Simulation};
use armid::signal::{FitScratch, PeriodicFit, PeriodicRecord, find_period, replicate_noise};
use rand::rngs::ChaCha8Rng;
use rand::{Rng, SeedableRng};
use rand_distr::{Distribution, StandardNormal};
use serde::Serialize;

#[derive(Serialize)]
struct Profile {
    samples: usize,
    joints: usize,
    parameters: usize,
    rate_hz: f64,
    period_samples: usize,
    periods: usize,
    /// First sample of the first whole period.
    first_sample: usize,
    /// Highest harmonic of the averaged acceleration, per joint.
    harmonics: Vec<usize>,
    /// One trial as the default scenario runs it: noise, then estimate and covariance from the spectra, ms.
    default_trial_ms: f64,
    /// Estimate by weighted least squares and covariance from the periods, of a log in memory, ms.
    wls_periods_ms: f64,
    stages: Vec<Stage>,
    /// ChaCha8 alone, 64-bit numbers per second.
    raw_random_per_s: f64,
    /// ChaCha8 and the ziggurat, normal numbers per second.
    normal_random_per_s: f64,
    theta: Vec<f64>,
    sigma: Vec<f64>,
    names: Vec<String>,
}

#[derive(Serialize)]
struct Stage {
    name: &'static str,
    ms: f64,
    /// What `work` counts.
    unit: &'static str,
    work: f64,
}

/// Time that this thread has been running, ms: the first number of its schedstat, in ns.
fn running_ms() -> Result<f64, Box<dyn Error>> {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat")?;
    let first = text.split_whitespace().next().ok_or("schedstat is empty")?;
    Ok(1e-6 * first.parse::<f64>()?)
}

/// Median time of `repeats` calls, ms.
fn median_ms(repeats: usize, mut call: impl FnMut()) -> Result<f64, Box<dyn Error>> {
    let mut times = Vec::with_capacity(repeats);
    for _ in 0..repeats {
        // The kernel adds up when it schedules: a yield brings the number up to date.
        std::thread::yield_now();
        let begun = running_ms()?;
        call();
        std::thread::yield_now();
        times.push(running_ms()? - begun);
    }
    times.sort_by(f64::total_cmp);
    Ok(times[repeats / 2])
}

fn main() -> Result<(), Box<dyn Error>> {
    let repeats = std::env::args().nth(1).map_or(Ok(100), |n| n.parse::<usize>())?.max(1);
    let simulation = Simulation::run(Scenario::load(None)?)?;
    let scenario = &simulation.scenario;
    let model = armid::dynamics::Model::new(&scenario.arm);
    let set = &scenario.set;
    let log = simulation.log(0)?;
    let samples = log.time_s.len();
    let joints = log.q_rad.joints();

    let wls = Options {
        estimator: Some(Estimator::Wls),
        covariance: Some(CovarianceKind::Periods),
        ..Options::default()
    };
    let mut identifier = Identifier::new(&model, set, wls);
    let result = identifier.identify(&log.measurement("simulated log"))?;
    let wls_periods_ms = median_ms(repeats, || {
        black_box(identifier.identify(&log.measurement("simulated log")).ok());
    })?;
    let mut own = log.clone();
    let mut spectral = Identifier::new(&model, set, Options::default());
    let mut trial = 0;
    let default_trial_ms = median_ms(repeats, || {
        trial += 1;
        simulation.log_into(trial, &mut own).ok();
        black_box(spectral.identify(&own.measurement("simulated log")).ok());
    })?;

    let noise_ms = median_ms(repeats, || {
        simulation.log_into(1, &mut own).ok();
    })?;
    let find_ms = median_ms(repeats, || {
        black_box(find_period(&log.q_rad).ok());
    })?;
    let period = find_period(&log.q_rad)?.ok_or("the default motion repeats")?;
    let cut = |signals: &armid::robot::JointSignals| signals.slice(period.window.clone());
    let torque = cut(&log.torque_nm);
    let record = PeriodicRecord::new(cut(&log.q_rad), cut(&log.qd_rad_s), period.samples);
    let rate_hz = scenario.plant.log_rate_hz;
    let fit = PeriodicFit::new(period.samples, period.periods, rate_hz)?;
    let mut scratch = FitScratch::default();
    let average_ms = median_ms(repeats, || {
        black_box(fit.fit(&record, &mut scratch).ok());
        black_box(replicate_noise(&torque, period.samples).ok());
    })?;
    let averaged = fit.fit(&record, &mut scratch)?;
    let motion = Motion {
        q_rad: averaged.q_rad,
        qd_rad_s: averaged.qd_rad_s,
        qdd_rad_s2: averaged.qdd_rad_s2,
    };
    let mut assembler = Assembler::new(&model);
    let mut problem = Problem::new(ColumnPlan::new(&model, set), rate_hz);
    let assemble_ms = median_ms(repeats, || {
        assembler.assemble(&mut problem, &model, &motion, &torque);
    })?;
    let mut fitter = Fitter::new(&problem);
    let solve_ms = median_ms(repeats, || {
        black_box(fitter.fit(&problem, set, Weighting::PerJoint).ok());
    })?;
    let solved = fitter.fit(&problem, set, Weighting::PerJoint)?;
    let covariance_ms = median_ms(repeats, || {
        black_box(CovarianceKind::Periods.covariance(&problem, &solved).ok());
    })?;

    let n = period.samples as f64;
    let periods = period.periods as f64;
    let columns = |j: usize| problem.plan.base_indices(j).len() as f64;
    // Householder: 2nc² − 2c³/3 for the triangle, 4nc per right-hand side.
    let flops: f64 = (0..joints)
        .map(|j| {
            let c = columns(j);
            2.0 * n * c * c - 2.0 / 3.0 * c.powi(3) + 4.0 * n * c * periods
        })
        .sum();
    let log2 = |x: f64| x.log2();
    let search = samples as f64 * 2.0;
    // Forward and backward transform of the zero-padded angles of every joint, 2.5 m log₂ m each (real data).
    let find_flops = joints as f64 * 2.0 * 2.5 * search * log2(search);
    let average_flops = joints as f64 * (2.0 * periods + 3.0) * 2.5 * n * log2(n);
    let regressor_bytes: f64 = (0..joints).map(|j| 8.0 * n * columns(j)).sum();

    const NUMBERS: usize = 4_000_000;
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let raw_ms = median_ms(5, || {
        black_box((0..NUMBERS).fold(0_u64, |sum, _| sum ^ rng.next_u64()));
    })?;
    let normal_ms = median_ms(5, || {
        let sum: f64 = (0..NUMBERS).map(|_| -> f64 { StandardNormal.sample(&mut rng) }).sum();
        black_box(sum);
    })?;
    let stage = |name, ms, unit, work| Stage { name, ms, unit, work };
    let profile = Profile {
        samples,
        joints,
        parameters: set.rank(),
        rate_hz,
        period_samples: period.samples,
        periods: period.periods,
        first_sample: period.window.start,
        harmonics: averaged.harmonics,
        default_trial_ms,
        wls_periods_ms,
        stages: vec![
            stage(
                "noise of 18 channels",
                noise_ms,
                "normal numbers",
                3.0 * (joints * samples) as f64,
            ),
            stage("finding the period", find_ms, "floating-point operations", find_flops),
            stage("averaging the periods", average_ms, "floating-point operations", average_flops),
            stage("base regressor", assemble_ms, "bytes written", regressor_bytes),
            stage(
                "QR, weights, estimates of all periods",
                solve_ms,
                "floating-point operations",
                flops,
            ),
            stage("covariance", covariance_ms, "numbers", (set.rank() * set.rank()) as f64),
        ],
        raw_random_per_s: NUMBERS as f64 / (1e-3 * raw_ms),
        normal_random_per_s: NUMBERS as f64 / (1e-3 * normal_ms),
        sigma: result.sigma(),
        names: (0..set.rank()).map(|k| set.name(k).to_owned()).collect(),
        theta: result.fit.theta,
    };
    println!("{}", serde_json::to_string_pretty(&profile)?);
    Ok(())
}
