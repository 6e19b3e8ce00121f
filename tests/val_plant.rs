//! The plant against Pinocchio and against this crate's own dynamics; neither shares code with the engine.

use armid::dynamics::{
    Model, Workspace, forward_dynamics, inverse_dynamics, kinetic_energy, potential_energy,
};
use armid::excitation::Reference;
use armid::plant::{
    Plant, PlantConfig, RapierArm, Recording, RigidDrivetrain, RungeKutta4, State, simulate,
};
use armid::robot::{Arm, JointSignals};
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};

/// The arm without friction.
fn frictionless(mut arm: Arm) -> Arm {
    for joint in &mut arm.joints {
        joint.drive.viscous_nm_s_rad = 0.0;
        joint.drive.coulomb_nm = 0.0;
    }
    arm
}

/// q_j = centre_j + Σ_l amplitude_jl sin(2π f_l t + phase_jl), an analytic motion.
struct Sines {
    duration_s: f64,
    amplitude_rad: f64,
}

impl Sines {
    /// Six joints with up to about 2 rad/s and 5 rad/s².
    fn vivid(duration_s: f64) -> Self {
        Self { duration_s, amplitude_rad: 0.35 }
    }
}

impl Reference for Sines {
    fn joints(&self) -> usize {
        6
    }

    fn duration_s(&self) -> f64 {
        self.duration_s
    }

    fn sample(&self, t_s: f64, q_rad: &mut [f64], qd_rad_s: &mut [f64], qdd_rad_s2: &mut [f64]) {
        const CENTRE: [f64; 6] = [0.2, -1.3, 0.9, -0.4, 0.7, 0.1];
        for j in 0..6 {
            let (mut q, mut qd, mut qdd) = (CENTRE[j], 0.0, 0.0);
            for l in 1..=3 {
                let w = std::f64::consts::TAU * 0.1 * f64::from(l * 2 - 1);
                let (sin, cos) = (w * t_s + (j as f64 + 1.0) * f64::from(l) * 1.7).sin_cos();
                let a = self.amplitude_rad;
                q += a * sin;
                qd += a * w * cos;
                qdd -= a * w * w * sin;
            }
            (q_rad[j], qd_rad_s[j], qdd_rad_s2[j]) = (q, qd, qdd);
        }
    }
}

/// Pinocchio's articulated-body algorithm without friction, on 200 random states of each of three arms, one of them
/// with tilted axes. Round-off of 1e-16 times the condition number of M (below 1e3) and a thousand operations is 1e-10.
#[test]
fn forward_dynamics_agrees_with_pinocchio() {
    for (arm, states) in crate::golden::all() {
        let mut plant = RapierArm::new(&arm).unwrap();
        let mut worst: f64 = 0.0;
        for s in &states {
            let mut qdd = vec![0.0; arm.dof()];
            plant.forward_dynamics(&s.q_rad, &s.qd_rad_s, &s.applied_nm(), &mut qdd);
            let norm = |v: &mut dyn Iterator<Item = f64>| v.map(|x| x * x).sum::<f64>().sqrt();
            let error = norm(&mut qdd.iter().zip(&s.acceleration_rad_s2).map(|(a, b)| a - b));
            worst = worst.max(error / norm(&mut s.acceleration_rad_s2.iter().copied()));
        }
        println!("{}: worst relative difference to Pinocchio {worst:.1e}", arm.name);
        assert!(worst < 1e-9, "{}: {worst:e}", arm.name);
    }
}

