//! Whitening of a single run, whose noise is known only from the fit's residual.

use std::ops::Range;

use crate::diagnose::error::DiagnoseError;
use crate::diagnose::image::{Column, Image};
use crate::identify::covariance;
use crate::identify::{MOVING_RAD_S, Options, Regression, kept_every};
use crate::signal::{Scratch, ZeroPhase};

/// Rows of a single run: the regression's low-pass, then one weight per joint. Only samples in which the joint moves
/// count: at rest, dry friction may take any value between ±Fc.
pub struct RunWhitening {
    filter: ZeroPhase,
    first_sample: usize,
    every: usize,
    rows: usize,
    /// Only every `thin`-th row is tested: after a low-pass, neighbouring rows carry the same information.
    thin: usize,
    weights: Vec<f64>,
    /// Whether a row counts, per joint and row.
    counts: Vec<Vec<bool>>,
    /// Rows per block of time, for tests that allow for autocorrelated noise.
    block_rows: usize,
}

/// Length of the blocks of a single run, s: short, so that there are many of them to test whether an effect is there.
/// Covariances need blocks that are longer than the memory of the noise ([`RunWhitening::TOGETHER`]).
const BLOCK_S: f64 = 1.0;
/// A joint slower than [`MOVING_RAD_S`] for this long, s, stands still.
const REST_S: f64 = 0.25;

impl RunWhitening {
    /// Number of blocks that together are as long as those of identification, which are long enough for a covariance.
    pub const TOGETHER: usize = (covariance::BLOCK_S / BLOCK_S) as usize;

    /// Whitening of a single run, from the standard deviation of its residual per joint, Nm.
    pub fn new(
        regression: &Regression,
        options: &Options,
        sigma_nm: &[f64],
    ) -> Result<Self, DiagnoseError> {
        let rate_hz = regression.prepared.processing.rate_hz;
        let filter = ZeroPhase::new(options.cutoff_hz, options.order, rate_hz)?;
        let rows = regression.problem.samples;
        Ok(Self {
            filter,
            first_sample: regression.first_sample,
            every: regression.every,
            rows,
            thin: kept_every(rate_hz / regression.every as f64, options.cutoff_hz),
            weights: sigma_nm.iter().map(|s| 1.0 / s).collect(),
            counts: Self::moving_rows(regression),
            block_rows: ((BLOCK_S * rate_hz / regression.every as f64) as usize).max(1),
        })
    }

    /// Block of time of every row of an image.
    pub fn blocks(&self) -> Vec<usize> {
        let one_joint: Vec<usize> =
            (0..self.rows).step_by(self.thin).map(|r| r / self.block_rows).collect();
        one_joint.repeat(self.weights.len())
    }

    /// Whether each row of an image counts.
    pub fn counting(&self) -> Vec<bool> {
        self.counts.iter().flat_map(|counts| counts.iter().step_by(self.thin).copied()).collect()
    }

    /// Per joint and row of the regression, whether the joint moves.
    pub fn moving_rows(regression: &Regression) -> Vec<Vec<bool>> {
        let motion = &regression.prepared.motion;
        let rest = (REST_S * regression.prepared.processing.rate_hz).ceil() as usize;
        let rows = 0..regression.problem.samples;
        (0..motion.joints())
            .map(|j| {
                let moves = moving(motion.qd_rad_s.joint(j), rest, rest / 4);
                let at = |r: usize| moves[regression.sample(r)];
                rows.clone().map(at).collect()
            })
            .collect()
    }

    /// Excludes these rows of the regression on all joints.
    pub fn leave_out(&mut self, rows: &[Range<usize>]) {
        for counts in &mut self.counts {
            rows.iter().for_each(|rows| counts[rows.clone()].fill(false));
        }
    }

    /// Whether row `row` of joint `joint` in the regression's time counts (the joint moves).
    pub fn counts(&self, joint: usize, row: usize) -> bool {
        self.counts[joint][row]
    }

    /// `y` in time as the regression sees it: filtered and decimated.
    pub(super) fn filtered(&self, y: &[f64]) -> Vec<f64> {
        let mut filtered = y.to_vec();
        // The run is longer than the filter's memory; otherwise there would be no regression.
        let _ = self.filter.filter_in_place(&mut filtered, &mut Scratch::default());
        filtered
            .iter()
            .skip(self.first_sample)
            .step_by(self.every)
            .take(self.rows)
            .copied()
            .collect()
    }

    /// See [`super::Whitening::image`]; `is_filtered` marks columns that have been through the regression's filter.
    pub(super) fn image(&self, column: &Column, is_filtered: bool) -> Image {
        let rows = self.rows.div_ceil(self.thin);
        let mut mean = vec![0.0; rows * self.weights.len()];
        for (j, y) in &column.parts {
            let filtered = if is_filtered { y.clone() } else { self.filtered(y) };
            let out = &mut mean[j * rows..(j + 1) * rows];
            for (k, (out, value)) in
                out.iter_mut().zip(filtered.iter().step_by(self.thin)).enumerate()
            {
                if self.counts[*j][k * self.thin] {
                    *out += self.weights[*j] * value;
                }
            }
        }
        Image { mean, contrast: Vec::new() }
    }
}

/// Samples in which a joint moves: neither within a rest of `rest` samples or longer, nor within `margin` samples of
/// one.
fn moving(qd_rad_s: &[f64], rest: usize, margin: usize) -> Vec<bool> {
    let n = qd_rad_s.len();
    let mut moves = vec![true; n];
    let mut start = 0;
    for k in 0..=n {
        if k < n && qd_rad_s[k].abs() < MOVING_RAD_S {
            continue;
        }
        if k - start >= rest {
            moves[start.saturating_sub(margin)..(k + margin).min(n)].fill(false);
        }
        start = k + 1;
    }
    moves
}
