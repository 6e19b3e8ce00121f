//! Which σ is true under which noise? Every method on the same logs.

use std::time::Instant;

use rayon::prelude::*;
use serde::Serialize;

use crate::identify::covariance::CovarianceKind as C;
use crate::identify::{
    Estimate, Estimator as E, Identifier, KnownNoise, LackOfFit, Measurement, Options, cramer_rao,
};
use crate::montecarlo::experiment::{Experiment, TrialError};
use crate::montecarlo::scenario::Scenario;
use crate::montecarlo::simulation::Simulation;
use crate::montecarlo::tally::{Failure, Tally};
use crate::plant::Measured;

/// Estimators with their covariances, cheap enough for every trial.
fn quick_methods() -> Vec<(E, Vec<C>)> {
    vec![
        (E::Ols, vec![C::Paper, C::Ols]),
        (E::Wls, vec![C::Wls, C::Blocks, C::Periods]),
        (E::Spectral, vec![C::Spectral, C::Periods]),
    ]
}

/// Those that take longer: every [`SLOW_EVERY`]-th trial.
fn slow_methods() -> Vec<(E, Vec<C>)> {
    vec![
        (E::Wls, vec![C::Hac, C::Bootstrap, C::Spectral]),
        (E::Sur, vec![C::Wls, C::Periods]),
        (E::Gls, vec![C::Wls, C::Hac]),
        (E::Decimated, vec![C::Wls]),
    ]
}

/// See [`slow_methods`].
pub const SLOW_EVERY: u64 = 5;

/// All scenarios of a study.
#[derive(Debug, Clone, Serialize)]
pub struct NoiseStudy {
    /// One entry per scenario.
    pub scenarios: Vec<ScenarioResult>,
}

/// What all methods say of one scenario.
#[derive(Debug, Clone, Serialize)]
pub struct ScenarioResult {
    /// Name.
    pub name: String,
    /// In a sentence.
    pub description: String,
    /// Trials run.
    pub trials: u64,
    /// Time for them, s.
    pub seconds: f64,
    /// Estimator and covariance that the log calls for.
    pub chosen: [String; 2],
    /// The methods that exist for such logs.
    pub methods: Vec<MethodResult>,
    /// Trials with a lack-of-fit test.
    pub tested_for_fit: u64,
    /// Those of them in which it rejected the model (at [`LackOfFit::REJECT_BELOW`]).
    pub rejected_fits: u64,
}

/// One method over all trials.
#[derive(Debug, Clone, Serialize)]
pub struct MethodResult {
    /// Estimator.
    pub estimator: String,
    /// Covariance.
    pub covariance: String,
    /// Trials.
    pub trials: u64,
    /// Trials without an estimate.
    pub failed: u64,
    /// Coverage of 95 % intervals, mean over the parameters.
    pub coverage_mean: f64,
    /// Coverage of the parameter furthest from 95 %.
    pub coverage_worst: f64,
    /// Its name.
    pub coverage_worst_of: String,
    /// Empirical over predicted σ: least, pooled, greatest over the parameters.
    pub ratio: [f64; 3],
    /// Largest |mean error| over σ of any parameter.
    pub bias_worst: f64,
    /// Its name.
    pub bias_worst_of: String,
    /// Empirical σ over the Cramér–Rao bound, where the law of the noise is known.
    pub efficiency: Option<Bound>,
}

/// σ over the least possible σ: root mean square over the parameters, and the worst.
#[derive(Debug, Clone, Copy, Serialize)]
pub struct Bound {
    /// Root mean square over the parameters.
    pub rms: f64,
    /// Largest of any parameter.
    pub worst: f64,
}

/// Tallies of the methods of one list.
struct Part {
    tallies: Vec<Vec<Tally>>,
    tested: u64,
    rejected: u64,
}

