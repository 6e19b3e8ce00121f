//! Scores: all trials together, judged against the targets.

use std::collections::BTreeMap;

use serde::Serialize;
use statrs::distribution::{ContinuousCDF, Normal};

use super::benchmark::BlindContent;
use super::case::Secret;
use super::family::Judged;
use super::judge::{Outcome, is_at, is_right};
use super::record::{HeldOutGain, Named, Record};
use super::target::{Target, targets};
use crate::diagnose::{Kind, candidates, chance};
use crate::median::median;
use crate::montecarlo::calibration::Verdict;
use crate::montecarlo::shard::Merged;
use crate::montecarlo::share::Share;
use crate::montecarlo::trials::Failure;

/// Format of the JSON output.
pub const SCORES_SCHEMA: &str = "armid.blind/2";

/// Edges of the bins of √λ.
const STRENGTHS: [f64; 15] =
    [0.0, 4.0, 5.0, 6.0, 8.0, 10.0, 12.0, 15.0, 20.0, 30.0, 40.0, 60.0, 100.0, 200.0, 500.0];
/// Edges of the bins of stated confidence.
const CONFIDENCES: [f64; 8] = [0.0, 0.5, 0.8, 0.9, 0.95, 0.99, 0.999, 1.0];

/// The cases in one range of √λ.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StrengthBin {
    /// Range of √λ.
    pub range: [f64; 2],
    /// Mean √λ.
    pub mean: f64,
    /// Cases in which anything was said.
    pub detected: Share,
    /// Cases named rightly, joint included.
    pub right: Share,
    /// Cases in which the first cause named is at the right joint.
    pub right_joint: Share,
    /// Cases with a wrong name given without reservation.
    pub wrong: Share,
    /// Power of the likelihood-ratio test of the right coefficient, mean over the cases.
    pub power: f64,
}

/// The cases of one family.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct FamilyScore {
    /// Family.
    pub kind: Kind,
    /// By what its effects are seen.
    pub judged: Judged,
    /// Mean √λ (or √λ_sim); null for faults of the record.
    pub mean_strength: Option<f64>,
    /// Cases named rightly, joint included, at √λ ≥ 8 (faults of the record: all cases).
    pub right: Share,
    /// Of the same cases, those in which the first cause named is at the right joint.
    pub right_joint: Share,
    /// Of the same cases, those in which nothing was said.
    pub silent: Share,
    /// Mean number of aliases stated, over the cases named rightly.
    pub mean_class: f64,
    /// Intervals of the effect's parameters that hold the true value.
    pub covered: Share,
}

/// Row of the confusion table: the names that one family was given.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Confusion {
    /// The family that was hidden.
    pub hidden: Kind,
    /// Number of cases by the first name given; `nothing` and `unexplained` count as names.
    pub said: BTreeMap<String, u64>,
}

/// The causes named in one range of stated confidence.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ConfidenceBin {
    /// Range of stated confidence.
    pub range: [f64; 2],
    /// Mean stated confidence.
    pub stated: f64,
    /// Causes that are right.
    pub right: Share,
}

/// Gains, along a motion that was not used, of the cases in one range of √λ.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GainBin {
    /// Range of √λ.
    pub range: [f64; 2],
    /// Number of cases.
    pub cases: u64,
    /// Median share of the explainable mean square that the causes named remove.
    pub removed: f64,
    /// Median share that the noise of the arm's parameters allows to be removed.
    pub possible: f64,
}

