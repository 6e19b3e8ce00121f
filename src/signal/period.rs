//! The period of a motion: the part of a log that repeats after a lag of some samples, and the length of the period,
//! refined to fractions of a sample. What counts as repeated follows from the log.
//!
//! 1. The difference |q(k + L) − q(k)|² after the lag L is judged block by block. A block repeats if its mean square is
//!    below what noise, half a sample of slip and one percent of the motion's amplitude allow. The longest run of such
//!    blocks is the repeated part; run-in and rest fall outside it.
//! 2. The run is cut again where a block exceeds four times the upper quartile of the run's own blocks, so that the
//!    limit follows from the noise of this log. If a period is no whole number of samples, half a sample of slip is far
//!    above that noise in the few blocks of a fast move, and nothing in those of a pause. The run is therefore also cut
//!    with the slip taken out, and that run counts where it is longer by a period.
//! 3. The period is refined by the interpolated lag between the first period and the last.

use std::ops::Range;

use super::noise::block_noise;
use super::slip::{add_squares_without_slip, slip};
use crate::cumulative_sum::accumulate;
use crate::median::{median, nearest_quantile};
use crate::robot::JointSignals;

/// Deviation between periods that still counts as repetition, relative to the motion's rms amplitude.
const REPEATS_WITHIN: f64 = 0.01;
/// Ratio of mean squares that separates blocks that repeat from blocks that do not.
const BLOCK_RATIO: f64 = 4.0;
/// Blocks per period.
const BLOCKS: usize = 64;
/// A stretch in which the angles vary by less than this share of their variance along the log is mostly rest.
const MOVING_SHARE: f64 = 0.25;
/// Number of samples over which the ends of the repeated part are judged.
const EDGE_SAMPLES: usize = 4;
/// Slip over the whole log that always counts as none, in samples.
const NO_SLIP: f64 = 0.01;
/// A lag that is off by this many samples is not the nearest to a period, and the slip no small one.
const LARGEST_SLIP: f64 = 1.0;

/// A repeated motion inside a log.
#[derive(Debug, Clone, PartialEq)]
pub struct Period {
    /// Length of the period, in whole samples (nearest).
    pub samples: usize,
    /// Length of the period in samples, interpolated.
    pub refined_samples: f64,
    /// Whether the period is a whole number of samples: the slip between `samples` and `refined_samples`, added up over
    /// the log, is hidden in the scatter between periods (or is below a hundredth of a sample). Only then may periods
    /// be folded onto each other.
    pub is_whole: bool,
    /// Number of whole periods in `window`.
    pub periods: usize,
    /// Range of samples that holds the whole periods; `periods` × `samples` long.
    pub window: Range<usize>,
}

/// The angles of a log and the tolerances derived from them.
pub(super) struct Record<'a> {
    q_rad: &'a JointSignals,
    /// Variance of q, summed over joints, rad².
    variance: f64,
    /// Mean square of the step from one sample to the next, summed over joints, rad².
    step_square: f64,
    /// Σ |q(i + 1) − q(i)|² over the joints and over the samples i before each k, rad².
    steps: Vec<f64>,
    /// Mean square difference up to which positions count as repeated, rad².
    tolerance: f64,
}

impl<'a> Record<'a> {
    pub(super) fn new(q_rad: &'a JointSignals) -> Self {
        let n = q_rad.samples() as f64;
        let (mut variance, mut step_square, mut noise) = (0.0, 0.0, 0.0);
        let mut steps = vec![0.0; q_rad.samples()];
        for j in 0..q_rad.joints() {
            let q = q_rad.joint(j);
            for (step, w) in steps[1..].iter_mut().zip(q.windows(2)) {
                *step += (w[1] - w[0]).powi(2);
            }
            variance += variance_of(q);
            step_square += q.windows(2).map(|w| (w[1] - w[0]).powi(2)).sum::<f64>() / (n - 1.0);
            noise += nearest_quantile(&block_noise(q, 32), 0.5).powi(2);
        }
        let amplitude = REPEATS_WITHIN.powi(2) * variance;
        let tolerance = BLOCK_RATIO * (2.0 * noise + 0.25 * step_square + amplitude);
        accumulate(&mut steps);
        Self { q_rad, variance, step_square, steps, tolerance }
    }

    /// Whether no angle ever changes. The variance of such a log need not be zero: its mean is rounded.
    pub(super) fn is_at_rest(&self) -> bool {
        self.step_square <= 0.0
    }

