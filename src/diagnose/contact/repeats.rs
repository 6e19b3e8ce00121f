//! The repetitions of a motion compared with each other, and the bumps that one has and the others have not.

use std::ops::Range;

use super::bump::{self, FELT_SHARE, Felt, Noise, ORDINARY, Push};
use super::loudness::Loudness;
use super::moves::Move;
use super::rarity;
use super::{Touch, are_near};
use crate::diagnose::chance;
use crate::diagnose::friction_drift::FrictionDrift;
use crate::diagnose::verdict::Estimate;
use crate::diagnose::whitening::FLOOR;
use crate::median::{robust_sigma, trimmed_mean};
use crate::robot::JointSignals;
use crate::signal::{MatchedFilter, SignalError, other_periods};

/// A joint felt a contact that another one shows by itself if it deviates by so many σ (once in 10⁴ by chance), and by
/// [`FELT_SHARE`] of the joint that felt it most.
const FELT_BESIDE: f64 = 4.0;
/// Shortest bump, s; a collision lasts a tenth of a second.
pub(super) const SHORTEST_S: f64 = 0.1;
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
    /// What is compared: torques, Nm, or angles, rad.
    pub(super) signals: JointSignals,
    /// Their values at a fractional sample.
    pub(super) between_samples: fn(&[f64], f64) -> f64,
    /// Joints (0-based) that can be compared.
    pub(super) joints: Vec<usize>,
    /// Samples of the repetitions.
    pub(super) window: Range<usize>,
    /// Samples per period.
    pub(super) period: f64,
    pub(super) rate_hz: f64,
    /// What drifting friction does; not asked for where nothing deviates anyway.
    pub(super) drift: Option<FrictionDrift>,
    /// Where the arm did not move as it did in the other periods.
    pub(super) moves: Vec<Move>,
}

/// Where a bump may be.
pub(super) struct Candidate {
    /// Sample of the window.
    pub(super) centre: usize,
    pub(super) length_s: f64,
    /// Which of the joints that are compared felt it.
    pub(super) felt: Vec<usize>,
    /// Which of them show noise alone.
    quiet: Vec<usize>,
    /// σ from which on a bump there in one joint is none of noise.
    far: f64,
    /// The same of a bump of its length anywhere in the log.
    far_anywhere: f64,
    /// Whether it is looked for because the arm moved otherwise there: which move it is.
    pub(super) of_move: Option<usize>,
}

