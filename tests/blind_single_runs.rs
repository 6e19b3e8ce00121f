//! Hide and find along single runs, whose noise nothing but their own residual tells.

use armid::diagnose::{Diagnosis, Kind, Verdict};

use crate::simulated::{Run, scenario};

/// A third of a UR5's noise.
const NOISE: &str =
    "torque_sd_nm = [0.3, 0.3, 0.2, 0.05, 0.05, 0.05]\nq_sd_rad = 6e-6\nqd_sd_rad_s = 3e-4\n";

/// 80 s, taken for a run that repeats nothing, with the effects of `toml`.
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

/// No family of single runs has it; bristles stand in for it, and were named with a confidence of one.
#[test]
fn one_joints_late_torque_is_unexplained_and_nothing_else_for_sure() {
    let d = diagnose(3, "[[effect]]\nkind = \"time_skew\"\njoint = 4\ndelay_s = 0.004\n");
    assert!(d.causes.iter().all(|c| c.confidence <= 0.5), "{:?}", d.causes);
    assert_eq!(d.unexplained.map(|unknown| unknown.joint), Some(4));
}

/// The time constant is a fifth of the record; half of it was the least that was looked for.
#[test]
fn friction_that_warms_up_early_is_told_its_time() {
    let warming = "kind = \"thermal_drift\"\njoint = 3\nfraction = -0.2\ntime_constant_s = 16.0\n";
    let d = diagnose(4, &format!("[[effect]]\n{warming}"));
    let named: Vec<_> = d.causes.iter().map(|c| (c.kind, c.joint)).collect();
    assert_eq!(named, [(Kind::ThermalDrift, Some(3))]);
    let time = &d.causes[0].parameters["time_constant_s"];
    // Twice the half width: 3.9 σ, which one log in 10⁴ misses by chance.
    assert!((time.value - 16.0).abs() < time.ci95[1] - time.ci95[0], "{time:?}");
    assert!(time.ci95[1] < 24.0, "{time:?}");
}
