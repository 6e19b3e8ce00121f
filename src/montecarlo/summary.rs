//! Summary of a run, in the form of its JSON output.

use serde::{Deserialize, Deserializer, Serialize};

use super::calibration::{Calibration, Check, Verdict, claims};
use super::efficiency::Efficiency;
use super::experiment::Estimation;
use super::shard::Merged;
use super::trials::Failure;

/// Format of the JSON output.
pub const SUMMARY_SCHEMA: &str = "armid.montecarlo/1";

/// Result of a Monte Carlo run. Fractions are 0…1; every σ is in the unit of its parameter.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Summary {
    /// Name of the scenario.
    pub scenario: String,
    /// Trials run, failed ones included.
    pub trials: u64,
    /// Number of trials that gave no estimate.
    pub failed: u64,
    /// Which trials failed, and why.
    pub failures: Vec<Failure>,
    /// Ranges of trials that have not been run: `[first, one past the last]`.
    pub missing: Vec<[u64; 2]>,
    /// Name of the estimator.
    pub estimator: String,
    /// Name of the kind of covariance.
    pub covariance: String,
    /// One entry per base parameter.
    pub parameters: Vec<ParameterSummary>,
    /// Coverage of nominal 95 % intervals, mean over parameters; the intervals of a failed trial count as misses.
    pub coverage_mean: f64,
    /// The parameter whose coverage is farthest from 95 %.
    pub coverage_worst: NamedValue,
    /// Empirical over predicted σ, pooled over parameters.
    pub sigma_ratio_pooled: f64,
    /// Error of all parameters jointly, in units of their predicted covariance; null if it cannot be determined.
    pub joint_ratio: Option<f64>,
    /// Empirical σ over the Cramér–Rao bound; null if the bound is not known, for example because the noise has no
    /// known law.
    pub efficiency: Option<Efficiency>,
    /// The checks behind the verdict.
    pub checks: Vec<CheckSummary>,
    /// Trials per second of wall time; for merged shards, per second of the sum of their times.
    pub trials_per_second: f64,
    /// Verdict on whether the claimed σ is true.
    pub verdict: Verdict,
}

/// Statistics of one base parameter.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ParameterSummary {
    /// Name of the standard parameter whose column is kept.
    pub name: String,
    /// The full linear combination of standard parameters.
    pub formula: String,
    /// SI unit.
    pub unit: String,
    /// True value.
    pub truth: f64,
    /// Mean estimate.
    pub mean: f64,
    /// Standard deviation of the estimates.
    pub sigma_empirical: f64,
    /// Root mean square of the claimed σ.
    pub sigma_predicted: f64,
    /// The Cramér–Rao bound; null if it is not known, for example because the noise has no known law.
    pub sigma_least: Option<f64>,
    /// Share of all trials whose 95 % interval holds the true value; failed trials count as misses.
    pub coverage: f64,
}

/// A value with the parameter it belongs to.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NamedValue {
    /// Name of the parameter.
    pub name: String,
    /// The value.
    pub value: f64,
}

/// One check with its interval and its claim.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct CheckSummary {
    /// The statistic, in words.
    pub what: String,
    /// The parameter that decided the check; null for statistics over all parameters.
    pub parameter: Option<String>,
    /// Measured value; null if nothing was measured.
    #[serde(deserialize_with = "number")]
    pub value: f64,
    /// Confidence interval of the true value for this number of trials.
    #[serde(deserialize_with = "ends")]
    pub interval: [f64; 2],
    /// Interval in which the true value lies according to the claim.
    pub claim: [f64; 2],
    /// The verdict.
    pub verdict: Verdict,
    /// Why the statistic could not be measured, if more trials would not help; otherwise null.
    pub reason: Option<String>,
}

/// Reads a number from JSON, where null stands for NaN.
fn number<'de, D: Deserializer<'de>>(source: D) -> Result<f64, D::Error> {
    Ok(Option::deserialize(source)?.unwrap_or(f64::NAN))
}

/// Reads the two ends of an interval from JSON; see [`number`].
fn ends<'de, D: Deserializer<'de>>(source: D) -> Result<[f64; 2], D::Error> {
    let ends: [Option<f64>; 2] = Deserialize::deserialize(source)?;
    Ok(ends.map(|end| end.unwrap_or(f64::NAN)))
}

impl CheckSummary {
    /// Summarises `check`; parameter k is called `name(k)`.
    pub fn of(check: &Check, name: impl Fn(usize) -> String) -> Self {
        Self {
            what: check.statistic.in_words().to_owned(),
            parameter: check.parameter.map(name),
            value: check.value,
            interval: check.interval,
            claim: check.claim,
            verdict: check.verdict,
            reason: check.reason.map(str::to_owned),
        }
    }
}

