//! From a raw log to θ̂ and σ: the one path that real logs and simulated trials share.

use super::columns::ColumnPlan;
use super::course::Course;
use super::covariance::{Covariance, CovarianceError, CovarianceKind};
use super::drive_answers::without_drive_answers;
use super::error::IdentifyError;
use super::estimation::{Estimate, Estimation, MotionAids};
use super::fit::{Estimator, Fit};
use super::lack_of_fit::LackOfFit;
use super::motion_noise::moved_to_mean;
use super::options::Options;
use super::pooled::Agreement;
use super::prepare::{Measurement, Prepared, Preparer, Processing};
use super::problem::{Assembler, Problem};
use super::residual::Residual;
use super::whiten::{SMOOTHER, smoothed};
use crate::base::BaseSet;
use crate::dynamics::Model;
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
    clock: Option<FineClock>,
}

/// The result of identification from a log.
#[derive(Debug, Clone)]
pub struct Identification {
    /// Which estimator made the solution.
    pub estimator: Estimator,
    /// The least-squares solution.
    pub fit: Fit,
    /// Its covariance.
    pub covariance: Covariance,
    /// Why this covariance was chosen.
    pub covariance_reason: &'static str,
    /// What was done to the log.
    pub processing: Processing,
    /// Torque samples per joint that were used.
    pub samples: usize,
    /// Scatter of the torque between periods; `None` for a single run.
    pub replicates: Option<Replicates>,
    /// Rms per joint of the repeating torque that the model does not explain, Nm; `None` for a single run.
    pub explainable_nm: Option<Vec<f64>>,
    /// Test of the model against the scatter between periods; known for the spectral estimator.
    pub lack_of_fit: Option<LackOfFit>,
    /// Test whether several logs come from one arm; known where each of them repeats its motion.
    pub agreement: Option<Agreement>,
    /// What the user should know about how the log was used.
    pub warnings: Vec<String>,
}

/// A log laid out for regression.
pub struct Regression {
    /// X and y of every joint.
    pub problem: Problem,
    /// The regressor along a smoother motion; only where the estimator asks for it.
    pub instruments: Option<Problem>,
    /// The motion and torque from which they were made; for a single run unfiltered and as long as the window.
    pub prepared: Prepared,
    /// First sample of `prepared` that is in `problem` (the edges of the filter are cut off).
    pub first_sample: usize,
    /// Samples of `prepared` per sample of `problem` (long logs are thinned after the filter).
    pub every: usize,
    /// Course of several joined logs, of which `prepared` holds the first; `None` for a single log.
    course: Option<Course>,
}

impl Regression {
    /// The sample of `prepared` that belongs to row `row` of one period (or of the run).
    pub fn sample(&self, row: usize) -> usize {
        self.first_sample + row * self.every
    }

    /// Time and velocity of every row.
    pub fn course(&self) -> Course {
        self.course.clone().unwrap_or_else(|| Course::of(self))
    }

    /// Joins several logs into one by stacking their rows. Every period then counts as part of a single run, and the
    /// processing reported is that of the first log.
    pub fn joined(regressions: Vec<Self>) -> Result<Self, IdentifyError> {
        let logs = regressions.len();
        let mut rates_hz = regressions.iter().map(|r| r.prepared.processing.rate_hz);
        let Some(expected_hz) = rates_hz.next() else {
            return Err(IdentifyError::NoLogs);
        };
        if let Some(found_hz) = rates_hz.find(|hz| (hz / expected_hz - 1.0).abs() > 0.02) {
            return Err(IdentifyError::Rates { found_hz, expected_hz });
        }
        // Long runs were thinned behind their low-pass; the others follow.
        let coarsest = regressions.iter().map(|r| r.every).max().unwrap_or(1);
        let thinned = |r: Self| if logs > 1 { r.thinned(coarsest) } else { r };
        let mut rest = regressions.into_iter().map(thinned);
        let Some(mut first) = rest.next() else {
            return Err(IdentifyError::NoLogs);
        };
        if logs == 1 {
            return Ok(first);
        }
        let mut course = first.course();
        let mut filled_rows = first.filled_rows();
        first.problem.unfold();
        first.instruments.iter_mut().for_each(Problem::unfold);
        first.prepared.replicates = None;
        first.prepared.acceleration = None;
        first.prepared.each_period = None;
        first.prepared.recorded = None;
        first.prepared.between = None;
        let processing = &mut first.prepared.processing;
        *processing = Processing { logs, periods: 1, harmonics: None, ..processing.clone() };
        for other in rest {
            course.append(&other.course());
            filled_rows += other.filled_rows();
            let mut problem = other.problem;
            problem.unfold();
            first.problem.append(&problem);
            match (&mut first.instruments, other.instruments) {
                (Some(instruments), Some(mut more)) => {
                    more.unfold();
                    instruments.append(&more);
                }
                (instruments, _) => *instruments = None,
            }
            first.prepared.warnings.extend(other.prepared.warnings);
        }
        first.prepared.filled_share = filled_rows / first.problem.samples as f64;
        first.course = Some(course);
        Ok(first)
    }

