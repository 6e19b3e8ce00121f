//! A search with many starts and fewer and fewer survivors.

use std::f64::consts::{PI, TAU};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Instant;

use nalgebra::DVector;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};
use rayon::prelude::*;

use super::interior_point::{Descent, Ending, Stage, descend};
use super::problem::{Problem, ProblemWorkspace};
use crate::robot::Arm;

/// How much work a search does, and what may end it early.
#[derive(Debug)]
pub struct Effort<'a> {
    /// Random starts.
    pub starts: usize,
    /// Seed of the starts; start k is the same whatever the number of starts or threads.
    pub seed: u64,
    /// No new work starts after this time.
    pub deadline: Option<Instant>,
    /// No new work starts once this is set.
    pub stop: &'a AtomicBool,
}

impl Effort<'_> {
    fn over(&self) -> bool {
        self.stop.load(Ordering::Relaxed) || self.deadline.is_some_and(|d| Instant::now() >= d)
    }
}

/// One round of the search, in which the best `survivors` of the round before are refined.
#[derive(Debug, Clone, PartialEq)]
pub struct Round {
    /// Number of designs that take part (in the first round, all starts).
    pub survivors: usize,
    /// Samples per period on which the limits are enforced and the information is summed.
    pub samples: usize,
    /// The stages that each of them goes through.
    pub stages: Vec<Stage>,
}

/// Progress of a search.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Progress {
    /// Round, from 1.
    pub round: usize,
    /// Number of designs of this round that are finished.
    pub done: usize,
    /// Number of designs in this round.
    pub of: usize,
    /// Best value of the criterion so far in this round (not smoothed).
    pub best: f64,
}

/// A design found by a search.
#[derive(Debug, Clone)]
pub struct Candidate {
    /// Number of the start it came from.
    pub start: usize,
    /// The variables, in the space of the last round reached.
    pub x: DVector<f64>,
    /// Value of the criterion on the grid of that round, not smoothed.
    pub value: f64,
}

/// Result of a search.
#[derive(Debug, Clone)]
pub struct Found {
    /// Survivors, best first.
    pub candidates: Vec<Candidate>,
    /// Number of starts tried before time ran out.
    pub tried_starts: usize,
    /// Number of starts that led to a feasible motion.
    pub feasible_starts: usize,
    /// Number of points evaluated.
    pub evaluations: usize,
    /// Whether the search was cut short by the deadline or the stop signal: then the result depends on the speed of the
    /// machine, otherwise only on the seed.
    pub cut_short: bool,
}

/// What a round made of one entrant.
struct Advanced {
    candidate: Candidate,
    evaluations: usize,
    /// Whether it was stopped before its last stage had ended.
    interrupted: bool,
}

/// Runs the rounds. `problem_at(samples)` is the problem on a grid of `samples` times.
///
/// Every start is a function of (seed, start) alone, every descent is sequential, and survivors are chosen by value,
/// with ties broken by the number of the start. The result therefore does not depend on the number of threads.
pub fn search(
    arm: &Arm,
    problem_at: impl Fn(usize) -> Problem,
    effort: &Effort,
    rounds: &[Round],
    progress: &(dyn Fn(Progress) + Sync),
) -> Found {
    let mut candidates: Vec<Candidate> = Vec::new();
    let (mut feasible_starts, mut evaluations, mut cut_short) = (0, 0, false);
    let tried_starts = AtomicUsize::new(0);
    for (index, round) in rounds.iter().enumerate() {
        let problem = problem_at(round.samples);
        let entrants: Vec<(usize, Option<DVector<f64>>)> = if index == 0 {
            (0..effort.starts).map(|start| (start, None)).collect()
        } else {
            let survivors = candidates.iter().take(round.survivors);
            survivors.map(|c| (c.start, Some(c.x.clone()))).collect()
        };
        if index > 0 && entrants.is_empty() {
            break;
        }
        let reached = std::sync::Mutex::new((0, f64::INFINITY));
        let of = entrants.len();
        let advance = |ws: &mut ProblemWorkspace, start: usize, x: Option<DVector<f64>>| {
            // The first start is tried even if time is over, so that there may be something feasible to return.
            if effort.over() && index == 0 && start > 0 {
                return None;
            }
            if index == 0 {
                tried_starts.fetch_add(1, Ordering::Relaxed);
            }
            let from = match x {
                Some(x) => x,
                None => random_start(arm, &problem, start as u64, effort.seed, ws)?,
            };
            refined(&problem, ws, (start, from), &round.stages, effort)
        };
        // Reported for every entrant, including those without a feasible motion.
        let report = |result: &Option<Advanced>| {
            let value = result.as_ref().map_or(f64::INFINITY, |found| found.candidate.value);
            if let Ok(mut reached) = reached.lock() {
                let (done, best) = &mut *reached;
                (*done, *best) = (*done + 1, best.min(value));
                progress(Progress { round: index + 1, done: *done, of, best: *best });
            }
        };
        let results: Vec<Option<Advanced>> = entrants
            .into_par_iter()
            .map_init(
                || problem.workspace(),
                |ws, (start, x)| {
                    let result = advance(ws, start, x);
                    report(&result);
                    result
                },
            )
            .collect();
        let mut next: Vec<Candidate> = Vec::new();
        for advanced in results.into_iter().flatten() {
            evaluations += advanced.evaluations;
            cut_short |= advanced.interrupted;
            next.push(advanced.candidate);
        }
        if index == 0 {
            feasible_starts = next.len();
        }
        next.sort_by(|a, b| a.value.total_cmp(&b.value).then(a.start.cmp(&b.start)));
        if !next.is_empty() {
            candidates = next;
        }
        if effort.over() {
            cut_short = true;
            break;
        }
    }
    let tried_starts = tried_starts.into_inner();
    Found { candidates, tried_starts, feasible_starts, evaluations, cut_short }
}

