//! Runs of the plant: tracking, saturation, and inputs that are refused.

use armid::excitation::{FourierSeries, Reference};
use armid::plant::{
    Drivetrain, Plant, PlantConfig, PlantError, RapierArm, RigidDrivetrain, RungeKutta4, Stage,
    State, simulate,
};
use armid::robot::{Arm, LinkInertia};
use nalgebra::{Matrix3, Vector3};

fn ur5() -> Arm {
    Arm::built_in("ur5").unwrap()
}

fn motion() -> FourierSeries {
    FourierSeries::built_in("ur5_identification").unwrap()
}

/// The controller does not know a tenth of the friction. With a stiffness of ω² times an inertia of at least the
/// rotor's, a joint deviates by 0.1 (rc + rv q̇)/(ω² Ia); twice that leaves room for errors of other joints that act
/// through the mass matrix.
#[test]
fn the_arm_follows_its_reference() {
    let arm = ur5();
    let config = PlantConfig::default();
    let run = simulate(&arm, &motion(), &config, None).unwrap();
    assert_eq!(run.saturated_decisions, 0);
    assert!(run.readings.is_none());
    let (first, last) = (run.time_s[0], run.time_s[run.time_s.len() - 1]);
    assert_eq!((first, last), (0.0, motion().duration_s()));
    for (j, joint) in arm.joints.iter().enumerate() {
        let errors = run.q_rad.joint(j).iter().zip(run.target_q_rad.joint(j));
        let worst = errors.map(|(q, target)| (q - target).abs()).fold(0.0, f64::max);
        let speed = run.qd_rad_s.joint(j).iter().fold(0.0, |m: f64, v| m.max(v.abs()));
        let unknown_nm = (1.0 - config.friction_feedforward)
            * (joint.drive.coulomb_nm + joint.drive.viscous_nm_s_rad * speed);
        let stiffness_nm_rad = config.bandwidth_rad_s.powi(2) * joint.drive.rotor_inertia_kg_m2;
        let bound = 2.0 * unknown_nm / stiffness_nm_rad;
        println!("joint {}: largest tracking error {worst:.1e} of {bound:.1e} rad", j + 1);
        assert!(worst < bound, "joint {}: {worst:e} rad", j + 1);
        assert!(worst > 0.01 * bound, "joint {}: {worst:e} rad with friction unknown", j + 1);
    }
}

/// 125 Hz is every fourth sample of 500 Hz: the rate of the log does not affect the motion.
#[test]
fn the_log_rate_does_not_change_the_run() {
    let slow = simulate(&ur5(), &motion(), &PlantConfig::default(), None).unwrap();
    let config = PlantConfig { log_rate_hz: 500.0, ..PlantConfig::default() };
    let fast = simulate(&ur5(), &motion(), &config, None).unwrap();
    for j in 0..6 {
        let thinned: Vec<f64> = fast.q_rad.joint(j).iter().step_by(4).copied().collect();
        assert_eq!(thinned, slow.q_rad.joint(j));
        let thinned: Vec<f64> = fast.torque_nm.joint(j).iter().step_by(4).copied().collect();
        assert_eq!(thinned, slow.torque_nm.joint(j));
    }
}

#[test]
fn a_weak_drive_saturates_and_is_counted() {
    let mut arm = ur5();
    arm.joints[1].limits.torque_nm = 40.0;
    let run = simulate(&arm, &motion(), &PlantConfig::default(), None).unwrap();
    assert!(run.saturated_decisions > 0);
    assert!(run.torque_nm.joint(1).iter().all(|t| t.abs() <= 40.0));
}

#[test]
fn a_body_that_cannot_exist_is_refused_with_its_numbers() {
    let mut arm = ur5();
    // Principal moments of inertia obey the triangle inequality; here 0.05 > 0.01 + 0.02.
    let tensor = Matrix3::from_diagonal(&Vector3::new(0.01, 0.02, 0.05));
    arm.joints[2].link = LinkInertia::from_com(2.0, Vector3::new(0.1, 0.0, 0.0), tensor);
    let error = RapierArm::new(&arm).unwrap_err();
    assert!(matches!(error, PlantError::Inertia { joint: 3, mass_kg: 2.0, .. }), "{error}");
    assert!(error.to_string().contains("0.05"), "{error}");
    arm.joints[2].link = LinkInertia::zero();
    assert!(matches!(RapierArm::new(&arm), Err(PlantError::Inertia { joint: 3, .. })));
}

#[test]
fn impossible_settings_are_refused() {
    let default = PlantConfig::default;
    for (key, config) in [
        ("step_s", PlantConfig { step_s: 0.0, ..default() }),
        ("step_s", PlantConfig { step_s: f64::NAN, ..default() }),
        ("control_rate_hz", PlantConfig { control_rate_hz: 300.0, ..default() }),
        ("log_rate_hz", PlantConfig { log_rate_hz: 2000.0, ..default() }),
        ("damping", PlantConfig { damping: -1.0, ..default() }),
    ] {
        match simulate(&ur5(), &motion(), &config, None) {
            Err(PlantError::Setting { key: named, .. }) => assert_eq!(named, key),
            other => panic!("{key}: {:?}", other.map(|run| run.time_s.len())),
        }
    }
    assert!(toml::from_str::<PlantConfig>("step = 0.001").is_err());
}

