//! Runs a design: from a specification to a motion that passed its check.

use std::sync::atomic::AtomicBool;
use std::time::Instant;

use super::barrier::LimitBarrier;
use super::error::DesignError;
use super::information::Information;
use super::interior_point::Stage;
use super::prediction::{Experiment, Prediction};
use super::problem::Problem;
use super::search::{Candidate, Effort, Progress, Round, search};
use super::space::DesignSpace;
use super::specification::Specification;
use crate::base::BaseSet;
use crate::dynamics::{Model, Parameter, ParameterLayout, Workspace, inverse_dynamics};
use crate::excitation::{
    ClearanceModel, Excitation, FourierSeries, Margins, Reference, Requirements, check,
};
use crate::robot::Arm;

/// A design that passed its check on the fine grid, including run-in and run-out.
#[derive(Debug, Clone)]
pub struct Design {
    /// The motion: run-in, enough periods to cover the experiment's data, run-out.
    pub excitation: Excitation,
    /// Value of the criterion (a logarithm, see [`super::Criterion`]) on the optimiser's grid. It is for data of the
    /// length asked for or, if the length of the period was given, of the length of its whole periods.
    pub value: f64,
    /// The experiment asked for, with the length of the motion's periods together.
    pub experiment: Experiment,
    /// The accuracy that it will give.
    pub prediction: Prediction,
    /// Margins of the motion from the limits.
    pub margins: Margins,
    /// Finalists, best first.
    pub finalists: Vec<Finalist>,
    /// Number of starts.
    pub starts: usize,
    /// Number of starts that became a motion inside the limits.
    pub feasible_starts: usize,
    /// Number of points evaluated (criterion, limits and their derivatives).
    pub evaluations: usize,
    /// Whether time or the user ended the search; if not, the result depends on the seed alone.
    pub cut_short: bool,
}

/// One design that was refined to the end.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Finalist {
    /// The start it came from.
    pub start: usize,
    /// Value of the criterion.
    pub value: f64,
}

/// Conditions that end a search before its work is done.
#[derive(Debug)]
pub struct Budget<'a> {
    /// The search ends at this time.
    pub deadline: Option<Instant>,
    /// The search ends once this is set.
    pub stop: &'a AtomicBool,
}

/// Samples per period of the fastest harmonic: first, middle and last round.
const GRIDS: [usize; 3] = [20, 24, 48];

fn rounds(spec: &Specification) -> Vec<Round> {
    let stage = |mu: f64, sharpness: f64, steps: usize| Stage { mu, sharpness, steps };
    let samples = |grid: usize| (spec.variables.order * grid).max(48);
    let halfway = spec.finalists.max(spec.starts.div_ceil(4));
    vec![
        Round {
            survivors: spec.starts,
            samples: samples(GRIDS[0]),
            stages: vec![stage(1.0, 4.0, 15), stage(0.3, 6.0, 25), stage(0.1, 8.0, 40)],
        },
        Round {
            survivors: halfway,
            samples: samples(GRIDS[1]),
            stages: vec![stage(0.03, 12.0, 80), stage(0.01, 20.0, 80)],
        },
        Round {
            survivors: spec.finalists,
            samples: samples(GRIDS[2]),
            stages: vec![stage(0.01, 20.0, 60), stage(0.003, 40.0, 120), stage(0.001, 80.0, 200)],
        },
    ]
}

/// Scale of every base parameter for the relative criteria.
///
/// The scale is the parameter's own size, but at least a thousandth of the largest parameter with the same unit, so
/// that parameters close to zero do not dominate the design. Offsets, which are nominally zero, get the size of the
/// largest.
pub fn parameter_scales(base: &BaseSet, model: &Model) -> Vec<f64> {
    const FLOOR: f64 = 1e-3;
    let theta = base.values(&model.standard_parameters());
    let layout = ParameterLayout::new(model.dof());
    let is_offset = |i: usize| {
        let (standard, _) = base.column(i)[0];
        matches!(layout.parameter(standard), Parameter::Offset(_))
    };
    (0..base.rank())
        .map(|i| {
            let same = (0..base.rank()).filter(|&k| base.unit(k) == base.unit(i));
            let largest = same.map(|k| theta[k].abs()).fold(0.0, f64::max);
            let floor = if is_offset(i) { largest } else { FLOOR * largest };
            theta[i].abs().max(floor).max(f64::MIN_POSITIVE)
        })
        .collect()
}

