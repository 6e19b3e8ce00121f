//! The whitened equations of a log, on which every test is made.
//!
//! Enters: a regression and the motion of its log. Leaves: the rows of any torque signal in these equations, where
//! noise has variance one. For a periodic motion, these are rows of the mean period and of the differences between
//! periods; for a single run, rows of the samples in which joints move.

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

use super::error::DiagnoseError;
use super::image::{Column, Image};
use crate::identify::{Options, Regression};
use crate::robot::JointSignals;

/// Map from torques in time to whitened rows.
pub enum Whitening {
    /// A periodic motion: the noise is known from the scatter between periods.
    Periods(Box<PeriodWhitening>),
    /// A single run: rows of the samples in which joints move, divided by the scatter of the fit's residual.
    Run(RunWhitening),
}

impl Whitening {
    /// For a log whose noise is not asked for: the filter that the columns of a single run go through
    /// ([`Self::as_regressed`]), with weights of 1; `None` where the motion repeats, which needs none.
    pub fn filter_of(
        regression: &Regression,
        options: &Options,
    ) -> Result<Option<Self>, DiagnoseError> {
        if regression.prepared.replicates.is_some() {
            return Ok(None);
        }
        let weights = vec![1.0; regression.problem.joints()];
        Ok(Some(Self::Run(RunWhitening::new(regression, options, &weights)?)))
    }

    /// Whitened rows of a torque signal in time.
    pub fn image(&self, column: &Column) -> Image {
        match self {
            Self::Periods(periods) => periods.image(column),
            Self::Run(run) => run.image(column, false),
        }
    }

    /// [`Self::image`] of all `columns` at once, which costs less than one by one.
    pub fn images<'c>(&self, columns: impl Iterator<Item = &'c Column>) -> Vec<Image> {
        match self {
            Self::Periods(periods) => periods.images(columns),
            Self::Run(run) => columns.map(|column| run.image(column, false)).collect(),
        }
    }

    /// Whitened rows of a column of the regression, which has already been through its filter.
    pub fn regression_image(&self, column: &Column) -> Image {
        match self {
            Self::Periods(periods) => periods.image(column),
            Self::Run(run) => run.image(column, true),
        }
    }

    /// Wᵀr in time: its scalar product with a torque signal is the score of that signal. `None` for a single run.
    pub fn in_time(&self, rows: &Image) -> Option<JointSignals> {
        match self {
            Self::Periods(periods) => Some(periods.in_time(&rows.mean)),
            Self::Run(_) => None,
        }
    }

    /// Joints (0-based) whose mean torque changes from period to period by more than noise, and by how much, Nm rms.
    pub fn drifting(&self) -> &[(usize, f64)] {
        match self {
            Self::Periods(periods) => periods.drifting(),
            Self::Run(_) => &[],
        }
    }

    /// Torque in time (n samples) as the regression sees it: filtered and decimated for a single run.
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
