//! The sensor chain: the errors it adds, the replay of a single trial, and the readings of the controller.

use std::sync::OnceLock;

use armid::excitation::FourierSeries;
use armid::plant::{
    Effort, Measured, NoiseModel, PerJoint, PlantConfig, PlantError, Recording, SensorConfig,
    Sensors, simulate,
};
use armid::random::TrialStreams;
use armid::robot::{Arm, JointSignals};

use crate::simulated::SIGMA_NM;

const RATE_HZ: f64 = 125.0;

fn arm_and_recording() -> (Arm, Recording) {
    static RUN: OnceLock<(Arm, Recording)> = OnceLock::new();
    let run = RUN.get_or_init(|| {
        let arm = Arm::built_in("ur5").unwrap();
        let motion = FourierSeries::built_in("ur5_identification").unwrap();
        let recording = simulate(&arm, &motion, &PlantConfig::default(), None).unwrap();
        (arm, recording)
    });
    run.clone()
}

fn noisy() -> SensorConfig {
    SensorConfig {
        q_sd_rad: PerJoint::All(2e-5),
        qd_sd_rad_s: PerJoint::All(1e-3),
        torque_sd_nm: PerJoint::Each(SIGMA_NM.to_vec()),
        torque_noise: NoiseModel::real_arm(),
        ..SensorConfig::default()
    }
}

fn measure(config: &SensorConfig, arm: &Arm, recording: &Recording, trial: u64) -> Measured {
    let sensors = Sensors::new(config, arm, RATE_HZ).unwrap();
    let mut measured = Measured::like(recording);
    sensors.measure(recording, &TrialStreams::new(5, b"sensors", trial), &mut measured);
    measured
}

/// Root mean square of a − b at joint j.
fn rms_difference(a: &JointSignals, b: &JointSignals, j: usize) -> f64 {
    let squares = a.joint(j).iter().zip(b.joint(j)).map(|(a, b)| (a - b).powi(2));
    (squares.sum::<f64>() / a.samples() as f64).sqrt()
}

#[test]
fn sensors_without_errors_report_the_truth() {
    let (arm, recording) = arm_and_recording();
    let measured = measure(&SensorConfig::default(), &arm, &recording, 0);
    assert_eq!(measured.q_rad, recording.q_rad);
    assert_eq!(measured.qd_rad_s, recording.qd_rad_s);
    assert_eq!(measured.torque_nm, recording.torque_nm);
}

/// White channels: the rms of n numbers has a relative standard deviation of 1/√(2n), here 2 %; five of these are
/// exceeded by chance once in 2 million seeds. For the coloured torque noise the bound is 5 × 1/√(2·n/n_c), with about
/// n_c = 5 samples per independent one.
#[test]
fn errors_have_the_size_asked_for() {
    let (arm, recording) = arm_and_recording();
    let measured = measure(&noisy(), &arm, &recording, 0);
    let n = recording.time_s.len() as f64;
    let (white, coloured) = (5.0 / (2.0 * n).sqrt(), 5.0 / (2.0 * n / 5.0).sqrt());
    for (j, torque_sd) in SIGMA_NM.into_iter().enumerate() {
        for (seen, asked, bound) in [
            (rms_difference(&measured.q_rad, &recording.q_rad, j), 2e-5, white),
            (rms_difference(&measured.qd_rad_s, &recording.qd_rad_s, j), 1e-3, white),
            (rms_difference(&measured.torque_nm, &recording.torque_nm, j), torque_sd, coloured),
        ] {
            assert!((seen / asked - 1.0).abs() < bound, "joint {j}: {seen}, asked {asked}");
        }
    }
}

#[test]
fn a_trial_can_be_replayed_alone() {
    let (arm, recording) = arm_and_recording();
    let sensors = Sensors::new(&noisy(), &arm, RATE_HZ).unwrap();
    let streams = |trial| TrialStreams::new(5, b"sensors", trial);
    let mut reused = Measured::like(&recording);
    for trial in 0..4 {
        sensors.measure(&recording, &streams(trial), &mut reused);
    }
    let alone = measure(&noisy(), &arm, &recording, 3);
    assert_eq!(reused.q_rad, alone.q_rad);
    assert_eq!(reused.qd_rad_s, alone.qd_rad_s);
    assert_eq!(reused.torque_nm, alone.torque_nm);
    let other = measure(&noisy(), &arm, &recording, 2);
    assert_ne!(other.torque_nm, alone.torque_nm);
    assert_ne!(other.q_rad, alone.q_rad);
}

