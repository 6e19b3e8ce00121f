//! From a raw log to θ̂ and σ: the one path that real logs and simulated trials share.

use super::course::row_velocities;
use super::covariance::{CovarianceError, CovarianceKind};
use super::drifting_friction::TakenOut;
use super::drive_answers::without_drive_answers;
use super::error::IdentifyError;
use super::estimation::{Estimate, Estimation, MotionAids};
use super::fit::Estimator;
use super::held_at_rest::HeldAtRest;
use super::identification::{Identification, explainable};
use super::lowered::Lowered;
use super::measurement::Measurement;
use super::motion_noise::moved_to_mean;
use super::options::Options;
use super::pauses::{Pauses, pauses, pauses_of_run};
use super::prepare::Preparer;
use super::prepared::{Prepared, Processing};
use super::problem::{Assembler, Problem};
use super::regression::Regression;
use super::rest::outpaced;
use super::untorn::Untorn;
use super::whiten::{SMOOTHER, Spectrum, smoothed};
use crate::base::{BaseSet, ColumnPlan};
use crate::dynamics::Model;
use crate::robot::JointSignals;
use crate::signal::{FineClock, Replicates, Scratch, ZeroPhase, fill_gaps};

/// Everything that stays the same from log to log, and reusable memory.
pub struct Identifier<'a> {
    model: &'a Model,
    set: &'a BaseSet,
    options: Options,
    preparer: Preparer,
    assembler: Assembler,
    problem: Problem,
    estimation: Estimation,
    filter: Scratch,
    spectrum: Spectrum,
    clock: Option<FineClock>,
}

const ALIKE_TO_THE_LAST_DIGIT: &str = "the periods are alike to the last digit, and their scatter says nothing: that of the \
     residual between blocks of time holds for noise with a memory short against a block";
/// Single runs are processed in pieces of this many samples, so that memory stays bounded.
const PIECE: usize = 1 << 16;
/// Instants per sample at which reversals of velocity are resolved: a millisecond at 125 Hz, a tenth of the time that
/// a joint takes to reverse its friction.
const TICKS: usize = 8;
/// Longest single run that keeps all its samples, of which a diagnosis needs some 30 kB each.
const LONG_RUN: usize = 30_000;
/// Sampling rate kept after a low-pass where a run is long or its rows are counted, in multiples of the cut-off.
const KEPT_RATE: f64 = 4.0;
/// Relative difference up to which two rates are the same: recorders of one arm differ by less.
pub(super) const SAME_RATE: f64 = 0.02;
/// Periods from which on their scatter is used; with fewer it has so few degrees of freedom that blocks of time are
/// more informative.
pub const MANY_PERIODS: usize = 4;

/// Samples at `rate_hz` of which one is kept behind a low-pass of `cutoff_hz`. Rates just below a whole multiple count
/// as that multiple, so that logs of nearly the same rate keep the same rows.
pub fn kept_every(rate_hz: f64, cutoff_hz: f64) -> usize {
    ((1.0 + SAME_RATE) * rate_hz / (KEPT_RATE * cutoff_hz)).floor().max(1.0) as usize
}

impl<'a> Identifier<'a> {
    /// An identifier for logs of one arm.
    pub fn new(model: &'a Model, set: &'a BaseSet, options: Options) -> Self {
        let problem = Problem::new(ColumnPlan::new(model, set), 0.0);
        Self {
            model,
            set,
            options,
            preparer: Preparer::default(),
            assembler: Assembler::new(model),
            estimation: Estimation::new(&problem),
            problem,
            filter: Scratch::default(),
            spectrum: Spectrum::default(),
            clock: None,
        }
    }

    /// An identifier for logs of the same arm with other `options`.
    pub fn with_options(&self, options: Options) -> Self {
        Self::new(self.model, self.set, options)
    }

    /// The options of identification.
    pub fn options(&self) -> &Options {
        &self.options
    }

