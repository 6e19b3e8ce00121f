//! The fewest changes with which a log fits its arm.

use rayon::prelude::*;

use super::EXPLAINED;
use super::bench::{Bench, Match};
use super::change::Change;
use super::reading::Reading;
use crate::robot::Arm;

/// Least gain of a change, in Σ ln (‖e_j‖² / ‖τ_j‖²): one joint's residual halves.
const LEAST_GAIN: f64 = 1.4;
/// Share of a joint's torque (rms) that no law of friction and no soft gear leaves: from there on several changes may be needed before
/// any of them is worth it.
const FAR: f64 = 0.2;
/// Readings that are followed at once where the log is that far from the arm.
const BREADTH: usize = 6;
/// Changes one after the other that may gain nothing by themselves there.
const PATIENCE: usize = 1;

/// A reading, how well it fits, and what that is worth.
#[derive(Clone)]
struct Tried {
    reading: Reading,
    fit: Match,
    cost: f64,
}

impl Tried {
    fn of(reading: Reading, bench: &Bench) -> Option<Self> {
        let fit = bench.fit(&reading)?;
        let steps: usize = reading.changes().iter().map(Change::steps).sum();
        let cost = fit.misfit() + LEAST_GAIN * steps as f64;
        Some(Self { reading, fit, cost })
    }
}

/// The best reading that was found, which is the log as it is read where none is worth its changes, and its fit.
pub fn best(arm: &Arm, bench: &Bench, as_read: &Match) -> (Reading, Match) {
    let possible = Change::all(arm);
    let (breadth, patience) =
        if as_read.leaves_more_than(FAR) { (BREADTH, PATIENCE) } else { (1, 0) };
    let reading = Reading::as_read(arm.dof());
    let mut seen = vec![reading.clone()];
    let mut best = Tried { reading, fit: as_read.clone(), cost: as_read.misfit() };
    let mut followed = vec![best.clone()];
    let mut in_vain = 0;
    for _ in 0..arm.dof() {
        let first = seen.len();
        for tried in &followed {
            for reading in possible.iter().map(|change| tried.reading.with(change)) {
                if !seen.iter().any(|other| other.is(&reading)) {
                    seen.push(reading);
                }
            }
        }
        let tried = seen[first..].par_iter().cloned();
        followed = tried.filter_map(|reading| Tried::of(reading, bench)).collect();
        followed.sort_by(|a, b| a.cost.total_cmp(&b.cost));
        followed.truncate(breadth);
        match followed.first() {
            Some(first) if first.cost < best.cost => {
                best = first.clone();
                in_vain = 0;
            }
            Some(_) if in_vain < patience => in_vain += 1,
            _ => break,
        }
        if !best.fit.leaves_more_than(EXPLAINED) {
            break;
        }
    }
    let best = told_shortly(best, bench);
    (best.reading, best.fit)
}

/// An arm mirrored in a plane turns all its joints the other way: as well as before, perhaps with fewer changes.
fn told_shortly(best: Tried, bench: &Bench) -> Tried {
    let joints = 0..best.fit.left.len();
    let reverse = |reading: Reading, j| reading.with(&Change::JointReversed { joints: [j] });
    let mirrored = Tried::of(joints.fold(best.reading.clone(), reverse), bench);
    mirrored.into_iter().fold(best, |best, other| if other.cost < best.cost { other } else { best })
}

/// With all torques reversed the model fits as well: the reading of the two in which friction brakes, or gravity pulls as described.
pub fn told_by_sign(reading: Reading, fit: Match, bench: &Bench) -> (Reading, Match) {
    if !fit.is_turned() {
        return (reading, fit);
    }
    let turned = reading.with(&Change::AllTorquesReversed);
    match bench.fit(&turned) {
        Some(other) if other.misfit() <= fit.misfit() => (turned, other),
        _ => (reading, fit),
    }
}
