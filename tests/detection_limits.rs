//! The detection limits of a diagnosis, checked with the plant: an effect of that size has the stated strength.

use armid::diagnose::{DetectionLimit, Diagnoser};
use armid::dynamics::Model;
use armid::montecarlo::{Scenario, Simulation};

use crate::simulated::{TORQUE_NOISE, scenario, simulation};

/// Simulation of four periods of an arm with `effects`.
fn run(effects: &str) -> Simulation {
    let along = ("ur5_identification", 4);
    simulation(scenario(("limits", 5), along, TORQUE_NOISE, effects))
}

/// Detection limits that the diagnosis of the log of `clean` states.
fn limits_of(clean: &Simulation) -> Vec<DetectionLimit> {
    let Scenario { arm, set, processing, .. } = &clean.scenario;
    let log = clean.log(0).unwrap();
    let model = Model::new(arm);
    let mut diagnoser = Diagnoser::new(arm, &model, set, processing.clone());
    diagnoser.diagnose(&log.measurement("limits"), &[], None).unwrap().diagnosis.detection_limits
}

/// An effect of the plant with the size of its detection limit has the stated √λ, however much the mechanism in the
/// plant differs from the regressor column that detects it.
///
/// Four periods determine the standard deviation of a slow harmonic's noise to an eighth, so that the √λ of the limit
/// may be a seventh too small. Usually it is too large: the diagnosis leaves a part of the effect to drives and
/// reversals, and scales for the error of the inverse of an estimated noise covariance (a tenth). It must not lose more
/// than half of √λ that way.
#[test]
fn an_effect_of_the_limits_size_is_as_strong_as_it_says() {
    let clean = run("");
    let limits = limits_of(&clean);
    let cases = [
        ("load_friction", Some(2), ""),
        ("load_friction", Some(5), ""),
        ("position_friction", Some(3), ""),
        ("nonlinear_viscous", Some(1), ""),
        ("stribeck", Some(4), ""),
        ("reversal_width", Some(3), ""),
        ("saturation", Some(1), ""),
        ("encoder_offset", Some(2), ""),
        ("spring", Some(3), "rest_rad = 0.0"),
        ("backlash", Some(1), ""),
        ("asymmetric_friction", Some(4), "coulomb_nm = 0.0"),
        ("current_offset", Some(2), ""),
        ("torque_gain", Some(3), ""),
        ("thermal_drift", Some(6), ""),
        ("ripple", Some(4), "phase_rad = 0.0"),
        ("elasticity", Some(2), ""),
        ("time_skew", Some(3), ""),
        ("base_tilt", None, "tilt_y_rad = 0.0"),
    ];
    let mut wrong = Vec::new();
    for (kind, joint, rest) in cases {
        let is_it = |l: &&DetectionLimit| (l.kind.name(), l.joint) == (kind, joint);
        let limit = limits.iter().find(is_it).unwrap();
        let mut effect = format!("[[effect]]\nkind = '{kind}'\n{rest}\n");
        if let Some(joint) = joint {
            effect += &format!("joint = {joint}\n");
        }
        for (name, value) in limit.given.iter().chain([(&limit.parameter, &limit.value.unwrap())]) {
            effect += &format!("{name} = {value:?}\n");
        }
        let size = run(&effect).size_beside(&clean.recording).unwrap();
        let ratio = size.lambda.sqrt() / limit.sqrt_lambda.unwrap();
        println!("{kind} {joint:?}: {} {:?}, {ratio:.2}", limit.parameter, limit.value);
        if !(0.86..2.0).contains(&ratio) {
            wrong.push((kind, joint, ratio));
        }
    }
    assert!(wrong.is_empty(), "{wrong:?}");
}