/// Designs the motion for `arm` that is most informative about the parameters of `base`.
///
/// # Errors
/// An invalid specification, or no feasible motion; there is then no design to return.
pub fn design(
    arm: &Arm,
    base: &BaseSet,
    spec: &Specification,
    budget: &Budget,
    progress: &(dyn Fn(Progress) + Sync),
) -> Result<Design, DesignError> {
    spec.check(arm)?;
    let spec = &of_whole_periods(spec);
    let model = Model::new(arm);
    let problem = problem(arm, base, spec, &model);
    let at = |samples: usize| Problem {
        space: DesignSpace::new(spec.variables.clone(), samples),
        ..problem.clone()
    };
    let effort = Effort {
        starts: spec.starts,
        seed: spec.seed,
        deadline: budget.deadline,
        stop: budget.stop,
    };
    let found = search(arm, at, &effort, &rounds(spec), progress);
    let tried = found.tried_starts;
    if found.candidates.is_empty() && tried < spec.starts {
        return Err(DesignError::OutOfTime { tried, starts: spec.starts });
    }
    if found.candidates.is_empty() {
        return Err(DesignError::Infeasible {
            starts: spec.starts,
            clearance_m: spec.requirements.clearance_m,
            arm: arm.name.clone(),
        });
    }
    let Checked { excitation, value, experiment, prediction, margins } =
        first_that_passes(&found.candidates, arm, base, spec, &model, &problem.space)?;
    let finalists = found.candidates.iter().take(spec.finalists);
    Ok(Design {
        excitation,
        value,
        experiment,
        prediction,
        margins,
        finalists: finalists.map(|c| Finalist { start: c.start, value: c.value }).collect(),
        starts: spec.starts,
        feasible_starts: found.feasible_starts,
        evaluations: found.evaluations,
        cut_short: found.cut_short,
    })
}

/// The problem that `spec` poses, on a coarse grid.
fn problem(arm: &Arm, base: &BaseSet, spec: &Specification, model: &Model) -> Problem {
    // Λ is averaged over the samples of one period, so it is multiplied by the number of samples of the experiment.
    let samples = spec.experiment.samples();
    let weights = if spec.criterion.whitened() {
        spec.experiment.weights().iter().map(|w| w * samples).collect()
    } else {
        vec![1.0; arm.dof()]
    };
    let torque_nm =
        arm.joints.iter().map(|j| spec.requirements.torque_share * j.limits.torque_nm).collect();
    Problem {
        space: DesignSpace::new(spec.variables.clone(), 8),
        information: Information::new(model, base, weights),
        criterion: spec.criterion,
        scales: parameter_scales(base, model),
        prior: spec.prior.clone(),
        barrier: LimitBarrier::new(arm, &spec.requirements, ClearanceModel::new(arm)),
        torque_nm,
    }
}

/// A candidate that passed its check.
struct Checked {
    excitation: Excitation,
    value: f64,
    experiment: Experiment,
    prediction: Prediction,
    margins: Margins,
}

/// The best of the `candidates`, which are sorted, that passes its check.
fn first_that_passes(
    candidates: &[Candidate],
    arm: &Arm,
    base: &BaseSet,
    spec: &Specification,
    model: &Model,
    space: &DesignSpace,
) -> Result<Checked, DesignError> {
    let mut last = String::new();
    for candidate in candidates {
        let (excitation, margins) = match finish(arm, spec, space, candidate) {
            Ok(finished) => finished,
            Err(reason) => {
                last = reason;
                continue;
            }
        };
        let series = excitation.series();
        let data_s = excitation.periods() as f64 * series.period_s;
        let experiment = Experiment { data_s, ..spec.experiment.clone() };
        let prediction = Prediction::of(model, base, &experiment, series, spec.prior.as_ref());
        let Some(prediction) = prediction else {
            last = "it leaves a parameter undetermined".into();
            continue;
        };
        return Ok(Checked { excitation, value: candidate.value, experiment, prediction, margins });
    }
    Err(DesignError::CheckFailed { candidates: candidates.len(), last })
}