/// Result of a blind benchmark.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Scores {
    /// Name of the scenario.
    pub scenario: String,
    /// Number of trials run.
    pub trials: u64,
    /// Trials without an answer.
    pub failures: Vec<Failure>,
    /// Ranges of trials that have not been run: `[first, one past the last]`.
    pub missing: Vec<[u64; 2]>,
    /// Number of trials by what is hidden.
    pub secrets: BTreeMap<Secret, u64>,
    /// The targets.
    pub targets: Vec<Target>,
    /// Single effects seen in the residual, by √λ.
    pub residual: Vec<StrengthBin>,
    /// Single effects seen against a simulation, by √λ_sim.
    pub simulation: Vec<StrengthBin>,
    /// Single strong effects, by √λ or √λ_sim; `right` counts the answers in which nothing else is said.
    pub strong: Vec<StrengthBin>,
    /// Effects whose family is withheld, by √λ; `right` counts the answers that report something unexplained.
    pub withheld: Vec<StrengthBin>,
    /// Share of right answers for single effects seen in the residual at √λ ≥ 8, by motion and noise.
    pub conditions: BTreeMap<String, Share>,
    /// Scores of single effects by family.
    pub families: Vec<FamilyScore>,
    /// Confusion table of single effects at √λ ≥ 8 and of faults of the record.
    pub confusion: Vec<Confusion>,
    /// Calibration of the stated confidence, over all causes named where no family was withheld.
    pub confidence: Vec<ConfidenceBin>,
    /// Mean absolute difference between stated confidence and share of right causes, weighted by the number of causes.
    pub calibration_error: f64,
    /// Gains along another motion, by √λ.
    pub gains: Vec<GainBin>,
    /// Answers that are not right: false alarms, single effects with √λ ≥ 8, faults of the record, pairs, and wrong
    /// names for withheld families.
    pub misses: Vec<Record>,
    /// Verdict over all targets.
    pub verdict: Verdict,
}

impl Scores {
    /// Scores the trials of merged shards.
    pub fn of(merged: &Merged<BlindContent>) -> Self {
        let all = &merged.tally.records;
        let secret = |s: Secret| all.iter().filter(move |r| r.case.secret == s);
        let one = |judged: Judged| all.iter().filter(move |r| r.case.is_one(judged));
        let mut secrets = BTreeMap::new();
        all.iter().for_each(|r| *secrets.entry(r.case.secret).or_insert(0) += 1);
        let targets = targets(merged);
        let verdict = match &targets {
            t if t.iter().any(|t| t.verdict == Verdict::Fail) => Verdict::Fail,
            t if t.iter().any(|t| t.verdict == Verdict::NotEvaluated) => Verdict::NotEvaluated,
            _ => Verdict::Pass,
        };
        let confidence = confidence(all);
        let stated: u64 = confidence.iter().map(|bin| bin.right.of).sum();
        let distance =
            |bin: &ConfidenceBin| (bin.stated - bin.right.value()).abs() * bin.right.of as f64;
        let is_miss = |r: &&Record| match r.case.secret {
            Secret::One => {
                (r.case.is_from(8.0) || r.case.is_one(Judged::Record))
                    && r.outcome() != Outcome::Right
            }
            Secret::Withheld => r.outcome() == Outcome::Wrong,
            Secret::Strong => r.outcome() != Outcome::Right || !r.is_all_right(),
            Secret::Nothing | Secret::Two | Secret::Beside => r.outcome() != Outcome::Right,
        };
        Self {
            scenario: merged.header.scenario.clone(),
            trials: all.len() as u64 + merged.tally.failures.len() as u64,
            failures: merged.tally.failures.clone(),
            missing: merged.missing.iter().map(|range| [range.start, range.end]).collect(),
            secrets,
            verdict,
            residual: bins(one(Judged::Residual), |r| r.outcome() == Outcome::Right),
            simulation: bins(one(Judged::Simulation), |r| r.outcome() == Outcome::Right),
            strong: bins(secret(Secret::Strong), |r| {
                r.outcome() == Outcome::Right && r.is_all_right()
            }),
            withheld: bins(secret(Secret::Withheld), |r| r.answer.left.is_some()),
            conditions: conditions(one(Judged::Residual).filter(|r| r.case.is_from(8.0))),
            families: families(all),
            confusion: confusion(secret(Secret::One)),
            calibration_error: confidence
                .iter()
                .filter(|b| b.right.of > 0)
                .map(distance)
                .sum::<f64>()
                / stated.max(1) as f64,
            confidence,
            gains: gains(all),
            misses: all.iter().filter(is_miss).cloned().collect(),
            targets,
        }
    }

