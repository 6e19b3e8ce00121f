//! The repetitions of a motion compared with each other, and the bumps that one has and the others have not.

use std::ops::Range;

use super::bump::{self, FELT_SHARE, Felt, Noise, ORDINARY, Push};
use super::rarity;
use super::{Touch, are_near};
use crate::diagnose::friction_drift::FrictionDrift;
use crate::diagnose::verdict::Estimate;
use crate::diagnose::whitening::FLOOR;
use crate::median::{robust_sigma, trimmed_mean};
use crate::robot::JointSignals;
use crate::signal::{MatchedFilter, SignalError};

/// A joint felt a contact that another one shows by itself if it deviates by so many σ (once in 10⁴ by chance), and by
/// [`FELT_SHARE`] of the joint that felt it most.
const FELT_BESIDE: f64 = 4.0;
/// Shortest bump, s; a collision lasts a tenth of a second.
const SHORTEST_S: f64 = 0.1;
/// The longest, s: a hand that leans on the arm.
const LONGEST_S: f64 = 6.0;
/// Step between lengths: a bump √√2 too long or short is seen with 97 % of its height.
const LENGTHEN: f64 = std::f64::consts::SQRT_2;
/// What lasts longer than this share of a period is no contact: friction that drifts, or another motion.
const LONGEST_OF_PERIOD: f64 = 0.5;
/// Bumps are looked for this far from those already found, s: closer ones are what their shape lacks.
const APART_S: f64 = 0.3;
/// A reading of so many σ that stands alone is wild: noise makes one of 10⁸.
const WILD: f64 = 5.8;
/// The trimmed mean of fewer periods is moved by one contact.
pub(super) const FEWEST_PERIODS: usize = 3;

/// A log on an even clock whose motion repeats.
pub(super) struct Repeats {
    pub(super) torque_nm: JointSignals,
    /// Joints (0-based) whose torque can be compared.
    pub(super) joints: Vec<usize>,
    /// Samples of the repetitions.
    pub(super) window: Range<usize>,
    /// Samples per period.
    pub(super) period: f64,
    pub(super) rate_hz: f64,
    /// What drifting friction does; not asked for where nothing deviates anyway.
    pub(super) drift: Option<FrictionDrift>,
}

/// Where a bump may be.
pub(super) struct Candidate {
    /// Sample of the window.
    centre: usize,
    length_s: f64,
    /// Which of the joints that are compared felt it.
    felt: Vec<usize>,
    /// Which of them show noise alone.
    quiet: Vec<usize>,
}

impl Candidate {
    /// Its samples in the whole log, and as many beside it: its foot may lie there.
    pub(super) fn samples(&self, repeats: &Repeats) -> Range<usize> {
        let reach = (self.length_s * repeats.rate_hz) as usize + 1;
        let centre = repeats.window.start + self.centre;
        centre.saturating_sub(reach).max(repeats.window.start)
            ..(centre + reach).min(repeats.window.end)
    }
}

impl Repeats {
    /// y(k) minus the trimmed mean of y at the same phase in the other periods, without those that are set `aside`
    /// there if any are left. Of two others their mean is wrong by half of either: y(k) itself counts with them where it
    /// is not set aside.
    pub(super) fn deviation(&self, y: &[f64], k: usize, aside: &[bool]) -> f64 {
        let from_start = (k - self.window.start) as f64;
        let own = (from_start / self.period).floor() as usize;
        let phase = from_start - own as f64 * self.period;
        let periods = (self.window.len() as f64 / self.period).ceil() as usize;
        let at = |period: usize| self.window.start as f64 + phase + period as f64 * self.period;
        let is_recorded = |period: &usize| at(*period) <= (self.window.end - 1) as f64;
        let others: Vec<f64> =
            (0..periods).filter(|p| *p != own && is_recorded(p)).map(at).collect();
        let value = |at: f64| {
            let left = (at.floor() as usize).min(y.len() - 2);
            let u = at - left as f64;
            y[left] * (1.0 - u) + y[left + 1] * u
        };
        let undisturbed = others.iter().filter(|at| !aside[at.floor() as usize]);
        let mut same: Vec<f64> = undisturbed.map(|at| value(*at)).collect();
        if same.is_empty() {
            same = others.iter().map(|at| value(*at)).collect();
        } else if others.len() < FEWEST_PERIODS && !aside[k] {
            same.push(y[k]);
        }
        y[k] - trimmed_mean(&mut same).unwrap_or(y[k])
    }

