//! Verdict over a tally: is the claimed σ true?

use serde::{Deserialize, Serialize};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::share::Share;
pub use super::statistic::Statistic;
use super::tally::Tally;
use crate::identify::covariance::student_quantile;

/// Probability that any check fails although the identifier is exactly as good as claimed.
pub const FALSE_FAILURE_RATE: f64 = 1e-3;

/// The claims: for each statistic the interval in which its true value must lie.
pub mod claims {
    /// Coverage of nominal 95 % intervals, mean over the parameters.
    pub const MEAN_COVERAGE: [f64; 2] = [0.935, 0.965];
    /// The same for a log whose motion does not repeat: there the noise can be estimated from the residuals only.
    pub const MEAN_COVERAGE_OF_A_SINGLE_RUN: [f64; 2] = [0.92, 0.965];

    /// Claimed mean coverage, for logs that are single runs or for logs that repeat their motion.
    pub fn mean_coverage(single_run: bool) -> [f64; 2] {
        if single_run { MEAN_COVERAGE_OF_A_SINGLE_RUN } else { MEAN_COVERAGE }
    }

    /// Coverage of each single parameter.
    pub const EACH_COVERAGE: [f64; 2] = [0.90, 0.985];
    /// |mean error| of each parameter in units of its σ.
    pub const BIAS: [f64; 2] = [-0.2, 0.2];
    /// Empirical over predicted σ, pooled over the parameters.
    pub const POOLED_RATIO: [f64; 2] = [0.95, 1.05];
    /// Error of all parameters jointly in units of their predicted covariance: the same claim as [`POOLED_RATIO`],
    /// for all linear combinations of the parameters.
    pub const JOINT_RATIO: [f64; 2] = [0.95, 1.05];
    /// Empirical over predicted σ of each parameter.
    pub const EACH_RATIO: [f64; 2] = [0.85, 1.15];
    /// Largest ratio of the empirical σ to the Cramér–Rao bound, rms over the parameters.
    pub const EFFICIENCY: f64 = 1.15;
}

/// Result of one check, or of all checks together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Verdict {
    /// The trials do not contradict the claim, and there are enough of them to tell.
    Pass,
    /// The claim is wrong beyond what chance explains.
    Fail,
    /// There are too few trials: chance alone could hide or fake a violation.
    NotEvaluated,
}

impl std::fmt::Display for Verdict {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.pad(match self {
            Self::Pass => "pass",
            Self::Fail => "fail",
            Self::NotEvaluated => "not_evaluated",
        })
    }
}

/// Why [`Statistic::JointRatio`] cannot be checked if fewer than two trials have a distance.
const NO_DISTANCE: &str = "the covariance is known with four degrees of freedom or fewer, with which the squared error has no \
                           mean that trials could find";

/// One check: a statistic, its confidence interval, and the claim.
#[derive(Debug, Clone, PartialEq)]
pub struct Check {
    /// The statistic that is checked.
    pub statistic: Statistic,
    /// The worst parameter, which decided the check; `None` for statistics over all parameters.
    pub parameter: Option<usize>,
    /// Measured value.
    pub value: f64,
    /// Confidence interval of the true value, at the confidence of the check.
    pub interval: [f64; 2],
    /// Interval in which the true value lies according to the claim.
    pub claim: [f64; 2],
    /// The verdict.
    pub verdict: Verdict,
    /// Why the statistic could not be measured; set only if more trials would not help.
    pub reason: Option<&'static str>,
}

/// All checks of one experiment.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibration {
    /// One check per claim.
    pub checks: Vec<Check>,
    /// `Fail` if any check fails; otherwise `NotEvaluated` if any check could not be evaluated; otherwise `Pass`.
    pub verdict: Verdict,
}

/// Number of claims that share [`FALSE_FAILURE_RATE`].
const CHECKS: f64 = 6.0;

