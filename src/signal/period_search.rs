//! Finds whether a motion repeats, how long its period is, and which part of the log consists of whole periods; there
//! is nothing to set.
//!
//! 1. Candidates: lags L at which the mean square difference d(L) = ⟨|q(k + L) − q(k)|²⟩, summed over joints and
//!    computed by FFT, has a local minimum below a quarter of the value for unrelated positions (2 × variance).
//! 2. Each candidate is moved to the lag nearby at which the fast parts of the motion differ least.
//! 3. At that lag, the part of the log that repeats is cut out, and the period refined ([`Record::repeats_at`]).
//! 4. Among the candidates that cover two or more periods, the one that covers most wins, and the shortest among
//!    equals, so that a period is preferred to its multiples.

use fourier::{Complex64, Forward, Inverse};

use super::error::{SignalError, enough};
use super::period::{Period, Record};
use crate::cumulative_sum::accumulate;
use crate::robot::JointSignals;

/// A longer log is thinned to about this many samples for the search for candidates.
const SEARCH_SAMPLES: usize = 16384;
/// Shortest period that is searched for, in samples of the (thinned) log.
const SHORTEST_PERIOD: usize = 16;
/// Largest mean square difference of a candidate, relative to that of unrelated positions.
const CANDIDATE_SHARE: f64 = 0.25;

/// Transform plans and working memory of the search, reused from log to log.
#[derive(Default)]
pub struct PeriodSearch {
    plans: Option<Plans>,
    time: Vec<f64>,
    spectrum: Vec<Complex64>,
    power: Vec<Complex64>,
    /// Σ q² before each sample of the thinned log, over all joints.
    energy: Vec<f64>,
    /// Σ |q(k + L) − q(k)|² before each k.
    sums: Vec<f64>,
}

/// Transforms of one length.
struct Plans {
    length: usize,
    forward: Forward,
    inverse: Inverse,
}

/// [`PeriodSearch::find`] for a single log.
pub fn find_period(q_rad: &JointSignals) -> Result<Option<Period>, SignalError> {
    PeriodSearch::default().find(q_rad)
}

/// A candidate lag and its uncertainty, in samples.
#[derive(Debug, Clone, Copy)]
struct Candidate {
    samples: usize,
    uncertainty: usize,
}

impl PeriodSearch {
    /// The period of the motion `q_rad` (joints × samples), or `None` if no stretch of two periods or
    /// more repeats. The log may have run-in, run-out and standstill around it.
    ///
    /// Errors: fewer than 64 samples, a value that is not finite.
    pub fn find(&mut self, q_rad: &JointSignals) -> Result<Option<Period>, SignalError> {
        enough("the search for a period", q_rad.samples(), 4 * SHORTEST_PERIOD)?;
        for joint in 0..q_rad.joints() {
            if let Some(sample) = q_rad.joint(joint).iter().position(|v| !v.is_finite()) {
                let value = q_rad.joint(joint)[sample];
                return Err(SignalError::NotFinite { what: "angle", joint, sample, value });
            }
        }
        let record = Record::new(q_rad);
        if record.is_at_rest() {
            return Ok(None);
        }
        let mut best: Option<Period> = None;
        for candidate in self.candidates(q_rad) {
            // To replace the best, a candidate must cover more by over one of its own periods, which no multiple of the
            // best period can.
            let needed =
                |period: usize| best.as_ref().map_or(0, |b: &Period| b.window.len() + period);
            if needed(candidate.samples - candidate.uncertainty) >= q_rad.samples() {
                continue;
            }
            let lag = candidate.sharpened(&record, q_rad.samples() / 2);
            let Some(found) = record.repeats_at(lag, &mut self.sums) else { continue };
            if found.window.len() > needed(found.samples) {
                best = Some(found);
            }
        }
        Ok(best)
    }