/// Where bumps are looked for.
struct Place {
    /// Samples of the window that may be their middle.
    centres: Range<usize>,
    /// Which of the joints that are compared may feel them alone.
    rows: Vec<usize>,
    /// σ from which on one in one joint is none of noise.
    far: f64,
    /// See [`Candidate::of_move`].
    of_move: Option<usize>,
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
        let Range { start, end } = self.window.clone();
        let others = other_periods(k - start, self.period, end - start).map(|at| start as f64 + at);
        let value = |at: f64| (self.between_samples)(y, at);
        let undisturbed = others.clone().filter(|at| !aside[at.floor() as usize]);
        let mut same: Vec<f64> = undisturbed.map(value).collect();
        if same.is_empty() {
            same = others.map(value).collect();
        } else if others.count() < FEWEST_PERIODS && !aside[k] {
            same.push(y[k]);
        }
        y[k] - trimmed_mean(&mut same).unwrap_or(y[k])
    }

    /// Deviations of all joints that are compared, without the pushes that are `known` and without drifting friction,
    /// samples of the window.
    pub(super) fn deviations(&self, aside: &[bool], known: &[Push]) -> JointSignals {
        let joints = &self.joints;
        let mut out = JointSignals::from_fn(joints.len(), self.window.len(), |row, k| {
            let j = joints[row];
            let deviation = self.deviation(self.signals.joint(j), self.window.start + k, aside);
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

    /// The bump that is highest beside what noise would not make, apart from the samples that were `looked_at`; `None` of one below
    /// `least` times that.
    pub(super) fn search(
        &self,
        aside: &[bool],
        known: &[Push],
        looked_at: &[Range<usize>],
        least: f64,
    ) -> Result<Option<Candidate>, SignalError> {
        let deviations = self.deviations(aside, known);
        let filter = MatchedFilter::new(&deviations, self.rate_hz)?;
        let loudness = Loudness::of(&deviations, self.rate_hz);
        let rows: Vec<usize> = (0..self.joints.len()).collect();
        if rows.is_empty() {
            return Ok(None);
        }
        let apart = (APART_S * self.rate_hz) as usize;
        let mut highest = least;
        let mut best = None;
        for length_s in self.lengths_s() {
            let heights = filter.heights(|t_s| bump::bump(ORDINARY, length_s, t_s));
            let noise = Noise::of(&heights);
            let others = |j: usize| [&rows[..j], &rows[j + 1..]].concat();
            let alone_felt: Vec<Felt> =
                rows.iter().map(|j| noise.felt_by(&[*j], &others(*j))).collect();
            let reach = (0.5 * length_s * self.rate_hz) as usize;
            let places = self.looked_through(length_s);
            let far_anywhere = places[0].far;
            for Place { centres, rows: telling, far, of_move } in places {
                let together = noise.felt_by(&telling, &[]);
                let far_together = rarity::as_far_in(telling.len(), far);
                for centre in centres.start.max(reach)..centres.end.min(self.window.len() - reach) {
                    let at = self.window.start + centre;
                    let samples = at.saturating_sub(reach)..at + reach;
                    if looked_at.iter().any(|other| are_near(other, &samples, apart)) {
                        continue;
                    }
                    let scores = noise.scores(&heights, centre);
                    // What is not so far in all joints is not in any.
                    if noise.gain(&scores) <= (highest * far).powi(2) {
                        continue;
                    }
                    let as_known = |felt: &Felt| felt.of_known_noise(felt.gain(&scores)).sqrt();
                    let alone: Vec<f64> = alone_felt.iter().map(as_known).collect();
                    let of_one = telling.iter().map(|j| alone[*j]).fold(0.0, f64::max) / far;
                    let of_all = match telling.len() {
                        1 => 0.0,
                        _ => as_known(&together) / far_together,
                    };
                    // Where it is louder noise makes higher bumps; which of those that it does not make is highest it does not tell.
                    let louder =
                        |row: &usize| loudness.over(*row, centre - reach..centre + reach).powi(2);
                    let beside = |felt: &Felt, louder: f64| {
                        felt.of_known_noise(felt.gain(&scores) / louder).sqrt()
                    };
                    let stands_out = || {
                        telling.iter().any(|j| beside(&alone_felt[*j], louder(j)) > least * far)
                            || telling.len() > 1 && {
                                let loudest = telling.iter().map(louder).fold(1.0, f64::max);
                                beside(&together, loudest) > least * far_together
                            }
                    };
                    if of_one.max(of_all) > highest && stands_out() {
                        highest = of_one.max(of_all);
                        let [mut felt, mut quiet] = felt_and_quiet(&scores, &alone, &telling);
                        if of_all > of_one {
                            // A joint that shows little of what all show is not quiet.
                            felt.extend(&telling);
                            felt.sort_unstable();
                            felt.dedup();
                            quiet.clear();
                        }
                        best = Some(Candidate {
                            centre,
                            length_s,
                            felt,
                            quiet,
                            far,
                            far_anywhere,
                            of_move,
                        });
                    }
                }
            }
        }
        Ok(best)
    }

    /// Where bumps of `length_s` are looked for on which joints: first all along the log on all of them, and where the arm moved
    /// otherwise on those that did. Noise of the torques does not choose where the angles differ, as long as no feedback brings it
    /// into them: it is asked there only whether a torque goes with a move that noise did not make.
    fn looked_through(&self, length_s: f64) -> Vec<Place> {
        let all = 0..self.joints.len();
        let everywhere = Place {
            centres: 0..self.window.len(),
            rows: all.clone().collect(),
            far: 0.0,
            of_move: None,
        };
        let of_move = |(number, own): (usize, &Move)| Place {
            centres: own.centres.clone(),
            rows: all.clone().filter(|row| own.joints.contains(&self.joints[*row])).collect(),
            far: 0.0,
            of_move: Some(number),
        };
        let mut where_moved: Vec<Place> = self.moves.iter().enumerate().map(of_move).collect();
        where_moved.retain(|place| !place.rows.is_empty());
        let mut everywhere = vec![everywhere];
        let lengths = self.lengths_s().len();
        let chances = [chance::CONTACT, chance::CONTACT_WHERE_MOVED];
        for (group, chance) in [&mut everywhere, &mut where_moved].into_iter().zip(chances) {
            let bumps = group.iter().map(|place| {
                // Each joint by itself, and all together.
                let ways = if place.rows.len() > 1 { place.rows.len() + 1 } else { 1 };
                let duration_s = place.centres.len() as f64 / self.rate_hz;
                rarity::bumps(length_s, duration_s, lengths * ways)
            });
            let far = rarity::far(bumps.sum(), chance);
            group.iter_mut().for_each(|place| place.far = far);
        }
        everywhere.append(&mut where_moved);
        everywhere
    }

    /// Lengths of the bumps that are looked for, s.
    fn lengths_s(&self) -> Vec<f64> {
        let longest_s = LONGEST_S.min(LONGEST_OF_PERIOD * self.period / self.rate_hz);
        let shortest_s = SHORTEST_S.max(4.0 / self.rate_hz);
        std::iter::successors(Some(shortest_s), |length_s| Some(LENGTHEN * length_s))
            .take_while(|length_s| *length_s < longest_s)
            .collect()
    }

    /// What the log knows of the push at `candidate`: where several joints feel it, whose levers change while
    /// the arm moves on, its begin and end are where any of them may see them.
    pub(super) fn weigh(
        &self,
        candidate: &Candidate,
        aside: &[bool],
        known: &[Push],
    ) -> Result<Option<Push>, SignalError> {
        let &Candidate { centre, length_s, far, far_anywhere, .. } = candidate;
        let deviations = self.deviations(aside, known);
        let filter = MatchedFilter::new(&deviations, self.rate_hz)?;
        let loudness = Loudness::of(&deviations, self.rate_hz);
        let noise = Noise::of(&filter.heights(|t_s| bump::bump(ORDINARY, length_s, t_s)));
        let reach = (0.5 * length_s * self.rate_hz) as usize + 1;
        let centres = centre.saturating_sub(reach)..(centre + reach).min(self.window.len());
        let felt_by = |felt: &[usize]| noise.felt_by(felt, &candidate.quiet);
        let weigh_on =
            |felt: &Felt| bump::weigh(&filter, felt, &self.joints, centres.clone(), length_s);
        let felt = felt_by(&candidate.felt);
        // What its neighbourhood tells of the noise may make it less than it seemed.
        let is_far = |felt: &Felt, push: &Push, far: f64| {
            let [start, end] =
                [&push.start_s, &push.end_s].map(|at| (at.value * self.rate_hz) as usize);
            let louder = felt.felt().iter().map(|row| loudness.over(*row, start..end));
            let gain = push.gain / louder.fold(1.0, f64::max).powi(2);
            felt.of_known_noise(gain) > rarity::as_far_in(felt.count(), far).powi(2)
        };
        let Some(mut all) = weigh_on(&felt).filter(|push| is_far(&felt, push, far)) else {
            return Ok(None);
        };
        if !is_far(&felt, &all, far_anywhere) {
            all.confidence = 1.0 - chance::CONTACT_WHERE_MOVED;
        }
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
                if weigh_on(&felt).is_some_and(|push| is_far(&felt, &push, far)) {
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
            let torque_nm = &self.signals.joint(j)[self.window.clone()];
            let square = torque_nm.iter().map(|t| t * t).sum::<f64>() / torque_nm.len() as f64;
            height.abs() < FLOOR * square.sqrt()
        })
    }

    /// `push` at `candidate` as a contact of the log, whose window begins at `begin_s`.
    pub(super) fn touch(&self, candidate: &Candidate, push: &Push, begin_s: f64) -> Touch {
        let here = self.moves.iter().filter(|own| own.centres.contains(&candidate.centre));
        let mut moved = here.flat_map(|own| &own.joints);
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
            peak_joint: push.peak_joint + 1,
            felt: push.felt_nm().map(|(j, height)| (j + 1, height)).collect(),
            strength: push.gain.sqrt(),
            moved_others: moved.any(|j| !push.is_felt_on(*j)),
            confidence: push.confidence,
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

/// Which joints felt a bump with these scores, each by itself and `alone` among all, and which show noise alone; the one of those
/// `telling` that shows most of it felt it.
fn felt_and_quiet(scores: &[f64], alone: &[f64], telling: &[usize]) -> [Vec<usize>; 2] {
    let limit = FELT_BESIDE.max(FELT_SHARE * farthest(scores));
    let most = telling.iter().max_by(|a, b| alone[**a].total_cmp(&alone[**b]));
    let is_felt = |j: &usize| scores[*j].abs() >= limit || Some(j) == most;
    let is_quiet = |j: &usize| scores[*j].abs() < FELT_BESIDE && !is_felt(j);
    let joints = 0..scores.len();
    [joints.clone().filter(is_felt).collect(), joints.filter(is_quiet).collect()]
}

fn farthest(scores: &[f64]) -> f64 {
    scores.iter().fold(0.0, |a, z| a.max(z.abs()))
}
