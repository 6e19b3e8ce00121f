//! Applies estimators and covariances to one problem.

use super::covariance::{Covariance, CovarianceError, CovarianceKind};
use super::error::IdentifyError;
use super::fit::{Estimator, Fit, FitError, Fitter, Weighting};
use super::held_at_rest::HeldAtRest;
use super::lack_of_fit::{Floor, LackOfFit};
use super::options::Options;
use super::problem::Problem;
use super::whiten::{ReplicateWhitening, decimate, decorrelate, instrument, prewhiten};
use crate::base::{BaseSet, ColumnPlan};
use crate::signal::{HarmonicPower, Scratch};

/// Memory for estimating problems of one shape.
pub struct Estimation {
    plan: ColumnPlan,
    fitter: Fitter,
    whitening: ReplicateWhitening,
    filter: Scratch,
    /// Rows whitened joint by joint.
    own: Option<Whitened>,
    /// Rows whitened across joints, with the cumulative column plan.
    mixed: Option<Whitened>,
    /// Rows in which every joint has all columns (instrumental variables).
    full: Option<Whitened>,
}

/// Additional knowledge of the motion, besides the regressor along it.
#[derive(Debug, Clone, Copy, Default)]
pub struct MotionAids<'a> {
    /// How well the averaged acceleration of a repeating motion is known, per joint: up to which harmonic
    /// [`Estimator::Spectral`] may trust it.
    pub acceleration: Option<&'a [HarmonicPower]>,
    /// The regressor along a smoother motion (same rows), for [`Estimator::Iv`].
    pub instruments: Option<&'a Problem>,
}

/// The result of one estimator for one problem.
#[derive(Debug, Clone)]
pub struct Estimate {
    /// The solution.
    pub fit: Fit,
    /// The covariances asked for, in their order.
    pub covariances: Vec<Result<Covariance, CovarianceError>>,
    /// Test whether the model explains the repeating part of the torque; known for the spectral estimator only.
    pub lack_of_fit: Option<LackOfFit>,
}

impl Estimate {
    /// Corrects covariances and test for periods some of whose rows were filled in: only the parts `kept` of the
    /// periods determine their mean and their scatter ([`Prepared::kept`](super::prepared::Prepared::kept)).
    pub(super) fn of_fewer_rows(mut self, kept: [f64; 2]) -> Self {
        let kept = kept[0] * kept[1];
        for covariance in self.covariances.iter_mut().flatten() {
            covariance.matrix /= kept;
        }
        self.lack_of_fit = self.lack_of_fit.map(|lack| lack.scaled(kept));
        self
    }

    /// Corrects the test for rows that were left out of the problem of `joints` joints because friction is `held` there:
    /// they contain nothing that the model could lack.
    pub(super) fn without_pauses(mut self, held: &[HeldAtRest], joints: usize) -> Self {
        let left_out = held.iter().map(|held| held.share).sum::<f64>() / joints as f64;
        self.lack_of_fit = self.lack_of_fit.map(|lack| lack.scaled(1.0 / (1.0 - left_out)));
        self
    }
}

struct Whitened {
    problem: Problem,
    fitter: Fitter,
}

impl Whitened {
    fn new(plan: ColumnPlan) -> Self {
        let problem = Problem::new(plan, 0.0);
        Self { fitter: Fitter::new(&problem), problem }
    }
}

/// Fewest periods whose scatter gives weights: with fewer, the noise of the weights costs more than the weights gain.
const LEAST_PERIODS: usize = 3;

impl Estimation {
    /// For problems shaped like `problem`, whatever its number of samples.
    pub fn new(problem: &Problem) -> Self {
        Self {
            plan: problem.plan.clone(),
            fitter: Fitter::new(problem),
            whitening: ReplicateWhitening::default(),
            filter: Scratch::default(),
            own: None,
            mixed: None,
            full: None,
        }
    }