/// Runs `trials` of `scenario` (its own number where `None`) with every method on `threads` threads.
pub fn study(
    scenario: Scenario,
    trials: Option<u64>,
    threads: usize,
    progress: &(dyn Fn(u64) + Sync),
) -> Result<ScenarioResult, TrialError> {
    let experiment = Experiment::prepare(scenario)?;
    let trials = trials.unwrap_or(experiment.simulation.scenario.trials);
    let begun = Instant::now();
    let done = std::sync::atomic::AtomicU64::new(0);
    let lists = [quick_methods(), slow_methods()];
    let empty = || lists.each_ref().map(|list| Part::new(list, experiment.truth.len()));
    let share = |t: usize| {
        let mut parts = empty();
        let mut bench = Bench::new(&experiment);
        for trial in (t as u64..trials).step_by(threads) {
            for (k, (part, list)) in parts.iter_mut().zip(&lists).enumerate() {
                if k == 0 || trial % SLOW_EVERY == 0 {
                    part.add(&experiment, trial, list, bench.estimate(trial, list));
                }
            }
            progress(done.fetch_add(1, std::sync::atomic::Ordering::Relaxed) + 1);
        }
        parts
    };
    let merge = |mut a: [Part; 2], b: [Part; 2]| {
        a.iter_mut().zip(&b).for_each(|(a, b)| a.merge(b));
        a
    };
    let parts = (0..threads).into_par_iter().map(share).reduce(empty, merge);
    let bound = bound(&experiment)?;
    let mut methods = Vec::new();
    for (part, list) in parts.iter().zip(&lists) {
        for ((estimator, kinds), tallies) in list.iter().zip(&part.tallies) {
            for (kind, tally) in kinds.iter().zip(tallies).filter(|(_, tally)| tally.succeeded > 1)
            {
                let names = [estimator.to_string(), kind.to_string()];
                methods.push(MethodResult::of(&experiment, names, tally, bound.as_deref()));
            }
        }
    }
    Ok(ScenarioResult {
        name: experiment.simulation.scenario.name.clone(),
        description: experiment.simulation.scenario.description.clone(),
        trials,
        seconds: begun.elapsed().as_secs_f64(),
        chosen: [experiment.estimator.to_string(), experiment.covariance.to_string()],
        methods,
        tested_for_fit: parts[0].tested,
        rejected_fits: parts[0].rejected,
    })
}

/// One thread's memory.
struct Bench<'a> {
    experiment: &'a Experiment,
    identifier: Identifier<'a>,
    measured: Measured,
}

type Estimates = Vec<Result<Estimate, TrialError>>;

impl<'a> Bench<'a> {
    fn new(experiment: &'a Experiment) -> Self {
        let Experiment { simulation, model, .. } = experiment;
        let Simulation { scenario, recording, .. } = simulation;
        let options: Options = scenario.processing.clone();
        Self {
            experiment,
            identifier: Identifier::new(model, &scenario.set, options),
            measured: Measured::like(recording),
        }
    }

    fn estimate(&mut self, trial: u64, methods: &[(E, Vec<C>)]) -> Result<Estimates, TrialError> {
        self.experiment.simulation.log_into(trial, &mut self.measured)?;
        let measurement = Measurement {
            source: "simulated log",
            time_s: &self.measured.time_s,
            q_rad: &self.measured.q_rad,
            qd_rad_s: &self.measured.qd_rad_s,
            torque_nm: &self.measured.torque_nm,
        };
        let estimates = self.identifier.compare(&measurement, methods)?;
        Ok(estimates.into_iter().map(|e| e.map_err(TrialError::from)).collect())
    }
}

impl Part {
    fn new(list: &[(E, Vec<C>)], parameters: usize) -> Self {
        let tallies = list.iter().map(|(_, kinds)| vec![Tally::new(parameters); kinds.len()]);
        Self { tallies: tallies.collect(), tested: 0, rejected: 0 }
    }

    fn merge(&mut self, other: &Self) {
        let pairs = self.tallies.iter_mut().flatten().zip(other.tallies.iter().flatten());
        pairs.for_each(|(a, b)| a.merge(b));
        self.tested += other.tested;
        self.rejected += other.rejected;
    }

