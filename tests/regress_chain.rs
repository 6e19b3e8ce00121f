//! The whole chain pinned: scenario, simulated log, estimate, σ, verdict. A change in any step shows here even if the
//! answer is still correct.
//!
//! After an intended change run `ARMID_PIN=1 cargo test regress_chain -- --nocapture` and copy the printed numbers. The
//! hash of the log covers every bit of the plant and the sensors. It depends on the platform's sine and logarithm, so
//! that another C library may require another hash; the estimates, compared to 1e-9, must not change with it.

use armid::identify::Options;
use armid::montecarlo::calibration::{Calibration, claims};
use armid::montecarlo::shard::Shard;
use armid::montecarlo::{Experiment, Scenario};
use sha2::{Digest, Sha256};

/// The default scenario with four periods instead of eight.
const SCENARIO: &str = r#"
name = "regress"
robot = "ur5"
seed = 7
trials = 24

[motion]
trajectory = "ur5_identification"
periods = 4

[sensors]
torque_sd_nm = [1.0, 1.0, 0.7, 0.15, 0.15, 0.15]
q_sd_rad = 2e-5
qd_sd_rad_s = 1e-3
"#;

const LOG_SHA256: &str = "d1d865bcee3207eccfc9c690db895a9be375800d5659511d760be8ec37370e8c";
/// `(name, estimate, σ)` of trial 0.
const ESTIMATES: [(&str, f64, f64); 4] = [
    ("mx2", -3.8891533372353644, 0.003602815890450162),
    ("Ia4", 0.24749583318073676, 0.000781388955511914),
    ("rv1", 12.008473647853293, 0.018679336404359915),
    ("rc6", 1.4062510456820756, 0.005664463037330922),
];
const VERDICT: &str = "not_evaluated";

fn experiment() -> Experiment {
    let folder = std::path::Path::new("");
    Experiment::prepare(Scenario::from_toml(SCENARIO, "regress", folder).unwrap()).unwrap()
}

#[test]
fn the_chain_takes_the_path_it_took() {
    let experiment = experiment();
    assert_eq!(experiment.simulation.scenario.processing, Options::default());
    let measured = experiment.simulation.log(0).unwrap();
    let mut hash = Sha256::new();
    measured.time_s.iter().for_each(|t| hash.update(t.to_le_bytes()));
    for signals in [&measured.q_rad, &measured.qd_rad_s, &measured.torque_nm] {
        for j in 0..signals.joints() {
            signals.joint(j).iter().for_each(|v| hash.update(v.to_le_bytes()));
        }
    }
    let log_sha256: String = hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect();
    let identification = experiment.worker().identify(0).unwrap();
    let sigma = identification.sigma();
    let set = &experiment.simulation.scenario.set;
    let find = |name: &str| (0..set.rank()).find(|&k| set.name(k) == name).unwrap();
    if std::env::var_os("ARMID_PIN").is_some() {
        println!("LOG_SHA256 = {log_sha256}");
        for (name, ..) in ESTIMATES {
            let k = find(name);
            println!("(\"{name}\", {:?}, {:?}),", identification.fit.theta[k], sigma[k]);
        }
        return;
    }
    assert_eq!(log_sha256, LOG_SHA256);
    for (name, estimate, sigma_pinned) in ESTIMATES {
        let k = find(name);
        let theta = identification.fit.theta[k];
        assert!((theta - estimate).abs() <= 1e-9 * estimate.abs(), "{name}: {theta:?}");
        assert!(
            (sigma[k] - sigma_pinned).abs() <= 1e-9 * sigma_pinned,
            "σ of {name}: {:?}",
            sigma[k]
        );
    }
}

#[test]
fn threads_and_shards_give_the_same_bits_and_few_trials_no_verdict() {
    let experiment = experiment();
    let stop = std::sync::atomic::AtomicBool::new(false);
    let run = |range: std::ops::Range<u64>, threads: usize| {
        let mut shard = Shard::new(&experiment, 24, range);
        shard.run(&experiment, threads, None, &stop, &|_| ()).unwrap();
        shard.tally
    };
    let whole = run(0..24, 1);
    assert_eq!(whole, run(0..24, 2));
    let mut parts = run(16..24, 2);
    parts.merge(&run(0..5, 1));
    parts.merge(&run(5..16, 2));
    assert_eq!(whole, parts);
    assert_eq!(Calibration::of(&whole, claims::MEAN_COVERAGE).verdict.to_string(), VERDICT);
}
