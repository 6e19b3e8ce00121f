//! Hidden effects against the physics they must obey: statics by virtual work, friction laws measured in runs at
//! constant speed, energies and impulses. No expected value is computed with the code of the effects.

use armid::excitation::Reference;
use armid::plant::faults::FaultyPlant;
use armid::plant::{PlantConfig, Recording};
use armid::robot::Arm;
use nalgebra::{Matrix3, Rotation3, Vector3};

use crate::simulated;

fn ur5() -> Arm {
    Arm::built_in("ur5").unwrap()
}

/// A pose in which gravity loads joints 2, 3, 4 and 5.
const POSE: [f64; 6] = [0.3, -0.9, 0.8, -0.4, 0.6, 0.5];

/// Joint `joint` (from 0) moves along `course` (angle, speed, acceleration over time) relative to `POSE`; the others
/// stand still.
struct One<F> {
    joint: usize,
    duration_s: f64,
    course: F,
}

impl<F: Fn(f64) -> [f64; 3] + Sync> Reference for One<F> {
    fn joints(&self) -> usize {
        6
    }

    fn duration_s(&self) -> f64 {
        self.duration_s
    }

    fn sample(&self, t_s: f64, q_rad: &mut [f64], qd_rad_s: &mut [f64], qdd_rad_s2: &mut [f64]) {
        q_rad.copy_from_slice(&POSE);
        qd_rad_s.fill(0.0);
        qdd_rad_s2.fill(0.0);
        let [q, qd, qdd] = (self.course)(t_s);
        q_rad[self.joint] += q;
        qd_rad_s[self.joint] = qd;
        qdd_rad_s2[self.joint] = qdd;
    }
}

/// Constant speed of joint `joint`, passing `POSE` at the end of the run.
fn turning(joint: usize, speed_rad_s: f64, duration_s: f64) -> impl Reference {
    let course = move |t: f64| [speed_rad_s * (t - duration_s), speed_rad_s, 0.0];
    One { joint, duration_s, course }
}

fn standing(duration_s: f64) -> impl Reference {
    One { joint: 0, duration_s, course: |_| [0.0; 3] }
}

/// The table of one effect with `keys`, separated by semicolons.
fn table(keys: &str) -> String {
    if keys.is_empty() {
        String::new()
    } else {
        format!("[[effect]]\n{}\n", keys.replace(';', "\n"))
    }
}

fn run_arm(arm: &Arm, keys: &str, reference: &dyn Reference) -> Recording {
    let plant = FaultyPlant::new(arm, &simulated::effects(&table(keys)), &PlantConfig::default());
    plant.unwrap_or_else(|e| panic!("{keys}: {e}")).run(reference, None).unwrap()
}

fn run(keys: &str, reference: &dyn Reference) -> Recording {
    run_arm(&ur5(), keys, reference)
}

/// Torques of all joints at the end of a run.
fn last_torque(recording: &Recording) -> [f64; 6] {
    std::array::from_fn(|j| *recording.torque_nm.joint(j).last().unwrap())
}

/// Angles that the encoders read at the end of a run. The arm deviates from its reference by 1e-4 rad and more because
/// of effects that its controller does not know; torques are therefore compared at the actual pose.
fn last_pose(recording: &Recording) -> [f64; 6] {
    std::array::from_fn(|j| *recording.q_rad.joint(j).last().unwrap())
}

/// Torque that an effect adds to joint `joint` (from 0) at constant speed, Nm.
fn added(keys: &str, joint: usize, speed_rad_s: f64) -> f64 {
    // The controller's errors decay at 50 /s: to e⁻⁵⁰ within a second.
    let at = |keys| last_torque(&run(keys, &turning(joint, speed_rad_s, 1.0)))[joint];
    at(keys) - at("")
}

