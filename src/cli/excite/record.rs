//! The content of a trajectory file.

use serde::Serialize;

use crate::base::BaseSet;
use crate::excitation::design::{Criterion, Design, Specification};
use crate::report::excitation::open_parameters;
use crate::robot::Arm;

/// A trajectory and the record of its design.
#[derive(Serialize)]
pub(super) struct Record<'a> {
    period_s: f64,
    q0_rad: &'a [f64],
    a_rad_s: &'a [Vec<f64>],
    b_rad_s: &'a [Vec<f64>],
    design: DesignRecord,
}

#[derive(Serialize)]
struct DesignRecord {
    robot: String,
    criterion: Criterion,
    value: f64,
    condition: f64,
    scaled_condition: f64,
    geometric_mean_sigma: f64,
    relative_sigma_median: f64,
    relative_sigma_90: f64,
    /// Number of base parameters.
    parameters: usize,
    /// How many will be known better than their own size, with the median and the 90th percentile of their relative σ.
    parameters_known: usize,
    known_sigma_median: f64,
    known_sigma_90: f64,
    /// Names of those that would stay open.
    not_identified: Vec<String>,
    run_in_s: f64,
    periods: usize,
    start_rad: Vec<f64>,
    margins: Vec<MarginRecord>,
    starts: usize,
    feasible_starts: usize,
    finalists: Vec<FinalistRecord>,
    evaluations: usize,
    cut_short: bool,
}

#[derive(Serialize)]
struct MarginRecord {
    limit: String,
    free: f64,
    unit: &'static str,
    /// `free` relative to half the range of a position, to the largest velocity, acceleration or torque, or to 0.1 m
    /// for a distance.
    share: f64,
    time_s: f64,
}

#[derive(Serialize)]
struct FinalistRecord {
    start: usize,
    value: f64,
}

impl<'a> Record<'a> {
    /// Records the design `found` for `arm`.
    pub(super) fn of(arm: &Arm, base: &BaseSet, spec: &Specification, found: &'a Design) -> Self {
        let p = &found.prediction;
        let series = found.excitation.series();
        Self {
            period_s: series.period_s,
            q0_rad: &series.q0_rad,
            a_rad_s: &series.a_rad_s,
            b_rad_s: &series.b_rad_s,
            design: DesignRecord {
                robot: arm.name.clone(),
                criterion: spec.criterion,
                value: found.value,
                condition: p.condition,
                scaled_condition: p.scaled_condition,
                geometric_mean_sigma: p.geometric_mean_sigma(),
                relative_sigma_median: p.relative_quantile(0.5),
                relative_sigma_90: p.relative_quantile(0.9),
                parameters: p.sigma.len(),
                parameters_known: p.known(),
                known_sigma_median: p.known_quantile(0.5),
                known_sigma_90: p.known_quantile(0.9),
                not_identified: open_parameters(arm, base, p),
                run_in_s: found.excitation.run_in_s(),
                periods: found.excitation.periods(),
                start_rad: found.excitation.start_rad(),
                margins: found
                    .margins
                    .all()
                    .iter()
                    .map(|m| MarginRecord {
                        limit: m.limit.to_string(),
                        free: m.free,
                        unit: m.limit.unit(),
                        share: m.share,
                        time_s: m.time_s,
                    })
                    .collect(),
                starts: found.starts,
                feasible_starts: found.feasible_starts,
                finalists: found
                    .finalists
                    .iter()
                    .map(|f| FinalistRecord { start: f.start, value: f.value })
                    .collect(),
                evaluations: found.evaluations,
                cut_short: found.cut_short,
            },
        }
    }
}