    /// The base set that is identified.
    pub fn base_set(&self) -> &'a BaseSet {
        self.set
    }

    /// Whether a log that repeats may be weighted by the noise between its periods: no other method was asked for.
    pub fn may_weigh_by_periods(&self) -> bool {
        let Options { estimator, covariance, .. } = self.options;
        !self.options.is_single_run()
            && estimator.is_none_or(|e| e == Estimator::Spectral)
            && covariance.is_none_or(|c| c == CovarianceKind::Spectral)
    }

    /// Identifies from one log.
    pub fn identify(&mut self, m: &Measurement) -> Result<Identification, IdentifyError> {
        let (prepared, first, every) = self.fill_from(m, false)?;
        let instruments = self.instruments_for(self.options.estimator, &prepared)?;
        let pauses =
            self.pauses(&prepared, || row_velocities(&prepared, &self.problem, [first, every]));
        self.solve(prepared, &pauses, instruments.as_ref(), m.source)
    }

    /// Lays out `m`, whose torque is the manufacturer's feed-forward, for regression. `None` where that torque is the
    /// same in every row of a joint that moves; this is then added to `warnings`.
    ///
    /// # Errors
    /// As [`Self::regression`].
    pub fn feed_forward(
        &mut self,
        m: &Measurement,
        warnings: &mut Vec<String>,
    ) -> Result<Option<Regression>, IdentifyError> {
        match self.regression(m) {
            Err(IdentifyError::DeadTorque { joint, .. }) => {
                warnings.push(format!(
                    "the manufacturer's torque of joint {joint} is the same in every row; nothing is compared with it"
                ));
                Ok(None)
            }
            regression => regression.map(Some),
        }
    }

    /// Lays a log out for regression without solving it: for validation and diagnosis.
    pub fn regression(&mut self, m: &Measurement) -> Result<Regression, IdentifyError> {
        let (prepared, first_sample, every) = self.fill_from(m, true)?;
        let instruments = self.instruments_for(self.options.estimator, &prepared)?;
        let empty = Problem::new(self.problem.plan.clone(), 0.0);
        let problem = std::mem::replace(&mut self.problem, empty);
        let mut regression =
            Regression::of(m.source, prepared, problem, instruments, [first_sample, every]);
        regression.lowered = Lowered::of(&self.options, m, &regression.prepared.processing);
        if self.options.rate_hz.is_some() {
            regression.outpaced = outpaced(m, &regression.course());
        }
        Ok(regression)
    }

    /// Solves a log laid out before.
    pub fn identify_regression(
        &mut self,
        regression: &Regression,
    ) -> Result<Identification, IdentifyError> {
        self.problem.clone_from(&regression.problem);
        let Regression { prepared, instruments, log, .. } = regression;
        let pauses = self.pauses(prepared, || regression.course().qd_rad_s);
        self.solve(prepared.clone(), &pauses, instruments.as_ref(), log)
    }

    /// The rows of each pause of every joint in the problem that was laid out from `prepared`. `velocities` are those of its
    /// rows, rad/s, which only a single run needs.
    fn pauses(
        &self,
        prepared: &Prepared,
        velocities: impl FnOnce() -> JointSignals,
    ) -> Vec<Pauses> {
        let (rate_hz, epsilon_rad_s) = (self.problem.rate_hz, self.model.friction_epsilon_rad_s());
        let joints = 0..self.problem.joints();
        if prepared.replicates.is_some() {
            let qd_rad_s = &prepared.motion.qd_rad_s;
            return joints.map(|j| pauses(qd_rad_s, j, rate_hz, epsilon_rad_s)).collect();
        }
        let (qd_rad_s, cutoff_hz) = (velocities(), self.options.cutoff_hz);
        let of_joint = |j| pauses_of_run(&qd_rad_s, j, rate_hz, epsilon_rad_s, cutoff_hz);
        joints.map(of_joint).collect()
    }

    fn fill_from(
        &mut self,
        m: &Measurement,
        for_diagnosis: bool,
    ) -> Result<(Prepared, usize, usize), IdentifyError> {
        if m.q_rad.joints() != self.model.dof() {
            let (found, expected) = (m.q_rad.joints(), self.model.dof());
            return Err(IdentifyError::Joints { log: m.source.to_owned(), found, expected });
        }
        if let Some(joint) = (0..m.q_rad.joints()).find(|j| m.is_dead(*j)) {
            let (log, torque_nm) = (m.source.to_owned(), m.torque_nm.joint(joint)[0]);
            return Err(IdentifyError::DeadTorque { log, joint: joint + 1, torque_nm });
        }
        let untorn = Untorn::of(m);
        let m = &untorn.as_ref().map_or(*m, |run| run.measurement(m.source));
        let filled = if self.options.is_single_run() {
            None
        } else {
            fill_gaps(m.time_s, m.q_rad, m.qd_rad_s, m.torque_nm)?
        };
        let m = &filled.as_ref().map_or(*m, |filled| Measurement {
            source: m.source,
            time_s: &filled.time_s,
            q_rad: &filled.q_rad,
            qd_rad_s: &filled.qd_rad_s,
            torque_nm: &filled.torque_nm,
        });
        let mut prepared = if for_diagnosis {
            self.preparer.prepare_for_diagnosis(m, &self.options)?
        } else {
            self.preparer.prepare(m, &self.options)?
        };
        if let Some(filled) = &filled {
            prepared.count_filled(&filled.gaps);
            prepared.warnings.push(filled.warning());
        }
        if let Some(run) = untorn {
            prepared.lead_in_s += run.before_s;
            prepared.warnings.push(run.warning);
        }
        let (first, every) = self.lay_out(&prepared)?;
        Ok((prepared, first, every))
    }

    /// Fills the problem with the rows of `prepared`. Returns the first sample used and the step between the samples
    /// used.
    fn lay_out(&mut self, prepared: &Prepared) -> Result<(usize, usize), IdentifyError> {
        self.problem.rate_hz = prepared.processing.rate_hz;
        if prepared.replicates.is_some() {
            let Prepared { motion, torque_nm, .. } = prepared;
            self.assembler.assemble(&mut self.problem, self.model, motion, torque_nm);
            return Ok((0, 1));
        }
        self.fill_filtered(prepared)
    }

    /// Lays out the rows of `prepared` along its smoothed motion, where `estimator` asks for them.
    fn instruments_for(
        &mut self,
        estimator: Option<Estimator>,
        prepared: &Prepared,
    ) -> Result<Option<Problem>, IdentifyError> {
        if estimator != Some(Estimator::Iv) {
            return Ok(None);
        }
        let Options { cutoff_hz, order, .. } = self.options;
        let (repeats, rate_hz) = (prepared.replicates.is_some(), prepared.processing.rate_hz);
        let cutoff_hz = SMOOTHER * cutoff_hz;
        let motion =
            smoothed(&prepared.motion, repeats, rate_hz, cutoff_hz, order, &mut self.filter)?;
        let along = Prepared { motion, ..prepared.clone() };
        let problem = self.problem.clone();
        let laid_out = self.lay_out(&along);
        let instruments = std::mem::replace(&mut self.problem, problem);
        laid_out?;
        Ok(Some(instruments))
    }

    /// Lays out a single run: the same low-pass acts on the torque and on every regressor column (Gautier 1997), in
    /// pieces that overlap by the filter's memory. The filter's edges are cut off.
    fn fill_filtered(&mut self, prepared: &Prepared) -> Result<(usize, usize), IdentifyError> {
        let rate_hz = prepared.processing.rate_hz;
        let Options { cutoff_hz, order, .. } = self.options;
        let filter = ZeroPhase::new(cutoff_hz, order, rate_hz)?;
        let samples = prepared.motion.samples();
        let edge = filter.edge_samples().min(samples / 8);
        let every = if samples > LONG_RUN { kept_every(rate_hz, cutoff_hz) } else { 1 };
        let mut whole = Problem::new(self.problem.plan.clone(), rate_hz / every as f64);
        whole.periods = 1;
        let kept = edge..samples - edge;
        let mut start = kept.start;
        let mut columns: Vec<Vec<Vec<f64>>> = Vec::new();
        while start < kept.end {
            let end = (start + PIECE.next_multiple_of(every)).min(kept.end);
            let from = start - edge;
            let part = from..(end + edge).min(samples);
            let motion = prepared.motion.slice(part.clone());
            let torque = prepared.torque_nm.slice(part.clone());
            self.assembler.assemble(&mut self.problem, self.model, &motion, &torque);
            let inside = start - from..end - from;
            for (j, panel) in self.problem.panels.iter_mut().enumerate() {
                let length = part.len();
                let all = panel.x.chunks_exact_mut(length).chain(panel.y.chunks_exact_mut(length));
                for (c, column) in all.enumerate() {
                    filter.filter_in_place(column, &mut self.filter)?;
                    if columns.len() <= j {
                        columns.push(Vec::new());
                    }
                    if columns[j].len() <= c {
                        columns[j].push(Vec::new());
                    }
                    columns[j][c].extend(column[inside.clone()].iter().step_by(every));
                }
            }
            start = end;
        }
        for (panel, mut columns) in whole.panels.iter_mut().zip(columns) {
            panel.y = columns.pop().unwrap_or_default();
            whole.samples = panel.y.len();
            panel.x = columns.concat();
        }
        self.problem = whole;
        Ok((kept.start, every))
    }

    /// Solves the problem that was laid out from `prepared`, which comes from `log`, with these `pauses` of every joint.
    fn solve(
        &mut self,
        mut prepared: Prepared,
        pauses: &[Pauses],
        instruments: Option<&Problem>,
        log: &str,
    ) -> Result<Identification, IdentifyError> {
        let without = |error| IdentifyError::Covariance { log: log.to_owned(), error };
        let are_alike = prepared.replicates.as_ref().is_some_and(Replicates::are_alike);
        let repeats = prepared.processing.periods >= MANY_PERIODS && !are_alike;
        let estimator = match self.options.estimator {
            Some(estimator) => estimator,
            None if repeats => Estimator::Spectral,
            None => Estimator::Wls,
        };
        // An estimator that works harmonic by harmonic has no blocks of time.
        let default_kind = match repeats || estimator == Estimator::Spectral {
            true => CovarianceKind::Spectral,
            false => CovarianceKind::Blocks,
        };
        let kind = self.options.covariance.unwrap_or(default_kind);
        let needs_scatter = estimator == Estimator::Spectral
            || matches!(kind, CovarianceKind::Spectral | CovarianceKind::Periods);
        if are_alike && needs_scatter {
            return Err(without(CovarianceError::AlikePeriods));
        }
        let Processing { logs, periods, .. } = prepared.processing;
        let covariance_reason = match (self.options.covariance, default_kind) {
            (Some(_), _) => "asked for",
            (None, CovarianceKind::Spectral) => {
                "the motion repeats: the scatter between periods holds for noise of any colour whose memory is short \
                 against a period"
            }
            (None, _) if are_alike => ALIKE_TO_THE_LAST_DIGIT,
            (None, _) if logs > 1 => {
                "several logs: the scatter between blocks of time holds for noise with a memory short against a block"
            }
            (None, _) if periods > 1 => {
                "few periods: the scatter between blocks of time holds for noise with a memory short against a block; \
                 from four periods on their own scatter holds for noise of any colour whose memory is short against a period"
            }
            (None, _) => {
                "a single run: the scatter between blocks of time holds for noise with a memory short against a block"
            }
        };
        let drifts = self.take_out_drift(&mut prepared);
        let (held, may_be_held) = self.held_at_rest(&prepared, pauses);
        let whole = self.with_answers_out(&prepared, &held);
        let by_harmonics = weighs_harmonics(estimator, &[kind]);
        leave_out(&mut self.problem, &held, by_harmonics);
        let aids = MotionAids { acceleration: prepared.acceleration.as_deref(), instruments };
        let estimate = self.estimation.estimate(
            &self.problem,
            self.set,
            estimator,
            &[kind],
            aids,
            &self.options,
        )?;
        let estimate = self
            .with_motion_noise(estimate, &prepared, (whole.as_ref(), &held))?
            .of_fewer_rows(prepared.kept());
        let Estimate { mut fit, mut covariances, lack_of_fit } = estimate;
        let covariance = covariances.swap_remove(0).map_err(without)?;
        let explainable_nm = prepared.replicates.as_ref().map(|replicates| {
            let shares = |j: usize| {
                let left_out = held.iter().find(|held| held.joint == j).map_or(0.0, |h| h.share);
                [1.0 - left_out, if by_harmonics { 1.0 } else { 1.0 - left_out }]
            };
            let (squares, parameters) = (&fit.residual_squares, fit.theta.len());
            explainable(squares, parameters, replicates, prepared.kept(), shares)
        });
        if let Some(whole) = whole {
            self.problem = whole;
        }
        if !drifts.is_empty() || !held.is_empty() {
            // The model leaves both, though neither is noise, and a drift is not the same every time.
            drifts.iter().for_each(|drift| drift.put_back(&mut self.problem));
            fit.state_residuals_of(&self.problem);
        }
        Ok(Identification {
            estimator,
            samples: self.problem.samples * self.problem.periods,
            explainable_nm,
            covariance,
            covariance_reason,
            processing: prepared.processing,
            replicates: prepared.replicates,
            lack_of_fit,
            agreement: None,
            drifting_friction: drifts
                .iter()
                .map(|drift| drift.finding(self.set, &fit.theta))
                .collect(),
            held_at_rest: held,
            may_be_held,
            warnings: prepared.warnings,
            fit,
        })
    }

    /// Takes friction that drifts along the log `prepared` out of the problem and of the scatter between its periods.
    fn take_out_drift(&mut self, prepared: &mut Prepared) -> Vec<TakenOut> {
        let [_, kept] = prepared.kept();
        let qd_rad_s = &prepared.motion.qd_rad_s;
        let Some(replicates) = &mut prepared.replicates else { return Vec::new() };
        let Self { problem, spectrum, .. } = self;
        if problem.periods < MANY_PERIODS || replicates.are_alike() {
            return Vec::new();
        }
        let drifts = TakenOut::of(problem, qd_rad_s, spectrum);
        drifts.iter().for_each(|drift| drift.leave(replicates, problem, kept));
        drifts
    }

    /// Friction that is held in the `pauses` of the log `prepared`, which knows it or has to be searched for it; and friction
    /// that may be held.
    fn held_at_rest(
        &mut self,
        prepared: &Prepared,
        pauses: &[Pauses],
    ) -> (Vec<HeldAtRest>, Vec<HeldAtRest>) {
        if !prepared.held_at_rest.is_empty() {
            return (prepared.held_at_rest.clone(), Vec::new());
        }
        let Self { clock, problem, model, set, .. } = self;
        let all = HeldAtRest::of(problem, set, pauses, |moving, held| {
            take_out_drive_answers(moving, clock, model, prepared, held);
            leave_out(moving, held, false);
        });
        all.into_iter().partition(|held| held.sticks)
    }

    /// Takes the drives' responses to friction out of the problem. Returns the problem if friction is `held` in some of its
    /// rows.
    fn with_answers_out(&mut self, prepared: &Prepared, held: &[HeldAtRest]) -> Option<Problem> {
        let Self { clock, problem, model, .. } = self;
        take_out_drive_answers(problem, clock, model, prepared, held);
        (!held.is_empty()).then(|| problem.clone())
    }

    /// Returns `estimate` of the log `prepared`. Where its model fails against the scatter of the torque, it is
    /// tested again against the scatter of torque and motion together. `whole` is the problem with the rows in which
    /// friction is `held`, if there are any.
    fn with_motion_noise(
        &mut self,
        estimate: Estimate,
        prepared: &Prepared,
        (whole, held): (Option<&Problem>, &[HeldAtRest]),
    ) -> Result<Estimate, IdentifyError> {
        let estimate = estimate.without_pauses(held, self.problem.joints());
        if estimate.lack_of_fit.is_none_or(|lack| lack.fits()) {
            return Ok(estimate);
        }
        let deviations = self.preparer.deviations(prepared)?;
        let (Some(deviations), Some(acceleration)) = (deviations, &prepared.acceleration) else {
            return Ok(estimate);
        };
        let Self { problem, assembler, model, set, .. } = self;
        let (mean, theta) = (&prepared.motion, &estimate.fit.theta);
        let whole = whole.unwrap_or(problem);
        let mut moved = moved_to_mean(whole, assembler, model, mean, &deviations, theta);
        leave_out(&mut moved, held, true);
        let lack_of_fit = Some(self.estimation.lack_of_fit(&moved, set, acceleration)?);
        Ok(Estimate { lack_of_fit, ..estimate }.without_pauses(held, moved.joints()))
    }

    /// Estimates from one log by several methods: estimators, each with its kinds of covariance.
    pub fn compare(
        &mut self,
        m: &Measurement,
        methods: &[(Estimator, Vec<CovarianceKind>)],
    ) -> Result<Vec<Result<Estimate, IdentifyError>>, IdentifyError> {
        let (mut prepared, first, every) = self.fill_from(m, false)?;
        let pauses =
            self.pauses(&prepared, || row_velocities(&prepared, &self.problem, [first, every]));
        let by_instruments = methods.iter().map(|(e, _)| *e).find(|e| *e == Estimator::Iv);
        let instruments = self.instruments_for(by_instruments, &prepared)?;
        self.take_out_drift(&mut prepared);
        let (held, _) = self.held_at_rest(&prepared, &pauses);
        let whole = self.with_answers_out(&prepared, &held);
        let aids = MotionAids {
            acceleration: prepared.acceleration.as_deref(),
            instruments: instruments.as_ref(),
        };
        let estimates = methods.iter().map(|(estimator, kinds)| {
            let Self { estimation, problem, set, options, .. } = &mut *self;
            if let Some(whole) = &whole {
                problem.clone_from(whole);
                leave_out(problem, &held, weighs_harmonics(*estimator, kinds));
            }
            let estimate = estimation.estimate(problem, set, *estimator, kinds, aids, options)?;
            let of_held = (whole.as_ref(), &held[..]);
            Ok(self.with_motion_noise(estimate, &prepared, of_held)?.of_fewer_rows(prepared.kept()))
        });
        Ok(estimates.collect())
    }
}

