//! The paper's error measure e_N against the length of the record.

use serde::Serialize;

use super::cutoff::Bench;
use super::error::StudyError;
use super::paper_equations::PaperEquations;
use crate::excitation::Excitation;
use crate::identify::{Fitter, Residual, Weighting};
use crate::montecarlo::scenario::Scenario;

/// Longest record, periods.
const LONGEST: usize = 8;

/// Errors of the fit for one length of the record.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct RecordLength {
    /// Length, s.
    pub record_s: f64,
    /// Number of time samples m.
    pub samples: usize,
    /// The paper's error measure (21), √(eᵀe)/m, for the fit.
    pub e_n: f64,
    /// Root mean square √(eᵀe/(N m)) over all N joints and m samples, Nm.
    pub rms_nm: f64,
    /// e_N expected from torque noise alone with b parameters: √(Σ_j s_j²/m) √(1 − b/(N m)).
    pub predicted_e_n: f64,
}

/// Fits records of 1 … 8 periods of the same run by the method of the paper's section IV-B.
pub(super) fn record_length(scenario: &Scenario) -> Result<Vec<RecordLength>, StudyError> {
    let series = scenario.excitation.series().clone();
    let excitation = Excitation::new(series, scenario.excitation.run_in_s(), LONGEST + 2)?;
    let bench = Bench::new(Scenario { excitation, ..scenario.clone() })?;
    let (set, rate_hz) = (&bench.scenario().set, bench.rate_hz());
    let log = bench.simulation.log(0)?;
    let joints = bench.model.dof() as f64;
    let noise: f64 = bench.torque_sd_nm()?.iter().map(|s| s * s).sum();
    let filtered =
        bench.record.start - bench.period..bench.record.start + (LONGEST + 1) * bench.period;
    (1..=LONGEST)
        .map(|periods| {
            let kept = bench.period..(1 + periods) * bench.period;
            let problem = PaperEquations::PAPER.assemble(
                &bench.model,
                set,
                &log,
                rate_hz,
                filtered.clone(),
                kept,
            )?;
            let fit = Fitter::new(&problem).fit(&problem, set, Weighting::Equal)?;
            let m = problem.samples as f64;
            let residual =
                Residual::from_squares(&fit.residual_squares, &fit.torque_squares, problem.samples);
            let squares: f64 = fit.residual_squares.iter().sum();
            Ok(RecordLength {
                record_s: m / rate_hz,
                samples: problem.samples,
                e_n: residual.e_n,
                rms_nm: (squares / (joints * m)).sqrt(),
                predicted_e_n: (noise / m * (1.0 - set.rank() as f64 / (joints * m))).sqrt(),
            })
        })
        .collect()
}