impl Summary {
    /// Summarises merged shards; `wall_s` is the time that the trials took, s.
    pub fn of(merged: &Merged<Estimation>, wall_s: f64) -> Self {
        let Merged { header, tally, missing, .. } = merged;
        let content = &header.content;
        let calibration = Calibration::of(tally, claims::mean_coverage(content.single_run));
        let parameters: Vec<ParameterSummary> = content
            .parameters
            .iter()
            .enumerate()
            .map(|(k, p)| {
                let s = tally.statistics(k);
                ParameterSummary {
                    name: p.name.clone(),
                    formula: p.formula.clone(),
                    unit: p.unit.clone(),
                    truth: p.truth,
                    mean: p.truth + s.bias * p.scale,
                    sigma_empirical: s.sigma_empirical * p.scale,
                    sigma_predicted: s.sigma_predicted * p.scale,
                    sigma_least: p.sigma_least,
                    coverage: s.coverage,
                }
            })
            .collect();
        let worst = parameters
            .iter()
            .max_by(|a, b| (a.coverage - 0.95).abs().total_cmp(&(b.coverage - 0.95).abs()));
        let checks = calibration.checks.iter();
        let checks = checks.map(|c| CheckSummary::of(c, |k| content.parameters[k].name.clone()));
        let sigma: Vec<f64> = parameters.iter().map(|p| p.sigma_empirical).collect();
        let name = |k: usize| parameters[k].name.clone();
        let least: Option<Vec<f64>> = parameters.iter().map(|p| p.sigma_least).collect();
        let efficiency =
            least.filter(|_| tally.succeeded > 1).map(|least| Efficiency::of(&sigma, &least, name));
        Self {
            scenario: header.scenario.clone(),
            trials: tally.trials(),
            failed: tally.failures.len() as u64,
            failures: tally.failures.clone(),
            missing: missing.iter().map(|range| [range.start, range.end]).collect(),
            estimator: content.estimator.clone(),
            covariance: content.covariance.clone(),
            coverage_mean: tally.mean_coverage().0,
            coverage_worst: worst.map_or_else(
                || NamedValue { name: String::new(), value: f64::NAN },
                |p| NamedValue { name: p.name.clone(), value: p.coverage },
            ),
            sigma_ratio_pooled: tally.pooled_ratio().0,
            joint_ratio: tally.joint_ratio().map(|(ratio, _)| ratio),
            efficiency,
            checks: checks.collect(),
            trials_per_second: tally.trials() as f64 / wall_s,
            verdict: calibration.verdict,
            parameters,
        }
    }

    /// The verdict in a sentence.
    pub fn sentence(&self) -> String {
        let percent = |share: f64| format!("{:.1} %", 100.0 * share);
        match self.verdict {
            Verdict::Pass => format!(
                "The predicted σ is true: {} of the 95 % intervals hold the true value, and the \
                 estimates scatter {:.3} times as far as predicted{}.",
                percent(self.coverage_mean),
                self.sigma_ratio_pooled,
                self.joint_ratio.map_or_else(String::new, |ratio| format!(
                    ", their combinations {ratio:.3} times"
                )),
            ),
            Verdict::Fail => {
                let failed = self.checks.iter().find(|c| c.verdict == Verdict::Fail);
                let reason = failed.map_or_else(String::new, |c| {
                    let of = c.parameter.as_ref().map_or(String::new(), |p| format!(" ({p})"));
                    let [low, high] = c.claim;
                    format!(": {}{of} is {:.3}, claimed {low} to {high}", c.what, c.value)
                });
                format!("The claim does not hold{reason}.")
            }
            Verdict::NotEvaluated => {
                let mut open = self.checks.iter().filter(|c| c.verdict == Verdict::NotEvaluated);
                match (open.next().and_then(|c| Some((&c.what, c.reason.as_ref()?))), open.next()) {
                    (Some((what, reason)), None) => format!(
                        "What could be checked of the predicted σ holds. Not checked is the {what}: {reason}."
                    ),
                    _ => format!(
                        "{} trials with an estimate are too few to tell whether the predicted σ is true.",
                        self.trials - self.failed
                    ),
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::montecarlo::tally::{Outcome, Outcomes, Tally};

    /// 4000 trials as claimed, but without a distance: more trials would not make the joint ratio measurable.
    #[test]
    fn what_cannot_be_checked_is_said_with_its_reason() {
        let mut tally = Tally::new(1);
        for trial in 0..4000 {
            let size = if trial % 20 < 2 { 2.0 } else { 0.82 };
            let z = if trial % 2 == 0 { size } else { -size };
            // One interval in twenty misses the true value.
            let quantile_95 = if trial % 20 == 0 { 1.96 } else { 2.01 };
            let parameters = vec![Outcome { z, sigma: 1.0, quantile_95 }];
            tally.add(&Outcomes { parameters, distance: None });
        }
        let calibration = Calibration::of(&tally, claims::MEAN_COVERAGE);
        let checks: Vec<CheckSummary> = calibration
            .checks
            .iter()
            .map(|check| CheckSummary::of(check, |_| "mx2".to_owned()))
            .collect();
        let summary = Summary {
            scenario: String::new(),
            trials: 4000,
            failed: 0,
            failures: Vec::new(),
            missing: Vec::new(),
            estimator: String::new(),
            covariance: String::new(),
            parameters: Vec::new(),
            coverage_mean: 0.95,
            coverage_worst: NamedValue { name: String::new(), value: 0.95 },
            sigma_ratio_pooled: 1.0,
            joint_ratio: None,
            efficiency: None,
            checks,
            trials_per_second: 1.0,
            verdict: calibration.verdict,
        };
        assert_eq!(summary.verdict, Verdict::NotEvaluated);
        let sentence = summary.sentence();
        assert!(
            sentence.contains("all parameters together: the covariance is known"),
            "{sentence}"
        );
        // A value that was not measured is written as null and read back as NaN.
        let text = serde_json::to_string(&summary.checks).unwrap();
        let read: Vec<CheckSummary> = serde_json::from_str(&text).unwrap();
        let last = &read[read.len() - 1];
        assert!(last.value.is_nan() && last.interval.iter().all(|end| end.is_nan()), "{last:?}");
        assert_eq!(last.reason, summary.checks[read.len() - 1].reason);
    }
}