/// Holding torques by virtual work: dU/dq of Σ m g z over the centres of mass, in a world whose gravity points straight
/// down and whose base is tilted.
fn static_torque(arm: &Arm, tilt: Matrix3<f64>, q_rad: &[f64]) -> Vec<f64> {
    let energy = |q: &[f64]| -> f64 {
        let bodies = arm.frames(q).into_iter().zip(&arm.joints);
        bodies
            .map(|(frame, joint)| {
                let link = &joint.link;
                let moment = frame.rotation * link.first_moment_kg_m()
                    + link.mass_kg() * frame.translation_m;
                arm.gravity_m_s2.norm() * (tilt * moment).z
            })
            .sum()
    };
    // Second-order difference of a function of size 100 J: round-off 1e-14·100/1e-5, truncation error 1e-10.
    const STEP: f64 = 1e-5;
    (0..q_rad.len())
        .map(|j| {
            let moved = |step: f64| {
                let mut q = q_rad.to_vec();
                q[j] += step;
                energy(&q)
            };
            (moved(STEP) - moved(-STEP)) / (2.0 * STEP)
        })
        .collect()
}

fn close(seen: f64, wanted: f64, tolerance: f64, what: &str) {
    assert!((seen - wanted).abs() < tolerance, "{what}: {seen}, wanted {wanted} ± {tolerance:.1e}");
}

/// v_s is the speed at which the extra friction has fallen to 1/e; far above it, none is left. Friction dissipates
/// power in both directions.
#[test]
fn stribeck_friction_fades_at_its_speed() {
    // The speeds are well above ε = 0.02 rad/s, where tanh is 1 to within 1e-8.
    let keys = "kind='stribeck';joint=1;extra_nm=3;vs_rad_s=0.4";
    let extra = |v| added(keys, 0, v);
    close(extra(0.4), 3.0 / std::f64::consts::E, 1e-6, "at v_s");
    close(extra(-0.4), -3.0 / std::f64::consts::E, 1e-6, "at -v_s");
    close(extra(2.0), 0.0, 1e-6, "far above v_s");
    assert!(extra(0.2) > extra(0.3) && extra(0.3) > extra(0.6));
    let rational =
        |v| added("kind='stribeck';joint=1;extra_nm=3;vs_rad_s=0.4;fall='rational'", 0, v);
    close(rational(0.4), 1.5, 1e-6, "half of it at v_s");
    close(rational(-1.2), -0.3, 1e-6, "a tenth at -3 v_s");
}

#[test]
fn nonlinear_viscous_friction_has_its_size_at_one_radian_per_second_and_its_curvature() {
    for (exponent, concave) in [(0.5, true), (2.0, false)] {
        let keys = format!("kind='nonlinear_viscous';joint=1;amplitude_nm=4;exponent={exponent}");
        let [low, mid, high] = [0.5, 1.0, 1.5].map(|v| added(&keys, 0, v));
        close(mid, 4.0, 1e-6, "at 1 rad/s");
        close(added(&keys, 0, -1.0), -4.0, 1e-6, "at -1 rad/s");
        assert_eq!(low + high - 2.0 * mid < 0.0, concave, "{low} {mid} {high}");
    }
}

#[test]
fn asymmetric_friction_is_half_the_difference_of_the_two_directions() {
    let keys = "kind='asymmetric_friction';joint=1;coulomb_nm=0.8;viscous_nm_s_rad=0.5";
    let torque = |v: f64| last_torque(&run(keys, &turning(0, v, 1.0)))[0];
    for v in [0.5, 1.5] {
        close(torque(v).abs() - torque(-v).abs(), 2.0 * (0.8 + 0.5 * v), 1e-6, "forth and back");
    }
    close(last_torque(&run(keys, &standing(0.5)))[0], 0.0, 1e-9, "at rest");
}

#[test]
fn changed_friction_is_seen_at_constant_speed() {
    let keys = "kind='friction_change';joint=6;coulomb_nm=-0.3;viscous_nm_s_rad=0.7";
    close(added(keys, 5, 1.0), 0.4, 1e-6, "rc - 0.3 + rv 0.7 at 1 rad/s");
}

