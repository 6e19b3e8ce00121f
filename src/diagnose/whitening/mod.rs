//! The equations of a log in which noise is white: where every test is made.
//!
//! Enters: a regression and the motion of its log. Leaves: for any torque in time its rows, in which noise has variance
//! one, of the mean of periods that repeat and of their differences, or of the samples of a single run in which joints
//! move.

mod coherence;
mod mean_noise;
mod periods;
mod repeating;
mod run;
mod scatter;
mod steps;

pub use periods::PeriodWhitening;
pub use repeating::RepeatingNoise;
pub use run::RunWhitening;
pub use scatter::FLOOR;

use super::image::{Column, Image};
use crate::robot::JointSignals;

/// From torques in time to whitened rows.
pub enum Whitening {
    /// A motion that repeats: noise known from the scatter between periods.
    Periods(Box<PeriodWhitening>),
    /// A single run: rows of moving samples, divided by the scatter of the fit's residual.
    Run(RunWhitening),
}

impl Whitening {
    /// Rows of a torque signal given in time.
    pub fn image(&self, column: &Column) -> Image {
        match self {
            Self::Periods(periods) => periods.image(column),
            Self::Run(run) => run.image(column, false),
        }
    }

    /// [`Self::image`] of all of `columns`, which costs less than one by one.
    pub fn images<'c>(&self, columns: impl Iterator<Item = &'c Column>) -> Vec<Image> {
        match self {
            Self::Periods(periods) => periods.images(columns),
            Self::Run(run) => columns.map(|column| run.image(column, false)).collect(),
        }
    }

    /// Rows of a column of the regression, which has been through its filter.
    pub fn regression_image(&self, column: &Column) -> Image {
        match self {
            Self::Periods(periods) => periods.image(column),
            Self::Run(run) => run.image(column, true),
        }
    }

    /// Wᵀr in time: its correlation with a torque signal is that signal's score. `None` for a single run.
    pub fn in_time(&self, rows: &Image) -> Option<JointSignals> {
        match self {
            Self::Periods(periods) => Some(periods.in_time(&rows.mean)),
            Self::Run(_) => None,
        }
    }

    /// Joints (0-based) whose mean torque changes from period to period more than noise does, and by how much, Nm rms.
    pub fn drifting(&self) -> &[(usize, f64)] {
        match self {
            Self::Periods(periods) => periods.drifting(),
            Self::Run(_) => &[],
        }
    }

    /// Torque in time (n samples) as the regression sees it: filtered and cut for a single run.
    pub fn as_regressed(&self, y: &[f64]) -> Vec<f64> {
        match self {
            Self::Periods(_) => y.to_vec(),
            Self::Run(run) => run.filtered(y),
        }
    }

    /// Whether row `row` of joint `joint` in the regression's time counts (the joint moves).
    pub fn counts(&self, joint: usize, row: usize) -> bool {
        match self {
            Self::Periods(_) => true,
            Self::Run(run) => run.counts(joint, row),
        }
    }
}