/// Angles up to 3.1 rad, speeds up to 3 rad/s, torques up to 50 Nm; each torque is also applied in two parts, the
/// second as a change of the first. Two algorithms without common code differ by round-off (2e-15 seen); a wrong term
/// in the equations would cause 1e-3 and more.
#[test]
fn forward_dynamics_agrees_with_newton_euler() {
    for name in ["ur5", "ur10e", "ur3e", "ur5e"] {
        let arm = frictionless(Arm::built_in(name).unwrap());
        let n = arm.dof();
        let model = Model::new(&arm);
        let mut ws = Workspace::new(&model);
        let mut plant = RapierArm::new(&arm).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut worst: f64 = 0.0;
        for _ in 0..500 {
            let mut draw = |limit: f64| -> Vec<f64> {
                (0..n).map(|_| rng.random_range(-limit..limit)).collect()
            };
            let (q, qd, torque) = (draw(3.1), draw(3.0), draw(50.0));
            let (mut ours, mut theirs) = (vec![0.0; n], vec![0.0; n]);
            forward_dynamics(&model, &mut ws, &q, &qd, &torque, &mut ours).unwrap();
            let scale = ours.iter().fold(0.0, |m: f64, a| m.max(a.abs()));
            let mut compare = |theirs: &[f64]| {
                for (a, b) in ours.iter().zip(theirs) {
                    worst = worst.max((a - b).abs() / scale);
                }
            };
            let first: Vec<f64> = torque.iter().zip(draw(30.0)).map(|(t, more)| t - more).collect();
            let more: Vec<f64> = torque.iter().zip(&first).map(|(t, first)| t - first).collect();
            plant.forward_dynamics(&q, &qd, &first, &mut theirs);
            plant.add_response(&more, &mut theirs);
            compare(&theirs);
            plant.forward_dynamics(&q, &qd, &torque, &mut theirs);
            compare(&theirs);
        }
        println!("{name}: worst relative difference {worst:.1e}");
        assert!(worst < 1e-9, "{name}: {worst:e}");
    }
}

/// The arm falls from a stretched pose and swings for 20 s; this crate's own dynamics give the energy. The error of the
/// method is O(h⁴): below 1e-9 J at 2 ms here, and about 16 times smaller at half the step.
#[test]
fn a_free_swing_keeps_its_energy() {
    let arm = frictionless(Arm::built_in("ur5").unwrap());
    let drift = |step_s: f64| {
        let n = arm.dof();
        let model = Model::new(&arm);
        let mut ws = Workspace::new(&model);
        let mut plant = RapierArm::new(&arm).unwrap();
        let mut drivetrain = RigidDrivetrain::new(&arm);
        let mut state = State::zeros(n, 0);
        state.parts_mut().0.copy_from_slice(&[0.1, 0.2, 0.4, -0.3, 0.5, 0.2]);
        let mut rk4 = RungeKutta4::new(&state);
        let mut energy = |s: &State| {
            kinetic_energy(&model, &mut ws, s.q_rad(), s.qd_rad_s())
                + potential_energy(&model, s.q_rad())
        };
        let start = energy(&state);
        let mut worst: f64 = 0.0;
        for k in 0..(20.0 / step_s).round() as usize {
            let t = k as f64 * step_s;
            rk4.step(&mut plant, &mut drivetrain, &mut state, t, step_s, &vec![0.0; n]);
            worst = worst.max((energy(&state) - start).abs());
        }
        worst
    };
    let (coarse, fine) = (drift(0.002), drift(0.001));
    println!("largest energy error over 20 s: {coarse:.1e} J at 2 ms, {fine:.1e} J at 1 ms");
    assert!(coarse < 1e-6, "{coarse:e} J");
    assert!(fine < coarse / 8.0, "{fine:e} J is not fourth order against {coarse:e} J");
}

