//! How far a bump rises above noise, and on which joints it is felt.

use super::bump::{self, FELT_SHARE, Felt, Noise, ORDINARY};
use super::loudness::Loudness;
use crate::signal::{Heights, MatchedFilter};

/// A joint felt a contact that is found on another joint alone if it deviates by this many σ (once in 10⁴ by chance),
/// and by [`FELT_SHARE`] of the σ of the joint that felt it most.
const FELT_BESIDE: f64 = 4.0;

/// The bumps of one length, with their middle at any sample.
pub(super) struct Bumps {
    pub(super) length_s: f64,
    /// Half of the length, in samples.
    pub(super) reach: usize,
    /// Their heights.
    heights: Heights,
    /// Noise of these heights.
    noise: Noise,
}

impl Bumps {
    /// The bumps of `length_s` in the signals of `filter`.
    pub(super) fn of(filter: &MatchedFilter, length_s: f64) -> Self {
        let heights = filter.heights(|t_s| bump::bump(ORDINARY, length_s, t_s));
        let noise = Noise::of(&heights);
        Self { length_s, reach: (0.5 * length_s * filter.rate_hz()) as usize, heights, noise }
    }

    /// For each joint, the noise model for bumps that it alone feels.
    pub(super) fn alone(&self) -> Vec<Felt<'_>> {
        let rows: Vec<usize> = (0..self.heights.height.joints()).collect();
        let others = |j: usize| [&rows[..j], &rows[j + 1..]].concat();
        rows.iter().map(|j| self.noise.felt_by(&[*j], &others(*j))).collect()
    }

    /// The noise model for bumps that the joints `rows` feel together.
    pub(super) fn together(&self, rows: &[usize]) -> Felt<'_> {
        self.noise.felt_by(rows, &[])
    }
}

/// Scores the bumps of one length at one place.
pub(super) struct Scoring<'a> {
    pub(super) bumps: &'a Bumps,
    /// See [`Bumps::alone`].
    pub(super) alone: &'a [Felt<'a>],
    /// Indices, among the compared joints, of those that may feel a bump alone.
    pub(super) telling: &'a [usize],
    /// The noise model for bumps that these joints feel together.
    pub(super) together: Felt<'a>,
    /// Height in σ from which on a bump in one joint is not noise.
    pub(super) far: f64,
    /// The same for a bump in all of `telling`.
    pub(super) far_together: f64,
    pub(super) loudness: &'a Loudness,
    /// Least height relative to these thresholds.
    pub(super) least: f64,
}

/// A bump with its score.
pub(super) struct Scored {
    /// Height relative to the threshold for noise.
    pub(super) height: f64,
    /// Indices, among the compared joints, of those that felt it.
    pub(super) felt: Vec<usize>,
    /// Indices of those that show noise alone.
    pub(super) quiet: Vec<usize>,
}

impl Scoring<'_> {
    /// The bump with its middle at the sample `centre`; `None` if it is no higher than `highest`, relative to the
    /// threshold, or does not stand out of the noise around it.
    pub(super) fn above(&self, highest: f64, centre: usize) -> Option<Scored> {
        let noise = &self.bumps.noise;
        let scores = noise.scores(&self.bumps.heights, centre);
        // A bump that is below the bound in all joints together is below it in each.
        if noise.gain(&scores) <= (highest * self.far).powi(2) {
            return None;
        }
        let as_known = |felt: &Felt| felt.of_known_noise(felt.gain(&scores)).sqrt();
        let alone: Vec<f64> = self.alone.iter().map(as_known).collect();
        let of_one = self.telling.iter().map(|j| alone[*j]).fold(0.0, f64::max) / self.far;
        let of_all = match self.telling.len() {
            1 => 0.0,
            _ => as_known(&self.together) / self.far_together,
        };
        let height = of_one.max(of_all);
        (height > highest && self.stands_out(&scores, centre)).then(|| {
            let [mut felt, mut quiet] = felt_and_quiet(&scores, &alone, self.telling);
            if of_all > of_one {
                // A joint that shows little of a push that all joints show together is not quiet.
                felt.extend(self.telling);
                felt.sort_unstable();
                felt.dedup();
                quiet.clear();
            }
            Scored { height, felt, quiet }
        })
    }

    /// Whether a bump with these scores is significant beside the noise around its middle, the sample `centre`.
    ///
    /// Louder noise makes higher bumps. The loudness decides whether a bump is noise, but not which of the significant
    /// bumps is highest.
    fn stands_out(&self, scores: &[f64], centre: usize) -> bool {
        let around = || centre - self.bumps.reach..centre + self.bumps.reach;
        let louder = |row: &usize| self.loudness.over(*row, around()).powi(2);
        let beside =
            |felt: &Felt, louder: f64| felt.of_known_noise(felt.gain(scores) / louder).sqrt();
        let is_far = |row: &usize| beside(&self.alone[*row], louder(row)) > self.least * self.far;
        self.telling.iter().any(is_far)
            || self.telling.len() > 1 && {
                let loudest = self.telling.iter().map(louder).fold(1.0, f64::max);
                beside(&self.together, loudest) > self.least * self.far_together
            }
    }
}

/// Which joints felt a bump with these scores, and which show noise alone. `alone` holds the significance of each joint
/// with the others taken as quiet; among those `telling`, the joint with the largest felt it in any case.
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
