//! Compares the repetitions of a motion with each other, and finds the bumps that one has and the others do not.

use std::ops::Range;

use rayon::prelude::*;

use super::bump::{self, Felt, Noise, ORDINARY, Push};
use super::loudness::Loudness;
use super::moves::Move;
use super::rarity;
use super::scoring::{Bumps, Scoring};
use super::{Touch, are_near};
use crate::diagnose::chance;
use crate::diagnose::verdict::Estimate;
use crate::diagnose::whitening::FLOOR;
use crate::identify::FrictionDrift;
use crate::median::{robust_sigma, trimmed_mean};
use crate::robot::JointSignals;
use crate::signal::{MatchedFilter, SignalError, other_periods};

/// Length of the shortest bump, s; a collision lasts a tenth of a second.
pub(super) const SHORTEST_S: f64 = 0.1;
/// Length of the longest bump, s: a hand that leans on the arm.
const LONGEST_S: f64 = 6.0;
/// Ratio of successive lengths: a bump that is too long or short by a factor √√2 still shows 97 % of its height.
const LENGTHEN: f64 = std::f64::consts::SQRT_2;
/// An event longer than this share of a period is no contact, but drifting friction or another motion.
const LONGEST_OF_PERIOD: f64 = 0.5;
/// Distance of further bumps from those already found, s: closer ones are due to the difference in shape.
const APART_S: f64 = 0.3;
/// A single isolated reading of this many σ is wild: noise makes one in 10⁸.
const WILD: f64 = 5.8;
/// Fewest periods: with fewer, one contact moves the trimmed mean.
pub(super) const FEWEST_PERIODS: usize = 3;

/// A log with a periodic motion, on an evenly spaced clock.
pub(super) struct Repeats {
    /// The compared signals: torques, Nm, or angles, rad.
    pub(super) signals: JointSignals,
    /// Interpolation of these signals at a fractional sample.
    pub(super) between_samples: fn(&[f64], f64) -> f64,
    /// Joints (0-based) that are compared.
    pub(super) joints: Vec<usize>,
    /// Samples of the repetitions.
    pub(super) window: Range<usize>,
    /// Samples per period.
    pub(super) period: f64,
    pub(super) rate_hz: f64,
    /// Effect of drifting friction; not computed where nothing deviates anyway.
    pub(super) drift: Option<FrictionDrift>,
    /// Where the arm did not move as in the other periods.
    pub(super) moves: Vec<Move>,
}

/// A possible bump.
pub(super) struct Candidate {
    /// Its middle, a sample of the window.
    pub(super) centre: usize,
    pub(super) length_s: f64,
    /// Indices, among the compared joints, of those that felt it.
    pub(super) felt: Vec<usize>,
    /// Indices of those that show noise alone.
    quiet: Vec<usize>,
    /// Height in σ from which on a bump there, in one joint, is not noise.
    far: f64,
    /// The same for a bump of its length anywhere in the log.
    far_anywhere: f64,
    /// Index of the move because of which it is searched for; `None`: it is searched for everywhere.
    pub(super) of_move: Option<usize>,
}

/// A place where bumps are searched for.
struct Place {
    /// Samples of the window that may be the middle of a bump.
    centres: Range<usize>,
    /// Indices, among the compared joints, of those that may feel a bump alone.
    rows: Vec<usize>,
    /// Height in σ from which on a bump in one joint is not noise.
    far: f64,
    /// See [`Candidate::of_move`].
    of_move: Option<usize>,
}

impl Candidate {
    /// Its samples in the whole log, with as many on either side, where its foot may lie.
    pub(super) fn samples(&self, repeats: &Repeats) -> Range<usize> {
        let reach = (self.length_s * repeats.rate_hz) as usize + 1;
        let centre = repeats.window.start + self.centre;
        centre.saturating_sub(reach).max(repeats.window.start)
            ..(centre + reach).min(repeats.window.end)
    }
}

impl Repeats {
    /// y(k) minus the trimmed mean of y at the same phase in the other periods. Samples that are set `aside` are
    /// excluded from the mean, if any others are left. With only two other periods, an error of either one enters the
    /// mean by half; y(k) itself is then included where it is not set aside.
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

    /// Deviations of all compared joints at the samples of the window, without the `known` pushes and without drifting
    /// friction.
    pub(super) fn deviations(&self, aside: &[bool], known: &[Push]) -> JointSignals {
        // Even the softest bump of nine samples is still half as high two samples from its top, so that it is not an
        // isolated value.
        let reach = if SHORTEST_S * self.rate_hz >= 9.0 { 2 } else { 1 };
        let of_joint = |&j: &usize| {
            let deviation = |k: usize| {
                let deviation = self.deviation(self.signals.joint(j), self.window.start + k, aside);
                let t_s = k as f64 / self.rate_hz;
                deviation - known.iter().map(|push| push.torque_nm(j, t_s)).sum::<f64>()
            };
            let mut out: Vec<f64> = (0..self.window.len()).map(deviation).collect();
            if let Some(drift) = &self.drift {
                drift.remove(j, &mut out, |k| !aside[self.window.start + k]);
            }
            level_wild_values(&mut out, reach);
            out
        };
        let rows: Vec<Vec<f64>> = self.joints.par_iter().map(of_joint).collect();
        JointSignals::from_fn(rows.len(), self.window.len(), |row, k| rows[row][k])
    }