    /// Deviations of all joints that are compared, without the pushes that are `known` and without drifting friction,
    /// samples of the window.
    fn deviations(&self, aside: &[bool], known: &[Push]) -> JointSignals {
        let joints = &self.joints;
        let mut out = JointSignals::from_fn(joints.len(), self.window.len(), |row, k| {
            let j = joints[row];
            let deviation = self.deviation(self.torque_nm.joint(j), self.window.start + k, aside);
            let t_s = k as f64 / self.rate_hz;
            deviation - known.iter().map(|push| push.torque_nm(j, t_s)).sum::<f64>()
        });
        if let Some(drift) = &self.drift {
            for (row, j) in joints.iter().enumerate() {
                drift.remove(*j, out.joint_mut(row), |k| !aside[self.window.start + k]);
            }
        }
        // Even the softest bump of nine samples is half as high two samples off its top: it does not stand out alone.
        let reach = if SHORTEST_S * self.rate_hz >= 9.0 { 2 } else { 1 };
        (0..joints.len()).for_each(|row| level_wild_values(out.joint_mut(row), reach));
        out
    }

    /// The highest bump that noise would not make, apart from the samples that were `looked_at`.
    pub(super) fn search(
        &self,
        aside: &[bool],
        known: &[Push],
        looked_at: &[Range<usize>],
    ) -> Result<Option<Candidate>, SignalError> {
        let deviation_nm = self.deviations(aside, known);
        let filter = MatchedFilter::new(&deviation_nm, self.rate_hz)?;
        let rows: Vec<usize> = (0..self.joints.len()).collect();
        if rows.is_empty() {
            return Ok(None);
        }
        let apart = (APART_S * self.rate_hz) as usize;
        let mut highest = 1.0;
        let mut best = None;
        for length_s in self.lengths_s() {
            let far = self.far(length_s);
            let far_together = rarity::as_far_in(rows.len(), far);
            let heights = filter.heights(|t_s| bump::bump(ORDINARY, length_s, t_s));
            let noise = Noise::of(&heights);
            let together = noise.felt_by(&rows, &[]);
            let others = |j: usize| [&rows[..j], &rows[j + 1..]].concat();
            let alone: Vec<Felt> = rows.iter().map(|j| noise.felt_by(&[*j], &others(*j))).collect();
            let reach = (0.5 * length_s * self.rate_hz) as usize;
            for centre in reach..self.window.len() - reach {
                let at = self.window.start + centre;
                let samples = at.saturating_sub(reach)..at + reach;
                if looked_at.iter().any(|other| are_near(other, &samples, apart)) {
                    continue;
                }
                let scores = noise.scores(&heights, centre);
                let gain = noise.gain(&scores);
                // What is not so far in all joints is not in any.
                if gain <= (highest * far).powi(2) {
                    continue;
                }
                let as_known = |felt: &Felt| felt.of_known_noise(felt.gain(&scores)).sqrt();
                let alone: Vec<f64> = alone.iter().map(as_known).collect();
                let together = together.of_known_noise(gain).sqrt();
                let [of_one, of_all] = [farthest(&alone) / far, together / far_together];
                if of_one.max(of_all) > highest {
                    highest = of_one.max(of_all);
                    // A joint that shows little of what all show is not quiet.
                    let [felt, quiet] = if of_all > of_one {
                        [rows.clone(), Vec::new()]
                    } else {
                        felt_and_quiet(&scores, &alone)
                    };
                    best = Some(Candidate { centre, length_s, felt, quiet });
                }
            }
        }
        Ok(best)
    }

    /// Lengths of the bumps that are looked for, s.
    fn lengths_s(&self) -> Vec<f64> {
        let longest_s = LONGEST_S.min(LONGEST_OF_PERIOD * self.period / self.rate_hz);
        let shortest_s = SHORTEST_S.max(4.0 / self.rate_hz);
        std::iter::successors(Some(shortest_s), |length_s| Some(LENGTHEN * length_s))
            .take_while(|length_s| *length_s < longest_s)
            .collect()
    }

    /// σ from which on a bump of `length_s` in one joint is a contact.
    fn far(&self, length_s: f64) -> f64 {
        let duration_s = self.window.len() as f64 / self.rate_hz;
        // Each by itself, and all together.
        let tests = if self.joints.len() > 1 { self.joints.len() + 1 } else { 1 };
        rarity::far(length_s, duration_s, self.lengths_s().len(), tests)
    }