    /// Mean of |q(k + lag) − q(k)|², summed over joints, over the samples k = from, from + every, … of `range`.
    fn difference(&self, range: &Range<usize>, lag: usize, every: usize) -> f64 {
        let later = range.start + lag..range.end + lag;
        let sum: f64 = (0..self.q_rad.joints())
            .map(|j| {
                let q = self.q_rad.joint(j);
                let pairs = q[range.clone()].iter().zip(&q[later.clone()]).step_by(every);
                pairs.map(|(now, then)| (then - now) * (then - now)).sum::<f64>()
            })
            .sum();
        sum / range.len().div_ceil(every) as f64
    }

    /// Cumulative sums of |q(k + lag) − q(k)|² over joints: entry k sums all samples before k.
    fn sum_differences(&self, lag: usize, sums: &mut Vec<f64>) {
        sums.clear();
        sums.resize(self.q_rad.samples() - lag + 1, 0.0);
        for j in 0..self.q_rad.joints() {
            let q = self.q_rad.joint(j);
            for (sum, (now, then)) in sums[1..].iter_mut().zip(q.iter().zip(&q[lag..])) {
                *sum += (then - now) * (then - now);
            }
        }
        accumulate(sums);
    }

    /// [`Self::sum_differences`] of what is left of the differences without a slip of `slip` samples.
    fn sum_differences_without(&self, slip: f64, lag: usize, sums: &mut Vec<f64>) {
        sums.clear();
        sums.resize(self.q_rad.samples() - lag + 1, 0.0);
        add_squares_without_slip(self.q_rad, lag, slip, &mut sums[1..]);
        accumulate(sums);
    }

    /// How much positions differ after `lag` samples: the median of block means of the square, rad², over the blocks in
    /// which the arm is at least as fast as on average. Where it rests, no lag is better than others. Each mean is over
    /// every `every`-th sample of its block.
    pub(super) fn difference_of_fast(&self, lag: usize, every: usize) -> f64 {
        let all = || blocks(self.q_rad.samples() - lag, lag / BLOCKS);
        let mean = |block: Range<usize>| self.difference(&block, lag, every);
        let mut means: Vec<f64> = all().filter(|block| self.is_fast(block)).map(mean).collect();
        if means.is_empty() {
            means = all().map(mean).collect();
        }
        let middle = means.len() / 2;
        *means.select_nth_unstable_by(middle, f64::total_cmp).1
    }

    /// Whether the arm is at least as fast in the samples `block` as on average.
    fn is_fast(&self, block: &Range<usize>) -> bool {
        let square = self.steps[block.end] - self.steps[block.start];
        square >= self.step_square * block.len() as f64
    }

    /// The period of about `lag` samples in the longest run that repeats after as many; `None` if no stretch of two
    /// periods or more does. `sums` is working memory.
    pub(super) fn repeats_at(&self, lag: usize, sums: &mut Vec<f64>) -> Option<Period> {
        let pairs = self.q_rad.samples() - lag;
        self.sum_differences(lag, sums);
        let mean = |r: &Range<usize>| (sums[r.end] - sums[r.start]) / r.len() as f64;
        let blocks: Vec<(Range<usize>, f64)> = blocks(pairs, lag / BLOCKS)
            .map(|b| {
                let m = mean(&b);
                (b, m)
            })
            .collect();

        let rough = self.longest_run(&blocks, self.tolerance, lag)?;
        let within: Vec<Range<usize>> = blocks
            .into_iter()
            .map(|(b, _)| b)
            .filter(|b| b.start >= rough.start && b.end <= rough.end)
            .collect();
        let mut run = self.own_run(&within, lag, sums);
        let slip = slip(self.q_rad, &rough, lag);
        if (NO_SLIP..LARGEST_SLIP).contains(&slip.abs()) {
            let with_slip = self.level_of_fast(&within, sums);
            self.sum_differences_without(slip, lag, sums);
            let without_slip = self.own_run(&within, lag, sums);
            let length =
                |run: &Option<Range<usize>>| run.as_ref().map_or(0, ExactSizeIterator::len);
            // What does not repeat in a few blocks looks like a slip, which all others then have.
            let is_better = self.level_of_fast(&within, sums) < with_slip;
            if is_better && length(&without_slip) >= length(&run) + lag {
                run = without_slip;
            } else {
                self.sum_differences(lag, sums);
            }
        }
        let run = run?;

        let periods = (run.len() + lag) / lag;
        let slack = run.len() + lag - periods * lag;
        let pairs_used = (periods - 1) * lag;
        let start = (run.start..=run.start + slack).min_by(|a, b| {
            let cost = |s: usize| sums[s + pairs_used] - sums[s];
            cost(*a).total_cmp(&cost(*b))
        })?;
        let window = start..start + periods * lag;
        let (refined_samples, scatter_square) = self.refine(&window, lag, periods);
        let slip = (refined_samples - lag as f64).abs() * (periods - 1) as f64;
        let hidden = (scatter_square / self.step_square).sqrt().max(NO_SLIP);
        Some(Period { samples: lag, refined_samples, is_whole: slip <= hidden, periods, window })
    }

