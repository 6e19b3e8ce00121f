//! `armid predict` from outside: the torque in its file is that of a validation, of the equations of motion, and of the
//! covariance.

use std::collections::BTreeMap;

use armid::base::{BaseSet, Parameterisation};
use armid::dynamics::{Model, Workspace, inverse_dynamics, regressor};
use armid::excitation::export::write_csv;
use armid::excitation::{Excitation, FourierSeries, PlannedMotion};
use armid::robot::Arm;
use nalgebra::{DMatrix, DVector};
use serde_json::{Value, json};

use crate::cli::{Folder, default_scenario};

/// The columns of a CSV file by their names.
fn columns(text: &str) -> BTreeMap<String, Vec<f64>> {
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    let rows: Vec<Vec<f64>> =
        lines.map(|line| line.split(',').map(|field| field.parse().unwrap()).collect()).collect();
    assert!(rows.iter().all(|row| row.len() == names.len()));
    let column = |(k, name): (usize, &&str)| {
        let values: Vec<f64> = rows.iter().map(|row| row[k]).collect();
        ((*name).to_owned(), values)
    };
    names.iter().enumerate().map(column).collect()
}

/// The header of the file, with these blocks of six joints.
fn header(blocks: &[&str]) -> String {
    let names = blocks.iter().flat_map(|block| (0..6).map(move |j| format!("{block}_{j}")));
    std::iter::once("timestamp".to_owned()).chain(names).collect::<Vec<_>>().join(",")
}

/// The UR5 as the plant simulates it.
struct Truth {
    model: Model,
    set: BaseSet,
}

impl Truth {
    fn new() -> Self {
        let arm = Arm::built_in("ur5").unwrap();
        let set = BaseSet::find(&arm, Parameterisation::full(6, arm.torque_offsets)).unwrap();
        Self { model: Model::new(&arm), set }
    }

    /// An identification that found the true parameters.
    fn result(&self) -> Value {
        let Self { model, set } = self;
        let values = set.values(&model.standard_parameters());
        let parameter = |(k, value): (usize, &f64)| json!({"name": set.name(k), "formula": set.formula(k), "value": value});
        let parameters: Vec<Value> = values.iter().enumerate().map(parameter).collect();
        json!({"schema": "armid.identify/1", "robot": "ur5", "base_parameters": parameters})
    }
}

/// One period with its run-in, as `armid excite --csv` writes it at 20 Hz.
fn planned() -> String {
    let series = FourierSeries::built_in("ur5_identification").unwrap();
    let mut text = Vec::new();
    write_csv(&mut text, &Excitation::new(series, 1.0, 1).unwrap(), 20.0).unwrap();
    String::from_utf8(text).unwrap()
}

/// A folder with the planned motion and the true result.
fn with_planned_motion(truth: &Truth) -> Folder {
    let folder = Folder::empty();
    folder.write("motion.csv", planned());
    folder.write("r.json", truth.result().to_string());
    folder
}

/// Angles, velocities and accelerations of every row of `motion.csv`.
fn states(folder: &Folder) -> Vec<[[f64; 6]; 3]> {
    let PlannedMotion { motion, .. } =
        PlannedMotion::read(&folder.path("motion.csv"), 6).unwrap().unwrap();
    let state = |k: usize| {
        [&motion.q_rad, &motion.qd_rad_s, &motion.qdd_rad_s2].map(|signals| {
            let mut row = [0.0; 6];
            signals.sample_into(k, &mut row);
            row
        })
    };
    (0..motion.samples()).map(state).collect()
}

