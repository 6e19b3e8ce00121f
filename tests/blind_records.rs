//! Hide and find: what a recorder, a sensor or its noise does to a log must not be taken for physics, and physics that
//! acts on all joints must not be taken for a fault of the recorder.

use armid::diagnose::{Diagnosis, Kind};
use armid::plant::Measured;
use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};

use crate::simulated::{NOISE, Run, TORQUE_NOISE, assert_holds, scenario};

/// Diagnoses a log of six periods with `sensors` and the effects in `rest`, modified by `change`.
fn diagnose(
    seed: u64,
    (sensors, rest): (&str, &str),
    change: impl Fn(&mut Measured, &mut ChaCha8Rng),
) -> Diagnosis {
    let mut run = Run::new(scenario(("blind", seed), ("ur5_identification", 6), sensors, rest));
    change(&mut run.log, &mut ChaCha8Rng::seed_from_u64(seed));
    let diagnosis =
        run.diagnoser().diagnose(&run.log.measurement("blind"), &[], None).unwrap().diagnosis;
    println!("{:#?}", diagnosis.sentences);
    diagnosis
}

fn as_recorded(_: &mut Measured, _: &mut ChaCha8Rng) {}

/// Kinds and joints of all named causes.
fn named(diagnosis: &Diagnosis) -> Vec<(Kind, Option<usize>)> {
    diagnosis.causes.iter().map(|cause| (cause.kind, cause.joint)).collect()
}

/// Only noise with a correlation time of half a second: at 30 Hz it has a hundredth of the amplitude of white noise,
/// and no period ends where it began. By design, 3 in 1000 logs of any kind are falsely said to have a fault; none of
/// three in 991 of 1000.
#[test]
fn steep_noise_is_no_fault() {
    let steep = "[sensors.torque_noise]\n\
                 components = [{ share = 1.0, colour = { ar1 = { time_constant_s = 0.5 } } }]";
    for seed in [301, 302, 303] {
        let diagnosis = diagnose(seed, (NOISE, steep), as_recorded);
        assert_eq!(named(&diagnosis), [], "seed {seed}");
        assert!(diagnosis.unexplained.is_none(), "seed {seed}");
    }
}

/// Angles in steps of 10 µrad, while the motion repeats to far less than a step: the scatter between periods does not
/// reveal the rounding.
#[test]
fn rounded_angles_of_a_motion_that_repeats_exactly_are_no_fault() {
    let rounded = format!("{TORQUE_NOISE}q_step_rad = 1e-5\nqd_sd_rad_s = 1e-3");
    let diagnosis = diagnose(311, (&rounded, ""), as_recorded);
    assert_eq!(named(&diagnosis), []);
    assert!(diagnosis.unexplained.is_none());
}

/// Replaces the velocities by the slopes of the angles over five rows.
fn with_slopes(log: &mut Measured, _: &mut ChaCha8Rng) {
    let step_s = log.time_s[1] - log.time_s[0];
    for j in 0..log.q_rad.joints() {
        let q = log.q_rad.joint(j);
        let slope = |y: &[f64]| (y[0] - 8.0 * y[1] + 8.0 * y[3] - y[4]) / (12.0 * step_s);
        let slopes: Vec<f64> = q.windows(5).map(slope).collect();
        log.qd_rad_s.joint_mut(j)[2..q.len() - 2].copy_from_slice(&slopes);
    }
}

const FAST: &str = "[plant]\nlog_rate_hz = 500.0\n";

/// Leaves only the last six periods of 5000 rows of the log.
fn without_run_in(log: &mut Measured) {
    let first = log.time_s.len() - 6 * 5000;
    log.time_s.drain(..first);
    for signals in [&mut log.q_rad, &mut log.qd_rad_s, &mut log.torque_nm] {
        *signals = signals.slice(first..signals.samples());
    }
}

/// Angles in steps of 50 µrad without noise, and velocities computed from them, at a rate that the diagnosis halves:
/// neither the scatter between periods nor the samples that are kept show the rounding.
#[test]
fn coarse_angles_of_a_fast_log_are_no_fault() {
    // Of finer steps, the fastest harmonics show motion as well; and without its run-in, the log begins and ends amid
    // the motion, where the low-pass does not know how it goes on.
    for (seed, step_rad, is_cut) in [(312, 5e-5, false), (314, 1e-5, true)] {
        let rounded = format!("{TORQUE_NOISE}q_step_rad = {step_rad}\n");
        let diagnosis = diagnose(seed, (&rounded, FAST), |log, rng| {
            with_slopes(log, rng);
            if is_cut {
                without_run_in(log);
            }
        });
        assert_eq!(named(&diagnosis), []);
        assert!(diagnosis.unexplained.is_none());
    }
}

