//! Hide and find along single runs, where only the residual itself tells the size of the noise.

use std::f64::consts::TAU;

use armid::diagnose::{Diagnosis, Kind, Verdict};

use crate::simulated::{Run, SIGMA_NM, assert_holds, scenario};

/// A third of a UR5's noise.
const NOISE: &str =
    "torque_sd_nm = [0.3, 0.3, 0.2, 0.05, 0.05, 0.05]\nq_sd_rad = 6e-6\nqd_sd_rad_s = 3e-4\n";

/// 80 s with the effects in `toml`, treated as a run that does not repeat.
fn diagnose(seed: u64, toml: &str) -> Diagnosis {
    let rest = format!("[processing]\nperiod_s = 0.0\n{toml}");
    let run = Run::new(scenario(("single", seed), ("ur5_identification", 8), NOISE, &rest));
    let d = run.diagnoser().diagnose(&run.log.measurement("single"), &[], None).unwrap().diagnosis;
    println!("{:#?}", d.sentences);
    d
}

#[test]
fn a_clean_run_has_no_cause_and_nothing_unexplained() {
    for seed in [1, 2] {
        assert_eq!(diagnose(seed, "").verdict, Verdict::NothingFound);
    }
}

/// Velocity noise, multiplied by the inertias, is in the residual as well as in the torque that would bend a gear. It
/// was once named as stiff gears of joints 2 and 3, with 6 and 9 % of the mean square error.
#[test]
fn noise_of_velocities_is_no_gear() {
    let third = SIGMA_NM.map(|sd| 0.3 * sd);
    let loud = format!("torque_sd_nm = {third:?}\nq_sd_rad = 2e-5\nqd_sd_rad_s = 3e-3\n");
    let run =
        scenario(("loud", 3), ("ur5_identification", 5), &loud, "[processing]\nperiod_s = 0.0");
    let mut run = Run::new(run);
    let diagnose = |run: &Run| {
        run.diagnoser().diagnose(&run.log.measurement("loud"), &[], None).unwrap().diagnosis
    };
    let d = diagnose(&run);
    assert_eq!(d.verdict, Verdict::NothingFound, "{:?}", d.sentences);
    // The same after a standstill longer than the motion and recorded as zero velocity, which says nothing about that
    // noise.
    let rest = 7000;
    let step_s = run.log.time_s[1] - run.log.time_s[0];
    let log = &mut run.log;
    let before = (1..=rest).rev().map(|k| log.time_s[0] - k as f64 * step_s);
    log.time_s = before.chain(log.time_s.iter().copied()).collect();
    log.qd_rad_s = log.qd_rad_s.map_joints(|_, qd| [vec![0.0; rest], qd.to_vec()].concat());
    for signals in [&mut log.q_rad, &mut log.torque_nm] {
        *signals = signals.map_joints(|_, y| [vec![y[0]; rest], y.to_vec()].concat());
    }
    let d = diagnose(&run);
    assert!(d.causes.iter().all(|cause| cause.kind != Kind::Elasticity), "{:?}", d.sentences);
}

/// The gear makes up half of the mean square error, and velocity noise as much.
#[test]
fn a_gear_is_seen_beside_noise_of_velocities() {
    let gear = "kind = \"elasticity\"\njoint = 2\nstiffness_nm_rad = 20000.0\n";
    let d = diagnose(5, &format!("[[effect]]\n{gear}"));
    let named: Vec<_> = d.causes.iter().map(|c| (c.kind, c.joint)).collect();
    assert_eq!(named, [(Kind::Elasticity, Some(2))]);
    assert_holds(&d.causes[0], "stiffness_nm_rad", 20000.0);
    assert_eq!(d.causes[0].form, Some("encoder on the motor"));
}

/// The dictionary for single runs has no late torque of one joint. Bristles explain it instead, and were once named
/// with a confidence of one.
#[test]
fn one_joints_late_torque_is_unexplained_and_nothing_else_for_sure() {
    let d = diagnose(3, "[[effect]]\nkind = \"time_skew\"\njoint = 4\ndelay_s = 0.004\n");
    assert!(d.causes.iter().all(|c| c.confidence <= 0.5), "{:?}", d.causes);
    assert_eq!(d.unexplained.map(|unknown| unknown.joint), Some(4));
}

/// Friction that turns round over four times the range of speeds of the robot's file was once called concave viscous
/// friction and a Stribeck curve, each of thousands of Nm, which cancelled each other.
#[test]
fn friction_that_turns_round_slowly_is_told_its_width() {
    let d = diagnose(7, "[[effect]]\nkind = \"reversal_width\"\njoint = 4\nwidth_rad_s = 0.08\n");
    let named: Vec<_> = d.causes.iter().map(|c| (c.kind, c.joint)).collect();
    assert_eq!(named, [(Kind::ReversalWidth, Some(4))]);
    assert_holds(&d.causes[0], "width_rad_s", 0.08);
}

/// A torque that sways in time has no name. How much it leaves is said all the same; of a clean run, nothing is.
#[test]
fn what_a_run_leaves_is_told_if_it_is_slow() {
    let said = |d: &Diagnosis| d.sentences.iter().any(|s| s.contains("slowly than white noise"));
    assert!(!said(&diagnose(1, "")));
    let rest = "[processing]\nperiod_s = 0.0";
    let mut run = Run::new(scenario(("sway", 1), ("ur5_identification", 8), NOISE, rest));
    let sway_nm = |t_s: f64| (TAU * t_s / 3.7).sin() + (TAU * t_s / 2.3).sin();
    let torque_nm = run.log.torque_nm.joint_mut(2).iter_mut();
    torque_nm.zip(&run.log.time_s).for_each(|(nm, t_s)| *nm += sway_nm(*t_s));
    let d = run.diagnoser().diagnose(&run.log.measurement("sway"), &[], None).unwrap().diagnosis;
    assert_eq!(d.verdict, Verdict::NothingFound, "{:#?}", d.sentences);
    assert!(said(&d), "{:#?}", d.sentences);
}

/// The time constant is a fifth of the record; half of the record was once the shortest that was searched for.
#[test]
fn friction_that_warms_up_early_is_told_its_time() {
    let warming = "kind = \"thermal_drift\"\njoint = 3\nfraction = -0.2\ntime_constant_s = 16.0\n";
    let d = diagnose(4, &format!("[[effect]]\n{warming}"));
    let named: Vec<_> = d.causes.iter().map(|c| (c.kind, c.joint)).collect();
    assert_eq!(named, [(Kind::ThermalDrift, Some(3))]);
    assert_holds(&d.causes[0], "time_constant_s", 16.0);
    let time = &d.causes[0].parameters["time_constant_s"];
    assert!(time.ci95[1] < 24.0, "{time:?}");
}
