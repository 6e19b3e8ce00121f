//! Brings the channels of a log to motion and torque on one clock.

use std::ops::Range;

use super::error::IdentifyError;
use super::even::{BetweenRows, Even};
use super::measurement::{FEWEST_SAMPLES, Measurement};
use super::options::Options;
use super::prepared::{Prepared, Processing};
use crate::dynamics::Motion;
use crate::median::median_step;
use crate::robot::JointSignals;
use crate::signal::{
    Activity, FitScratch, Period, PeriodSearch, PeriodicFit, PeriodicRecord, Scratch, ZeroPhase,
    central_4, reading_limit, reading_noise, replicate_noise, resolution,
};

/// Fewest periods for which a log is put on another clock: two reveal little about the noise.
const FEWEST_PERIODS: usize = 3;
/// Number of clocks tried until a period is a whole number of samples: with each the period is known better.
const CLOCKS: usize = 3;
/// Fewest cycles of its cut-off that a single run may last. Behind a low-pass at f, T seconds hold 2 f T independent
/// values of each torque; six cycles, of whose samples at least three quarters are used, hold 54 for six joints, about
/// as many as such an arm has base parameters.
const LEAST_CYCLES: f64 = 6.0;

/// Filters and plans kept from log to log.
#[derive(Default)]
pub struct Preparer {
    search: PeriodSearch,
    periodic: Option<PeriodicFit>,
    fit: FitScratch,
    filter: Scratch,
    for_diagnosis: bool,
}

impl Preparer {
    /// As [`Self::prepare`], with what only a diagnosis reads: the motion of every single period, and the resolution
    /// and limits of the readings, for which whole columns of the log are sorted.
    pub fn prepare_for_diagnosis(
        &mut self,
        m: &Measurement,
        options: &Options,
    ) -> Result<Prepared, IdentifyError> {
        self.for_diagnosis = true;
        let prepared = self.prepare(m, options);
        self.for_diagnosis = false;
        prepared
    }

    /// Brings `m` into the shape of a regression problem.
    ///
    /// A motion that repeats is averaged over its whole periods and differentiated as a Fourier
    /// series; the torque of every period is kept and nothing is filtered. A single run keeps its
    /// samples; the low-pass comes later, on torque and regressor alike.
    pub fn prepare(
        &mut self,
        m: &Measurement,
        options: &Options,
    ) -> Result<Prepared, IdentifyError> {
        m.require_rows()?;
        let mut warnings = Vec::new();
        let mut even = Even::of(m, options, None, &mut self.filter, &mut warnings)?;
        if let Some(rate_hz) = options.rate_hz.filter(|_| even.q_rad.samples() < FEWEST_SAMPLES) {
            return Err(IdentifyError::RateTooLow { log: m.source.to_owned(), rate_hz });
        }
        let mut period =
            if options.is_single_run() { None } else { self.search.find(&even.q_rad)? };
        let is_misfit = |p: &&Period| !p.is_whole && p.periods >= FEWEST_PERIODS;
        if let (Some(found), None) = (period.as_ref().filter(is_misfit), options.rate_hz)
            && let Some((fitting, whole, remarks)) =
                self.on_fitting_clock(m, options, found.clone())?
        {
            (even, period, warnings) = (fitting, Some(whole), remarks);
        }
        if let Some(wanted) = options.repetition.period_s() {
            let found = period.as_ref().map(|p| p.samples as f64 / even.rate_hz);
            if found.is_none_or(|found| (found - wanted).abs() > 1.5 / even.rate_hz) {
                let log = m.source.to_owned();
                return Err(IdentifyError::NoSuchPeriod { log, wanted_s: wanted, found_s: found });
            }
        }
        match period {
            Some(period) if period.is_whole => {
                self.periodic(m, &even, (period.window, period.samples), warnings)
            }
            Some(period) => {
                warnings.push(format!(
                    "the motion repeats every {:.3} samples, which is not a whole number: periods \
                     are not averaged",
                    period.refined_samples
                ));
                self.single_run(m, &even, options, warnings)
            }
            None => self.single_run(m, &even, options, warnings),
        }
    }