/// The same specification, with the data extended to the whole periods that will be played if their length is fixed.
fn of_whole_periods(spec: &Specification) -> Specification {
    let mut spec = spec.clone();
    if spec.variables.period_range_s.is_none() {
        let period_s = spec.variables.period_s;
        let periods = periods_to_cover(spec.experiment.data_s, period_s);
        spec.experiment.data_s = periods as f64 * period_s;
    }
    spec
}

/// Number of whole periods that cover `data_s`; up to a hundredth of a period may be missing.
fn periods_to_cover(data_s: f64, period_s: f64) -> usize {
    (data_s / period_s - 0.01).ceil().max(1.0) as usize
}

/// Prepares a candidate for execution: scales it down slightly if it exceeds a limit on the fine grid, starts it at its
/// calmest moment, adds run-in and run-out, and checks the whole motion. Says why if it fails wherever it starts.
fn finish(
    arm: &Arm,
    spec: &Specification,
    space: &DesignSpace,
    candidate: &Candidate,
) -> Result<(Excitation, Margins), String> {
    const SHRINK: f64 = 0.998;
    const ATTEMPTS: usize = 15;
    let requirements = &spec.requirements;
    let mut x = candidate.x.as_slice().to_vec();
    for _ in 0..ATTEMPTS {
        let margins = check(arm, requirements, &space.series(&x)).map_err(|e| e.to_string())?;
        if margins.feasible() {
            break;
        }
        x = space.scaled(&x, SHRINK);
    }
    let series = space.series(&x);
    let periods = periods_to_cover(spec.experiment.data_s, series.period_s);
    let mut failure = String::new();
    for shift_s in calm_moments(arm, spec, &series) {
        match whole_motion(arm, requirements, series.shifted(shift_s), periods) {
            Ok(whole) => return Ok(whole),
            Err(reason) => failure = reason,
        }
    }
    Err(failure)
}

/// Largest number of periods along which a whole motion is checked: they are all alike, and more of them take time
/// only.
const CHECKED_PERIODS: usize = 32;

/// The motion of `periods` periods of `series` with run-in and run-out, or the reason why it cannot be played. The
/// run-in was chosen with one period, so that the instants at which the whole is checked lie elsewhere in the period.
fn whole_motion(
    arm: &Arm,
    requirements: &Requirements,
    series: FourierSeries,
    periods: usize,
) -> Result<(Excitation, Margins), String> {
    let excitation =
        Excitation::fitted(arm, requirements, series, periods, true).map_err(|e| e.to_string())?;
    let checked = excitation.clone().with_periods(periods.min(CHECKED_PERIODS));
    let margins = check(arm, requirements, &checked).map_err(|e| e.to_string())?;
    let [_, end_s] = checked.periodic_window_s();
    let margins = margins.prolonged(end_s, excitation.duration_s() - checked.duration_s());
    if margins.feasible() {
        return Ok((excitation, margins));
    }
    let worst = margins.worst();
    let (limit, short, time_s) = (&worst.limit, worst.shortfall_in_words(), worst.time_s);
    Err(format!("the whole motion passes a limit: {limit} by {short} at t = {time_s:.3} s"))
}

