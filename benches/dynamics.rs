//! Time per sample of every dynamics algorithm, for the UR5 on a single thread.
//!
//! `cargo bench --bench dynamics`; `benches/compare.sh` compares the numbers with Pinocchio's. Each iteration works
//! through the same random states, so that neither the branch predictor nor cached sines benefit from a repeated state;
//! times are divided by the number of states.

use std::hint::black_box;
use std::time::{Duration, Instant};

use armid::dynamics::{
    Lanes, Model, Motion, RegressorBlock, Workspace, forward_dynamics, inverse_dynamics,
    mass_matrix, regressor,
};
use armid::robot::{Arm, JointSignals};
use criterion::{
    BenchmarkGroup, Criterion, criterion_group, criterion_main, measurement::WallTime,
};
use nalgebra::DMatrix;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};

/// States per pass. The regressor of a block of this many samples takes 1 MB and stays in the second-level cache.
const STATES: usize = 512;

type Angles = [f64; 6];

struct States {
    motion: Motion,
    single: Vec<[Angles; 3]>,
}

fn states() -> States {
    let mut rng = ChaCha8Rng::seed_from_u64(1);
    let mut uniform = |bound: f64| {
        JointSignals::from_fn(6, STATES, |_, _| bound * (2.0 * rng.random::<f64>() - 1.0))
    };
    let motion = Motion {
        q_rad: uniform(std::f64::consts::PI),
        qd_rad_s: uniform(3.0),
        qdd_rad_s2: uniform(10.0),
    };
    let single = (0..STATES)
        .map(|k| {
            let mut state = [[0.0; 6]; 3];
            motion.q_rad.sample_into(k, &mut state[0]);
            motion.qd_rad_s.sample_into(k, &mut state[1]);
            motion.qdd_rad_s2.sample_into(k, &mut state[2]);
            state
        })
        .collect();
    States { motion, single }
}

/// Reports the time per state, measured on whole passes over all states.
fn per_state(group: &mut BenchmarkGroup<'_, WallTime>, name: &str, mut pass: impl FnMut()) {
    group.bench_function(name, |bencher| {
        bencher.iter_custom(|states| {
            // Only whole passes are timed; criterion gets the share of the time for the number of states it asked for.
            let passes = states.div_ceil(STATES as u64);
            let start = Instant::now();
            for _ in 0..passes {
                pass();
            }
            let nanoseconds = start.elapsed().as_nanos() as f64;
            let share = states as f64 / (passes * STATES as u64) as f64;
            Duration::from_nanos((nanoseconds * share).round() as u64)
        });
    });
}

fn dynamics(criterion: &mut Criterion) {
    let model = Model::new(&Arm::built_in("ur5").expect("built in"));
    let States { motion, single } = states();
    let mut ws = Workspace::new(&model);
    let mut group = criterion.benchmark_group("dynamics");

    let mut torque = [0.0; 6];
    per_state(&mut group, "inverse_dynamics", || {
        for [q, qd, qdd] in &single {
            inverse_dynamics(&model, &mut ws, q, qd, qdd, &mut torque);
            black_box(&torque);
        }
    });
    per_state(&mut group, "regressor_single", || {
        for [q, qd, qdd] in &single {
            black_box(regressor(&model, &mut ws, q, qd, qdd));
        }
    });
    let mut lanes: Workspace<Lanes> = Workspace::new(&model);
    let mut block = RegressorBlock::new(&model, STATES);
    per_state(&mut group, "regressor_block", || {
        block.fill(&model, &mut lanes, &motion, 0..STATES);
        black_box(&block);
    });
    let mut small = RegressorBlock::new(&model, 64);
    per_state(&mut group, "regressor_block_of_64", || {
        for start in (0..STATES).step_by(64) {
            small.fill(&model, &mut lanes, &motion, start..start + 64);
            black_box(&small);
        }
    });
    let mut mass = DMatrix::zeros(6, 6);
    per_state(&mut group, "mass_matrix", || {
        for [q, _, _] in &single {
            mass_matrix(&model, &mut ws, q, &mut mass);
            black_box(&mass);
        }
    });
    let mut acceleration = [0.0; 6];
    per_state(&mut group, "forward_dynamics", || {
        for [q, qd, torque] in &single {
            forward_dynamics(&model, &mut ws, q, qd, torque, &mut acceleration)
                .expect("a UR5 has a positive definite mass matrix");
            black_box(&acceleration);
        }
    });
    group.finish();
}

criterion_group!(benches, dynamics);
criterion_main!(benches);