    /// Puts the log on a clock that is faster or slower by so much that the period is a whole number of samples.
    /// Returns the log, that period, and remarks; `None` where no such clock is found.
    fn on_fitting_clock<'a>(
        &mut self,
        m: &Measurement<'a>,
        options: &Options,
        mut period: Period,
    ) -> Result<Option<(Even<'a>, Period, Vec<String>)>, IdentifyError> {
        let mut faster = 1.0;
        for _ in 0..CLOCKS {
            faster *= period.samples as f64 / period.refined_samples;
            let mut remarks = Vec::new();
            let even = Even::of(m, options, Some(faster), &mut self.filter, &mut remarks)?;
            let Some(found) = self.search.find(&even.q_rad)? else { return Ok(None) };
            if found.is_whole {
                return Ok(Some((even, found, remarks)));
            }
            period = found;
        }
        Ok(None)
    }

    /// Deviation of every period's motion from the averaged motion, in the harmonics that the average keeps; `None`
    /// for a single run.
    pub(super) fn deviations(
        &mut self,
        prepared: &Prepared,
    ) -> Result<Option<Motion>, IdentifyError> {
        let Some(record) = &prepared.recorded else { return Ok(None) };
        let Processing { periods, rate_hz, .. } = prepared.processing;
        let fit = self.periodic_fit(prepared.motion.samples(), periods, rate_hz)?;
        let deviations = fit.deviations(record, &mut self.fit);
        self.periodic = Some(fit);
        let [q_rad, qd_rad_s, qdd_rad_s2] = deviations?;
        Ok(Some(Motion { q_rad, qd_rad_s, qdd_rad_s2 }))
    }

    /// The fit of the last log, where it suits this motion, or a new one.
    fn periodic_fit(
        &mut self,
        samples_per_period: usize,
        periods: usize,
        rate_hz: f64,
    ) -> Result<PeriodicFit, IdentifyError> {
        let fits = |fit: &PeriodicFit| {
            fit.samples_per_period() == samples_per_period
                && fit.periods() == periods
                && fit.rate_hz() == rate_hz
        };
        Ok(match self.periodic.take().filter(fits) {
            Some(fit) => fit,
            None => PeriodicFit::new(samples_per_period, periods, rate_hz)?,
        })
    }

    fn periodic(
        &mut self,
        m: &Measurement,
        even: &Even,
        (window, samples_per_period): (Range<usize>, usize),
        mut warnings: Vec<String>,
    ) -> Result<Prepared, IdentifyError> {
        let periods = window.len() / samples_per_period;
        let at = |k: usize| even.start_s + k as f64 / even.rate_hz;
        if even.q_rad.samples() / samples_per_period > periods {
            let unused_s = (even.q_rad.samples() - window.len()) as f64 / even.rate_hz;
            warnings.push(format!(
                "the motion repeats from {:.2} s to {:.2} s; the other {unused_s:.2} s of the log, longer than a period, are not used",
                at(window.start),
                at(window.end)
            ));
        }
        let fit = self.periodic_fit(samples_per_period, periods, even.rate_hz)?;
        let [q_rad, qd_rad_s, torque_nm] =
            even.repeated(&window, samples_per_period, &mut self.filter)?;
        let rows = even.as_read(&window);
        let record = match &rows {
            Some((rows, every)) => PeriodicRecord::decimated(
                [q_rad, qd_rad_s],
                rows.each_ref(),
                samples_per_period * every,
                *every,
            ),
            None => PeriodicRecord::new(q_rad, qd_rad_s, samples_per_period),
        };
        let averaged = fit.fit(&record, &mut self.fit);
        let each_period = self
            .for_diagnosis
            .then(|| fit.each_period(&record, even.highest, &mut self.fit))
            .transpose();
        self.periodic = Some(fit);
        let averaged = averaged?;
        let (angle_resolution_rad, torque_limit_nm) = self.readings(m);
        let each_period = each_period?.map(|[q_rad, qd_rad_s, qdd_rad_s2]| Motion {
            q_rad,
            qd_rad_s,
            qdd_rad_s2,
        });
        Ok(Prepared {
            motion: Motion {
                q_rad: averaged.q_rad,
                qd_rad_s: averaged.qd_rad_s,
                qdd_rad_s2: averaged.qdd_rad_s2,
            },
            lead_in_s: even.start_s - m.time_s[0] + window.start as f64 / even.rate_hz,
            each_period,
            recorded: Some(record),
            between: even.between.as_ref().map(|rows| BetweenRows {
                time_s: rows.time_s.clone(),
                qd_rad_s: rows.qd_rad_s.clone(),
                places: rows.places[window.clone()].to_vec(),
            }),
            highest: even.highest,
            angle_resolution_rad,
            velocity_noise: None,
            held_at_rest: Vec::new(),
            torque_limit_nm,
            replicates: Some(replicate_noise(&torque_nm, samples_per_period)?),
            acceleration: Some(averaged.acceleration),
            torque_nm,
            processing: Processing {
                cutoff_hz: None,
                order: None,
                rate_hz: even.rate_hz,
                window_s: [at(window.start), at(window.end)],
                torque_filtered: false,
                period_s: Some(samples_per_period as f64 / even.rate_hz),
                periods,
                logs: 1,
                resampled: even.resampled,
                harmonics: Some(averaged.harmonics),
            },
            filled_share: 0.0,
            warnings,
        })
    }

    /// Resolution of the angles, rad, and limit of the torques, Nm, as read, where a diagnosis wants them.
    fn readings(&self, m: &Measurement) -> (Vec<f64>, Vec<Option<f64>>) {
        if !self.for_diagnosis {
            return (Vec::new(), Vec::new());
        }
        let angles = (0..m.q_rad.joints()).map(|j| m.q_rad.joint(j));
        let torques = (0..m.torque_nm.joints()).map(|j| m.torque_nm.joint(j));
        (angles.map(resolution).collect(), torques.map(reading_limit).collect())
    }

    fn single_run(
        &mut self,
        m: &Measurement,
        even: &Even,
        options: &Options,
        warnings: Vec<String>,
    ) -> Result<Prepared, IdentifyError> {
        let rate_hz = even.rate_hz;
        let window = experiment_window(&Activity::of(&even.qd_rad_s, rate_hz)?)
            .ok_or_else(|| without_motion(m, options))?;
        if window.len() < FEWEST_SAMPLES {
            let (samples, needed) = (window.len(), FEWEST_SAMPLES);
            return Err(IdentifyError::TooShort { log: m.source.to_owned(), samples, needed });
        }
        if options.cutoff_hz >= 0.5 * rate_hz {
            let (log, cutoff_hz) = (m.source.to_owned(), options.cutoff_hz);
            return Err(IdentifyError::Cutoff { log, cutoff_hz, rate_hz });
        }
        let seconds = window.len() as f64 / rate_hz;
        let cycles = options.cutoff_hz * seconds;
        if cycles < LEAST_CYCLES {
            let (log, cutoff_hz, needed) = (m.source.to_owned(), options.cutoff_hz, LEAST_CYCLES);
            return Err(IdentifyError::CutoffTooLow { log, cutoff_hz, seconds, cycles, needed });
        }
        let cutoff_hz = options.derivative_cutoff_hz(rate_hz);
        let smooth = ZeroPhase::new(cutoff_hz, options.order, rate_hz)?;
        let light = ZeroPhase::new(Options::VELOCITY_END * rate_hz, options.order, rate_hz)?;
        let mut qd_rad_s = even.qd_rad_s.clone().into_owned();
        let mut qdd_rad_s2 = JointSignals::zeros(even.q_rad.joints(), even.q_rad.samples());
        for j in 0..qdd_rad_s2.joints() {
            let mut qd = even.qd_rad_s.joint(j).to_vec();
            smooth.filter_in_place(&mut qd, &mut self.filter)?;
            central_4(&qd, rate_hz, qdd_rad_s2.joint_mut(j))?;
            light.filter_in_place(qd_rad_s.joint_mut(j), &mut self.filter)?;
        }
        let at = |k: usize| even.start_s + k as f64 / rate_hz;
        let (angle_resolution_rad, torque_limit_nm) = self.readings(m);
        Ok(Prepared {
            motion: Motion {
                q_rad: even.q_rad.slice(window.clone()),
                qd_rad_s: qd_rad_s.slice(window.clone()),
                qdd_rad_s2: qdd_rad_s2.slice(window.clone()),
            },
            lead_in_s: even.start_s - m.time_s[0] + window.start as f64 / rate_hz,
            torque_nm: even.torque_nm.slice(window.clone()),
            each_period: None,
            recorded: None,
            between: None,
            highest: even.highest,
            angle_resolution_rad,
            velocity_noise: Some(velocity_noise(m)),
            held_at_rest: Vec::new(),
            torque_limit_nm,
            replicates: None,
            acceleration: None,
            processing: Processing {
                cutoff_hz: Some(options.cutoff_hz),
                order: Some(options.order),
                rate_hz,
                window_s: [at(window.start), at(window.end)],
                torque_filtered: true,
                period_s: None,
                periods: 1,
                logs: 1,
                resampled: even.resampled,
                harmonics: None,
            },
            filled_share: 0.0,
            warnings,
        })
    }
}

