//! One Monte Carlo trial, its parts, the QR decomposition compared with faer's, and the reader of logs.
//!
//! `cargo bench --bench identify`

use std::hint::black_box;
use std::path::Path;

use armid::base::ColumnPlan;
use armid::identify::{Assembler, Identifier, Measurement, Options, Problem, Repetition, Triangle};
use armid::montecarlo::{Experiment, Scenario};
use criterion::{Criterion, criterion_group, criterion_main};
use faer::Mat;
use faer::prelude::SolveLstsq;

fn trial(criterion: &mut Criterion) {
    let experiment = Experiment::prepare(Scenario::load(None).unwrap()).unwrap();
    let measured = experiment.simulation.log(0).unwrap();
    let measurement = Measurement {
        source: "bench",
        time_s: &measured.time_s,
        q_rad: &measured.q_rad,
        qd_rad_s: &measured.qd_rad_s,
        torque_nm: &measured.torque_nm,
    };
    let set = &experiment.simulation.scenario.set;
    let mut group = criterion.benchmark_group("trial");
    group.sample_size(20);
    let mut worker = experiment.worker();
    let mut k = 0;
    group.bench_function("noise, processing, regression, covariance", |b| {
        b.iter(|| {
            k += 1;
            black_box(worker.trial(k).unwrap())
        })
    });
    let mut identifier = Identifier::new(&experiment.model, set, Options::default());
    group.bench_function("identify, periods averaged", |b| {
        b.iter(|| black_box(identifier.identify(&measurement).unwrap()))
    });
    let single = Options { repetition: Repetition::Never, ..Options::default() };
    let mut identifier = Identifier::new(&experiment.model, set, single);
    group.bench_function("identify, single run of 10 000 samples, filtered", |b| {
        b.iter(|| black_box(identifier.identify(&measurement).unwrap()))
    });
    group.bench_function("find the period", |b| {
        b.iter(|| black_box(armid::signal::find_period(&measured.q_rad).unwrap()))
    });
    let motion = armid::dynamics::Motion {
        q_rad: measured.q_rad.clone(),
        qd_rad_s: measured.qd_rad_s.clone(),
        qdd_rad_s2: measured.qd_rad_s.clone(),
    };
    let mut assembler = Assembler::new(&experiment.model);
    let mut problem = Problem::new(ColumnPlan::new(&experiment.model, set), 125.0);
    group.bench_function("assemble the base regressor of the whole log", |b| {
        b.iter(|| {
            assembler.assemble(&mut problem, &experiment.model, &motion, &measured.torque_nm);
            black_box(problem.samples)
        })
    });
    group.finish();
}

/// Least squares with 10 000 rows × 40 columns and one right-hand side: the size of joint 1 in the default log.
fn qr(criterion: &mut Criterion) {
    let (rows, columns, block) = (10_000, 40, 256);
    let entry = |i: usize, k: usize| (i as f64 * (0.31 + 0.27 * k as f64) + k as f64).sin();
    let x = Mat::from_fn(rows, columns, entry);
    let y = Mat::from_fn(rows, 1, |i, _| entry(i, 50));
    let mut group = criterion.benchmark_group("QR of 10 000 x 40");
    group.sample_size(20);
    group.bench_function("triangle, block by block", |b| {
        let mut scratch = Vec::new();
        b.iter(|| {
            let mut triangle = Triangle::new(columns, 1);
            for start in (0..rows).step_by(block) {
                let n = block.min(rows - start);
                scratch.clear();
                for k in 0..columns {
                    let column = &x.col_as_slice(k)[start..start + n];
                    scratch.extend_from_slice(column);
                }
                scratch.extend_from_slice(&y.col_as_slice(0)[start..start + n]);
                triangle.append(&mut scratch, n);
            }
            let mut solution = triangle.rhs(0).to_vec();
            triangle.solve_in_place(&mut solution);
            black_box(solution)
        })
    });
    group.bench_function("faer, whole matrix", |b| b.iter(|| black_box(x.qr().solve_lstsq(&y))));
    group.finish();
}

/// Reading a log of 10 000 rows.
fn log(criterion: &mut Criterion) {
    let experiment = Experiment::prepare(Scenario::load(None).unwrap()).unwrap();
    let m = experiment.simulation.log(0).unwrap();
    let effort = armid::log::Effort::Torque(m.torque_nm);
    let log = armid::log::Log::new("bench", m.time_s, m.q_rad, m.qd_rad_s, effort).unwrap();
    let file = std::env::temp_dir().join(format!("armid-bench-{}.csv", std::process::id()));
    armid::log::write_log(&file, &log).unwrap();
    let layout = armid::log::Layout::default();
    let mut group = criterion.benchmark_group("log");
    group.sample_size(20);
    group.bench_function("read 10 000 rows of 19 columns", |b| {
        b.iter(|| black_box(armid::log::read_log(Path::new(&file), &layout, 6).unwrap()))
    });
    group.finish();
    std::fs::remove_file(&file).unwrap();
}

criterion_group!(benches, trial, qr, log);
criterion_main!(benches);