/// With ε = 1 mrad/s the friction of the wrists decays at about (1.4/0.001 + 2)/0.3 = 5000 /s.
#[test]
fn a_step_too_long_for_the_friction_is_refused() {
    let mut arm = ur5();
    arm.friction_epsilon_rad_s = 0.001;
    match simulate(&arm, &motion(), &PlantConfig::default(), None) {
        Err(PlantError::StepTooLong { decay_per_s, longest_s, .. }) => {
            assert!((2e3..1e4).contains(&decay_per_s), "{decay_per_s}");
            let step_s = 0.0001;
            assert!(step_s < longest_s);
            let config = PlantConfig { step_s, ..PlantConfig::default() };
            let short = Lost { joints: 6, until_s: f64::INFINITY };
            simulate(&arm, &short, &config, None).unwrap();
        }
        other => panic!("{other:?}"),
    }
}

/// A constant reference for `joints` joints that becomes NaN at `until_s`.
struct Lost {
    joints: usize,
    until_s: f64,
}

impl Reference for Lost {
    fn joints(&self) -> usize {
        self.joints
    }

    fn duration_s(&self) -> f64 {
        1.0
    }

    fn sample(&self, t_s: f64, q_rad: &mut [f64], qd_rad_s: &mut [f64], qdd_rad_s2: &mut [f64]) {
        q_rad.fill(if t_s < self.until_s { 0.3 } else { f64::NAN });
        qd_rad_s.fill(0.0);
        qdd_rad_s2.fill(0.0);
    }
}

#[test]
fn a_run_that_breaks_down_says_when_and_where() {
    match simulate(&ur5(), &Lost { joints: 6, until_s: 0.5 }, &PlantConfig::default(), None) {
        Err(PlantError::Diverged { time_s, joint: 1, .. }) => {
            assert!((time_s - 0.5).abs() < 1e-9, "{time_s}");
        }
        other => panic!("{other:?}"),
    }
    let error = simulate(&ur5(), &Lost { joints: 7, until_s: 0.5 }, &PlantConfig::default(), None)
        .unwrap_err();
    assert_eq!(error, PlantError::Joints { what: "the reference", found: 7, expected: 6 });
}

/// A rigid gear with one additional state per joint: the distance travelled, ż = q̇.
struct Odometer {
    gear: RigidDrivetrain,
}

impl Drivetrain for Odometer {
    fn states(&self) -> usize {
        6
    }

    fn start(&mut self, arm: &mut RapierArm, q: &mut [f64], qd: &mut [f64], states: &mut [f64]) {
        self.gear.start(arm, q, qd, &mut []);
        states.fill(0.0);
    }

    fn fastest_decay_per_s(&self, inverse_inertia: &[f64]) -> f64 {
        self.gear.fastest_decay_per_s(inverse_inertia)
    }

    fn rates(
        &mut self,
        arm: &mut RapierArm,
        stage: &Stage<'_>,
        qdd_rad_s2: &mut [f64],
        states_rate: &mut [f64],
    ) {
        self.gear.rates(arm, stage, qdd_rad_s2, &mut []);
        states_rate.copy_from_slice(stage.qd_rad_s);
    }
}

/// The states of a drivetrain are integrated together with the joints, and do not disturb them.
#[test]
fn a_drivetrain_may_have_states_of_its_own() {
    let arm = ur5();
    let odometer = || Odometer { gear: RigidDrivetrain::new(&arm) };
    let mut engine = RapierArm::new(&arm).unwrap();
    let mut drivetrain = odometer();
    let mut state = State::zeros(6, drivetrain.states());
    state.parts_mut().0.copy_from_slice(&[0.1, -1.0, 0.5, 0.3, 0.2, 0.7]);
    let start = state.q_rad().to_vec();
    drivetrain.start(&mut engine, &mut start.clone(), &mut [0.0; 6], &mut [0.0; 6]);
    let mut rk4 = RungeKutta4::new(&state);
    for k in 0..200 {
        let time_s = f64::from(k) * 2e-3;
        rk4.step(&mut engine, &mut drivetrain, &mut state, time_s, 2e-3, &[5.0; 6]);
    }
    let (q, _, distance) = state.parts_mut();
    for ((q, start), distance) in q.iter().zip(&start).zip(distance) {
        assert!((q - start - *distance).abs() < 1e-13, "{q} − {start} is not {distance}");
    }
    let config = PlantConfig::default();
    let run = |drivetrain: Box<dyn Drivetrain>| {
        Plant::with_drivetrain(&arm, &arm, &[config.friction_feedforward; 6], drivetrain, &config)
            .unwrap()
            .run(&motion(), None)
            .unwrap()
    };
    assert_eq!(run(Box::new(odometer())), run(Box::new(RigidDrivetrain::new(&arm))));
}