    /// What the log knows of the push at `candidate`: where several joints feel it, whose levers change while
    /// the arm moves on, its begin and end are where any of them may see them.
    pub(super) fn weigh(
        &self,
        candidate: &Candidate,
        aside: &[bool],
        known: &[Push],
    ) -> Result<Option<Push>, SignalError> {
        let &Candidate { centre, length_s, .. } = candidate;
        let filter = MatchedFilter::new(&self.deviations(aside, known), self.rate_hz)?;
        let noise = Noise::of(&filter.heights(|t_s| bump::bump(ORDINARY, length_s, t_s)));
        let reach = (0.5 * length_s * self.rate_hz) as usize + 1;
        let centres = centre.saturating_sub(reach)..(centre + reach).min(self.window.len());
        let felt_by = |felt: &[usize]| noise.felt_by(felt, &candidate.quiet);
        let weigh_on =
            |felt: &Felt| bump::weigh(&filter, felt, &self.joints, centres.clone(), length_s);
        let felt = felt_by(&candidate.felt);
        let far = self.far(length_s);
        // What its neighbourhood tells of the noise may make it less than it seemed.
        let is_far = |felt: &Felt, push: &Push| {
            felt.of_known_noise(push.gain) > rarity::as_far_in(felt.count(), far).powi(2)
        };
        let Some(mut all) = weigh_on(&felt).filter(|push| is_far(&felt, push)) else {
            return Ok(None);
        };
        let rows = |push: &Push| -> Vec<usize> {
            let is_felt = |row: &usize| push.is_felt_on(self.joints[*row]);
            candidate.felt.iter().copied().filter(is_felt).collect()
        };
        if candidate.felt.len() > 1 {
            for row in rows(&all) {
                weigh_on(&felt_by(&[row])).iter().for_each(|own| all.reach_over(own));
            }
            // Where they do not show it by themselves the log does not tell that the others did not feel it.
            while let Some(next) = all.next_to_feel() {
                let felt = felt_by(&rows(&all));
                if weigh_on(&felt).is_some_and(|push| is_far(&felt, &push)) {
                    break;
                }
                all.felt.push(next);
            }
        }
        Ok(Some(all))
    }

    /// Whether `push` is nowhere where it is felt more than what rounding leaves of the torque: periods that are alike to the
    /// last digit of a file differ by that alone, and have no noise beside which it would be small: such joints tell nothing.
    pub(super) fn is_rounding(&self, push: &Push) -> bool {
        push.felt_nm().all(|(j, height)| {
            let torque_nm = &self.torque_nm.joint(j)[self.window.clone()];
            let square = torque_nm.iter().map(|t| t * t).sum::<f64>() / torque_nm.len() as f64;
            height.abs() < FLOOR * square.sqrt()
        })
    }

    /// `push` as a contact of the log, whose window begins at `begin_s`.
    pub(super) fn touch(&self, push: &Push, begin_s: f64) -> Touch {
        let shifted = |estimate: &Estimate| Estimate {
            value: begin_s + estimate.value,
            unit: estimate.unit,
            ci95: estimate.ci95.map(|bound| begin_s + bound),
        };
        let sample = |t_s: f64| {
            let from_start = (t_s * self.rate_hz).round().max(0.0) as usize;
            (self.window.start + from_start).min(self.window.end)
        };
        Touch {
            samples: sample(push.start_s.value)..sample(push.end_s.value),
            start_s: shifted(&push.start_s),
            end_s: shifted(&push.end_s),
            peak_nm: push.peak_nm.clone(),
            felt: push.felt_nm().map(|(j, height)| (j + 1, height)).collect(),
            strength: push.gain.sqrt(),
        }
    }
}

/// Puts what stands `reach` samples before and behind in place of values that stand out alone: a reading that went
/// wild, and what resampling makes of it, is over before anything that touches the arm has begun.
fn level_wild_values(y: &mut [f64], reach: usize) {
    let measured = y.to_vec();
    let beside = |k: usize| [measured[k - reach], measured[k + reach]];
    let level = |k: usize| 0.5 * beside(k).iter().sum::<f64>();
    let all = reach..measured.len().saturating_sub(reach);
    let mut changes: Vec<f64> = all.clone().map(|k| (measured[k] - level(k)).abs()).collect();
    // Of three values that know nothing of each other.
    let sigma = robust_sigma(&mut changes) / 1.5f64.sqrt();
    for k in all {
        let size = measured[k].abs();
        if size > WILD * sigma && beside(k).iter().all(|y| y.abs() < 0.5 * size) {
            y[k + 1 - reach..k + reach].fill(level(k));
        }
    }
}

/// Which joints felt a bump with these scores, each by itself and `alone` among all, and which show noise alone.
fn felt_and_quiet(scores: &[f64], alone: &[f64]) -> [Vec<usize>; 2] {
    let limit = FELT_BESIDE.max(FELT_SHARE * farthest(scores));
    let most = (0..alone.len()).max_by(|a, b| alone[*a].total_cmp(&alone[*b]));
    let is_felt = |j: &usize| scores[*j].abs() >= limit || Some(*j) == most;
    let is_quiet = |j: &usize| scores[*j].abs() < FELT_BESIDE && !is_felt(j);
    let joints = 0..scores.len();
    [joints.clone().filter(is_felt).collect(), joints.filter(is_quiet).collect()]
}

fn farthest(scores: &[f64]) -> f64 {
    scores.iter().fold(0.0, |a, z| a.max(z.abs()))
}