    /// Median of the means of what `sums` adds up over those of `blocks` in which the arm is fast; zero without one.
    fn level_of_fast(&self, blocks: &[Range<usize>], sums: &[f64]) -> f64 {
        let mean = |r: &Range<usize>| (sums[r.end] - sums[r.start]) / r.len() as f64;
        let mut levels: Vec<f64> = blocks.iter().filter(|b| self.is_fast(b)).map(mean).collect();
        median(&mut levels).unwrap_or(0.0)
    }

    /// The longest run among neighbouring `blocks` that is below the limit which follows from these blocks, and the
    /// samples beside it that are as well.
    fn own_run(&self, blocks: &[Range<usize>], lag: usize, sums: &[f64]) -> Option<Range<usize>> {
        let mean = |r: &Range<usize>| (sums[r.end] - sums[r.start]) / r.len() as f64;
        let blocks: Vec<(Range<usize>, f64)> =
            blocks.iter().map(|b| (b.clone(), mean(b))).collect();
        let mut levels: Vec<f64> = blocks.iter().map(|(_, m)| *m).collect();
        levels.sort_by(f64::total_cmp);
        let rounding = 1e-10 * self.variance;
        let own = (BLOCK_RATIO * nearest_quantile(&levels, 0.75)).max(rounding);
        Some(widened(self.longest_run(&blocks, own, lag)?, own, sums))
    }

    /// Longest run of neighbouring blocks below `limit` that is at least one lag long (hence covers two periods of the
    /// log) and in which the arm really moves.
    fn longest_run(
        &self,
        blocks: &[(Range<usize>, f64)],
        limit: f64,
        lag: usize,
    ) -> Option<Range<usize>> {
        blocks
            .chunk_by(|a, b| (a.1 <= limit) == (b.1 <= limit))
            .filter(|run| run[0].1 <= limit)
            .filter_map(|run| Some(run.first()?.0.start..run.last()?.0.end))
            .filter(|run| run.len() >= lag && self.moves(run.start..run.end + lag))
            .max_by_key(|run| run.len())
    }

    /// Whether a stretch holds a good part of the log's motion; a stretch at rest would repeat at any lag.
    fn moves(&self, stretch: Range<usize>) -> bool {
        let variance: f64 = (0..self.q_rad.joints())
            .map(|j| variance_of(&self.q_rad.joint(j)[stretch.clone()]))
            .sum();
        variance > MOVING_SHARE * self.variance
    }

    /// Refines the period from the shift that maps the first period of `window` onto its last; returns it with the mean
    /// square that no shift removes.
    ///
    /// The period may differ from `lag` by half a sample. If that could add up to a large part of a period over all
    /// periods, a first estimate uses so few of them that it cannot.
    fn refine(&self, window: &Range<usize>, lag: usize, periods: usize) -> (f64, f64) {
        let few = periods.min(lag / 4);
        let reach = few.div_ceil(2) + 1;
        let Some(rough) = self.refined_over(window, lag, few, (few - 1) * lag, reach) else {
            return (lag as f64, 0.0);
        };
        if few == periods {
            return rough;
        }
        let far = (rough.0 * (periods - 1) as f64).round() as usize;
        self.refined_over(window, lag, periods, far, periods.div_ceil(few) + 1).unwrap_or(rough)
    }

    /// [`Self::refine`] from the shifts within `reach` of `far`, at which the first of `periods` periods falls onto the
    /// last. The minimum is that of the parabola through the three best shifts. `None` if too few samples follow the
    /// window.
    fn refined_over(
        &self,
        window: &Range<usize>,
        lag: usize,
        periods: usize,
        far: usize,
        reach: usize,
    ) -> Option<(f64, f64)> {
        let (from, to) = (far.saturating_sub(reach), far + reach);
        let last = (window.start + lag).min(self.q_rad.samples().saturating_sub(to));
        if last < window.start + lag / 2 {
            return None;
        }
        let costs: Vec<f64> =
            (from..=to).map(|shift| self.difference(&(window.start..last), shift, 1)).collect();
        let inner = 1..costs.len() - 1;
        let i = inner.min_by(|a, b| costs[*a].total_cmp(&costs[*b]))?;
        let (left, middle, right) = (costs[i - 1], costs[i], costs[i + 1]);
        let bend = left - 2.0 * middle + right;
        let shift = if bend > 0.0 { (0.5 * (left - right) / bend).clamp(-1.0, 1.0) } else { 0.0 };
        let residue = (middle - 0.5 * bend * shift * shift).max(0.0);
        Some((((from + i) as f64 + shift) / (periods - 1) as f64, residue))
    }
}

