//! Noise study: which σ is true under which noise? All methods run on the same logs.

use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use crate::identify::covariance::{CovarianceKind as C, Z_95};
use crate::identify::{Estimate, Estimator as E, Floor, Identifier, LackOfFit};
use crate::montecarlo::calibration::{Calibration, claims, wilson};
use crate::montecarlo::efficiency::Efficiency;
use crate::montecarlo::experiment::{Experiment, TrialError};
use crate::montecarlo::scenario::Scenario;
use crate::montecarlo::summary::CheckSummary;
use crate::montecarlo::tally::Tally;
use crate::montecarlo::trials::Failure;
use crate::plant::Measured;

/// The methods that are compared, in the order of the tables: estimator, covariance, and whether the method is fast
/// enough to run on every trial. The caller chooses how often the slow methods run.
const METHODS: [(E, C, bool); 17] = [
    (E::Ols, C::Paper, true),
    (E::Ols, C::Ols, true),
    (E::Wls, C::Wls, true),
    (E::Wls, C::Blocks, true),
    (E::Wls, C::Periods, true),
    (E::Wls, C::Spectral, false),
    (E::Wls, C::Hac, false),
    (E::Wls, C::Bootstrap, false),
    (E::Sur, C::Wls, false),
    (E::Sur, C::Periods, false),
    (E::Gls, C::Wls, false),
    (E::Gls, C::Hac, false),
    (E::Decimated, C::Wls, false),
    (E::Iv, C::Blocks, false),
    (E::Iv, C::Periods, false),
    (E::Spectral, C::Spectral, true),
    (E::Spectral, C::Periods, true),
];

/// Results of a study over all its scenarios.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NoiseStudy {
    /// One entry per scenario.
    pub scenarios: Vec<ScenarioResult>,
}

/// Results of all methods for one scenario.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ScenarioResult {
    /// Name of the scenario.
    pub name: String,
    /// Description of the scenario, in a sentence.
    pub description: String,
    /// Number of trials run.
    pub trials: u64,
    /// The slow methods ran on one trial out of this many.
    pub slow_every: u64,
    /// Wall time of all trials, s.
    pub seconds: f64,
    /// Whether the arm has a hidden effect that the model does not know.
    pub model_is_wrong: bool,
    /// Whether the log is treated as a single run that does not repeat.
    pub single_run: bool,
    /// Estimator and covariance that the program chooses for such a log.
    pub chosen: [String; 2],
    /// Checks of the claims about the chosen estimator and covariance.
    pub checks: Vec<CheckSummary>,
    /// The methods that are applicable to such logs.
    pub methods: Vec<MethodResult>,
    /// Number of trials with a lack-of-fit test.
    pub tested_for_fit: u64,
    /// Of these, trials whose test failed against the scatter of the torque alone and was repeated against the scatter
    /// of torque and motion.
    pub tested_again: u64,
    /// Of the tested trials, those whose final test rejected the model (at the level [`LackOfFit::REJECT_BELOW`]).
    pub rejected_fits: u64,
}

/// Result of one method over all trials.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MethodResult {
    /// Estimator.
    pub estimator: String,
    /// Covariance.
    pub covariance: String,
    /// Number of trials.
    pub trials: u64,
    /// Number of trials without an estimate.
    pub failed: u64,
    /// Coverage of 95 % intervals, mean over the parameters; failed trials count as misses.
    pub coverage_mean: f64,
    /// Standard error of `coverage_mean`, from the scatter between trials.
    pub coverage_error: f64,
    /// Coverage of the parameter whose coverage is farthest from 95 %.
    pub coverage_worst: f64,
    /// 95 % confidence interval of the true value of `coverage_worst` (Wilson's binomial interval).
    pub coverage_worst_within: [f64; 2],
    /// Name of that parameter.
    pub coverage_worst_of: String,
    /// Empirical over predicted σ: smallest, pooled (rms) and largest over the parameters.
    pub ratio: [f64; 3],
    /// Largest |mean error| over empirical σ of any parameter.
    pub bias_worst: f64,
    /// Name of that parameter.
    pub bias_worst_of: String,
    /// Empirical σ over the Cramér–Rao bound; `None` where the bound is not known.
    pub efficiency: Option<Efficiency>,
}

/// Tallies of all methods, in the order of [`METHODS`], and counts of the lack-of-fit test.
struct Tallies {
    methods: Vec<Tally>,
    tested: u64,
    tested_again: u64,
    rejected: u64,
}

