//! Targets that a blind benchmark must meet.

use serde::Serialize;

use super::benchmark::BlindContent;
use super::case::Secret;
use super::family::Judged;
use super::judge::{Outcome, is_at};
use super::record::Record;
use super::score::causes;
use crate::identify::covariance::Z_95;
use crate::montecarlo::calibration::Verdict;
use crate::montecarlo::shard::Merged;
use crate::montecarlo::share::Share;

/// A share of fewer cases than this is not judged.
const FEWEST: u64 = 20;

/// √λ from which a case counts among the strong ones.
const STRONG: f64 = 60.0;

/// Name of the headline target.
pub const NAMED_RIGHTLY: &str = "one effect, √λ ≥ 8: kind (class) and joint right";

/// One target.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Target {
    /// What is counted.
    pub what: &'static str,
    /// The count.
    pub share: Share,
    /// Measured value: the share, or its upper bound if the target is about the bound.
    pub measured: f64,
    /// 95 % confidence interval of the probability behind the share. If each case contributes several counts, the
    /// interval comes from the scatter between cases.
    pub interval: [f64; 2],
    /// Smallest and largest value that meet the target.
    pub target: [f64; 2],
    /// Whether the measured value meets the target; not evaluated if there are too few cases. The verdict ignores
    /// `interval`, which shows how far chance may have moved the value.
    pub verdict: Verdict,
}

impl Target {
    fn new(what: &'static str, share: Share, target: [f64; 2]) -> Self {
        Self::about(what, share, share.of, share.bounds(0.025), target)
    }

    /// Target about the pooled share of `cases`, each of which contributes n counts, c of them wanted, that are
    /// correlated within the case. The interval comes from the scatter between the cases: the variance of Σ c/Σ n is Σ
    /// (c − n Σ c/Σ n)²/(Σ n)². It is never narrower than the interval for independent counts.
    fn of_cases(what: &'static str, cases: impl Iterator<Item = Share>, target: [f64; 2]) -> Self {
        let cases: Vec<Share> = cases.filter(|case| case.of > 0).collect();
        let sum = |f: &dyn Fn(&Share) -> u64| cases.iter().map(f).sum();
        let all = Share { count: sum(&|case| case.count), of: sum(&|case| case.of) };
        let off = |case: &Share| case.count as f64 - case.of as f64 * all.value();
        let square: f64 = cases.iter().map(|case| off(case).powi(2)).sum();
        let count = cases.len() as f64;
        let half = Z_95 * (square * count / (count - 1.0)).sqrt() / all.of as f64;
        let [low, high] = all.bounds(0.025);
        // For a single case `half` is NaN, which `min` and `max` ignore.
        let interval = [low.min(all.value() - half), high.max(all.value() + half)];
        Self::about(what, all, cases.len() as u64, interval, target)
    }

    /// Target about `share`, which was counted in `cases` cases and has the confidence interval `interval`.
    fn about(
        what: &'static str,
        share: Share,
        cases: u64,
        interval: [f64; 2],
        target: [f64; 2],
    ) -> Self {
        let measured = share.value();
        let verdict = match measured {
            _ if cases < FEWEST => Verdict::NotEvaluated,
            m if m >= target[0] && m <= target[1] => Verdict::Pass,
            _ => Verdict::Fail,
        };
        Self { what, share, measured, interval, target, verdict }
    }
}

/// Target about the upper bound of the false `alarms`. It is not evaluated if there are so few cases that even no alarm
/// at all would miss it.
fn upper_bound_of(alarms: Share) -> Target {
    let most = 0.01;
    let bound = |count: u64| Share { count, ..alarms }.bounds(0.05)[1];
    let measured = bound(alarms.count);
    Target {
        what: "clean: one-sided 95 % upper bound of the false alarms",
        share: alarms,
        measured,
        interval: alarms.bounds(0.025),
        target: [0.0, most],
        verdict: match measured {
            _ if bound(0) > most => Verdict::NotEvaluated,
            bound if bound <= most => Verdict::Pass,
            _ => Verdict::Fail,
        },
    }
}

