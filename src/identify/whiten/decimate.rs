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
    let repeats = periods > 1;
    let filter = ZeroPhase::new(cutoff_hz, order, problem.rate_hz)?;
    let edge = filter.edge_samples().min(n / 8);
    let mut every = ((problem.rate_hz / (2.0 * cutoff_hz)) as usize).max(1);
    while repeats && !n.is_multiple_of(every) {
        every -= 1;
    }
    let mut filtered = Vec::new();
    let mut thin = |series: &[f64], out: &mut Vec<f64>| {
        let inside = filter.filter_into(series, repeats, &mut filtered, scratch)?;
        // A single run loses its ends; a repeating motion is continued periodically.
        let kept = if repeats { inside } else { edge..n - edge };
        out.extend(filtered[kept].iter().step_by(every));
        Ok::<(), SignalError>(())
    };
    for (source, target) in problem.panels.iter().zip(&mut out.panels) {
        target.x.clear();
        target.y.clear();
        for column in source.x.chunks_exact(n) {
            thin(column, &mut target.x)?;
        }
        thin(&source.y, &mut target.y)?;
        out.samples = target.y.len() / periods;
    }
    out.periods = periods;
    out.rate_hz = problem.rate_hz / every as f64;
    out.domain = problem.domain;
    Ok(())
}
