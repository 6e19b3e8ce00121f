//! Speed of the plant: one forward dynamics, one Runge–Kutta step, one second in closed loop, and the sensors of one
//! trial.
//!
//! `cargo bench --bench plant`

use std::hint::black_box;
use std::time::Duration;

use armid::excitation::{Excitation, FourierSeries, Reference};
use armid::plant::{
    Measured, NoiseModel, PerJoint, PlantConfig, RapierArm, RigidDrivetrain, RungeKutta4,
    SensorConfig, Sensors, State, simulate,
};
use armid::random::TrialStreams;
use armid::robot::Arm;
use criterion::{Criterion, Throughput, criterion_group, criterion_main};

fn dynamics(c: &mut Criterion) {
    let arm = Arm::built_in("ur5").unwrap();
    let mut plant = RapierArm::new(&arm).unwrap();
    let (qd, torque) = ([0.4; 6], [1.0; 6]);
    let mut q = [0.1, -1.0, 0.5, 0.3, 0.2, 0.7];
    let mut qdd = [0.0; 6];
    let mut group = c.benchmark_group("plant");
    group.bench_function("forward_dynamics", |b| {
        b.iter(|| {
            // The pose changes in every call, as in an integration.
            q[0] += 1e-7;
            plant.forward_dynamics(black_box(&q), &qd, &torque, &mut qdd);
            qdd[0]
        })
    });

    let mut drivetrain = RigidDrivetrain::new(&arm);
    let mut state = State::zeros(6, 0);
    state.parts_mut().0.copy_from_slice(&q);
    let mut rk4 = RungeKutta4::new(&state);
    group.bench_function("rk4_step", |b| {
        b.iter(|| rk4.step(&mut plant, &mut drivetrain, &mut state, 0.0, 2e-3, black_box(&torque)))
    });
    group.finish();
}

fn closed_loop(c: &mut Criterion) {
    let arm = Arm::built_in("ur5").unwrap();
    let series = FourierSeries::built_in("ur5_identification").unwrap();
    let config = PlantConfig::default();
    let mut group = c.benchmark_group("plant");
    // One element is one simulated second, so that the throughput is simulated seconds per second.
    group.sample_size(10).throughput(Throughput::Elements(series.duration_s() as u64));
    group.bench_function("simulate", |b| {
        b.iter(|| simulate(&arm, black_box(&series), &config, None).unwrap())
    });

    let one_trial = Excitation::new(series, 2.0, 8).unwrap();
    let recording = simulate(&arm, &one_trial, &config, None).unwrap();
    group.sample_size(50).measurement_time(Duration::from_secs(3));
    group.throughput(Throughput::Elements(18 * recording.time_s.len() as u64));
    for (name, torque_noise) in
        [("white", NoiseModel::white()), ("real_arm", NoiseModel::real_arm())]
    {
        let sensors = SensorConfig {
            q_sd_rad: PerJoint::All(2e-5),
            qd_sd_rad_s: PerJoint::All(1e-3),
            torque_sd_nm: PerJoint::Each(vec![1.0, 1.0, 0.7, 0.15, 0.15, 0.15]),
            torque_noise,
            ..SensorConfig::default()
        };
        let sensors = Sensors::new(&sensors, &arm, config.log_rate_hz).unwrap();
        let mut measured = Measured::like(&recording);
        let mut trial = 0;
        group.bench_function(format!("sensors/{name}"), |b| {
            b.iter(|| {
                trial += 1;
                let streams = TrialStreams::new(1, b"bench", trial);
                sensors.measure(&recording, &streams, &mut measured);
            })
        });
    }
    group.finish();
}

criterion_group!(benches, dynamics, closed_loop);
criterion_main!(benches);