impl Calibration {
    /// Checks every claim against `tally`. `mean_coverage` is the claim about the mean coverage, which depends on
    /// whether the logs repeat their motion.
    ///
    /// Each statistic gets an interval at confidence 1 − α/(number of claims × number of statistics in the claim)
    /// (Bonferroni), from the binomial, Student's or χ² distribution for the tally's number of trials, so that the
    /// intervals of a handful of trials are as wide as they have to be; those of the ratios of σ over all parameters are
    /// Student's of their logarithm. A claim **fails** when an interval lies wholly outside it, is **not evaluated**
    /// when an interval is wider than the claim, and passes otherwise. A failed trial counts as an interval that misses
    /// the truth.
    pub fn of(tally: &Tally, mean_coverage: [f64; 2]) -> Self {
        let b = tally.parameters();
        let (n, all) = (tally.succeeded as f64, tally.trials() as f64);
        if tally.succeeded < 2 || b == 0 {
            // A failed trial counts as a 95 % interval that misses, which has a probability of 5 %. The claim fails if
            // so many misses in a row are too improbable.
            let failed = 0.05_f64.powf(tally.failures.len() as f64) < FALSE_FAILURE_RATE;
            let verdict = if failed { Verdict::Fail } else { Verdict::NotEvaluated };
            return Self { checks: Vec::new(), verdict };
        }
        let statistics: Vec<_> = (0..b).map(|k| tally.statistics(k)).collect();
        let single = FALSE_FAILURE_RATE / CHECKS;
        let each = single / b as f64;
        let [t_single, t_each] = [single, each].map(|alpha| two_sided_quantile(alpha, n - 1.0));
        let (mean, error) = tally.mean_coverage();
        // A handful of trials may show no scatter at all. The standard error is therefore at least the smallest
        // one possible, that of independent parameters: the binomial error of one parameter over √b.
        let least = (0.95 * 0.05 / (all * b as f64)).sqrt();
        let half = two_sided_quantile(single, all - 1.0) * error.max(least);
        let ratios: Vec<f64> =
            statistics.iter().map(|s| s.sigma_empirical / s.sigma_predicted).collect();
        let (pooled, pooled_error) = tally.pooled_ratio();
        // A ratio of standard deviations is positive, and a mean of squares from a few trials has a long upper tail: the
        // interval is that of the logarithm, whose standard error is the relative one of the ratio (delta method). With
        // h = t · error/ratio it is ratio · e^±h, to first order ratio ± t · error. Again the error is at least that of
        // independent parameters: s/σ of one parameter has a σ of 1/√(2n).
        let least = (0.5 / (n * b as f64)).sqrt();
        let around = |ratio: f64, error: f64| {
            let factor = (t_single * (error / ratio).max(least)).exp();
            [(None, ratio, [ratio / factor, ratio * factor])]
        };
        let ratio_interval = |ratio: f64, alpha: f64| {
            // (n − 1) s²/σ² ~ χ²(n − 1).
            match ChiSquared::new(n - 1.0) {
                Ok(chi) => {
                    let root = |p: f64| (chi.inverse_cdf(p) / (n - 1.0)).sqrt();
                    [ratio / root(1.0 - 0.5 * alpha), ratio / root(0.5 * alpha)]
                }
                Err(_) => [0.0, f64::INFINITY],
            }
        };
        let mut checks = vec![
            Check::new(
                Statistic::MeanCoverage,
                mean_coverage,
                [(None, mean, [mean - half, mean + half])],
            ),
            Check::new(
                Statistic::EachCoverage,
                claims::EACH_COVERAGE,
                statistics.iter().enumerate().map(|(k, s)| {
                    let count = (s.coverage * all).round() as u64;
                    let share = Share { count, of: tally.trials() };
                    (Some(k), share.value(), share.bounds(0.5 * each))
                }),
            ),
            Check::new(
                Statistic::Bias,
                claims::BIAS,
                statistics.iter().enumerate().map(|(k, s)| {
                    let bias = s.bias / s.sigma_empirical;
                    let half = t_each / n.sqrt();
                    (Some(k), bias, [bias - half, bias + half])
                }),
            ),
            Check::new(Statistic::PooledRatio, claims::POOLED_RATIO, around(pooled, pooled_error)),
            Check::new(
                Statistic::EachRatio,
                claims::EACH_RATIO,
                ratios.iter().enumerate().map(|(k, &r)| (Some(k), r, ratio_interval(r, each))),
            ),
        ];
        checks.push(match tally.joint_ratio() {
            Some((ratio, error)) => {
                Check::new(Statistic::JointRatio, claims::JOINT_RATIO, around(ratio, error))
            }
            None => Check::not_measured(Statistic::JointRatio, claims::JOINT_RATIO, NO_DISTANCE),
        });
        let any = |wanted| checks.iter().any(|check: &Check| check.verdict == wanted);
        let verdict = if any(Verdict::Fail) {
            Verdict::Fail
        } else if any(Verdict::NotEvaluated) {
            Verdict::NotEvaluated
        } else {
            Verdict::Pass
        };
        Self { checks, verdict }
    }
}