/// Angles in steps of 0.01° without noise, and velocities computed from them: their error, 9 and 18 mrad/s at these rates,
/// is the same in every period and turns friction round elsewhere at every reversal. (The log at 125 Hz had friction that
/// turns round over another range of speeds.)
#[test]
fn very_coarse_angles_without_velocities_are_no_fault() {
    let step_rad = 0.01f64.to_radians();
    let rounded = format!("{TORQUE_NOISE}q_step_rad = {step_rad}\n");
    for (seed, rate_hz) in [(315, 125), (316, 250)] {
        let plant = format!("[plant]\nlog_rate_hz = {rate_hz}.0\n");
        let diagnosis = diagnose(seed, (&rounded, &plant), with_slopes);
        assert_eq!(named(&diagnosis), [], "seed {seed}");
        assert!(diagnosis.unexplained.is_none(), "seed {seed}");
        let says_so = |warning: &String| warning.contains("steps of 0.0100° or 0.175 mrad");
        assert!(diagnosis.warnings.iter().any(says_so), "{:?}", diagnosis.warnings);
    }
}

/// What is hidden in such a log is found as in any other.
#[test]
fn friction_is_found_in_coarse_angles_of_a_fast_log() {
    let rounded = format!("{TORQUE_NOISE}q_step_rad = 5e-5\n");
    let effect = "[[effect]]\nkind = \"presliding\"\njoint = 3\nstiffness_per_rad = 1000.0\n";
    let diagnosis = diagnose(313, (&rounded, &format!("{effect}{FAST}")), with_slopes);
    assert_eq!(named(&diagnosis), [(Kind::Presliding, Some(3))]);
    assert!(diagnosis.unexplained.is_none());
    assert_holds(&diagnosis.causes[0], "stiffness_per_rad", 1000.0);
}

/// Friction that builds up after the reversals of all joints comes late, as if the whole torque were recorded late.
#[test]
fn presliding_of_all_joints_is_no_clock() {
    let of_joint = |joint: usize| {
        format!("[[effect]]\nkind = \"presliding\"\njoint = {joint}\nstiffness_per_rad = 300.0\n")
    };
    let everywhere: String = (1..=6).map(of_joint).collect();
    let diagnosis = diagnose(321, (NOISE, &everywhere), as_recorded);
    let named = named(&diagnosis);
    for joint in 1..=6 {
        assert!(named.contains(&(Kind::Presliding, Some(joint))), "joint {joint}: {named:?}");
    }
    assert!(named.iter().all(|(kind, _)| *kind == Kind::Presliding), "{named:?}");
}

/// One in five torque readings of one joint, drawn at random, repeats the reading before it.
#[test]
fn torque_readings_that_repeat_are_no_physics() {
    let diagnosis = diagnose(331, (NOISE, ""), |log, rng| {
        let torque = log.torque_nm.joint_mut(2);
        for k in 1..torque.len() {
            if rng.random_bool(0.2) {
                torque[k] = torque[k - 1];
            }
        }
    });
    assert_eq!(named(&diagnosis), [(Kind::DroppedSamples, Some(3))]);
    // Binomial: the share in 7500 rows has a σ of 0.5 %; the bound is four of them. Repeated readings at standstill are
    // not detected.
    let share = diagnosis.causes[0].parameters["fraction"].value;
    assert!((share - 0.2).abs() < 0.02, "{share}");
}

/// The torque sensor of one joint freezes for two seconds.
#[test]
fn a_torque_that_hangs_is_no_contact() {
    let diagnosis = diagnose(341, (NOISE, ""), |log, _| {
        let from = log.time_s.partition_point(|t| *t < 22.0);
        let to = log.time_s.partition_point(|t| *t < 24.0);
        let torque = log.torque_nm.joint_mut(1);
        let value = torque[from];
        torque[from..to].fill(value);
    });
    assert_eq!(named(&diagnosis), [(Kind::DroppedSamples, Some(2))]);
}

/// One in a hundred angles of every joint is off by 40 mrad in either direction.
#[test]
fn wild_angles_are_outliers_and_no_clock() {
    let diagnosis = diagnose(351, (NOISE, ""), |log, rng| {
        for j in 0..log.q_rad.joints() {
            for q in log.q_rad.joint_mut(j) {
                if rng.random_bool(0.01) {
                    *q += if rng.random_bool(0.5) { 0.04 } else { -0.04 };
                }
            }
        }
    });
    let expected: Vec<_> = (1..=6).map(|joint| (Kind::Outliers, Some(joint))).collect();
    assert_eq!(named(&diagnosis), expected);
}