/// Lifting and lowering slowly, friction is the drive torque beyond the holding torque. A payload adds a load known by
/// virtual work, and friction of μ times that load.
#[test]
fn friction_grows_with_the_load_that_is_lifted() {
    let mu = 0.06;
    let com = Vector3::new(0.0, 0.0, 0.1);
    let friction = format!("kind='load_friction';joint=2;mu={mu}");
    let payload = "\n[[effect]];kind='payload';mass_kg=4;com_x_m=0;com_y_m=0;com_z_m=0.1";
    for speed in [0.2, -0.2] {
        let load_and_loss = |keys: &str, arm: &Arm| {
            let log = run(keys, &turning(1, speed, 1.0));
            let load = static_torque(arm, Matrix3::identity(), &last_pose(&log))[1];
            (load, last_torque(&log)[1] - load)
        };
        let (load, loss) = load_and_loss(&friction, &ur5());
        let (more_load, more_loss) =
            load_and_loss(&format!("{friction}{payload}"), &with_payload(4.0, com));
        let (added_load, added_loss) = (more_load.abs() - load.abs(), more_loss - loss);
        assert!(added_load > 10.0, "the payload must load the joint: {added_load} Nm");
        // Accelerations remain because the pose changes: 0.2 rad/s · 0.1 of the load's 50 Nm/rad.
        close(added_loss * speed.signum() / added_load, mu, 3e-3 * mu, "mu");
    }
}

fn with_payload(mass_kg: f64, com_m: Vector3<f64>) -> Arm {
    let mut arm = ur5();
    let body = armid::robot::LinkInertia::from_com(mass_kg, com_m, Matrix3::identity() * 1e-3);
    let last = arm.joints.last_mut().unwrap();
    last.link = last.link.plus(&body);
    arm
}

/// From rest, the bristles act as a spring of stiffness rc k; after a travel of many 1/k, the full rc is reached. A
/// closed loop dissipates energy.
#[test]
fn presliding_is_a_spring_first_and_coulomb_friction_later() {
    let (k, rc) = (500.0, ur5().joints[0].drive.coulomb_nm);
    let keys = format!("kind='presliding';joint=1;stiffness_per_rad={k}");
    let span = 5e-5;
    let w = std::f64::consts::TAU;
    let small = One {
        joint: 0,
        duration_s: 2.0,
        course: move |t: f64| {
            [
                0.5 * span * (1.0 - (w * t).cos()),
                0.5 * span * w * (w * t).sin(),
                0.5 * span * w * w * (w * t).cos(),
            ]
        },
    };
    let log = run(&keys, &small);
    let (q, torque) = (log.q_rad.joint(0), log.torque_nm.joint(0));
    let (mut lowest, mut highest) = (0, 0);
    for i in 62..187 {
        if q[i] < q[lowest] || lowest == 0 {
            lowest = i;
        }
        if q[i] > q[highest] || highest == 0 {
            highest = i;
        }
    }
    let slope = (torque[highest] - torque[lowest]) / (q[highest] - q[lowest]);
    // The spring softens by k·span = 2.5 % over the loop; inertia adds 3 kg m² · (2π)² = 120 Nm/rad to 3500.
    close(slope, rc * k, 0.08 * rc * k, "stiffness");
    let loss: f64 = (62..187).map(|i| 0.5 * (torque[i] + torque[i + 1]) * (q[i + 1] - q[i])).sum();
    assert!(loss > 0.0, "{loss} J");
    close(added(&keys, 0, 0.5), 0.0, 1e-4, "against Coulomb friction when sliding");
}

/// At constant speed v friction is rc tanh(v/w) instead of the rc tanh(v/ε) of the arm's file.
#[test]
fn friction_turns_round_within_its_width() {
    let (width, speed) = (0.06, 0.03);
    let arm = ur5();
    let law = |width: f64| arm.joints[0].drive.coulomb_nm * (speed / width).tanh();
    let expected = law(width) - law(arm.friction_epsilon_rad_s);
    for site in ["", "joint=1;"] {
        let keys = format!("kind='reversal_width';{site}width_rad_s={width}");
        close(added(&keys, 0, speed), expected, 1e-3 * expected.abs(), "friction");
    }
}

