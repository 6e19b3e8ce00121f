//! Trajectories side by side, in this project's base set, truth and clearance model:
//! `cargo run --release --example compare_excitations -- FILE.json…`
//!
//! A file is a trajectory of `armid excite`, or a collection `{"designs": [{criterion, period_s, order,
//! rest_start, max_acceleration_rad_s2, q0_rad, a_rad_s, b_rad_s}]}`. Robot: UR5; 80 s at 125 Hz with noise 1/1/.7/.15/.15/.15 Nm.

use std::error::Error;

use armid::base::{BaseSet, Parameterisation};
use armid::dynamics::Model;
use armid::excitation::design::{Experiment, Prediction};
use armid::excitation::{FourierSeries, Requirements, check};
use armid::report::{Column, Table};
use armid::robot::Arm;
use serde::Deserialize;

#[derive(Deserialize)]
struct Collection {
    designs: Vec<Entry>,
}

#[derive(Deserialize)]
struct Entry {
    criterion: String,
    period_s: f64,
    order: usize,
    rest_start: bool,
    max_acceleration_rad_s2: f64,
    q0_rad: Vec<f64>,
    a_rad_s: Vec<Vec<f64>>,
    b_rad_s: Vec<Vec<f64>>,
}

fn main() -> Result<(), Box<dyn Error>> {
    let arm = Arm::built_in("ur5")?;
    let model = Model::new(&arm);
    let base = BaseSet::find(&arm, Parameterisation::full(6, false))?;
    let experiment = Experiment {
        data_s: 80.0,
        rate_hz: 125.0,
        torque_noise_nm: vec![1.0, 1.0, 0.7, 0.15, 0.15, 0.15],
    };
    let mut table = Table::new([
        Column::text("trajectory"),
        Column::number("cond(ΘᵀΘ)", ""),
        Column::number("columns scaled", ""),
        Column::number("geo-mean σ", ""),
        Column::number("median rel. σ", "%"),
        Column::number("90 % rel. σ", "%"),
        Column::number("clearance", "m"),
        Column::text("closest limit"),
    ]);
    for path in std::env::args().skip(1) {
        let text = std::fs::read_to_string(&path)?;
        for (name, series) in trajectories(&path, &text)? {
            let Some(p) = Prediction::of(&model, &base, &experiment, &series, None) else {
                println!("{name}: leaves parameters undetermined");
                continue;
            };
            // Without any clearance asked for, the margin of a distance is the distance.
            let requirements = Requirements { clearance_m: 0.0, ..Requirements::default() };
            let margins = check(&arm, &requirements, &series)?;
            let distances = margins.all().iter().filter(|m| m.limit.unit() == "m");
            let least = distances.map(|m| m.free).fold(f64::INFINITY, f64::min);
            let worst = check(&arm, &Requirements::default(), &series)?;
            let worst = worst.worst();
            table.push([
                name,
                format!("{:.1}", p.condition),
                format!("{:.1}", p.scaled_condition),
                format!("{:.6}", p.geometric_mean_sigma()),
                format!("{:.2}", 100.0 * p.relative_quantile(0.5)),
                format!("{:.1}", 100.0 * p.relative_quantile(0.9)),
                format!("{least:.4}"),
                format!("{}: {} left", worst.limit, worst.in_words()),
            ]);
        }
    }
    println!("{}", table.to_markdown());
    Ok(())
}

fn trajectories(path: &str, text: &str) -> Result<Vec<(String, FourierSeries)>, Box<dyn Error>> {
    let Ok(collection) = serde_json::from_str::<Collection>(text) else {
        return Ok(vec![(path.to_owned(), FourierSeries::from_json(text, path)?)]);
    };
    collection
        .designs
        .into_iter()
        .map(|d| {
            let rest = if d.rest_start { ", rest start" } else { "" };
            let name = format!(
                "baseline {}, T = {} s, order {}{rest}, {} rad/s²",
                d.criterion, d.period_s, d.order, d.max_acceleration_rad_s2
            );
            Ok((name, FourierSeries::new(d.period_s, d.q0_rad, d.a_rad_s, d.b_rad_s)?))
        })
        .collect()
}
