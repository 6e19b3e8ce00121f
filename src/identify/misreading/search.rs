//! Searches for the fewest changes with which a log fits its arm.

use rayon::prelude::*;

use super::EXPLAINED;
use super::bench::{Bench, Match};
use super::change::{Change, Channels};
use super::reading::Reading;
use crate::robot::Arm;

/// Least gain of a change, in Σ ln (‖e_j‖² / ‖τ_j‖²): the residual of one joint halves.
const LEAST_GAIN: f64 = 1.4;
/// Residual share of a joint's torque (rms) that friction laws and soft gears hardly ever leave on more than one
/// joint. Where two joints or more exceed it, several changes may be needed before any one of them pays.
const FAR: f64 = 0.1;
/// Number of readings followed in parallel where the log is that far from the arm.
const BREADTH: usize = 4;
/// Number of consecutive changes that may gain nothing by themselves there.
const PATIENCE: usize = 1;
/// Largest number of joints for which all ways to mirror an arm are tried.
const MIRRORED: usize = 8;

/// A reading with its fit and its cost.
#[derive(Clone)]
struct Tried {
    reading: Reading,
    fit: Match,
    cost: f64,
}

impl Tried {
    fn of(reading: Reading, bench: &Bench) -> Option<Self> {
        let fit = bench.fit(&reading)?;
        let cost = fit.misfit() + LEAST_GAIN * steps(&reading);
        Some(Self { reading, fit, cost })
    }

    fn steps(&self) -> f64 {
        steps(&self.reading)
    }

    fn cheaper(self, other: Self) -> Self {
        if other.cost < self.cost { other } else { self }
    }
}

fn steps(reading: &Reading) -> f64 {
    reading.changes().iter().map(Change::steps).sum()
}

/// Returns the best reading found and its fit: the log as it is read, where no reading is worth its changes.
///
/// A different order of the joints is a step to which no few exchanges lead, and any other mistake beside it looks
/// wrong until that step is taken. Where the log is far from the arm, the search therefore also starts from each
/// order that recorders use.
pub fn best(arm: &Arm, bench: &Bench, as_read: &Match) -> (Reading, Match) {
    let possible = Change::all(arm);
    let reading = Reading::as_read(arm.dof());
    let root = Tried { reading, fit: as_read.clone(), cost: as_read.misfit() };
    let mut search = Search { possible: &possible, bench, seen: vec![root.reading.clone()] };
    let is_far = as_read.joints_left_by(FAR) > 1 || as_read.friction_pushes.contains(&true);
    let (breadth, patience) = if is_far { (BREADTH, PATIENCE) } else { (1, 0) };
    let mut best = search.from(root.clone(), breadth, patience);
    if is_far {
        for order in Change::orders_of_joints(arm) {
            if !best.fit.leaves_more_than(EXPLAINED) {
                break;
            }
            let ordered = Tried::of(root.reading.with(&order), bench);
            let found = ordered.map(|ordered| search.from(ordered, 1, PATIENCE));
            best = found.into_iter().fold(best, Tried::cheaper);
        }
    }
    let mut best = told_shortly(best, bench);
    if best.fit.leaves_more_than(EXPLAINED) {
        best = search.from(best, 1, 0);
    }
    (best.reading, best.fit)
}

struct Search<'a> {
    possible: &'a [Change],
    bench: &'a Bench,
    seen: Vec<Reading>,
}

impl Search<'_> {
    /// The best reading found from `root` on by one change after the other.
    fn from(&mut self, root: Tried, breadth: usize, patience: usize) -> Tried {
        let mut followed = vec![root.clone()];
        let mut best = root;
        let mut in_vain = 0;
        for _ in 0..best.fit.left.len() {
            let first = self.seen.len();
            for tried in &followed {
                for reading in self.possible.iter().map(|change| tried.reading.with(change)) {
                    if !self.seen.iter().any(|other| other.is(&reading)) {
                        self.seen.push(reading);
                    }
                }
            }
            let bench = self.bench;
            let tried = self.seen[first..].par_iter().cloned();
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
        best
    }
}

/// Replaces a reading by a mirrored one that is cheaper. Mirroring an arm in a plane reverses some of its joints, and
/// turns the mounting upside down if the plane is the ground. The mirrored arm fits as well as before, perhaps with
/// fewer changes.
fn told_shortly(best: Tried, bench: &Bench) -> Tried {
    let joints = best.fit.left.len();
    if best.steps() < 2.0 || joints > MIRRORED {
        return best;
    }
    let as_described = best.reading.mounted_as_described();
    let mounted: Vec<Reading> = [best.reading.clone()].into_iter().chain(as_described).collect();
    let mirrored = (0..mounted.len() << joints).into_par_iter().filter_map(|k| {
        let (mounted, reversed) = (&mounted[k % mounted.len()], k / mounted.len());
        let joints = (0..joints).filter(|j| reversed >> j & 1 == 1);
        let reverse = |reading: Reading, joint| {
            reading.with(&Change::Reversed { what: Channels::All, joint })
        };
        let reading = joints.fold(mounted.clone(), reverse);
        // A mirrored fit is no better; only fewer changes can make it cheaper.
        (steps(&reading) < best.steps()).then(|| Tried::of(reading, bench)).flatten()
    });
    let cheapest = mirrored.min_by(|a, b| a.cost.total_cmp(&b.cost));
    cheapest.into_iter().fold(best, Tried::cheaper)
}

/// Decides the sign of all torques, with either of which the model fits equally well: returns the reading in which
/// friction brakes, or gravity pulls as described.
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