impl Check {
    /// The check of the worst of the `statistics`: a failed one before one that is not evaluated, and among equals the
    /// one whose value is farthest from the middle of the claim.
    fn new(
        statistic: Statistic,
        claim: [f64; 2],
        statistics: impl IntoIterator<Item = (Option<usize>, f64, [f64; 2])>,
    ) -> Self {
        let middle = 0.5 * (claim[0] + claim[1]);
        let half = 0.5 * (claim[1] - claim[0]);
        let mut worst: Option<Self> = None;
        for (parameter, value, interval) in statistics {
            let outside = interval[0] > claim[1] || interval[1] < claim[0];
            let verdict = if outside {
                Verdict::Fail
            } else if interval[1] - interval[0] <= claim[1] - claim[0] {
                Verdict::Pass
            } else {
                // Too wide, or not a number: 0/0 where trials neither scatter nor claim to.
                Verdict::NotEvaluated
            };
            let severity = |check: &Self| {
                let rank = match check.verdict {
                    Verdict::Fail => 2,
                    Verdict::NotEvaluated => 1,
                    Verdict::Pass => 0,
                };
                (rank, ((check.value - middle).abs() / half * 1e9) as u64)
            };
            let check =
                Self { statistic, parameter, value, interval, claim, verdict, reason: None };
            if worst.as_ref().is_none_or(|known| severity(&check) > severity(known)) {
                worst = Some(check);
            }
        }
        worst.unwrap_or_else(|| Self::not_measured(statistic, claim, "there is no parameter"))
    }

    fn not_measured(statistic: Statistic, claim: [f64; 2], reason: &'static str) -> Self {
        Self {
            statistic,
            parameter: None,
            value: f64::NAN,
            interval: [f64::NEG_INFINITY, f64::INFINITY],
            claim,
            verdict: Verdict::NotEvaluated,
            reason: Some(reason),
        }
    }
}

/// What |t| exceeds with probability `alpha`.
fn two_sided_quantile(alpha: f64, degrees_of_freedom: f64) -> f64 {
    student_quantile(1.0 - 0.5 * alpha, degrees_of_freedom)
}

