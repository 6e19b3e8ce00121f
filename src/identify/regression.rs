//! A log laid out for regression, and several logs stacked into one.

use super::course::Course;
use super::error::IdentifyError;
use super::identifier::SAME_RATE;
use super::lowered::Lowered;
use super::prepared::{Prepared, Processing};
use super::problem::Problem;

/// A log laid out for regression.
#[derive(Clone)]
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
    /// What options lowered for every log.
    pub lowered: Vec<Lowered>,
    /// Joints (0-based) that move in every log, too fast for the rate asked for.
    pub(super) outpaced: Vec<usize>,
    /// Where the log comes from, or the logs that are joined, for messages.
    pub(super) log: String,
    /// Course of several joined logs, of which `prepared` holds the first; `None` for a single log.
    course: Option<Course>,
}

impl Regression {
    /// A single log from `log`, `prepared` and laid out from its sample `first_sample` on, every `every`-th.
    pub(super) fn of(
        log: &str,
        prepared: Prepared,
        problem: Problem,
        instruments: Option<Problem>,
        [first_sample, every]: [usize; 2],
    ) -> Self {
        Self {
            problem,
            instruments,
            prepared,
            first_sample,
            every,
            lowered: Vec::new(),
            outpaced: Vec::new(),
            log: log.to_owned(),
            course: None,
        }
    }

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
        let is_other = |found_hz: &f64, own_hz: f64| (found_hz / own_hz - 1.0).abs() > SAME_RATE;
        if let Some(found_hz) = rates_hz.find(|hz| is_other(hz, expected_hz)) {
            return Err(IdentifyError::Rates { found_hz, expected_hz });
        }
        // Long runs were thinned behind their low-pass. The others follow, because blocks of time and the colour of the
        // noise are counted in rows.
        let coarsest = regressions.iter().map(|r| r.every).max().unwrap_or(1);
        let thinned = |r: Self| if logs > 1 { r.thinned(coarsest) } else { r };
        let regressions: Vec<Self> = regressions.into_iter().map(thinned).collect();
        let mut rows_hz = regressions.iter().map(|r| r.problem.rate_hz);
        let expected_hz = rows_hz.next().unwrap_or(expected_hz);
        if let Some(found_hz) = rows_hz.find(|hz| is_other(hz, expected_hz)) {
            return Err(IdentifyError::Rates { found_hz, expected_hz });
        }
        let mut all = regressions.into_iter();
        let Some(mut first) = all.next() else {
            return Err(IdentifyError::NoLogs);
        };
        let mut rest: Vec<Self> = all.collect();
        if rest.is_empty() {
            return Ok(first);
        }
        let mut course = first.course();
        course.append(&rest.iter().map(Self::course).collect::<Vec<_>>());
        let filled_rows = first.filled_rows() + rest.iter().map(Self::filled_rows).sum::<f64>();
        for part in std::iter::once(&mut first).chain(&mut rest) {
            part.problem.unfold();
            part.instruments.iter_mut().for_each(Problem::unfold);
        }
        let Prepared { processing, warnings, .. } = &mut first.prepared;
        *processing = Processing { logs, periods: 1, harmonics: None, ..processing.clone() };
        warnings.extend(rest.iter().flat_map(|other| other.prepared.warnings.clone()));
        let is_in = |other: &Self, one: &Lowered| other.lowered.iter().any(|l| l.is_like(one));
        first.lowered.retain(|one| rest.iter().all(|other| is_in(other, one)));
        first.outpaced.retain(|j| rest.iter().all(|other| other.outpaced.contains(j)));
        first.log =
            std::iter::once(&first).chain(&rest).map(|r| &*r.log).collect::<Vec<_>>().join(", ");
        first.prepared.replicates = None;
        first.prepared.acceleration = None;
        first.prepared.each_period = None;
        first.prepared.recorded = None;
        first.prepared.between = None;
        let (problems, instruments): (Vec<Problem>, Vec<Option<Problem>>) =
            rest.into_iter().map(|other| (other.problem, other.instruments)).unzip();
        first.problem.append(&problems);
        let instruments: Option<Vec<Problem>> = instruments.into_iter().collect();
        first.instruments = first.instruments.zip(instruments).map(|(mut own, others)| {
            own.append(&others);
            own
        });
        first.prepared.filled_share = filled_rows / first.problem.samples as f64;
        first.course = Some(course);
        Ok(first)
    }

    /// The same with `every`-th sample of `prepared` in the problem, as far as that is a multiple of what it has now.
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