#[test]
fn readings_are_whole_steps() {
    let (arm, recording) = arm_and_recording();
    let config = SensorConfig {
        q_step_rad: 1e-4,
        qd_step_rad_s: 1e-3,
        effort_step: 0.01,
        effort: Effort::Current,
        ..noisy()
    };
    let measured = measure(&config, &arm, &recording, 0);
    for (j, joint) in arm.joints.iter().enumerate() {
        for (signal, step) in [
            (&measured.q_rad, 1e-4),
            (&measured.qd_rad_s, 1e-3),
            (&measured.torque_nm, 0.01 * joint.drive.gain_nm_a()),
        ] {
            for value in signal.joint(j) {
                let steps = value / step;
                assert!((steps - steps.round()).abs() < 1e-9, "joint {j}: {value} of {step}");
            }
        }
    }
}

/// With noise in the loop, the log holds the readings of the controller, the arm itself moves differently, and the
/// readings differ from the true motion by exactly the errors of the encoders.
#[test]
fn the_controller_reads_what_the_log_says() {
    let (arm, exact) = arm_and_recording();
    let sensors = Sensors::new(&noisy(), &arm, RATE_HZ).unwrap();
    let motion = FourierSeries::built_in("ur5_identification").unwrap();
    let streams = TrialStreams::new(5, b"loop", 0);
    let run =
        |config: &PlantConfig| simulate(&arm, &motion, config, Some(sensors.encoders(&streams)));
    let recording = run(&PlantConfig::default()).unwrap();
    assert_ne!(recording.q_rad, exact.q_rad);
    assert_ne!(recording.torque_nm, exact.torque_nm);

    let mut measured = Measured::like(&recording);
    sensors.measure(&recording, &streams, &mut measured);
    let readings = recording.readings.as_ref().unwrap();
    assert_eq!(measured.q_rad, readings.q_rad);
    assert_eq!(measured.qd_rad_s, readings.qd_rad_s);
    let bound = 5.0 / (2.0 * recording.time_s.len() as f64).sqrt();
    for j in 0..arm.dof() {
        let q = rms_difference(&measured.q_rad, &recording.q_rad, j) / 2e-5;
        let qd = rms_difference(&measured.qd_rad_s, &recording.qd_rad_s, j) / 1e-3;
        assert!((q - 1.0).abs() < bound && (qd - 1.0).abs() < bound, "joint {j}: {q}, {qd}");
    }

    assert_eq!(run(&PlantConfig::default()).unwrap(), recording);
    // A log cannot hold the controller's readings at instants at which the controller does not read.
    let config = PlantConfig { control_rate_hz: 62.5, ..PlantConfig::default() };
    assert!(matches!(run(&config), Err(PlantError::Setting { key: "log_rate_hz", .. })));
}

#[test]
fn impossible_sensors_are_refused() {
    let arm = Arm::built_in("ur5").unwrap();
    for (key, config) in [
        ("q_sd_rad", SensorConfig { q_sd_rad: PerJoint::All(-1e-5), ..noisy() }),
        ("qd_sd_rad_s", SensorConfig { qd_sd_rad_s: PerJoint::All(f64::NAN), ..noisy() }),
        ("torque_sd_nm", SensorConfig { torque_sd_nm: PerJoint::Each(vec![1.0; 5]), ..noisy() }),
        ("effort_step", SensorConfig { effort_step: f64::INFINITY, ..noisy() }),
    ] {
        let message = Sensors::new(&config, &arm, RATE_HZ).unwrap_err().to_string();
        assert!(message.contains(key), "{message}");
    }
}

#[test]
fn sensors_are_read_from_toml() {
    let text = r#"
        q_sd_rad = 2e-5
        qd_sd_rad_s = 1e-3
        torque_sd_nm = [1.0, 1.0, 0.7, 0.15, 0.15, 0.15]
        effort = "current"

        [torque_noise]
        cross_joint_correlation = 0.3
        components = [
            { share = 0.5, colour = "white" },
            { share = 0.3, colour = { ar1 = { time_constant_s = 0.02 } } },
            { share = 0.2, colour = { ar1 = { time_constant_s = 1.0 } } },
        ]
    "#;
    let read: SensorConfig = toml::from_str(text).unwrap();
    assert_eq!(read, SensorConfig { effort: Effort::Current, ..noisy() });
    assert!(toml::from_str::<SensorConfig>("torque_sd = 1.0").is_err());
}