/// Takes the entrant that came from `start` and is at `from` now through `stages`; `None` if no motion about its
/// offsets is feasible.
fn refined(
    problem: &Problem,
    ws: &mut ProblemWorkspace,
    (start, from): (usize, DVector<f64>),
    stages: &[Stage],
    effort: &Effort,
) -> Option<Advanced> {
    let from = inside(problem, ws, from, stages.first()?)?;
    let Descent { x, evaluations, ending } = descend(problem, ws, from, stages, &|| effort.over())?;
    let value = problem.exact(ws, &x)?;
    let candidate = Candidate { start, x, value };
    Some(Advanced { candidate, evaluations, interrupted: ending == Ending::Interrupted })
}

/// Returns `x` if it is strictly feasible in `problem`, or the largest of a series of smaller motions about the same
/// offsets that is.
fn inside(
    problem: &Problem,
    ws: &mut ProblemWorkspace,
    x: DVector<f64>,
    stage: &Stage,
) -> Option<DVector<f64>> {
    let mut factor = 1.0;
    for _ in 0..40 {
        let candidate = DVector::from_vec(problem.space.scaled(x.as_slice(), factor));
        if problem.point(ws, candidate.clone(), stage.mu, stage.sharpness).is_some() {
            return Some(candidate);
        }
        factor *= if factor > 0.9 { 0.985 } else { 0.8 };
    }
    None
}

/// Number of poses tried for the offsets of one start.
const POSES: usize = 200;

/// Creates a random feasible motion: a pose that keeps its distances, and random coefficients scaled down until the
/// motion stays inside the limits.
fn random_start(
    arm: &Arm,
    problem: &Problem,
    start: u64,
    seed: u64,
    ws: &mut ProblemWorkspace,
) -> Option<DVector<f64>> {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    rng.set_stream(start);
    let space = &problem.space;
    let stage = Stage { mu: 1.0, sharpness: 4.0, steps: 0 };
    for _ in 0..POSES {
        let mut series = space.series(&vec![0.0; space.count()]);
        series.period_s = space.variables().period_s;
        for (j, joint) in arm.joints.iter().enumerate() {
            let limits = &joint.limits;
            let [low, high] = limits.position_rad;
            // Half a turn either way covers every pose; a wider range only repeats them.
            let reach = (0.5 * (high - low)).min(PI);
            let centre = 0.5 * (high + low);
            series.q0_rad[j] = centre + reach * rng.random_range(-1.0..1.0);
            let order = space.variables().order;
            // Over a long period the joint would cross its range many times at full speed: there the path of the
            // shorter period of which the amplitude v/ω is the whole range is played more slowly.
            let crossing_rad_s = TAU / series.period_s * 2.0 * reach;
            let size = limits.velocity_rad_s.min(crossing_rad_s) / (order as f64).sqrt();
            for l in 0..order {
                series.a_rad_s[j][l] = size * rng.random_range(-1.0..1.0);
                series.b_rad_s[j][l] = size * rng.random_range(-1.0..1.0);
            }
        }
        let x = DVector::from_vec(space.project(&series));
        let mut factor = 1.0;
        // A motion below a tenth of its size is a poor start: another pose is better.
        while factor > 0.1 {
            let candidate = DVector::from_vec(space.scaled(x.as_slice(), factor));
            if problem.point(ws, candidate.clone(), stage.mu, stage.sharpness).is_some() {
                return Some(candidate);
            }
            factor *= 0.75;
        }
    }
    None
}