/// Over a turn, dry friction varies by ±P around its mean rc.
#[test]
fn position_dependent_friction_averages_out_over_a_turn() {
    let keys = "kind='position_friction';joint=1;amplitude_nm=1.5;phase_rad=0.7";
    let speed = 2.0;
    let turn_s = std::f64::consts::TAU / speed;
    let extra = |keys: &str| {
        let log = run(keys, &turning(0, speed, 2.0 * turn_s));
        let samples = log.torque_nm.joint(0);
        samples[samples.len() - (turn_s * 125.0) as usize..].to_vec()
    };
    let series: Vec<f64> = extra(keys).iter().zip(extra("")).map(|(a, b)| a - b).collect();
    let mean = series.iter().sum::<f64>() / series.len() as f64;
    let largest = series.iter().fold(f64::MIN, |m, v| m.max(*v));
    let smallest = series.iter().fold(f64::MAX, |m, v| m.min(*v));
    // The turn is not a whole number of samples: one sample of 392 is missing or double.
    close(mean, 0.0, 0.01, "mean");
    // The arm speeds up and slows down slightly under the varying friction.
    close(largest, 1.5, 0.03, "highest");
    close(smallest, -1.5, 0.03, "lowest");
}

/// At constant speed, friction approaches its final value exponentially: after T, 1 − 1/e of the change has happened.
#[test]
fn a_warming_joint_loses_friction_at_its_time_constant() {
    let keys = "kind='thermal_drift';joint=1;fraction=-0.2;time_constant_s=2";
    let log = run(keys, &turning(0, 1.0, 14.0));
    let torque = log.torque_nm.joint(0);
    let at = |t: f64| torque[(t * 125.0) as usize];
    // The torque is friction alone: nothing accelerates, and gravity does not load joint 1.
    let (early, late) = (at(2.0), at(14.0));
    let cold = last_torque(&run("", &turning(0, 1.0, 1.0)))[0];
    close(late / cold, 0.8 + 0.2 * (-7.0_f64).exp(), 1e-3, "warm");
    close((cold - early) / (0.2 * cold), 1.0 - (-1.0_f64).exp(), 5e-3, "after T");
}

/// At creep speed the drive must compensate the ripple: its spectral line is at n cycles per turn.
#[test]
fn ripple_stands_at_its_order() {
    let (n, speed) = (202.0, 0.1);
    let keys = "kind='ripple';joint=1;amplitude_nm=0.5;order_per_turn=202;phase_rad=0.4";
    let cycles = 4.0;
    let window_s = cycles * std::f64::consts::TAU / n / speed;
    let reference = turning(0, speed, 1.0 + window_s);
    let log = run(keys, &reference);
    let clean = last_torque(&run("", &turning(0, speed, 1.0)))[0];
    let samples = (window_s * 125.0).round() as usize;
    let (q, torque) = (log.q_rad.joint(0), log.torque_nm.joint(0));
    let from = torque.len() - samples;
    let project = |order: f64| {
        let (mut c, mut s) = (0.0, 0.0);
        for i in from..torque.len() {
            let (sin, cos) = (order * q[i]).sin_cos();
            c += 2.0 / samples as f64 * (torque[i] - clean) * cos;
            s += 2.0 / samples as f64 * (torque[i] - clean) * sin;
        }
        (c.hypot(s), (-s).atan2(c))
    };
    // At 3.2 Hz the position loop (50 rad/s) lets a part of the ripple move the joint, and the inertia shifts the
    // phase: 10 %.
    let (amplitude, phase) = project(n);
    close(amplitude, 0.5, 0.05, "line");
    close(phase, 0.4, 0.15, "phase");
    assert!(project(n * 1.5).0 < 0.05, "no line between");
}