/// The result was identified along another motion. Both commands read θ from the same bits, but the file holds measured
/// and predicted torque, whose difference is the error to within some 1e-13 Nm; errors are 0.04 Nm and more.
#[test]
fn a_log_is_predicted_as_a_validation_predicts_it() {
    let folder = Folder::empty();
    let scenario = default_scenario(2);
    folder.write("s.toml", &scenario);
    folder.write("other.toml", scenario.replace("ur5_identification", "ur5_validation"));
    for words in ["s.toml --out run.csv", "other.toml --out other.csv --trial 1"] {
        folder.armid(&format!("simulate --scenario {words}")).says(0, &["samples"]);
    }
    for options in ["", "--cutoff 5 --rate 100"] {
        let words =
            format!("identify run.csv --robot ur5 --period 0 {options} --json r.json --validate");
        folder.armid(&format!("{words} other.csv")).says(0, &["Identified 52"]);
        let validation = folder.result("r.json")["validation"][0].clone();
        let words =
            format!("predict other.csv --robot ur5 {options} --result r.json --out torque.csv");
        let said = ["The error of the torque predicted along other.csv is", "σ by the parameters"];
        folder.armid(&words).says(0, &said);
        let text = folder.read("torque.csv");
        let blocks = ["actual_torque", "predicted_torque", "predicted_sd"];
        assert_eq!(text.lines().next().unwrap(), header(&blocks));
        let torque = columns(&text);
        let samples = torque["timestamp"].len();
        assert_eq!(validation["samples"].as_u64(), Some(samples as u64));
        for j in 0..6 {
            let [actual, predicted, sd] = blocks.map(|block| &torque[&format!("{block}_{j}")]);
            let squares =
                |values: &mut dyn Iterator<Item = f64>| values.map(|v| v * v).sum::<f64>();
            let error = squares(&mut actual.iter().zip(predicted).map(|(a, p)| a - p));
            let percent = 100.0 * (error / squares(&mut actual.iter().copied())).sqrt();
            let expected = validation["relative_percent"][j].as_f64().unwrap();
            assert!((percent / expected - 1.0).abs() < 1e-9, "joint {j}: {percent} {expected}");
            // Both logs have the same noise and 2500 rows, with some 400 independent values per joint behind a low-pass
            // at 10 Hz: the part of 52 parameters in the error is smaller than that of the noise.
            let rms = |square: f64| (square / samples as f64).sqrt();
            let of_parameters = rms(squares(&mut sd.iter().copied()));
            assert!(
                of_parameters > 0.0 && of_parameters < rms(error),
                "joint {j}: {of_parameters}"
            );
        }
    }
}

/// With the true parameters the torque is that of the equations of motion: the same numbers but for the rounding of a
/// sum of 52 products, and for coefficients of the base parameters below 1e-9, which are rounding themselves.
#[test]
fn the_torque_of_a_planned_motion_is_that_of_the_equations_of_motion() {
    let truth = Truth::new();
    let folder = with_planned_motion(&truth);
    let words = "predict motion.csv --robot ur5 --result r.json";
    let said =
        ["no covariance of the base parameters", "no drive is asked for more than its limit"];
    folder.armid(&format!("{words} --out torque.csv")).says(0, &said);
    let text = folder.read("torque.csv");
    assert_eq!(text.lines().next().unwrap(), header(&["predicted_torque"]));
    let torque = columns(&text);
    let states = states(&folder);
    assert_eq!(torque["timestamp"].len(), states.len());
    let mut workspace = Workspace::new(&truth.model);
    let expected: Vec<[f64; 6]> = states
        .iter()
        .map(|[q, qd, qdd]| {
            let mut torque_nm = [0.0; 6];
            inverse_dynamics(&truth.model, &mut workspace, q, qd, qdd, &mut torque_nm);
            torque_nm
        })
        .collect();
    for j in 0..6 {
        let predicted = &torque[&format!("predicted_torque_{j}")];
        let largest = expected.iter().map(|row| row[j].abs()).fold(0.0, f64::max);
        for (k, row) in expected.iter().enumerate() {
            let off = (predicted[k] - row[j]).abs();
            assert!(off < 1e-9 * largest, "joint {j}, row {k}: {} {}", predicted[k], row[j]);
        }
    }
    // A weaker drive of the first joint is told, and so are options that do nothing.
    let weaker =
        include_str!("../robots/ur5.toml").replacen("torque_nm = 150.0", "torque_nm = 10.0", 1);
    folder.write("weaker.toml", weaker);
    let words =
        "predict motion.csv --robot weaker.toml --result r.json --cutoff 5 --out torque.csv";
    let said = ["joint 1 needs ", "its drive gives 10 Nm", "--cutoff and --rate are not used"];
    folder.armid(words).says(0, &said);
    assert_eq!(folder.read("torque.csv"), text);
    let to_terminal = "predict motion.csv --robot ur5 --result r.json --out /dev/stdout";
    let said = folder.armid(to_terminal).says(0, &[]);
    assert!(said.starts_with(&text), "{said}");
}