/// Wilson's confidence interval for a binomial proportion (E. B. Wilson 1927).
pub fn wilson(share: f64, trials: f64, z: f64) -> [f64; 2] {
    let z2 = z * z / trials;
    let centre = (share + 0.5 * z2) / (1.0 + z2);
    let half = z / (1.0 + z2) * (share * (1.0 - share) / trials + 0.25 * z2 / trials).sqrt();
    // Round-off must not push the bounds below 0 or above 1 for a share of 0 or 1.
    [(centre - half).max(0.0), (centre + half).min(1.0)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::montecarlo::tally::{Outcome, Outcomes};
    use crate::montecarlo::trials::Failure;
    use rand::SeedableRng;
    use rand_distr::{Distribution, StandardNormal};

    /// Trials of 20 independent parameters whose true σ is `true_sigma`, while the claimed σ is 1.
    fn experiment(trials: usize, true_sigma: f64, bias: f64) -> Verdict {
        seeded(11, trials, true_sigma, bias)
    }

    fn seeded(seed: u64, trials: usize, true_sigma: f64, bias: f64) -> Verdict {
        let mut rng = rand::rngs::ChaCha8Rng::seed_from_u64(seed);
        let mut tally = Tally::new(20);
        for _ in 0..trials {
            let outcomes: Vec<Outcome> = (0..20)
                .map(|_| {
                    let z: f64 = StandardNormal.sample(&mut rng);
                    Outcome { z: bias + true_sigma * z, sigma: 1.0, quantile_95: 1.96 }
                })
                .collect();
            let distance = outcomes.iter().map(|o| o.z * o.z).sum::<f64>() / 20.0;
            tally.add(&Outcomes { parameters: outcomes, distance: Some(distance) });
        }
        Calibration::of(&tally, claims::MEAN_COVERAGE).verdict
    }

    #[test]
    fn a_true_sigma_passes_and_a_false_one_fails() {
        assert_eq!(experiment(2000, 1.0, 0.0), Verdict::Pass);
        assert_eq!(experiment(2000, 1.3, 0.0), Verdict::Fail);
        assert_eq!(experiment(2000, 0.7, 0.0), Verdict::Fail);
        assert_eq!(experiment(2000, 1.0, 0.4), Verdict::Fail);
    }

    #[test]
    fn trials_that_all_fail_are_no_open_question() {
        let failed = |count: u64| {
            let mut tally = Tally::new(20);
            for trial in 0..count {
                tally.failures.push(Failure { trial, reason: String::new() });
            }
            Calibration::of(&tally, claims::MEAN_COVERAGE).verdict
        };
        assert_eq!(failed(100), Verdict::Fail);
        assert_eq!(failed(1), Verdict::NotEvaluated);
    }

    #[test]
    fn a_handful_of_trials_cannot_tell() {
        assert_eq!(experiment(1, 1.0, 0.0), Verdict::NotEvaluated);
        assert_eq!(experiment(20, 1.0, 0.0), Verdict::NotEvaluated);
    }

    /// A handful of trials may not fail a true claim more often than once in a thousand runs. Of 500 runs 0.5 are
    /// expected to fail; more than four fail with a probability of 2e-4.
    #[test]
    fn a_handful_of_trials_does_not_fail_what_is_true() {
        for trials in [2, 3, 5] {
            let fails = |seed: &u64| seeded(*seed, trials, 1.0, 0.0) == Verdict::Fail;
            let failed = (0..500).filter(fails).count();
            assert!(failed <= 4, "{failed} of 500 runs of {trials} trials");
        }
    }

    #[test]
    fn failed_trials_count_against_coverage() {
        let mut tally = Tally::new(1);
        for k in 0..2000 {
            let z = if k % 20 == 0 { 2.5 } else { 0.9 * f64::from(k % 3 - 1) };
            let parameters = vec![Outcome { z, sigma: 1.0, quantile_95: 1.96 }];
            tally.add(&Outcomes { parameters, distance: Some(z * z) });
        }
        for trial in 2000..4000 {
            tally.add_failure(Failure { trial, reason: "x".into() });
        }
        assert_eq!(Calibration::of(&tally, claims::MEAN_COVERAGE).verdict, Verdict::Fail);
    }

    /// 1000 trials, of which `failed` failed; the intervals of all others hold the true values of all 20 parameters.
    fn all_held(failed: u64, distance: Option<f64>) -> Tally {
        let mut tally = Tally::new(20);
        for trial in 0..1000 {
            if trial < failed {
                tally.add_failure(Failure { trial, reason: "x".into() });
                continue;
            }
            let z = if trial % 2 == 0 { 1.0 } else { -1.0 };
            let parameters = vec![Outcome { z, sigma: 1.0, quantile_95: 1.96 }; 20];
            tally.add(&Outcomes { parameters, distance });
        }
        tally
    }

    fn check_of(tally: &Tally, statistic: Statistic, mean_coverage: [f64; 2]) -> Check {
        let checks = Calibration::of(tally, mean_coverage).checks;
        checks.into_iter().find(|check| check.statistic == statistic).unwrap()
    }

    /// 50 of 1000 trials failed. Coverage is then 95 %, with the standard error √(0.95·0.05/999) of 1000 coin tosses,
    /// regardless of how many parameters each failed trial takes with it.
    #[test]
    fn failed_trials_scatter_the_coverage() {
        let check = check_of(&all_held(50, None), Statistic::MeanCoverage, claims::MEAN_COVERAGE);
        let half = two_sided_quantile(FALSE_FAILURE_RATE / CHECKS, 999.0)
            * (0.95_f64 * 0.05 / 999.0).sqrt();
        assert!((check.value - 0.95).abs() < 1e-12, "{}", check.value);
        let off = [0.95 - half - check.interval[0], 0.95 + half - check.interval[1]];
        assert!(off.iter().all(|off| off.abs() < 1e-12), "{:?} {half}", check.interval);
    }

    /// 7 % of the intervals miss: too many for logs that repeat, but within the claim for single runs.
    #[test]
    fn less_is_claimed_of_single_runs() {
        let mut tally = Tally::new(20);
        for trial in 0..20_000_u64 {
            let z = |k: u64| if (trial * 7 + k * 3) % 100 < 7 { 2.2 } else { 0.9 };
            let outcome = |k: u64| Outcome { z: z(k), sigma: 1.0, quantile_95: 1.96 };
            tally.add(&Outcomes { parameters: (0..20).map(outcome).collect(), distance: None });
        }
        let of = |claim| check_of(&tally, Statistic::MeanCoverage, claim).verdict;
        assert_eq!(of(claims::MEAN_COVERAGE), Verdict::Fail);
        assert_eq!(of(claims::MEAN_COVERAGE_OF_A_SINGLE_RUN), Verdict::Pass);
    }

    /// Trials without any scatter that claim none have no ratio of the two. They do not pass as if they had, neither
    /// alone nor beside a parameter that passes.
    #[test]
    fn a_ratio_that_is_no_number_does_not_pass() {
        let of = |ratios: &[f64]| {
            let each = ratios.iter().map(|r| (None, *r, [*r - 0.01, *r + 0.01]));
            Check::new(Statistic::EachRatio, claims::EACH_RATIO, each).verdict
        };
        assert_eq!(of(&[1.0]), Verdict::Pass);
        assert_eq!(of(&[f64::NAN]), Verdict::NotEvaluated);
        assert_eq!(of(&[1.0, f64::NAN, 1.1]), Verdict::NotEvaluated);
        assert_eq!(of(&[f64::NAN, 2.0]), Verdict::Fail);
    }

    /// One error of 30 σ among twenty trials: the interval is as long as that asks for, but no ratio of σ is negative.
    /// Its ends are the ratio over and times the same factor, up to round-off.
    #[test]
    fn a_ratio_of_few_trials_is_positive() {
        let mut tally = Tally::new(1);
        for trial in 0..20 {
            let z = match trial {
                0 => 30.0,
                _ if trial % 2 == 0 => 1.0,
                _ => -1.0,
            };
            let parameters = vec![Outcome { z, sigma: 1.0, quantile_95: 1.96 }];
            tally.add(&Outcomes { parameters, distance: Some(z * z) });
        }
        for statistic in [Statistic::PooledRatio, Statistic::JointRatio] {
            let check = check_of(&tally, statistic, claims::MEAN_COVERAGE);
            let ([low, high], ratio) = (check.interval, check.value);
            assert_eq!(check.verdict, Verdict::NotEvaluated);
            assert!(0.0 < low && low < 1.0 && high > 2.0 * ratio, "{check:?}");
            assert!((low * high / ratio.powi(2) - 1.0).abs() < 1e-12, "{check:?}");
        }
    }

    /// Trials that scatter alike leave the least error, 1/√(2 · 1000 · 20) = 0.005. The ends of the interval differ from
    /// those of ratio ± h · ratio by less than the next term of the exponential, h²/2 · e^h with e^h < 1.02.
    #[test]
    fn the_interval_of_a_ratio_is_symmetric_where_it_is_narrow() {
        let check = check_of(&all_held(0, None), Statistic::PooledRatio, claims::MEAN_COVERAGE);
        let h = two_sided_quantile(FALSE_FAILURE_RATE / CHECKS, 999.0) * 0.005;
        let ends = [1.0 - h, 1.0 + h].map(|share| share * check.value);
        let off = [ends[0] - check.interval[0], ends[1] - check.interval[1]];
        assert!(off.iter().all(|off| off.abs() < 0.51 * h * h * check.value), "{off:?} {check:?}");
    }

    /// A claim does not pass if no trial provides evidence about it.
    #[test]
    fn what_is_not_measured_is_not_evaluated() {
        let of = |distance| {
            check_of(&all_held(0, distance), Statistic::JointRatio, claims::MEAN_COVERAGE)
        };
        let check = of(None);
        assert_eq!((check.verdict, check.reason), (Verdict::NotEvaluated, Some(NO_DISTANCE)));
        assert_eq!(of(Some(1.0)).verdict, Verdict::Pass);
    }
}