/// A soft gear puts the link at q − τ/k (and half the play further); the drive then holds the gravity of that pose. The
/// encoder on the motor does not show the deflection.
#[test]
fn gears_deflect_by_load_over_stiffness_and_half_their_play() {
    for (keys, stiffness, gap) in [
        ("kind='elasticity';joint=2;stiffness_nm_rad=3000", 3000.0, 0.0),
        ("kind='backlash';joint=2;gap_rad=0.02;stiffness_nm_rad=50000", 50000.0, 0.02),
        (
            "kind='elasticity';joint=2;stiffness_nm_rad=3000\n[[effect]];kind='backlash';joint=2;gap_rad=0.02",
            3000.0,
            0.02,
        ),
    ] {
        let log = run(keys, &standing(8.0));
        let torque = last_torque(&log);
        let read = last_pose(&log);
        let mut pose = read;
        pose[1] -= torque[1] / stiffness + 0.5 * gap * torque[1].signum();
        let held = static_torque(&ur5(), Matrix3::identity(), &pose);
        let unaware = static_torque(&ur5(), Matrix3::identity(), &read)[1];
        assert!((torque[1] - unaware).abs() > 0.02, "{keys}: nothing to see");
        // After it takes the load, the gear rings at its resonance (ζω ≈ 1.5 /s); the ringing has decayed after 8 s.
        for j in 0..6 {
            close(torque[j], held[j], 1e-4, keys);
        }
    }
}

