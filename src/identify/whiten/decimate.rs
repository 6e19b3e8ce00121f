//! Thins a problem to as few rows as the motion needs.

use crate::identify::problem::Problem;
use crate::signal::{Scratch, SignalError, ZeroPhase};

/// Filters every column and the torque by one zero-phase low-pass at `cutoff_hz`, keeps every nd-th row with
/// nd = f_s/(2 cutoff) (Gautier 1997), and writes them into `out` (same plan). For a repeating motion nd is reduced
/// to the next smaller divisor of the samples per period.
pub fn decimate(
    problem: &Problem,
    cutoff_hz: f64,
    order: usize,
    scratch: &mut Scratch,
    out: &mut Problem,
) -> Result<(), SignalError> {
    let n = problem.samples;
    let periods = problem.periods;
    let filter = ZeroPhase::new(cutoff_hz, order, problem.rate_hz)?;
    let edge = filter.edge_samples();
    let mut every = ((problem.rate_hz / (2.0 * cutoff_hz)) as usize).max(1);
    while periods > 1 && !n.is_multiple_of(every) {
        every -= 1;
    }
    // A single run loses its ends; a repeating motion is continued periodically.
    let (before, kept) = if periods > 1 {
        // One edge leaves 1 % of a transient, three leave 1e-6; inside the log there is none.
        ((3 * edge).min(n), 0..n * periods)
    } else {
        (0, edge.min(n / 8)..n - edge.min(n / 8))
    };
    let mut filtered = Vec::new();
    let mut thin = |series: &[f64], out: &mut Vec<f64>, kept: std::ops::Range<usize>| {
        filtered.clear();
        filtered.extend_from_slice(&series[series.len() - before..]);
        filtered.extend_from_slice(series);
        filtered.extend_from_slice(&series[..before]);
        filter.filter_in_place(&mut filtered, scratch)?;
        out.extend(filtered[before..][kept].iter().step_by(every));
        Ok::<(), SignalError>(())
    };
    for (source, target) in problem.panels.iter().zip(&mut out.panels) {
        target.x.clear();
        target.y.clear();
        let one = if periods > 1 { 0..n } else { kept.clone() };
        for column in source.x.chunks_exact(n) {
            thin(column, &mut target.x, one.clone())?;
        }
        thin(&source.y, &mut target.y, kept.clone())?;
        out.samples = target.y.len() / periods;
    }
    out.periods = periods;
    out.rate_hz = problem.rate_hz / every as f64;
    out.domain = problem.domain;
    Ok(())
}