    /// The same with `every`-th sample of `prepared` in the problem, a multiple of what it has now.
    fn thinned(mut self, every: usize) -> Self {
        let factor = (every / self.every).max(1);
        if factor > 1 {
            let mut course = self.course();
            course.thin(factor);
            self.course = Some(course);
            for problem in std::iter::once(&mut self.problem).chain(&mut self.instruments) {
                problem.unfold();
                problem.thin(factor);
            }
            self.every *= factor;
        }
        self
    }

    /// Number of rows that were filled in and are not in the log.
    fn filled_rows(&self) -> f64 {
        self.prepared.filled_share * (self.problem.samples * self.problem.periods) as f64
    }
}

const ALIKE_TO_THE_LAST_DIGIT: &str = "the periods are alike to the last digit, and their scatter says nothing: that of the \
     residual between blocks of time holds for noise with a memory short against a block";
/// Single runs are processed in pieces of this many samples, so that memory stays bounded.
const PIECE: usize = 1 << 16;
/// Instants per sample at which reversals of velocity are resolved: a millisecond at 125 Hz, a tenth of the time that
/// a joint takes to reverse its friction.
const TICKS: usize = 8;
/// Longest single run that keeps all its samples.
const LONG_RUN: usize = 100_000;
/// Sampling rate kept after a low-pass where a run is long or its rows are counted, in multiples of the cut-off.
pub const KEPT_RATE: f64 = 4.0;

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
            clock: None,
        }
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
        let (prepared, ..) = self.fill_from(m, false)?;
        let instruments = self.instruments_for(self.options.estimator, &prepared)?;
        self.solve(prepared, instruments.as_ref())
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
        Ok(Regression { problem, instruments, prepared, first_sample, every, course: None })
    }

    /// Solves a log laid out before.
    pub fn identify_regression(
        &mut self,
        regression: &Regression,
    ) -> Result<Identification, IdentifyError> {
        self.problem.clone_from(&regression.problem);
        self.solve(regression.prepared.clone(), regression.instruments.as_ref())
    }

    fn fill_from(
        &mut self,
        m: &Measurement,
        with_periods: bool,
    ) -> Result<(Prepared, usize, usize), IdentifyError> {
        if m.q_rad.joints() != self.model.dof() {
            let (found, expected) = (m.q_rad.joints(), self.model.dof());
            return Err(IdentifyError::Joints { log: m.source.to_owned(), found, expected });
        }
        if let Some(joint) = (0..m.q_rad.joints()).find(|j| m.is_dead(*j)) {
            let (log, torque_nm) = (m.source.to_owned(), m.torque_nm.joint(joint)[0]);
            return Err(IdentifyError::DeadTorque { log, joint: joint + 1, torque_nm });
        }
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
        let mut prepared = if with_periods {
            self.preparer.prepare_with_periods(m, &self.options)?
        } else {
            self.preparer.prepare(m, &self.options)?
        };
        if let Some(filled) = &filled {
            prepared.count_filled(&filled.gaps);
            prepared.warnings.push(filled.warning());
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
        let every = if samples > LONG_RUN {
            ((rate_hz / (KEPT_RATE * cutoff_hz)).floor() as usize).max(1)
        } else {
            1
        };
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

    fn solve(
        &mut self,
        prepared: Prepared,
        instruments: Option<&Problem>,
    ) -> Result<Identification, IdentifyError> {
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
        if are_alike && matches!(kind, CovarianceKind::Spectral | CovarianceKind::Periods) {
            return Err(CovarianceError::AlikePeriods.into());
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
        self.take_out_drive_answers(&prepared);
        let aids = MotionAids { acceleration: prepared.acceleration.as_deref(), instruments };
        let estimate = self.estimation.estimate(
            &self.problem,
            self.set,
            estimator,
            &[kind],
            aids,
            &self.options,
        )?;
        let estimate = self.with_motion_noise(estimate, &prepared)?.of_fewer_rows(prepared.kept());
        let Estimate { fit, mut covariances, lack_of_fit } = estimate;
        let covariance = covariances.swap_remove(0)?;
        Ok(Identification {
            estimator,
            samples: self.problem.samples * self.problem.periods,
            explainable_nm: prepared
                .replicates
                .as_ref()
                .map(|r| explainable(&fit.residual_squares, fit.theta.len(), r, prepared.kept())),
            covariance,
            covariance_reason,
            processing: prepared.processing,
            replicates: prepared.replicates,
            lack_of_fit,
            agreement: None,
            warnings: prepared.warnings,
            fit,
        })
    }

    /// Projects the drives' responses to friction out of the problem. A single run stays as it is: its low-pass is
    /// far slower than the response of a drive at a reversal.
    fn take_out_drive_answers(&mut self, prepared: &Prepared) {
        let Some(acceleration) = &prepared.acceleration else { return };
        let Self { clock, problem, model, .. } = self;
        clock.take_if(|clock| clock.samples() != problem.samples);
        let clock = clock.get_or_insert_with(|| FineClock::new(problem.samples, TICKS));
        without_drive_answers(problem, clock, model, &prepared.motion, acceleration);
    }

    /// Returns `estimate` of the log `prepared`. Where its model fails against the scatter of the torque, it is
    /// tested again against the scatter of torque and motion together.
    fn with_motion_noise(
        &mut self,
        estimate: Estimate,
        prepared: &Prepared,
    ) -> Result<Estimate, IdentifyError> {
        if estimate.lack_of_fit.is_none_or(|lack| lack.fits()) {
            return Ok(estimate);
        }
        let deviations = self.preparer.deviations(prepared)?;
        let (Some(deviations), Some(acceleration)) = (deviations, &prepared.acceleration) else {
            return Ok(estimate);
        };
        let Self { problem, assembler, model, set, .. } = self;
        let (mean, theta) = (&prepared.motion, &estimate.fit.theta);
        let moved = moved_to_mean(problem, assembler, model, mean, &deviations, theta);
        let lack_of_fit = Some(self.estimation.lack_of_fit(&moved, set, acceleration)?);
        Ok(Estimate { lack_of_fit, ..estimate })
    }

    /// Estimates from one log by several methods: estimators, each with its kinds of covariance.
    pub fn compare(
        &mut self,
        m: &Measurement,
        methods: &[(Estimator, Vec<CovarianceKind>)],
    ) -> Result<Vec<Result<Estimate, IdentifyError>>, IdentifyError> {
        let (prepared, ..) = self.fill_from(m, false)?;
        let by_instruments = methods.iter().map(|(e, _)| *e).find(|e| *e == Estimator::Iv);
        let instruments = self.instruments_for(by_instruments, &prepared)?;
        self.take_out_drive_answers(&prepared);
        let aids = MotionAids {
            acceleration: prepared.acceleration.as_deref(),
            instruments: instruments.as_ref(),
        };
        let estimates = methods.iter().map(|(estimator, kinds)| {
            let Self { estimation, problem, set, options, .. } = &mut *self;
            let estimate = estimation.estimate(problem, set, *estimator, kinds, aids, options)?;
            Ok(self.with_motion_noise(estimate, &prepared)?.of_fewer_rows(prepared.kept()))
        });
        Ok(estimates.collect())
    }
}

/// Rms per joint of the repeating torque that is not explained, Nm. `residual_squares` are ‖e_j‖² over all periods,
/// left by a fit of `parameters` parameters. From them the scatter between periods is subtracted, and from the mean
/// period the share of its noise σ²/P that the fit leaves. Filled-in rows lower P and the scatter to the parts that
/// are `kept` ([`Prepared::kept`](super::Prepared::kept)).
fn explainable(
    residual_squares: &[f64],
    parameters: usize,
    replicates: &Replicates,
    kept: [f64; 2],
) -> Vec<f64> {
    let n = replicates.mean.samples() as f64;
    let periods = replicates.periods as f64;
    let joints = replicates.sigma.len() as f64;
    let fitted = parameters as f64 / (joints * n);
    let pairs = residual_squares.iter().zip(&replicates.sigma);
    pairs
        .map(|(squares, sigma)| {
            let variance = sigma * sigma;
            let of_mean = (squares - kept[1] * variance * n * (periods - 1.0)) / (n * periods);
            (of_mean - variance / (kept[0] * periods) * (1.0 - fitted)).max(0.0).sqrt()
        })
        .collect()
}

/// Periods from which on their scatter is used; with fewer it has so few degrees of freedom that blocks of time are
/// more informative.
pub const MANY_PERIODS: usize = 4;

impl Identification {
    /// Residual of the fit over all samples used.
    pub fn residual(&self) -> Residual {
        Residual::from_squares(&self.fit.residual_squares, &self.fit.torque_squares, self.samples)
    }

    /// Share of each joint's torque (rms) that the model leaves, without noise as far as the log reveals it.
    pub fn left(&self) -> Vec<f64> {
        let Residual { rms_nm, relative_percent, .. } = self.residual();
        let beyond_noise = |j: usize| self.explainable_nm.as_ref().map_or(rms_nm[j], |nm| nm[j]);
        let share = |j: usize| 0.01 * relative_percent[j] * beyond_noise(j) / rms_nm[j];
        (0..rms_nm.len()).map(share).collect()
    }

    /// σ of every base parameter.
    pub fn sigma(&self) -> Vec<f64> {
        self.covariance.sigma()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::JointSignals;
    use crate::signal::replicate_noise;
    use rand::{SeedableRng, rngs::ChaCha8Rng};
    use rand_distr::{Distribution, StandardNormal};

    /// Eight periods of an error of 0.3 Nm rms that repeats, under noise of 1 Nm. A twelfth of the rows, at other
    /// phases in each period, is the mean of the other periods. The mean square of the mean period is 0.09 and
    /// 1/(8 · 11/12) Nm², known to √(2/8000) of the second term and twice the root of both terms' product over 8000:
    /// 0.0048 Nm². Five of these standard deviations leave 0.257 to 0.338; without `kept` the result would be 0.16.
    #[test]
    fn rows_that_were_filled_in_explain_nothing() {
        const N: usize = 8000;
        const PERIODS: usize = 8;
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let mut noise = || -> f64 { StandardNormal.sample(&mut rng) };
        let error = |k: usize| 0.3 * std::f64::consts::SQRT_2 * (0.01 * k as f64).sin();
        let mut y: Vec<f64> = (0..N * PERIODS).map(|k| error(k % N) + noise()).collect();
        let is_filled = |k: usize, period: usize| k % 12 == period;
        for k in 0..N {
            for period in (0..PERIODS).filter(|period| is_filled(k, *period)) {
                let others = (0..PERIODS).filter(|other| *other != period);
                y[period * N + k] = others.map(|other| y[other * N + k]).sum::<f64>() / 7.0;
            }
        }
        let filled = (0..N * PERIODS).filter(|k| is_filled(k % N, k / N)).count();
        let f = filled as f64 / (N * PERIODS) as f64;
        let kept = [1.0 - f, 1.0 - f * 8.0 / 7.0];
        let signals = JointSignals::from_fn(1, N * PERIODS, |_, k| y[k]);
        let mut replicates = replicate_noise(&signals, N).unwrap();
        replicates.sigma[0] /= kept[1].sqrt();
        let squares = y.iter().map(|y| y * y).sum::<f64>();
        let found = explainable(&[squares], 0, &replicates, kept)[0];
        assert!((0.257..0.338).contains(&found), "{found}");
    }
}