/// Runs the scenario's trials (at most `most`) with every method on `threads` threads; the slow methods run on every
/// `slow_every`-th trial only. `progress` is called with the number of trials done.
///
/// Each trial's log is simulated and its equations are assembled once; each estimator solves them once for all its
/// covariances.
pub fn study(
    scenario: Scenario,
    most: Option<u64>,
    slow_every: u64,
    threads: usize,
    progress: &(dyn Fn(u64) + Sync),
) -> Result<ScenarioResult, TrialError> {
    let experiment = Experiment::prepare(scenario)?;
    let scenario = &experiment.simulation.scenario;
    let trials = most.map_or(scenario.trials, |most| most.min(scenario.trials));
    let begun = Instant::now();
    let done = AtomicU64::new(0);
    let share = |t: usize| {
        let mut tallies = Tallies::new(experiment.truth.len());
        let mut bench = Bench::new(&experiment);
        for trial in (t as u64..trials).step_by(threads) {
            tallies.add(trial, &due(trial, slow_every), &mut bench);
            progress(done.fetch_add(1, Ordering::Relaxed) + 1);
        }
        tallies
    };
    let tallies = (0..threads)
        .into_par_iter()
        .map(share)
        .reduce(|| Tallies::new(experiment.truth.len()), Tallies::merged);
    let name = |k: usize| scenario.set.name(k).to_owned();
    let chosen = (experiment.estimator, experiment.covariance);
    let by_itself = METHODS.iter().zip(&tallies.methods).find(|((e, c, _), _)| (*e, *c) == chosen);
    let claimed = claims::mean_coverage(experiment.single_run);
    let checks =
        by_itself.map_or_else(Vec::new, |(_, tally)| Calibration::of(tally, claimed).checks);
    let results = METHODS.iter().zip(&tallies.methods);
    let methods = results
        .filter(|(_, tally)| tally.succeeded > 1)
        .map(|((estimator, kind, _), tally)| {
            let names = [estimator.to_string(), kind.to_string()];
            MethodResult::of(&experiment, names, tally)
        })
        .collect();
    Ok(ScenarioResult {
        name: scenario.name.clone(),
        description: scenario.description.clone(),
        trials,
        slow_every,
        seconds: begun.elapsed().as_secs_f64(),
        model_is_wrong: !scenario.effects.is_empty(),
        single_run: experiment.single_run,
        chosen: [chosen.0.to_string(), chosen.1.to_string()],
        checks: checks.iter().map(|check| CheckSummary::of(check, name)).collect(),
        methods,
        tested_for_fit: tallies.tested,
        tested_again: tallies.tested_again,
        rejected_fits: tallies.rejected,
    })
}

/// Working memory of one thread.
struct Bench<'a> {
    experiment: &'a Experiment,
    identifier: Identifier<'a>,
    measured: Measured,
}

type Estimates = Vec<Result<Estimate, TrialError>>;

impl<'a> Bench<'a> {
    fn new(experiment: &'a Experiment) -> Self {
        let Experiment { simulation, model, .. } = experiment;
        let options = simulation.scenario.processing.clone();
        Self {
            experiment,
            identifier: Identifier::new(model, &simulation.scenario.set, options),
            measured: Measured::like(&simulation.recording),
        }
    }

    fn estimate(&mut self, trial: u64, requests: &[(E, Vec<C>)]) -> Result<Estimates, TrialError> {
        self.experiment.simulation.log_into(trial, &mut self.measured)?;
        let measurement = self.measured.measurement("simulated log");
        let estimates = self.identifier.compare(&measurement, requests)?;
        Ok(estimates.into_iter().map(|e| e.map_err(TrialError::from)).collect())
    }
}

/// The methods to run on trial `trial`: for each estimator the indices of its methods in [`METHODS`].
fn due(trial: u64, slow_every: u64) -> Vec<(E, Vec<usize>)> {
    let mut due: Vec<(E, Vec<usize>)> = Vec::new();
    for (index, (estimator, _, always)) in METHODS.iter().enumerate() {
        if !always && !trial.is_multiple_of(slow_every) {
            continue;
        }
        match due.last_mut().filter(|(known, _)| known == estimator) {
            Some((_, indices)) => indices.push(index),
            None => due.push((*estimator, vec![index])),
        }
    }
    due
}

impl Tallies {
    fn new(parameters: usize) -> Self {
        let methods = vec![Tally::new(parameters); METHODS.len()];
        Self { methods, tested: 0, tested_again: 0, rejected: 0 }
    }

