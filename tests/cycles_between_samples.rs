//! Cycles of moves with pauses between them whose period is no whole number of samples.

use armid::dynamics::{Model, Workspace, inverse_dynamics};
use armid::robot::Arm;
use rand::{SeedableRng, rngs::ChaCha8Rng};
use rand_distr::{Distribution, StandardNormal};

use crate::cli::Folder;
use crate::simulated::SIGMA_NM;

/// 1371.25 samples.
const PERIOD_S: f64 = 10.97;
const RATE_HZ: f64 = 125.0;
const MOVES: usize = 5;
/// Share of the period that a move takes.
const MOVING: f64 = 0.06;

/// Angle, velocity and acceleration of joint `j` at `t` s: five smooth moves from pose to pose, and back to the first.
fn state(j: usize, t: f64) -> [f64; 3] {
    let pose = |m: usize| 0.7 * ((j + 1) as f64 * ((m % MOVES) as f64).powi(2) + j as f64).sin();
    let phase = (t / PERIOD_S).fract();
    let rate = 1.0 / (MOVING * PERIOD_S);
    let moves = (0..MOVES).map(|m| {
        let s = ((phase - m as f64 / MOVES as f64) / MOVING).clamp(0.0, 1.0);
        let way = pose(m + 1) - pose(m);
        let rest = s * (1.0 - s);
        [
            way * s.powi(3) * (10.0 - 15.0 * s + 6.0 * s * s),
            way * rate * 30.0 * rest * rest,
            way * rate * rate * 60.0 * rest * (1.0 - 2.0 * s),
        ]
    });
    moves.fold([0.0; 3], |sum, part| [sum[0] + part[0], sum[1] + part[1], sum[2] + part[2]])
}

/// Six cycles and a fifth of a UR5, in the default layout.
fn log() -> String {
    let arm = Arm::built_in("ur5").unwrap();
    let model = Model::new(&arm);
    let mut ws = Workspace::new(&model);
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mut noise = |sd: f64| {
        let value: f64 = StandardNormal.sample(&mut rng);
        sd * value
    };
    let names = |what: &str| (0..6).map(|j| format!("{what}_{j}")).collect::<Vec<_>>().join(",");
    let columns = ["actual_q", "actual_qd", "actual_torque"].map(names).join(",");
    let mut text = format!("timestamp,{columns}\n");
    for k in 0..(6.2 * PERIOD_S * RATE_HZ) as usize {
        let t = k as f64 / RATE_HZ;
        let states: Vec<[f64; 3]> = (0..6).map(|j| state(j, t)).collect();
        let [q, qd, qdd] = [0, 1, 2].map(|d| states.iter().map(|s| s[d]).collect::<Vec<f64>>());
        let mut torque_nm = [0.0; 6];
        inverse_dynamics(&model, &mut ws, &q, &qd, &qdd, &mut torque_nm);
        let mut values = vec![t];
        values.extend(q.iter().map(|q| q + noise(2e-5)));
        values.extend(qd.iter().map(|qd| qd + noise(1e-3)));
        values.extend(torque_nm.iter().zip(SIGMA_NM).map(|(nm, sd)| nm + noise(sd)));
        let fields: Vec<String> = values.iter().map(f64::to_string).collect();
        text.push_str(&fields.join(","));
        text.push('\n');
    }
    text
}

/// The log was once read as a single run, and its period refused.
#[test]
fn they_are_averaged_over_their_period() {
    let folder = Folder::empty();
    folder.write("log.csv", log());
    for period in ["", " --period 10.97"] {
        let words = format!("identify log.csv --robot ur5 --json r.json{period}");
        folder.armid(&words).says(0, &["6 periods of 10.970 s averaged"]);
        let processing = folder.result("r.json")["processing"].clone();
        // The period is known to a hundredth of a sample over the log.
        let period_s = processing["period_s"].as_f64().unwrap();
        assert!((period_s - PERIOD_S).abs() < 0.01 / RATE_HZ, "{processing}");
    }
}
