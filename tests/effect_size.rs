//! The size of a hidden effect in units of the noise.

use armid::montecarlo::{EffectSize, Scenario, Simulation};
use armid::plant::Recording;
use armid::plant::faults::FaultyPlant;
use armid::robot::JointSignals;

use crate::simulated::{SIGMA_NM, TORQUE_NOISE, scenario, simulation};

/// One period of the default scenario's motion, with its own noise.
fn size_of(effects: &str, noise: &str) -> EffectSize {
    let sensors = TORQUE_NOISE.to_owned() + noise;
    let scenario = scenario(("size", 1), ("ur5_identification", 1), &sensors, effects);
    let clean = Scenario { effects: Vec::new(), ..scenario.clone() };
    simulation(scenario).size_beside(&simulation(clean).recording).unwrap()
}

const COLOURED: &str = "[sensors.torque_noise]\ncross_joint_correlation = 0.3\n\
    components = [{ share = 0.6, colour = 'white' }, \
    { share = 0.4, colour = { ar1 = { time_constant_s = 0.1 } } }]";

/// More noise makes no effect easier to see. Encoder noise, multiplied by the inertia, grows with frequency: it hides a
/// ripple at tens of hertz more than friction that depends on the angle.
#[test]
fn noise_of_encoders_hides_what_is_fast() {
    let encoders = "q_sd_rad = 2e-5\nqd_sd_rad_s = 1e-3\n";
    let share = |effect: &str| size_of(effect, encoders).lambda / size_of(effect, "").lambda;
    let fast = share(
        "[[effect]]\nkind='ripple'\njoint=2\namplitude_nm=0.5\norder_per_turn=202\nphase_rad=0",
    );
    let slow =
        share("[[effect]]\nkind='position_friction'\njoint=2\namplitude_nm=0.5\nphase_rad=0.3");
    println!("{fast} {slow}");
    assert!(fast < 0.6 && slow > 0.8 && slow < 1.0, "{fast} {slow}");
}

/// An effect that amounts to changed parameters of the null model: all of it moves the parameters, except that
/// reversals fall between other rows. That remainder is less than a test at 3 σ detects.
#[test]
fn what_the_null_model_absorbs_has_only_a_size_against_a_simulation() {
    let payload = "[[effect]]\nkind='payload'\nmass_kg=0.5\ncom_x_m=0\ncom_y_m=0\ncom_z_m=0.05";
    for noise in ["", COLOURED] {
        let size = size_of(payload, noise);
        println!("{size:?}");
        assert!(size.lambda_sim > 1e3 && size.lambda < 9.0, "{size:?}");
    }
}

/// λ is quadratic: twice the effect gives four times λ. Stribeck friction is linear in its size apart from its
/// influence on the motion, a few percent here.
#[test]
fn the_size_of_an_effect_is_quadratic() {
    let stribeck = |nm: f64| {
        size_of(&format!("[[effect]]\nkind='stribeck'\njoint=4\nextra_nm={nm}\nvs_rad_s=0.1"), "")
    };
    let (one, two) = (stribeck(0.25), stribeck(0.5));
    println!("{one:?} {two:?}");
    assert!((two.lambda / one.lambda - 4.0).abs() < 0.2, "{one:?} {two:?}");
}

/// Copied periods equal integrated ones: the log of two periods and its λ, for effects with a memory (bristles, a
/// spring with an inertia, and a delayed channel).
#[test]
fn a_log_that_repeats_need_not_be_integrated() {
    let effects = "[[effect]]\nkind='presliding'\njoint=4\nstiffness_per_rad=300\n\
                   [[effect]]\nkind='elasticity'\njoint=2\nstiffness_nm_rad=8000\n\
                   [[effect]]\nkind='time_skew'\njoint=3\ndelay_s=-0.004";
    let scenario = scenario(("size", 1), ("ur5_identification", 2), TORQUE_NOISE, effects);
    let plant = FaultyPlant::new(&scenario.arm, &scenario.effects, &scenario.plant).unwrap();
    let recording = plant.run(&scenario.excitation, None).unwrap();
    let copied = Simulation::run(scenario.clone()).unwrap();
    let mut whole = Simulation::run(scenario).unwrap();
    whole.recording = recording;
    assert_eq!(whole.recording.time_s, copied.recording.time_s);
    // In the last half second, the whole run lacks the later samples that a delayed channel would read.
    let settled = whole.recording.time_s.len() - 63;
    let worst = |of: fn(&Recording) -> &JointSignals, j: usize| {
        let pairs = of(&whole.recording).joint(j).iter().zip(of(&copied.recording).joint(j));
        pairs.take(settled).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max)
    };
    for (j, torque_sd_nm) in SIGMA_NM.into_iter().enumerate() {
        let torque = worst(|run| &run.torque_nm, j) / torque_sd_nm;
        let angle = worst(|run| &run.q_rad, j) / 2e-5;
        let velocity = worst(|run| &run.qd_rad_s, j) / 1e-3;
        println!("joint {}: {torque:.2e}, {angle:.2e} and {velocity:.2e} σ", j + 1);
        // Ten thousand samples that are off by a hundredth of the noise give λ = 1.
        assert!(torque.max(angle).max(velocity) < 0.01, "joint {}", j + 1);
    }
    let [of_whole, of_copied] = [&whole, &copied].map(|s| s.effect_size().unwrap().lambda);
    assert!((of_copied / of_whole - 1.0).abs() < 0.01, "{of_copied} {of_whole}");
}

/// A gear that oscillates for longer than the settling time allowed, and friction that warms up, are integrated from
/// the first row to the last.
#[test]
fn what_does_not_repeat_is_integrated() {
    for effect in [
        "kind='elasticity'\njoint=2\nstiffness_nm_rad=2000\ndamping_ratio=0.002",
        "kind='thermal_drift'\njoint=2\nfraction=-0.3\ntime_constant_s=20.0",
    ] {
        let effects = format!("[[effect]]\n{effect}");
        let scenario = scenario(("size", 1), ("ur5_identification", 2), TORQUE_NOISE, &effects);
        let plant = FaultyPlant::new(&scenario.arm, &scenario.effects, &scenario.plant).unwrap();
        let whole = plant.run(&scenario.excitation, None).unwrap();
        assert_eq!(Simulation::run(scenario).unwrap().recording, whole, "{effect}");
    }
}