/// All targets, evaluated on the trials.
pub fn targets(merged: &Merged<BlindContent>) -> Vec<Target> {
    let all = &merged.tally.records;
    let is_right = |r: &&Record| r.outcome() == Outcome::Right;
    let one = |judged: Judged, [low, high]: [f64; 2]| {
        all.iter().filter(move |r| {
            r.case.is_one(judged) && r.case.strength().is_some_and(|s| s >= low && s < high)
        })
    };
    let above = |low: f64| [low, f64::INFINITY];
    let alarms = Share::of(all.iter().filter(|r| r.case.secret == Secret::Nothing), |r| {
        r.outcome() != Outcome::Right
    });
    let strong = |secret: Secret| {
        all.iter().filter(move |r| {
            r.case.secret == secret
                && r.case.hidden.iter().all(|h| h.strength.is_some_and(|s| s >= 15.0))
        })
    };
    let two = strong(Secret::Two).filter(|r| r.case.cosine.is_some_and(|c| c.abs() < 0.5));
    let beside = strong(Secret::Beside);
    let withheld = |low: f64| {
        let of_them =
            all.iter().filter(move |r| r.case.secret == Secret::Withheld && r.case.is_from(low));
        Share::of(of_them, |r| r.outcome() == Outcome::Wrong)
    };
    let residual = Judged::Residual;
    let sure = |record: &Record| {
        let causes = causes(std::slice::from_ref(record));
        Share::of(causes.filter(|(named, _)| named.confidence >= 0.99), |(_, right)| *right)
    };
    let covered = all.iter().filter(|r| r.case.secret == Secret::One).map(Record::covered);
    let is_one = |r: &&Record| r.case.is_one(residual) && r.outcome() == Outcome::Right;
    let base = all.iter().filter(is_one).map(|r| r.answer.base);
    let large = || all.iter().filter(|r| r.case.is_from(40.0)).filter_map(|r| r.answer.gain);
    // Where physics allows an effect no strength far above the noise, it is drawn as strong as it allows.
    let of_strong =
        || all.iter().filter(|r| r.case.secret == Secret::Strong && r.case.is_from(STRONG));
    // All other targets are about cases that have an answer.
    let failures = merged.tally.failures.len() as u64;
    let silent = Share { count: failures, of: all.len() as u64 + failures };
    vec![
        Target::new("clean: a false alarm", alarms, [0.0, 0.003]),
        upper_bound_of(alarms),
        Target::new(NAMED_RIGHTLY, Share::of(one(residual, above(8.0)), is_right), [0.97, 1.0]),
        Target::new(
            "one effect, √λ 6 … 8: kind (class) and joint right",
            Share::of(one(residual, [6.0, 8.0]), is_right),
            [0.90, 1.0],
        ),
        Target::new(
            "one effect, √λ ≥ 8: joint right",
            Share::of(one(residual, above(8.0)), |r| r.first_is(is_at)),
            [0.99, 1.0],
        ),
        Target::new(
            "one effect against a simulation, √λ_sim ≥ 8: kind (class) and joint right",
            Share::of(one(Judged::Simulation, above(8.0)), is_right),
            [0.97, 1.0],
        ),
        Target::of_cases(
            "causes named with confidence ≥ 0.99 in logs whose family is known: right",
            all.iter().map(sure),
            [0.99, 1.0],
        ),
        Target::new(
            "two effects, both √λ ≥ 15, |cos| < 0.5: both named",
            Share::of(two, is_right),
            [0.90, 1.0],
        ),
        Target::new(
            "a change and a law, √λ_sim and √λ ≥ 15: both named",
            Share::of(beside, is_right),
            [0.90, 1.0],
        ),
        Target::new(
            "family withheld, √λ ≥ 15: a wrong name without doubt",
            withheld(15.0),
            [0.0, 0.05],
        ),
        Target::new(
            "family withheld, √λ ≥ 30: a wrong name without doubt",
            withheld(30.0),
            [0.0, 0.01],
        ),
        Target::of_cases(
            "95 % intervals of a named effect's parameters that hold the truth",
            covered,
            [0.93, 0.97],
        ),
        Target::of_cases(
            "one effect, named rightly: 95 % intervals of the base parameters that hold the truth",
            base,
            [0.935, 0.965],
        ),
        Target::new(
            "√λ ≥ 40: at least 95 % of the explainable mean square removed on another motion",
            Share::of(large(), |gain| gain.share() >= 0.95),
            [0.5, 1.0],
        ),
        Target::new(
            "√λ ≥ 40: at least 95 % of what a right model under the same noise removes",
            Share::of(large(), |gain| gain.share() >= 0.95 * gain.possible()),
            [0.9, 1.0],
        ),
        Target::new(
            "one effect, √λ ≥ 60: kind (class) and joint right",
            Share::of(of_strong(), is_right),
            [0.97, 1.0],
        ),
        Target::new(
            "one effect, √λ ≥ 60: right, and nothing else said",
            Share::of(of_strong(), |r| is_right(r) && r.is_all_right()),
            [0.90, 1.0],
        ),
        Target::of_cases(
            "one effect, √λ ≥ 60: 95 % intervals of its parameters that hold the truth",
            of_strong().map(Record::covered),
            [0.93, 0.97],
        ),
        Target::new("cases without an answer", silent, [0.0, 0.005]),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// In half of the cases all intervals hold the truth, in the other half none: 100 such cases carry as much
    /// information as 100 single intervals, and no more.
    #[test]
    fn what_goes_together_counts_once() {
        let cases = (0..100).map(|i| Share { count: 50 * (i % 2), of: 50 });
        let [low, high] = Target::of_cases("", cases, [0.0, 1.0]).interval;
        let half = Z_95 * (0.25_f64 / 99.0).sqrt();
        assert!((low - 0.5 + half).abs() < 1e-12 && (high - 0.5 - half).abs() < 1e-12);
    }

    /// 52 parameters of one case do not count as 52 cases.
    #[test]
    fn few_cases_are_not_judged() {
        let verdict = |cases: u64, held: u64| {
            let cases = (0..cases).map(|i| Share { count: held + i % 2, of: 52 });
            Target::of_cases("", cases, [0.935, 0.965]).verdict
        };
        assert_eq!(verdict(1, 49), Verdict::NotEvaluated);
        assert_eq!(verdict(1000, 49), Verdict::Pass);
        assert_eq!(verdict(1000, 40), Verdict::Fail);
        let of = |count, of| Target::new("", Share { count, of }, [0.97, 1.0]).verdict;
        assert_eq!([of(19, 19), of(30, 30)], [Verdict::NotEvaluated, Verdict::Pass]);
        assert_eq!(of(28, 30), Verdict::Fail);
    }

    /// Even 0 alarms in 100 cases do not show with 95 % confidence that the rate is below 1 %: 0.05^(1/100) is 0.970. 0
    /// in 299 do.
    #[test]
    fn a_bound_that_nothing_can_meet_is_not_missed() {
        let verdict = |count, of| upper_bound_of(Share { count, of }).verdict;
        assert_eq!(verdict(0, 100), Verdict::NotEvaluated);
        assert_eq!([verdict(0, 299), verdict(4, 1100)], [Verdict::Pass; 2]);
        assert_eq!(verdict(1, 299), Verdict::Fail);
    }
}