/// Rms per joint of the residual of the equations of motion along a log, Nm.
///
/// The acceleration comes from the log alone, by the fourth-order Hermite formula
/// a_k = 2 (q_{k+1} − 2 q_k + q_{k−1})/h² − (q̇_{k+1} − q̇_{k−1})/(2h),
/// at samples `first`, `first + every`, … of a log with one sample per step.
fn residual_rms(arm: &Arm, log: &Recording, first: usize, every: usize) -> Vec<f64> {
    let n = arm.dof();
    let h = log.time_s[1];
    let model = Model::new(arm);
    let mut ws = Workspace::new(&model);
    let at = |s: &JointSignals, k: usize| -> Vec<f64> { (0..n).map(|j| s.joint(j)[k]).collect() };
    let samples: Vec<usize> = (first..log.time_s.len() - 1).step_by(every).collect();
    let mut sums = vec![0.0; n];
    for &k in &samples {
        let [q0, q, q1] = [k - 1, k, k + 1].map(|k| at(&log.q_rad, k));
        let [v0, v, v1] = [k - 1, k, k + 1].map(|k| at(&log.qd_rad_s, k));
        let a: Vec<f64> = (0..n)
            .map(|j| 2.0 * (q1[j] - 2.0 * q[j] + q0[j]) / (h * h) - (v1[j] - v0[j]) / (2.0 * h))
            .collect();
        let mut torque = vec![0.0; n];
        inverse_dynamics(&model, &mut ws, &q, &v, &a, &mut torque);
        for (j, sum) in sums.iter_mut().enumerate() {
            *sum += (torque[j] - log.torque_nm.joint(j)[k]).powi(2);
        }
    }
    sums.iter().map(|s| (s / samples.len() as f64).sqrt()).collect()
}

/// The equations of motion, evaluated by this crate's inverse dynamics along the plant's log: the error of the plant as
/// a torque.
///
/// The torque is constant while the controller holds it, and the acceleration jumps where the torque changes. With a
/// hold of two steps, the samples in the middle see no jump: their residual is the error of the integrator and of the
/// formula, both O(h⁴). Twice the step then gives about sixteen times the residual with friction; without friction both
/// errors are below round-off. (With a decision at every step, each formula spans a jump, and the slope of the friction
/// causes an O(h²) error of the formula, not of the plant.)
#[test]
fn the_log_obeys_the_equations_of_motion() {
    let ur5 = Arm::built_in("ur5").unwrap();
    let step_s = PlantConfig::default().step_s;
    for (what, arm) in [("frictionless", frictionless(ur5.clone())), ("with friction", ur5)] {
        let [coarse, fine] = [2.0 * step_s, step_s].map(|step_s| {
            let config = PlantConfig {
                step_s,
                control_rate_hz: 0.5 / step_s,
                log_rate_hz: 1.0 / step_s,
                ..PlantConfig::default()
            };
            let log = simulate(&arm, &Sines::vivid(10.0), &config, None).unwrap();
            assert_eq!(log.saturated_decisions, 0);
            let rms = residual_rms(&arm, &log, 1, 2);
            println!("{what}, {step_s} s: {rms:?} Nm");
            rms.iter().fold(0.0, |m: f64, r| m.max(*r))
        });
        println!("  largest: {coarse:.1e} and {fine:.1e} Nm");
        if what == "frictionless" {
            // Angles up to π and inertias up to 5 kg m², differenced twice.
            let round_off_nm = 4.0 * f64::EPSILON * std::f64::consts::PI / step_s.powi(2) * 5.0;
            assert!(coarse.max(fine) < round_off_nm, "{coarse:e} and {fine:e} Nm");
            continue;
        }
        // The accuracy that the documentation of `PlantConfig` promises.
        assert!(fine < 2e-5, "{what}: {fine:e} Nm");
        assert!(fine < coarse / 8.0, "{what}: {fine:e} is not fourth order against {coarse:e} Nm");
    }
}

/// Runs in one thread, in two threads, and in a plant that has run before give the same bits.
#[test]
fn runs_are_bit_identical() {
    let arm = Arm::built_in("ur5").unwrap();
    let config = PlantConfig::default();
    let run = || simulate(&arm, &Sines::vivid(1.0), &config, None).unwrap();
    let in_pool = |threads: usize| -> Vec<Recording> {
        use rayon::prelude::*;
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| (0..4).into_par_iter().map(|_| run()).collect())
    };
    let alone = run();
    for recording in in_pool(1).iter().chain(&in_pool(2)) {
        assert_eq!(*recording, alone);
    }
    let mut plant = Plant::new(&arm, &config).unwrap();
    plant.run(&Sines::vivid(0.37), None).unwrap();
    assert_eq!(plant.run(&Sines::vivid(1.0), None).unwrap(), alone);
}