    /// Number of targets met, and number of targets that could be judged.
    pub fn met(&self) -> [usize; 2] {
        let count = |v: Verdict| self.targets.iter().filter(|t| t.verdict == v).count();
        [count(Verdict::Pass), count(Verdict::Pass) + count(Verdict::Fail)]
    }
}

/// All causes named in trials where no family is withheld, each with whether it is one of the hidden effects.
pub fn causes(all: &[Record]) -> impl Iterator<Item = (&Named, bool)> {
    all.iter().filter(|r| r.case.secret != Secret::Withheld).flat_map(|r| {
        r.answer.named.iter().map(|n| (n, r.case.hidden.iter().any(|h| is_right(n, h))))
    })
}

/// Power of the likelihood-ratio test of one coefficient at √λ: Φ(√λ − z₁₋ₐ/₂ₘ). The false-alarm rate a of all laws is
/// divided evenly among m tests, one for each family of the dictionary at each of six joints.
pub fn power(sqrt_lambda: f64) -> f64 {
    let tests = 6 * candidates::all().len();
    let normal = Normal::standard();
    let threshold = normal.inverse_cdf(1.0 - 0.5 * chance::LAW / tests as f64);
    normal.cdf(sqrt_lambda - threshold)
}

fn bins<'a>(
    records: impl Iterator<Item = &'a Record>,
    right: impl Fn(&Record) -> bool,
) -> Vec<StrengthBin> {
    let with: Vec<(f64, &Record)> = records.filter_map(|r| Some((r.case.strength()?, r))).collect();
    STRENGTHS
        .windows(2)
        .map(|edges| {
            let last = edges[1] == STRENGTHS[STRENGTHS.len() - 1];
            let inside = |s: &f64| *s >= edges[0] && (*s < edges[1] || last);
            let here: Vec<&(f64, &Record)> = with.iter().filter(|(s, _)| inside(s)).collect();
            let mean = |f: &dyn Fn(f64) -> f64| {
                here.iter().map(|(s, _)| f(*s)).sum::<f64>() / here.len() as f64
            };
            let share = |wanted: &dyn Fn(&Record) -> bool| Share::of(&here, |(_, r)| wanted(r));
            StrengthBin {
                range: [edges[0], if last { f64::INFINITY } else { edges[1] }],
                mean: mean(&|s| s),
                detected: share(&|r| !r.is_silent()),
                right: share(&right),
                right_joint: share(&|r| r.first_is(is_at)),
                wrong: share(&|r| r.outcome() == Outcome::Wrong),
                power: mean(&power),
            }
        })
        .filter(|bin| bin.right.of > 0)
        .collect()
}

fn conditions<'a>(records: impl Iterator<Item = &'a Record>) -> BTreeMap<String, Share> {
    let mut out: BTreeMap<String, Share> = BTreeMap::new();
    for r in records {
        let share = out.entry(format!("{}, {} noise", r.case.motion, r.case.noise)).or_default();
        share.of += 1;
        share.count += u64::from(r.outcome() == Outcome::Right);
    }
    out
}

fn families(all: &[Record]) -> Vec<FamilyScore> {
    let mut groups: BTreeMap<(Judged, Kind), Vec<&Record>> = BTreeMap::new();
    for r in all.iter().filter(|r| r.case.secret == Secret::One) {
        for h in &r.case.hidden {
            groups.entry((h.judged, h.kind)).or_default().push(r);
        }
    }
    groups
        .into_iter()
        .map(|((judged, kind), records)| {
            let strengths: Vec<f64> = records.iter().filter_map(|r| r.case.strength()).collect();
            let seen: Vec<&&Record> = records
                .iter()
                .filter(|r| judged == Judged::Record || r.case.is_from(8.0))
                .collect();
            let right: Vec<&&&Record> =
                seen.iter().filter(|r| r.outcome() == Outcome::Right).collect();
            let class = |r: &&&&Record| r.answer.named.first().map_or(0, |n| n.class.len());
            let mut covered = Share::default();
            for share in records.iter().map(|r| r.covered()) {
                covered.count += share.count;
                covered.of += share.of;
            }
            FamilyScore {
                kind,
                judged,
                mean_strength: (!strengths.is_empty())
                    .then(|| strengths.iter().sum::<f64>() / strengths.len() as f64),
                right: Share::of(&seen, |r| r.outcome() == Outcome::Right),
                right_joint: Share::of(&seen, |r| r.first_is(is_at)),
                silent: Share::of(&seen, |r| r.is_silent()),
                mean_class: right.iter().map(class).sum::<usize>() as f64 / right.len() as f64,
                covered,
            }
        })
        .collect()
}