/// σ of every row is √(x Σ xᵀ) with the row x of the dense regressor, for parameters whose correlation falls by half from
/// each to the next. Its eigenvalues are between 1/3 and 3 times the variance, so that of 52² products no more than two
/// digits cancel.
#[test]
fn sigma_is_that_of_the_covariance() {
    let truth = Truth::new();
    let folder = with_planned_motion(&truth);
    let Truth { model, set } = &truth;
    let rank = set.rank();
    let covariance = DMatrix::from_fn(rank, rank, |a, b| 1e-4 * 0.5_f64.powi(a.abs_diff(b) as i32));
    let rows: Vec<Vec<f64>> =
        covariance.row_iter().map(|row| row.iter().copied().collect()).collect();
    let mut result = truth.result();
    result["base_covariance"] = json!(rows);
    result["intervals"] = json!({"trusted": false});
    folder.write("r.json", result.to_string());
    let words = "predict motion.csv --robot ur5 --result r.json --out torque.csv";
    folder.armid(words).says(0, &["note: r.json: the model was wrong along its log"]);
    let torque = columns(&folder.read("torque.csv"));
    let mut workspace = Workspace::new(model);
    for (k, [q, qd, qdd]) in states(&folder).iter().enumerate() {
        let dense = regressor(model, &mut workspace, q, qd, qdd);
        for j in 0..6 {
            let entry = |b: usize| -> f64 {
                set.column(b).iter().map(|&(index, factor)| factor * dense[(j, index)]).sum()
            };
            let x = DVector::from_fn(rank, |b, _| entry(b));
            let expected = x.dot(&(&covariance * &x)).sqrt();
            let sd = torque[&format!("predicted_sd_{j}")][k];
            // At rest gravity asks nothing of the first joint, whose axis is vertical: its row is zero but for rounding.
            let tolerance = 1e-9 * expected + 1e-12;
            assert!((sd - expected).abs() < tolerance, "joint {j}, row {k}: {sd} {expected}");
        }
    }
}

#[test]
fn what_does_not_fit_together_is_refused() {
    let truth = Truth::new();
    let folder = with_planned_motion(&truth);
    let motion = folder.read("motion.csv");
    let saved = |name: &str, key: &str, value: Value| {
        let mut result = truth.result();
        result[key] = value;
        folder.write(name, result.to_string());
    };
    saved("ur10e.json", "robot", json!("ur10e"));
    saved("reduced.json", "reduced", json!("paper"));
    saved("declined.json", "base_parameters", json!([]));
    let three = |name: &str| format!("{name}_0,{name}_1,{name}_2");
    let names = |names: [&str; 3]| format!("timestamp,{}", names.map(three).join(","));
    let rows = "0,0,0,0,0,0,0,0,0,0\n0.008,0,0,0,0,0,0,0,0,0\n";
    let log = names(["actual_q", "actual_qd", "actual_torque"]);
    folder.write("log3.csv", format!("{log}\n{rows}"));
    let plan = names(["target_q", "target_qd", "target_qdd"]);
    folder.write("motion3.csv", format!("{plan}\n{rows}"));
    for (log, result, out, expected) in [
        ("motion.csv", "ur10e.json", "t.csv", "it is about \"ur10e\", not \"ur5\""),
        ("motion.csv", "reduced.json", "t.csv", "--reduced paper"),
        ("motion.csv", "declined.json", "t.csv", "no base parameters were identified"),
        ("motion.csv", "no.json", "t.csv", "no.json"),
        ("no.csv", "r.json", "t.csv", "no.csv"),
        ("motion.csv", "r.json", "motion.csv", "reads this file"),
        ("motion.csv", "r.json", "r.json", "reads this file"),
        ("motion.csv", "r.json", "no/t.csv", "the folder no does not exist"),
        ("log3.csv", "r.json", "t.csv", "the log has 3 joints, the arm has 6"),
        ("motion3.csv", "r.json", "t.csv", "the motion has 3 joints, the arm has 6"),
        ("motion.csv", "r.json", "t.csv --cutoff 0", "--cutoff 0: must be a positive number"),
    ] {
        let words = format!("predict {log} --robot ur5 --result {result} --out {out}");
        folder.armid(&words).complains(1, &[expected]);
    }
    folder.armid("predict motion.csv --robot ur5 --out t.csv").complains(2, &["--result"]);
    assert!(!folder.path("t.csv").exists());
    assert_eq!(folder.read("motion.csv"), motion);
}