    /// Finds the bump that is highest relative to the threshold for noise, apart from the samples `looked_at`; `None`
    /// if all are below `least` times the threshold.
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
        if self.joints.is_empty() {
            return Ok(None);
        }
        let lengths = self.lengths_s().into_par_iter().with_max_len(1);
        let of_lengths: Vec<Bumps> = lengths.map(|length_s| Bumps::of(&filter, length_s)).collect();
        let mut highest = least;
        let mut best = None;
        for bumps in of_lengths {
            let alone = bumps.alone();
            let places = self.looked_through(bumps.length_s);
            let far_anywhere = places[0].far;
            for place in places {
                let scoring = Scoring {
                    bumps: &bumps,
                    alone: &alone,
                    telling: &place.rows,
                    together: bumps.together(&place.rows),
                    far: place.far,
                    far_together: rarity::as_far_in(place.rows.len(), place.far),
                    loudness: &loudness,
                    least,
                };
                for centre in self.centres(&place, bumps.reach, looked_at) {
                    let Some(found) = scoring.above(highest, centre) else { continue };
                    highest = found.height;
                    best = Some(Candidate {
                        centre,
                        length_s: bumps.length_s,
                        felt: found.felt,
                        quiet: found.quiet,
                        far: place.far,
                        far_anywhere,
                        of_move: place.of_move,
                    });
                }
            }
        }
        Ok(best)
    }

    /// Samples of the window, in `place`, that may be the middle of a bump with `reach` samples on either side, apart
    /// from the samples `looked_at`.
    fn centres(
        &self,
        place: &Place,
        reach: usize,
        looked_at: &[Range<usize>],
    ) -> impl Iterator<Item = usize> {
        let apart = (APART_S * self.rate_hz) as usize;
        let is_apart = move |centre: &usize| {
            let at = self.window.start + centre;
            let samples = at.saturating_sub(reach)..at + reach;
            !looked_at.iter().any(|other| are_near(other, &samples, apart))
        };
        let Range { start, end } = place.centres;
        (start.max(reach)..end.min(self.window.len() - reach)).filter(is_apart)
    }

    /// Places and joints where bumps of `length_s` are searched for: first the whole log on all joints, then where the
    /// arm moved differently, on the joints that did.
    ///
    /// Noise of the torques does not influence where the angles differ, as long as no feedback couples the two. At such
    /// a place, the only question is therefore whether a torque goes with a move that noise did not make.
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
                // Each joint alone, and all together.
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

    /// Lengths of the bumps that are searched for, s.
    fn lengths_s(&self) -> Vec<f64> {
        let longest_s = LONGEST_S.min(LONGEST_OF_PERIOD * self.period / self.rate_hz);
        let shortest_s = SHORTEST_S.max(4.0 / self.rate_hz);
        std::iter::successors(Some(shortest_s), |length_s| Some(LENGTHEN * length_s))
            .take_while(|length_s| *length_s < longest_s)
            .collect()
    }

    /// Determines the push at `candidate` as far as the log allows; `None` if it turns out to be noise. Where several
    /// joints feel it, their lever arms change while the arm moves on: the intervals of begin and end then cover those
    /// of every single joint.
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
        // The noise in its neighbourhood may make it less significant than it seemed.
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
            // If the joints that feel the push do not show it significantly by themselves, the log does not exclude
            // that the others felt it.
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

    /// Whether `push` is nowhere larger than the rounding of the torque. Periods that are alike to the last digit of a
    /// file differ only by rounding, and have no noise to compare the push with: such joints tell nothing.
    pub(super) fn is_rounding(&self, push: &Push) -> bool {
        push.felt_nm().all(|(j, height)| {
            let torque_nm = &self.signals.joint(j)[self.window.clone()];
            let square = torque_nm.iter().map(|t| t * t).sum::<f64>() / torque_nm.len() as f64;
            height.abs() < FLOOR * square.sqrt()
        })
    }

    /// Converts `push` at `candidate` to a contact of the log, whose window begins at `begin_s`.
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

/// Replaces isolated values by the mean of the values `reach` samples before and after: a reading that went wild,
/// including its trace after resampling, is over before any real touch of the arm has begun.
fn level_wild_values(y: &mut [f64], reach: usize) {
    let measured = y.to_vec();
    let beside = |k: usize| [measured[k - reach], measured[k + reach]];
    let level = |k: usize| 0.5 * beside(k).iter().sum::<f64>();
    let all = reach..measured.len().saturating_sub(reach);
    let mut changes: Vec<f64> = all.clone().map(|k| (measured[k] - level(k)).abs()).collect();
    // A value less the mean of two independent others has 1.5 times the variance of one.
    let sigma = robust_sigma(&mut changes) / 1.5f64.sqrt();
    for k in all {
        let size = measured[k].abs();
        if size > WILD * sigma && beside(k).iter().all(|y| y.abs() < 0.5 * size) {
            y[k + 1 - reach..k + reach].fill(level(k));
        }
    }
}
