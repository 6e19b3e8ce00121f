//! Written logs read back to the same bits, and currents are converted to torques.

use armid::log::{Effort, Layout, Log, read_log, write_log};
use armid::robot::{Arm, JointSignals};

const JOINTS: usize = 6;
const STEP_S: f64 = 0.008;

/// A log with every optional signal and numbers that are hard to print exactly.
fn full_log() -> Log {
    let hard = [0.1, -0.0, 5e-324, 1.0 / 3.0, 123_456.789e-12, f64::EPSILON, -1e-5, 2.5e-7];
    let time_s: Vec<f64> = (0..50).map(|k| 1e9 + STEP_S * k as f64).collect();
    let of =
        |scale: f64| JointSignals::from_fn(JOINTS, 50, |j, k| hard[(j + k) % hard.len()] * scale);
    // The arm is at rest, so that the hard numbers do not count as jumps.
    let current = |scale| Effort::Current { ampere: of(scale), gain_nm_a: None };
    let still = JointSignals::from_fn(JOINTS, 50, |j, _| hard[j] / 10.0);
    let mut log = Log::new("made", time_s, still.clone(), of(1e-3), current(1.0)).unwrap();
    log.target_q_rad = Some(still);
    log.target_qd_rad_s = Some(of(1e-4));
    log.target_qdd_rad_s2 = Some(of(1.7));
    log.target_effort = Some(current(0.9));
    log.temperature_c = Some(of(30.0));
    log
}

fn bits(signals: &JointSignals) -> Vec<u64> {
    (0..signals.joints()).flat_map(|j| signals.joint(j).iter().map(|v| v.to_bits())).collect()
}

#[test]
fn a_written_log_reads_back_to_the_same_bits() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.csv");
    let log = full_log();
    let sha256 = write_log(&path, &log).unwrap();
    let back = read_log(&path, &Layout::default(), JOINTS).unwrap();
    assert_eq!(back.sha256, sha256);
    assert_eq!(back.rows, log.rows);
    assert_eq!(back.time_s, log.time_s);
    for (a, b) in [
        (Some(&back.q_rad), Some(&log.q_rad)),
        (Some(&back.qd_rad_s), Some(&log.qd_rad_s)),
        (Some(back.effort.signals()), Some(log.effort.signals())),
        (back.target_q_rad.as_ref(), log.target_q_rad.as_ref()),
        (back.target_qd_rad_s.as_ref(), log.target_qd_rad_s.as_ref()),
        (back.target_qdd_rad_s2.as_ref(), log.target_qdd_rad_s2.as_ref()),
        (back.temperature_c.as_ref(), log.temperature_c.as_ref()),
    ] {
        assert_eq!(a.map(bits), b.map(bits));
    }
    assert_eq!(back.target_effort, log.target_effort);
}

#[test]
fn torques_and_moments_have_their_own_columns() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.csv");
    let mut log = full_log();
    log.effort = Effort::Torque(log.effort.signals().clone());
    log.target_effort = Some(Effort::Torque(log.effort.signals().clone()));
    write_log(&path, &log).unwrap();
    let back = read_log(&path, &Layout::default(), JOINTS).unwrap();
    assert_eq!((&back.effort, &back.target_effort), (&log.effort, &log.target_effort));
    let arm = Arm::built_in("ur5").unwrap();
    assert_eq!(&back.torque_nm(&arm).unwrap(), log.effort.signals());
}

#[test]
fn a_log_that_could_not_be_read_back_is_not_written() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.csv");
    let mut log = full_log();
    log.q_rad.joint_mut(2)[5] = f64::NAN;
    let message = write_log(&path, &log).unwrap_err().to_string();
    for part in ["log.csv", "row 7", "actual_q_2", "NaN"] {
        assert!(message.contains(part), "{message}");
    }
    let mut log = full_log();
    log.temperature_c = Some(JointSignals::zeros(JOINTS, 49));
    let message = write_log(&path, &log).unwrap_err().to_string();
    assert!(message.contains("temperature") && message.contains("49 samples"), "{message}");
    assert!(!path.exists());
}

#[test]
fn currents_become_torques_by_the_arms_gains_or_the_layouts() {
    let arm = Arm::built_in("ur5").unwrap();
    let log = full_log();
    let torque_nm = log.torque_nm(&arm).unwrap();
    let gain = arm.joints[4].drive.gain_nm_a();
    assert_eq!(torque_nm.joint(4)[9], gain * log.effort.signals().joint(4)[9]);
    let mut wrong = full_log();
    let ampere = wrong.effort.signals().clone();
    wrong.effort = Effort::Current { ampere, gain_nm_a: Some(vec![1.0; 3]) };
    let message = wrong.torque_nm(&arm).unwrap_err().to_string();
    assert!(message.contains("drive_gain_nm_a has 3 joints"), "{message}");
}