/// Why the samples of `m` show no motion: there is none in the log, or none that the rate asked for resolves.
fn without_motion(m: &Measurement, options: &Options) -> IdentifyError {
    let log = m.source.to_owned();
    match options.rate_hz {
        Some(rate_hz) if (0..m.q_rad.joints()).any(|j| m.moves(j)) => {
            IdentifyError::RateTooLow { log, rate_hz }
        }
        _ => IdentifyError::NoMotion { log },
    }
}

fn velocity_noise(m: &Measurement) -> Vec<f64> {
    let step_s = median_step(m.time_s).unwrap_or(0.0);
    let density = |j| 2.0 * step_s * reading_noise(m.qd_rad_s.joint(j)).powi(2);
    (0..m.qd_rad_s.joints()).map(density).collect()
}

/// The samples of the experiment proper: the motion without standstill at its ends, and without a part that a pause
/// separates from it (the arm driving to its start), provided that one uninterrupted stretch is most of the motion.
/// Where many moves and pauses alternate, all of them are the experiment.
fn experiment_window(activity: &Activity) -> Option<Range<usize>> {
    let whole = activity.moving_window(0)?;
    let inside = activity.rests.iter().filter(|r| r.start > whole.start && r.end < whole.end);
    let mut start = whole.start;
    let mut longest = 0..0;
    for rest in inside.cloned().chain(std::iter::once(whole.end..whole.end)) {
        if rest.start - start > longest.len() {
            longest = start..rest.start;
        }
        start = rest.end;
    }
    Some(if longest.len() > whole.len() / 2 { longest } else { whole })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::fill_gaps;
    use crate::signal::repeated_motions::{minimum_jerk, moves_with_pauses};
    use rand::{SeedableRng, rngs::ChaCha8Rng};
    use rand_distr::{Distribution, StandardNormal};

    /// Six periods of 10 s, sampled at `rate_hz`: time, angles, velocities, and torques with a noise of 1 Nm.
    fn log(rate_hz: f64) -> (Vec<f64>, [JointSignals; 3]) {
        let samples = (62.0 * rate_hz) as usize;
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut noise = || -> f64 { StandardNormal.sample(&mut rng) };
        let time_s: Vec<f64> = (0..samples).map(|k| k as f64 / rate_hz).collect();
        let omega = std::f64::consts::TAU / 10.0;
        let phase = |j: usize, k: usize| omega * (1.0 + j as f64) * time_s[k];
        let q_rad = JointSignals::from_fn(2, samples, |j, k| phase(j, k).sin() + 2e-5 * noise());
        let qd_rad_s = JointSignals::from_fn(2, samples, |j, k| {
            omega * (1.0 + j as f64) * phase(j, k).cos() + 1e-3 * noise()
        });
        let torque_nm = JointSignals::from_fn(2, samples, |j, k| 9.0 * phase(j, k).sin() + noise());
        (time_s, [q_rad, qd_rad_s, torque_nm])
    }

    fn prepared_from(time_s: &[f64], [q_rad, qd_rad_s, torque_nm]: [&JointSignals; 3]) -> Prepared {
        let m = Measurement { source: "test", time_s, q_rad, qd_rad_s, torque_nm };
        Preparer::default().prepare(&m, &Options::default()).unwrap()
    }

    fn prepared(rate_hz: f64) -> Prepared {
        let (time_s, channels) = log(rate_hz);
        prepared_from(&time_s, channels.each_ref())
    }

    /// 80 of 1000 rows are filled in. The scatter of 12 000 values of σ = 1 Nm is known to 1/√(2·10 000), of which
    /// five are allowed; without its correction the scatter would be 5 % too low.
    #[test]
    fn rows_that_were_filled_in_make_no_noise_quieter() {
        let (time_s, channels) = log(100.0);
        // Ten gaps a period, at other phases in each.
        let is_there = |k: &usize| !(40..48).contains(&((k + 11 * (k / 1000)) % 100));
        let rows: Vec<usize> = (0..time_s.len()).filter(is_there).collect();
        let of =
            |y: &JointSignals| JointSignals::from_fn(2, rows.len(), |j, i| y.joint(j)[rows[i]]);
        let time_s: Vec<f64> = rows.iter().map(|k| time_s[*k]).collect();
        let [q, qd, torque] = channels.each_ref().map(of);
        let filled = fill_gaps(&time_s, &q, &qd, &torque).unwrap().expect("gaps to fill");
        let channels = [&filled.q_rad, &filled.qd_rad_s, &filled.torque_nm];
        let mut prepared = prepared_from(&filled.time_s, channels);
        assert_eq!(prepared.processing.periods, 6);
        let before = prepared.replicates.clone().unwrap().sigma;
        let mut in_parts = prepared.clone();
        prepared.count_filled(&filled.gaps);
        // Gap by gap, and beside none, they count as they do together.
        filled.gaps.iter().for_each(|gap| in_parts.count_filled(std::slice::from_ref(gap)));
        in_parts.count_filled(&[]);
        let share = prepared.filled_share;
        assert!((in_parts.filled_share - share).abs() < 1e-14, "{}", in_parts.filled_share);
        let sigmas = [&prepared, &in_parts].map(|p| p.replicates.clone().unwrap().sigma);
        for (together, in_parts) in sigmas[0].iter().zip(&sigmas[1]) {
            // A product of as many square roots as there are gaps.
            assert!((in_parts / together - 1.0).abs() < 1e-13, "{together} {in_parts}");
        }
        assert!((0.07..0.085).contains(&share), "{share}");
        for (sigma, before) in prepared.replicates.unwrap().sigma.iter().zip(before) {
            assert!((sigma - 1.0).abs() < 0.035 && before < 0.965, "{sigma} {before}");
        }
    }

    /// The longest stretch begins after a gap, at 7 s. The samples used begin there, and not where the log does, at
    /// 100 s by its clock.
    #[test]
    fn time_before_the_longest_stretch_has_passed() {
        let (time_s, channels) = log(100.0);
        let rows: Vec<usize> = (0..time_s.len()).filter(|k| !(500..700).contains(k)).collect();
        let of =
            |y: &JointSignals| JointSignals::from_fn(2, rows.len(), |j, i| y.joint(j)[rows[i]]);
        let time_s: Vec<f64> = rows.iter().map(|k| 100.0 + time_s[*k]).collect();
        let channels = channels.each_ref().map(of);
        let prepared = prepared_from(&time_s, channels.each_ref());
        let [start_s, _] = prepared.processing.window_s;
        assert!((start_s - 100.0 - prepared.lead_in_s).abs() < 1e-9, "{}", prepared.lead_in_s);
        assert!(prepared.lead_in_s > 6.9, "{}", prepared.lead_in_s);
    }

    #[test]
    fn a_period_of_whole_samples_keeps_the_clock() {
        let processing = prepared(100.0).processing;
        assert_eq!((processing.periods, processing.resampled), (6, false));
        assert!((processing.rate_hz - 100.0).abs() < 1e-9);
    }

    /// Cycles of moves with pauses that last 10.97 s, 1371.25 samples: the period that is found is the one asked for.
    #[test]
    fn cycles_with_pauses_are_put_on_a_clock_that_fits() {
        const PERIOD_S: f64 = 10.97;
        const RATE_HZ: f64 = 125.0;
        const MOVING: f64 = 0.12;
        let samples = (6.2 * PERIOD_S * RATE_HZ) as usize;
        let time_s: Vec<f64> = (0..samples).map(|k| k as f64 / RATE_HZ).collect();
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let mut noise = || -> f64 { StandardNormal.sample(&mut rng) };
        let mut of = |sigma: f64, progress: &dyn Fn(f64) -> f64| {
            JointSignals::from_fn(2, samples, |j, k| {
                moves_with_pauses(j, time_s[k] / PERIOD_S, MOVING, progress) + sigma * noise()
            })
        };
        let q_rad = of(2e-5, &minimum_jerk);
        let rate = 30.0 / (MOVING * PERIOD_S);
        let qd_rad_s = of(1e-3, &|s| rate * (s * (1.0 - s)).powi(2));
        let torque_nm = of(1.0, &|s| 9.0 * s);
        let (q_rad, qd_rad_s, torque_nm) = (&q_rad, &qd_rad_s, &torque_nm);
        let m = Measurement { source: "test", time_s: &time_s, q_rad, qd_rad_s, torque_nm };
        for wanted_s in [None, Some(PERIOD_S)] {
            let options = Options { repetition: wanted_s.into(), ..Options::default() };
            let processing = Preparer::default().prepare(&m, &options).unwrap().processing;
            assert_eq!((processing.periods, processing.resampled), (6, true), "{wanted_s:?}");
            let period_s = processing.period_s.unwrap();
            assert!((period_s - PERIOD_S).abs() < 0.01 / RATE_HZ, "{period_s}");
        }
    }

    /// A period of 937.3 samples has 937 on a clock that is 0.03 % slower. The period is then known as well as that
    /// clock: to a hundredth of a sample over the log.
    #[test]
    fn a_period_between_samples_is_put_on_a_clock_that_fits() {
        let processing = prepared(93.73).processing;
        assert_eq!((processing.periods, processing.resampled), (6, true));
        let period_s = processing.period_s.unwrap();
        assert!((period_s - 10.0).abs() < 0.01 / 93.73, "{period_s}");
    }
}