    fn add(
        &mut self,
        experiment: &Experiment,
        trial: u64,
        list: &[(E, Vec<C>)],
        estimates: Result<Estimates, TrialError>,
    ) {
        let lost = |tally: &mut Tally, reason: String| tally.add_failure(Failure { trial, reason });
        let estimates = match estimates {
            Ok(estimates) => estimates,
            Err(error) => {
                let reason = error.to_string();
                self.tallies.iter_mut().flatten().for_each(|t| lost(t, reason.clone()));
                return;
            }
        };
        for ((estimate, tallies), (_, kinds)) in estimates.iter().zip(&mut self.tallies).zip(list) {
            let estimate = match estimate {
                Ok(estimate) => estimate,
                Err(error) => {
                    tallies.iter_mut().for_each(|t| lost(t, error.to_string()));
                    continue;
                }
            };
            self.tested += u64::from(estimate.lack_of_fit.is_some());
            self.rejected += u64::from(estimate.lack_of_fit.is_some_and(|lack| !lack.fits()));
            for ((covariance, tally), kind) in estimate.covariances.iter().zip(tallies).zip(kinds) {
                match covariance {
                    Ok(covariance) => {
                        let quantile_95 = covariance.quantile_95();
                        match experiment.outcomes(
                            &estimate.fit.theta,
                            &covariance.sigma(),
                            quantile_95,
                        ) {
                            Ok(outcomes) => tally.add(&outcomes),
                            Err(error) => lost(tally, error.to_string()),
                        }
                    }
                    Err(error) => lost(tally, format!("{kind}: {error}")),
                }
            }
        }
    }
}

impl MethodResult {
    fn of(
        experiment: &Experiment,
        [estimator, covariance]: [String; 2],
        tally: &Tally,
        bound: Option<&[f64]>,
    ) -> Self {
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
        // The pooled ratio of the empirical σ alone; bias is stated by itself.
        let square = |f: &dyn Fn(usize) -> f64| {
            (0..statistics.len()).map(|k| f(k).powi(2)).sum::<f64>() / statistics.len() as f64
        };
        let efficiency = bound.map(|bound| {
            let ratio = |k: usize| statistics[k].sigma_empirical * experiment.scale[k] / bound[k];
            Bound {
                rms: square(&ratio).sqrt(),
                worst: (0..statistics.len()).map(ratio).fold(0.0, f64::max),
            }
        });
        Self {
            estimator,
            covariance,
            trials: tally.trials(),
            failed: tally.failures.len() as u64,
            coverage_mean: tally.mean_coverage().0,
            coverage_worst: statistics[coverage].coverage,
            coverage_worst_of: set.name(coverage).to_owned(),
            ratio: [
                ratios().fold(f64::INFINITY, f64::min),
                square(&ratio).sqrt(),
                ratios().fold(0.0, f64::max),
            ],
            bias_worst: bias(biased),
            bias_worst_of: set.name(biased).to_owned(),
            efficiency,
        }
    }
}

/// The least σ along the noise-free motion, where the torque noise has a known law.
fn bound(experiment: &Experiment) -> Result<Option<Vec<f64>>, TrialError> {
    let Some(torque) = experiment.simulation.known_torque_noise() else { return Ok(None) };
    let Simulation { scenario, recording, .. } = &experiment.simulation;
    let options = Options { period_s: None, ..scenario.processing.clone() };
    let regression =
        Identifier::new(&experiment.model, &scenario.set, options).regression(&Measurement {
            source: "noise-free log",
            time_s: &recording.time_s,
            q_rad: &recording.q_rad,
            qd_rad_s: &recording.qd_rad_s,
            torque_nm: &recording.torque_nm,
        })?;
    let rate_hz = regression.problem.rate_hz;
    let noise = KnownNoise {
        torque_sd_nm: torque.sd_nm,
        correlation: torque.model.cross_joint_correlation,
        power: &|frequency_hz| torque.model.power(frequency_hz, rate_hz),
    };
    let harmonics = regression.problem.samples;
    let bound = cramer_rao(&regression.problem, &scenario.set, &noise, harmonics)
        .map_err(|e| TrialError::Identify(e.into()))?;
    Ok(Some(bound))
}

impl NoiseStudy {
    /// Share of the trials of all scenarios that the lack-of-fit test rejected.
    pub fn rejected_share(&self) -> f64 {
        let tested: u64 = self.scenarios.iter().map(|s| s.tested_for_fit).sum();
        let rejected: u64 = self.scenarios.iter().map(|s| s.rejected_fits).sum();
        rejected as f64 / tested.max(1) as f64
    }

    /// Level of the lack-of-fit test.
    pub fn rejection_level() -> f64 {
        LackOfFit::REJECT_BELOW
    }
}