/// The stiffer the gear, the closer to a rigid one: deflections are L/k, so that torques differ by (dτ/dq) L/k and by
/// the oscillation that the deflection starts.
#[test]
fn a_stiff_gear_is_a_rigid_one_in_the_limit() {
    let w = 3.0;
    let swing = One {
        joint: 0,
        duration_s: 1.0,
        course: move |t: f64| {
            [0.3 * (1.0 - (w * t).cos()), 0.3 * w * (w * t).sin(), 0.3 * w * w * (w * t).cos()]
        },
    };
    let rigid = run("", &swing);
    let differs = |k: f64| {
        let keys = format!("kind='elasticity';joint=1;stiffness_nm_rad={k}");
        let log = run(&keys, &swing);
        let pairs = log.torque_nm.joint(0).iter().zip(rigid.torque_nm.joint(0)).skip(60);
        pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    let [soft, stiff] = [2e4, 2e5].map(differs);
    println!(
        "largest difference to a rigid gear: {soft:.1e} Nm at 2e4, {stiff:.1e} Nm at 2e5 Nm/rad"
    );
    assert!(stiff < 0.3 * soft, "{soft} {stiff}");
}

#[test]
fn drives_that_are_misread_hold_the_same_gravity() {
    let held = |log: &Recording| static_torque(&ur5(), Matrix3::identity(), &last_pose(log));
    let log = run("kind='torque_gain';joint=2;error_fraction=0.05", &standing(2.0));
    close(last_torque(&log)[1], 1.05 * held(&log)[1], 1e-5, "gain");
    let log = run("kind='current_offset';joint=3;offset_nm=0.7", &standing(2.0));
    close(last_torque(&log)[2], held(&log)[2] + 0.7, 1e-5, "offset");
}

#[test]
fn a_saturated_reading_ends_at_its_limit_and_leaves_the_motion_alone() {
    let held = static_torque(&ur5(), Matrix3::identity(), &POSE)[1];
    let limit = 0.9 * held.abs();
    let log = run(&format!("kind='saturation';joint=2;limit_nm={limit}"), &standing(0.2));
    assert_eq!(last_torque(&log)[1].abs(), limit);
    assert_eq!(log.q_rad, run("", &standing(0.2)).q_rad);
}

#[test]
fn a_spring_must_be_held() {
    let keys = "kind='spring';joint=4;stiffness_nm_rad=2;rest_rad=0.3";
    let log = run(keys, &standing(2.0));
    let pose = last_pose(&log);
    let held = static_torque(&ur5(), Matrix3::identity(), &pose)[3];
    close(last_torque(&log)[3] - held, 2.0 * (pose[3] - 0.3), 1e-5, "k (q - q0)");
}

/// The joint is at rest in the same place before and after the push, so that the drive has returned its whole momentum.
/// The arm has no friction, which would take a share.
#[test]
fn a_contact_costs_the_drive_its_impulse() {
    let mut arm = ur5();
    for joint in &mut arm.joints {
        joint.drive.coulomb_nm = 0.0;
        joint.drive.viscous_nm_s_rad = 0.0;
    }
    let keys = "kind='contact';joint=1;start_s=0.2;end_s=0.6;peak_nm=20";
    let log = run_arm(&arm, keys, &standing(1.5));
    let torque = log.torque_nm.joint(0);
    let impulse = torque.iter().sum::<f64>() / 125.0;
    close(impulse, 0.5 * 20.0 * 0.4, 0.01, "impulse, Nms");
    // There is no torque before the push.
    assert!(torque[..25].iter().all(|t| t.abs() < 1e-9));
}

/// A slow push on the flange: the torques of the drives do the work of the force, for every direction in which the
/// flange can move.
#[test]
fn a_push_on_the_flange_does_the_work_of_a_force() {
    let log = run("kind='contact';start_s=0;end_s=8;peak_nm=15", &standing(4.0));
    let arm = ur5();
    let held = static_torque(&arm, Matrix3::identity(), &POSE);
    let reach: f64 = arm.joints.iter().map(|j| j.placement.translation_m.norm()).sum();
    let force = Vector3::repeat(-15.0 / reach / 3.0_f64.sqrt());
    let flange = |q: &[f64]| arm.frames(q)[5].translation_m;
    for j in 0..6 {
        let moved = |step: f64| {
            let mut q = POSE;
            q[j] += step;
            flange(&q)
        };
        let work = force.dot(&((moved(1e-6) - moved(-1e-6)) / 2e-6));
        close(last_torque(&log)[j] - held[j], -work, 0.03, "virtual work");
    }
}

#[test]
fn bodies_gravity_and_tilt_are_held_as_virtual_work_says() {
    let pi_tilt = Rotation3::new(Vector3::new(0.03, -0.05, 0.0)).into_inner();
    let mut moon = ur5();
    moon.gravity_m_s2 *= 9.78 / 9.81;
    let mut longer = ur5();
    longer.joints[2].placement.translation_m *= 1.0 + 0.01 / 0.425;
    let com = Vector3::new(0.02, -0.03, 0.06);
    for (keys, arm, tilt) in [
        (
            "kind='payload';mass_kg=2;com_x_m=0.02;com_y_m=-0.03;com_z_m=0.06",
            with_payload(2.0, com),
            Matrix3::identity(),
        ),
        ("kind='gravity';g_m_s2=9.78", moon, Matrix3::identity()),
        ("kind='base_tilt';tilt_x_rad=0.03;tilt_y_rad=-0.05", ur5(), pi_tilt),
        ("kind='link_length';joint=3;error_m=0.01", longer, Matrix3::identity()),
    ] {
        let log = run(keys, &standing(2.0));
        let torque = last_torque(&log);
        let held = static_torque(&arm, tilt, &last_pose(&log));
        let nominal = static_torque(&ur5(), Matrix3::identity(), &POSE);
        assert!((0..6).any(|j| (held[j] - nominal[j]).abs() > 0.02), "{keys}: nothing to see");
        for j in 0..6 {
            close(torque[j], held[j], 1e-5, keys);
        }
    }
}

#[test]
fn an_encoder_off_zero_is_believed() {
    let log = run("kind='encoder_offset';joint=2;offset_rad=0.02", &standing(2.0));
    close(*log.q_rad.joint(1).last().unwrap(), POSE[1], 1e-4, "the reading");
    let mut pose = last_pose(&log);
    pose[1] -= 0.02;
    let held = static_torque(&ur5(), Matrix3::identity(), &pose);
    for (torque, held) in last_torque(&log).into_iter().zip(held) {
        close(torque, held, 1e-5, "true pose");
    }
}