    /// Estimates θ̂ by `estimator`, with its covariances `kinds`. `options` is used for the filter of
    /// [`Estimator::Decimated`] only.
    pub fn estimate(
        &mut self,
        problem: &Problem,
        set: &BaseSet,
        estimator: Estimator,
        kinds: &[CovarianceKind],
        aids: MotionAids,
        options: &Options,
    ) -> Result<Estimate, IdentifyError> {
        let plan = &self.plan;
        let own = || Whitened::new(plan.clone());
        let mixed = || Whitened::new(plan.cumulative());
        let full = || Whitened::new(plan.full());
        let weighting = match estimator {
            Estimator::Ols | Estimator::Sur | Estimator::Iv | Estimator::Spectral => {
                Weighting::Equal
            }
            Estimator::Wls | Estimator::Gls | Estimator::Decimated => Weighting::PerJoint,
        };
        let whitened = match estimator {
            Estimator::Ols | Estimator::Wls => {
                let fit = self.fitter.fit(problem, set, weighting)?;
                return Ok(Estimate {
                    covariances: covariances(problem, &fit, kinds),
                    fit,
                    lack_of_fit: None,
                });
            }
            Estimator::Sur => {
                let whitened = self.mixed.get_or_insert_with(mixed);
                let first = self.fitter.fit(problem, set, Weighting::PerJoint)?;
                decorrelate(problem, &first, &mut whitened.problem);
                whitened
            }
            Estimator::Gls => {
                let whitened = self.own.get_or_insert_with(own);
                let first = self.fitter.fit(problem, set, Weighting::PerJoint)?;
                prewhiten(problem, &first, &mut whitened.problem);
                whitened
            }
            Estimator::Decimated => {
                let whitened = self.own.get_or_insert_with(own);
                let Options { cutoff_hz, order, .. } = *options;
                decimate(problem, cutoff_hz, order, &mut self.filter, &mut whitened.problem)?;
                whitened
            }
            Estimator::Iv => {
                let instruments = aids.instruments.ok_or(FitError::NoInstruments)?;
                let whitened = self.full.get_or_insert_with(full);
                let first = self.fitter.fit(problem, set, Weighting::PerJoint)?;
                instrument(problem, instruments, &first.weights, &mut whitened.problem)?;
                whitened
            }
            Estimator::Spectral => {
                let acceleration = aids.acceleration.unwrap_or_default();
                if problem.periods < LEAST_PERIODS {
                    let (periods, needed) = (problem.periods, LEAST_PERIODS);
                    return Err(FitError::TooFewPeriods { periods, needed }.into());
                }
                if acceleration.iter().all(|power| power.noise.is_empty()) {
                    return Err(FitError::StandsStill.into());
                }
                let whitened = self.mixed.get_or_insert_with(mixed);
                self.whitening.whiten(problem, acceleration, &mut whitened.problem);
                whitened
            }
        };
        let mut fit = whitened.fitter.fit(&whitened.problem, set, weighting)?;
        let covariances = covariances(&whitened.problem, &fit, kinds);
        let lack_of_fit = (estimator == Estimator::Spectral)
            .then(|| LackOfFit::of(&whitened.problem, &fit.theta, Floor::Torque));
        fit.state_residuals_of(problem);
        Ok(Estimate { fit, covariances, lack_of_fit })
    }

    /// Tests whether a model explains the repeating part of the torque of `problem`, whose scatter between periods
    /// includes the noise of the motion; `acceleration` as in [`MotionAids`].
    pub fn lack_of_fit(
        &mut self,
        problem: &Problem,
        set: &BaseSet,
        acceleration: &[HarmonicPower],
    ) -> Result<LackOfFit, IdentifyError> {
        let plan = &self.plan;
        let Whitened { problem: rows, fitter } =
            self.mixed.get_or_insert_with(|| Whitened::new(plan.cumulative()));
        self.whitening.whiten(problem, acceleration, rows);
        let fit = fitter.fit(rows, set, Weighting::Equal)?;
        Ok(LackOfFit::of(rows, &fit.theta, Floor::TorqueAndMotion))
    }
}

fn covariances(
    problem: &Problem,
    fit: &Fit,
    kinds: &[CovarianceKind],
) -> Vec<Result<Covariance, CovarianceError>> {
    kinds.iter().map(|kind| kind.covariance(problem, fit)).collect()
}