    fn merged(mut self, other: Self) -> Self {
        self.methods.iter_mut().zip(&other.methods).for_each(|(a, b)| a.merge(b));
        self.tested += other.tested;
        self.tested_again += other.tested_again;
        self.rejected += other.rejected;
        self
    }

    fn add(&mut self, trial: u64, due: &[(E, Vec<usize>)], bench: &mut Bench) {
        let kinds = |indices: &[usize]| indices.iter().map(|&k| METHODS[k].1).collect();
        let requests: Vec<(E, Vec<C>)> = due.iter().map(|(e, k)| (*e, kinds(k))).collect();
        match bench.estimate(trial, &requests) {
            Ok(estimates) => {
                for (estimate, (_, indices)) in estimates.into_iter().zip(due) {
                    self.add_estimate(bench.experiment, trial, estimate, indices);
                }
            }
            Err(error) => {
                let indices = due.iter().flat_map(|(_, indices)| indices);
                indices.for_each(|&k| self.lose(k, trial, error.to_string()));
            }
        }
    }

    fn add_estimate(
        &mut self,
        experiment: &Experiment,
        trial: u64,
        estimate: Result<Estimate, TrialError>,
        indices: &[usize],
    ) {
        let estimate = match estimate {
            Ok(estimate) => estimate,
            Err(error) => {
                indices.iter().for_each(|&k| self.lose(k, trial, error.to_string()));
                return;
            }
        };
        if let Some(lack) = estimate.lack_of_fit {
            self.tested += 1;
            self.tested_again += u64::from(lack.floor == Floor::TorqueAndMotion);
            self.rejected += u64::from(!lack.fits());
        }
        for (covariance, &k) in estimate.covariances.iter().zip(indices) {
            let outcomes = match covariance {
                Ok(covariance) => experiment
                    .outcomes(&estimate.fit.theta, covariance)
                    .map_err(|error| error.to_string()),
                Err(error) => Err(error.to_string()),
            };
            match outcomes {
                Ok(outcomes) => self.methods[k].add(&outcomes),
                Err(reason) => self.lose(k, trial, reason),
            }
        }
    }

    fn lose(&mut self, method: usize, trial: u64, reason: String) {
        self.methods[method].add_failure(Failure { trial, reason });
    }
}

impl MethodResult {
    fn of(experiment: &Experiment, [estimator, covariance]: [String; 2], tally: &Tally) -> Self {
        let set = &experiment.simulation.scenario.set;
        let statistics: Vec<_> = (0..tally.parameters()).map(|k| tally.statistics(k)).collect();
        let furthest = |off: &dyn Fn(usize) -> f64| {
            (0..statistics.len()).max_by(|a, b| off(*a).total_cmp(&off(*b))).unwrap_or(0)
        };
        let ratio = |k: usize| statistics[k].sigma_empirical / statistics[k].sigma_predicted;
        let ratios = || (0..statistics.len()).map(ratio);
        let bias = |k: usize| (statistics[k].bias / statistics[k].sigma_empirical).abs();
        let coverage = furthest(&|k| (statistics[k].coverage - 0.95).abs());
        let biased = furthest(&bias);
        // The pooled ratio uses the scatter about the mean only; bias is reported separately.
        let pooled = ratios().map(|r| r * r).sum::<f64>() / statistics.len() as f64;
        let sigma: Vec<f64> = statistics
            .iter()
            .zip(&experiment.scale)
            .map(|(s, scale)| s.sigma_empirical * scale)
            .collect();
        let (coverage_mean, coverage_error) = tally.mean_coverage();
        let coverage_worst = statistics[coverage].coverage;
        Self {
            estimator,
            covariance,
            trials: tally.trials(),
            failed: tally.failures.len() as u64,
            coverage_mean,
            coverage_error,
            coverage_worst,
            coverage_worst_within: wilson(coverage_worst, tally.trials() as f64, Z_95),
            coverage_worst_of: set.name(coverage).to_owned(),
            ratio: [
                ratios().fold(f64::INFINITY, f64::min),
                pooled.sqrt(),
                ratios().fold(0.0, f64::max),
            ],
            bias_worst: bias(biased),
            bias_worst_of: set.name(biased).to_owned(),
            efficiency: experiment
                .least_sigma
                .as_ref()
                .map(|least| Efficiency::of(&sigma, least, |k| set.name(k).to_owned())),
        }
    }
}

impl NoiseStudy {
    /// Significance level of the lack-of-fit test.
    pub fn rejection_level() -> f64 {
        LackOfFit::REJECT_BELOW
    }
}
