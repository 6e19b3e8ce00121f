//! Two recordings in one log, the second directly behind the first and elsewhere, with velocities that come late.

use armid::diagnose::{Kind, Mended};
use armid::identify::{Identifier, Measurement};
use armid::plant::Measured;
use armid::robot::JointSignals;

use crate::simulated::{NOISE, Run, scenario};

/// Velocities that come a sample late.
const LATE: &str = "[[effect]]\nkind = \"velocity_lag\"\ndelay_s = 0.008\n";

/// Four periods of `trajectory`.
fn run(trajectory: &str) -> Run {
    Run::new(scenario(("two", 7), (trajectory, 4), NOISE, LATE))
}

/// Three quarters of `second` behind `first`, on one clock that goes on evenly.
fn one_behind_the_other(first: &Measured, second: &Measured) -> Measured {
    let rows = 3 * second.time_s.len() / 4;
    let mut both = first.clone();
    let samples = first.time_s.len() + rows;
    both.time_s = (0..samples).map(|k| first.time_s[0] + 0.008 * k as f64).collect();
    let joined = |one: &JointSignals, other: &JointSignals| {
        one.map_joints(|j, y| [y, &other.joint(j)[..rows]].concat())
    };
    both.q_rad = joined(&first.q_rad, &second.q_rad);
    both.qd_rad_s = joined(&first.qd_rad_s, &second.qd_rad_s);
    both.torque_nm = joined(&first.torque_nm, &second.torque_nm);
    both
}

/// Slopes and filters across the jump once made inertias negative, and a touch of 2000 Nm was named there.
#[test]
fn nothing_is_used_across_the_place_where_they_meet() {
    let [first, second] = ["ur5_identification", "ur5_validation"].map(run);
    let both = one_behind_the_other(&first.log, &second.log);
    let mended = Mended::of(&both.measurement("both.csv")).unwrap();
    let [q_rad, qd_rad_s, torque_nm] = &mended.channels;
    let m = Measurement { source: "both.csv", time_s: &mended.time_s, q_rad, qd_rad_s, torque_nm };
    let mut identifier = Identifier::new(&first.model, &first.set, first.options.clone());
    let found = identifier.identify(&m).unwrap();
    assert_eq!(found.processing.periods, 4);
    // The window ends a step behind its last sample.
    let end_s = 0.008 * first.log.time_s.len() as f64;
    assert!(found.processing.window_s[1] < end_s + 0.004, "{:?}", found.processing);
    let is_told = |warnings: &[String]| warnings.iter().any(|w| w.contains("jumps once"));
    assert!(is_told(&found.warnings), "{:?}", found.warnings);
    let truth = first.set.values(&first.model.standard_parameters());
    let half = found.sigma().into_iter().map(|sigma| found.covariance.quantile_95() * sigma);
    let errors = found.fit.theta.iter().zip(&truth).map(|(theta, truth)| (theta - truth).abs());
    let held = errors.zip(half).filter(|(error, half)| error <= half).count();
    // 52 intervals that hold at 95 %: fewer than 43 hold once in 4500 if they are independent.
    assert!(held >= 43, "{held} of {}", truth.len());

    let found = first.diagnoser().diagnose(&both.measurement("both.csv"), &[], None).unwrap();
    let kinds: Vec<Kind> = found.diagnosis.causes.iter().map(|cause| cause.kind).collect();
    assert_eq!(kinds, [Kind::VelocityLag], "{:#?}", found.diagnosis.sentences);
    assert!(is_told(&found.diagnosis.warnings), "{:?}", found.diagnosis.warnings);
}