/// Whether an estimate, or one of its covariances, weighs harmonics by the scatter between periods.
fn weighs_harmonics(estimator: Estimator, kinds: &[CovarianceKind]) -> bool {
    estimator == Estimator::Spectral || kinds.contains(&CovarianceKind::Spectral)
}

/// Leaves the rows in which friction is `held` out of `problem`, whose harmonics may be weighted by their scatter.
fn leave_out(problem: &mut Problem, held: &[HeldAtRest], by_harmonics: bool) {
    for held in held {
        held.leave_out(problem);
        if by_harmonics {
            held.spread_scatter(problem);
        }
    }
}

/// Projects the drives' responses to friction out of `problem`, except where it is `held`. A single run stays as it is: its
/// low-pass is far slower than the response of a drive at a reversal.
fn take_out_drive_answers(
    problem: &mut Problem,
    clock: &mut Option<FineClock>,
    model: &Model,
    prepared: &Prepared,
    held: &[HeldAtRest],
) {
    let Some(acceleration) = &prepared.acceleration else { return };
    clock.take_if(|clock| clock.samples() != problem.samples);
    let clock = clock.get_or_insert_with(|| FineClock::new(problem.samples, TICKS));
    without_drive_answers(problem, clock, model, &prepared.motion, acceleration, held);
}

#[cfg(test)]
mod tests {
    use super::*;

    /// At 40 Hz behind a low-pass of 10 Hz, clocks that are off by 0.01 % keep the same rows.
    #[test]
    fn logs_of_nearly_one_rate_keep_the_same_rows() {
        assert_eq!([199.98, 200.0, 200.02].map(|hz| kept_every(hz, 10.0)), [5; 3]);
        assert_eq!([125.0, 500.0, 30.0].map(|hz| kept_every(hz, 10.0)), [3, 12, 1]);
    }
}