/// Name in the confusion table for an answer that says nothing.
pub const SAID_NOTHING: &str = "nothing";
/// Name in the confusion table for an answer that reports something unexplained without naming a cause.
pub const SAID_UNEXPLAINED: &str = "unexplained";

fn confusion<'a>(records: impl Iterator<Item = &'a Record>) -> Vec<Confusion> {
    let mut rows: BTreeMap<Kind, BTreeMap<String, u64>> = BTreeMap::new();
    for r in records.filter(|r| r.case.is_from(8.0) || r.case.is_one(Judged::Record)) {
        let Some(hidden) = r.case.hidden.first() else { continue };
        let said = match r.answer.named.first() {
            // An answer whose class contains the hidden effect counts as right.
            Some(named) if is_right(named, hidden) => hidden.kind.name(),
            Some(named) => named.kind.name(),
            None if r.answer.left.is_some() => SAID_UNEXPLAINED,
            None => SAID_NOTHING,
        };
        *rows.entry(hidden.kind).or_default().entry(said.to_owned()).or_insert(0) += 1;
    }
    rows.into_iter().map(|(hidden, said)| Confusion { hidden, said }).collect()
}

fn confidence(all: &[Record]) -> Vec<ConfidenceBin> {
    CONFIDENCES
        .windows(2)
        .map(|edges| {
            let last = edges[1] == 1.0;
            let inside = |c: f64| c >= edges[0] && (c < edges[1] || last);
            let here: Vec<(&Named, bool)> =
                causes(all).filter(|(n, _)| inside(n.confidence)).collect();
            let stated = here.iter().map(|(n, _)| n.confidence).sum::<f64>() / here.len() as f64;
            let right = Share::of(here, |(_, right)| *right);
            ConfidenceBin { range: [edges[0], edges[1]], stated, right }
        })
        .filter(|bin| bin.right.of > 0)
        .collect()
}

fn gains(all: &[Record]) -> Vec<GainBin> {
    let with: Vec<(f64, HeldOutGain)> = all
        .iter()
        .filter_map(|r| Some((r.case.sqrt_lambda, r.answer.gain?)))
        .filter(|(_, gain)| gain.before > 0.0)
        .collect();
    STRENGTHS
        .windows(2)
        .map(|edges| {
            let last = edges[1] == STRENGTHS[STRENGTHS.len() - 1];
            let inside = |s: f64| s >= edges[0] && (s < edges[1] || last);
            let here: Vec<HeldOutGain> =
                with.iter().filter(|(s, _)| inside(*s)).map(|(_, gain)| *gain).collect();
            let middle = |of: &dyn Fn(&HeldOutGain) -> f64| {
                let mut values: Vec<f64> = here.iter().map(of).collect();
                median(&mut values).unwrap_or(f64::NAN)
            };
            GainBin {
                range: [edges[0], if last { f64::INFINITY } else { edges[1] }],
                cases: here.len() as u64,
                removed: middle(&HeldOutGain::share),
                possible: middle(&HeldOutGain::possible),
            }
        })
        .filter(|bin| bin.cases > 0)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// At the threshold z₁₋ₐ/₂ₘ the power is one half, and an effect of size zero is found with the one-sided
    /// probability a/2m. In 1 − a/2m eleven digits of this probability survive.
    #[test]
    fn half_the_effects_at_the_threshold_are_found() {
        let one_side = 0.5 * chance::LAW / (6 * candidates::all().len()) as f64;
        let threshold = Normal::standard().inverse_cdf(1.0 - one_side);
        assert!((power(threshold) - 0.5).abs() < 1e-12, "{}", power(threshold));
        assert!((power(0.0) / one_side - 1.0).abs() < 1e-9, "{} {one_side}", power(0.0));
    }
}