    /// The candidates, from a log thinned by averaging neighbouring samples.
    fn candidates(&mut self, q_rad: &JointSignals) -> Vec<Candidate> {
        let thin = q_rad.samples().div_ceil(SEARCH_SAMPLES);
        let n = q_rad.samples() / thin;
        let longest = n / 2;
        // Long enough that the circular correlation does not wrap around at any lag in use.
        let length = (n + longest + 1).next_power_of_two();
        let plans = match self.plans.take().filter(|plans| plans.length == length) {
            Some(plans) => plans,
            None => Plans::new(length),
        };
        let Self { time, spectrum, power, energy, .. } = self;
        time.resize(length, 0.0);
        spectrum.resize(length / 2 + 1, Complex64::ZERO);
        power.clear();
        power.resize(length / 2 + 1, Complex64::ZERO);
        energy.clear();
        energy.resize(n + 1, 0.0);
        for j in 0..q_rad.joints() {
            let series = q_rad.joint(j);
            let mean = series.iter().sum::<f64>() / series.len() as f64;
            time.fill(0.0);
            for (t, part) in time.iter_mut().zip(series.chunks_exact(thin)).take(n) {
                *t = part.iter().sum::<f64>() / thin as f64 - mean;
            }
            for (energy, t) in energy[1..].iter_mut().zip(time.iter()) {
                *energy += t * t;
            }
            plans.forward.process(time, spectrum).expect("buffers have the plan's length");
            for (p, c) in power.iter_mut().zip(spectrum.iter()) {
                p.re += c.norm_sqr();
            }
        }
        accumulate(energy);
        plans.inverse.process(power, time).expect("buffers fit and the ends are real");
        self.plans = Some(plans);
        let correlation = |lag: usize| time[lag] / length as f64;
        let difference = |lag: usize| {
            let both = energy[n - lag] + energy[n] - energy[lag];
            (both - 2.0 * correlation(lag)) / (n - lag) as f64
        };
        let unrelated = 2.0 * energy[n] / n as f64;
        (SHORTEST_PERIOD..=longest)
            .filter(|&lag| {
                let d = difference(lag);
                d < CANDIDATE_SHARE * unrelated
                    && d <= difference(lag - 1)
                    && d <= difference(lag + 1)
            })
            .map(|lag| Candidate { samples: lag * thin, uncertainty: thin })
            .collect()
    }
}

impl Candidate {
    /// The lag near the candidate, `longest` at most, at which most of the `record` repeats best.
    fn sharpened(self, record: &Record, longest: usize) -> usize {
        let Self { samples, uncertainty } = self;
        let cost = |lag: usize| record.difference_of_fast(lag, uncertainty);
        let mut best = (samples, cost(samples));
        // Run-in and rest bias the candidate, so the search continues as long as it improves.
        loop {
            let lowest = best.0.saturating_sub(uncertainty).max(SHORTEST_PERIOD);
            let highest = (best.0 + uncertainty).min(longest);
            let Some(next) = (lowest..=highest)
                .map(|lag| (lag, cost(lag)))
                .min_by(|a, b| a.1.total_cmp(&b.1))
                .filter(|next| next.1 < best.1)
            else {
                return best.0;
            };
            best = next;
        }
    }
}

impl Plans {
    fn new(length: usize) -> Self {
        let (forward, inverse) = (fourier::forward(length), fourier::inverse(length));
        Self { length, forward, inverse }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::signal::repeated_motions::smooth_periods;
    use rand::{SeedableRng, rngs::ChaCha8Rng};
    use rand_distr::{Distribution, StandardNormal};

    #[test]
    fn two_periods_are_enough_and_one_is_not() {
        let two = find_period(&smooth_periods(2500.0, 2.3, 500, 0, 2e-5, 7))
            .unwrap()
            .expect("two periods");
        assert_eq!((two.samples, two.periods, two.is_whole), (2500, 2, true));
        assert_eq!(find_period(&smooth_periods(2500.0, 1.6, 500, 200, 2e-5, 8)).unwrap(), None);
        assert_eq!(find_period(&smooth_periods(5000.0, 1.0, 300, 300, 2e-5, 9)).unwrap(), None);
    }

    #[test]
    fn rest_and_noise_are_not_periodic() {
        // Means of whole numbers are exact, those of tenths are not.
        for apart_rad in [1.0, 0.1] {
            let still = JointSignals::from_fn(6, 4000, |j, _| apart_rad * j as f64);
            assert_eq!(find_period(&still).unwrap(), None);
        }
        let mut rng = ChaCha8Rng::seed_from_u64(11);
        let noise = JointSignals::from_fn(6, 4000, |_, _| StandardNormal.sample(&mut rng));
        assert_eq!(find_period(&noise).unwrap(), None);
        let mut wandering = JointSignals::zeros(6, 6000);
        for j in 0..6 {
            let mut q = 0.0;
            for value in wandering.joint_mut(j) {
                let step: f64 = StandardNormal.sample(&mut rng);
                q += 0.01 * step;
                *value = q;
            }
        }
        assert_eq!(find_period(&wandering).unwrap(), None);
    }

    #[test]
    fn a_long_log_is_searched_thinned_and_found_to_the_sample() {
        let q = smooth_periods(5003.0, 12.0, 1000, 0, 2e-5, 12);
        let found = find_period(&q).unwrap().expect("twelve periods");
        assert_eq!((found.samples, found.periods, found.is_whole), (5003, 12, true), "{found:?}");
    }
}