/// Extends the run sample by sample at both ends, as long as the mean over the next [`EDGE_SAMPLES`] stays below
/// `limit`: blocks end at arbitrary places, periods do not.
fn widened(run: Range<usize>, limit: f64, sums: &[f64]) -> Range<usize> {
    let pairs = sums.len() - 1;
    let below = |from: usize| sums[from + EDGE_SAMPLES] - sums[from] <= limit * EDGE_SAMPLES as f64;
    let Range { mut start, mut end } = run;
    while start > 0 && below(start - 1) {
        start -= 1;
    }
    while end < pairs && below(end + 1 - EDGE_SAMPLES) {
        end += 1;
    }
    start..end
}

/// Splits 0..count into blocks of `length` (at least 8); the last takes the remainder.
fn blocks(count: usize, length: usize) -> impl Iterator<Item = Range<usize>> {
    let length = length.max(8).min(count.max(1));
    let full = count / length;
    (0..full).map(move |b| {
        let end = if b + 1 == full { count } else { (b + 1) * length };
        b * length..end
    })
}

/// Mean square about the mean.
pub fn variance_of(y: &[f64]) -> f64 {
    let n = y.len() as f64;
    let mean = y.iter().sum::<f64>() / n;
    y.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / n
}

#[cfg(test)]
mod tests {
    use crate::robot::JointSignals;
    use crate::signal::find_period;
    use crate::signal::repeated_motions::{minimum_jerk, moves_with_pauses, smooth_periods};
    use rand::{SeedableRng, rngs::ChaCha8Rng};
    use rand_distr::{Distribution, StandardNormal};

    #[test]
    fn whole_periods_are_found_behind_a_run_in_and_between_rests() {
        for (sigma, run_in, rest, seed) in [
            (2e-5, 0, 0, 1),
            (2e-5, 600, 0, 2),
            (2e-5, 300, 250, 3),
            (0.0, 600, 100, 4),
            (1e-3, 50, 0, 5),
        ] {
            let q = smooth_periods(1250.0, 8.0, run_in, rest, sigma, seed);
            let found = find_period(&q).unwrap().expect("eight periods are there");
            assert_eq!((found.samples, found.is_whole), (1250, true), "{found:?}");
            assert_eq!(found.window.len(), found.samples * found.periods);
            assert!(found.periods >= 7, "{found:?}");
            // Where the run-in still differs, no period may start.
            assert!(found.window.start + 20 >= rest + run_in, "{found:?}");
            assert!(found.window.end <= rest + run_in + 10020, "{found:?}");
            if sigma > 0.0 && rest == 0 {
                assert_eq!(found.periods, 8);
            }
        }
    }

    /// Two hundred periods of 99.6 samples are 80 samples shorter than two hundred of 100.
    #[test]
    fn many_short_periods_show_what_each_is_off() {
        for (period, whole) in [(99.6, false), (124.7, false), (100.0, true)] {
            let found = find_period(&smooth_periods(period, 200.0, 0, 0, 2e-5, 6))
                .unwrap()
                .expect("periods");
            assert_eq!(found.is_whole, whole, "{found:?}");
            assert!((found.refined_samples - period).abs() < 1e-3, "{found:?}");
        }
    }

    #[test]
    fn a_period_between_samples_is_reported_as_such() {
        let found =
            find_period(&smooth_periods(1000.3, 6.0, 200, 0, 2e-5, 10)).unwrap().expect("periodic");
        assert_eq!((found.samples, found.is_whole), (1000, false), "{found:?}");
        assert!((found.refined_samples - 1000.3).abs() < 0.01, "{found:?}");
    }

    /// Cycles of moves of six joints with pauses for half of the time or three quarters. The slip, by a part of a
    /// sample, is far above the noise in every move.
    #[test]
    fn cycles_with_pauses_are_found_between_samples() {
        let cycles = [(1371.25, 1371, false), (2742.4, 2742, false), (1371.0, 1371, true)];
        let each = cycles.into_iter().flat_map(|cycle| [(cycle, 0.12), (cycle, 0.06)]);
        for ((period, samples, whole), moving) in each {
            let mut rng = ChaCha8Rng::seed_from_u64(13);
            let q = JointSignals::from_fn(6, (6.2 * period) as usize, |j, k| {
                let noise: f64 = StandardNormal.sample(&mut rng);
                moves_with_pauses(j, k as f64 / period, moving, minimum_jerk) + 2e-5 * noise
            });
            let found = find_period(&q).unwrap().expect("six cycles");
            assert_eq!((found.samples, found.is_whole, found.periods), (samples, whole, 6));
            assert!((found.refined_samples - period).abs() < 1e-3, "{found:?}");
        }
    }
}