/// Times of the period at which the motion may start: only 0 for a motion through rest; otherwise the moments closest
/// to rest, judged by speed, acceleration and torque, at some distance from each other.
fn calm_moments(arm: &Arm, spec: &Specification, series: &FourierSeries) -> Vec<f64> {
    const MOMENTS: usize = 200;
    const TRIED: usize = 8;
    if spec.variables.rest_start {
        return vec![0.0];
    }
    let n = arm.dof();
    let model = Model::new(arm);
    let mut ws = Workspace::new(&model);
    let (mut q, mut qd, mut qdd) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    let mut torque_nm = vec![0.0; n];
    let mut moments: Vec<(f64, usize)> = (0..MOMENTS)
        .map(|k| {
            let t_s = series.period_s * k as f64 / MOMENTS as f64;
            series.sample(t_s, &mut q, &mut qd, &mut qdd);
            inverse_dynamics(&model, &mut ws, &q, &qd, &qdd, &mut torque_nm);
            let stress = arm.joints.iter().enumerate().map(|(j, joint)| {
                let limits = &joint.limits;
                (qd[j] / limits.velocity_rad_s)
                    .abs()
                    .max((qdd[j] / limits.acceleration_rad_s2).abs())
                    .max((torque_nm[j] / limits.torque_nm).abs())
            });
            (stress.fold(0.0, f64::max), k)
        })
        .collect();
    moments.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    let mut chosen: Vec<usize> = Vec::new();
    for (_, k) in moments {
        let far = |&c: &usize| {
            let apart = k.abs_diff(c);
            apart.min(MOMENTS - apart) >= MOMENTS / 20
        };
        if chosen.len() < TRIED && chosen.iter().all(far) {
            chosen.push(k);
        }
    }
    chosen.into_iter().map(|k| series.period_s * k as f64 / MOMENTS as f64).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::excitation::LimitKind;

    /// Joint 6 oscillates with a period of 4 s, and its speed reaches `share` of its limit. The run-in is chosen along
    /// a motion of 5 … 12 s, and at one sample in ten seconds that joint is at rest in each of these. Along 25 periods,
    /// all run-ins leave a sample at which its speed is at least 0.93 of its largest.
    fn sampled_rarely(share: f64) -> Result<(Excitation, Margins), String> {
        let arm = Arm::built_in("ur5").unwrap();
        let rare = Requirements { check_rate_hz: 0.1, ..Requirements::default() };
        let mut b = vec![vec![0.0]; 6];
        b[5] = vec![share * arm.joints[5].limits.velocity_rad_s];
        let q0 = vec![0.0, -1.2, 0.0, -1.5, 0.3, 0.0];
        let series = FourierSeries::new(4.0, q0, vec![vec![0.0]; 6], b).unwrap();
        whole_motion(&arm, &rare, series, 25)
    }

    #[test]
    fn no_motion_is_handed_out_that_passes_a_limit_after_its_first_period() {
        let (excitation, margins) = sampled_rarely(0.9).unwrap();
        assert!(excitation.periods() == 25 && margins.feasible());
        let refused = sampled_rarely(1.1).unwrap_err();
        assert!(refused.contains("whole motion") && refused.contains("joint 6"), "{refused}");
    }

    /// Joint 6 oscillates by 1/2π rad about 1 rad. It is fastest where the periods begin and end, with 1 rad/s, so that
    /// a run-out of T brings it T/2 farther, at least 0.25 rad: the end of the motion is nearest to its limit of 2π.
    #[test]
    fn margins_of_many_periods_have_their_times() {
        let arm = Arm::built_in("ur5").unwrap();
        let requirements = Requirements { check_rate_hz: 100.0, ..Requirements::default() };
        let mut a = vec![vec![0.0]; 6];
        a[5] = vec![1.0];
        let q0 = vec![0.0, -1.2, 0.0, -1.5, 0.3, 1.0];
        let series = FourierSeries::new(1.0, q0, a, vec![vec![0.0]; 6]).unwrap();
        let periods = 10 * CHECKED_PERIODS;
        let (excitation, margins) = whole_motion(&arm, &requirements, series, periods).unwrap();
        assert_eq!(excitation.periods(), periods);
        let margin = |limit: LimitKind| margins.all().iter().find(|m| m.limit == limit).unwrap();
        let last = margin(LimitKind::Position { joint: 5 });
        let free_rad = std::f64::consts::TAU - 1.0 - 0.5 * excitation.run_in_s();
        assert!((last.free - free_rad).abs() < 1e-12, "{} {free_rad}", last.free);
        assert!((last.time_s - excitation.duration_s()).abs() < 1e-9, "{}", last.time_s);
        // The acceleration reaches 2π rad/s² in the periods and at most 1.5 · (1 rad/s)/(0.5 s) in the run-out.
        let hardest = margin(LimitKind::Acceleration { joint: 5 });
        assert!(hardest.time_s < excitation.run_in_s() + CHECKED_PERIODS as f64);
    }
}
