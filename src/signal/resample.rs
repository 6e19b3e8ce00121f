//! Resamples signals with jittered time stamps and gaps onto a uniform grid.
//!
//! The grid is t₀ + k/f_s, starting at the first time stamp. Between two time stamps that are close enough a value is
//! interpolated. Across a longer gap nothing is invented: its grid points are left out and the gap is reported. Samples
//! on either side of a gap belong to different [`Resampler::segments`], and filters must not run across.

use std::ops::Range;

use super::error::{SignalError, checked_rate_hz, enough};
use super::instants::{Bracket, Instants};
use crate::median::median;

/// A stretch of time without samples that is longer than the caller allows to be interpolated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gap {
    /// Last time stamp before it, s.
    pub start_s: f64,
    /// First time stamp after it, s.
    pub end_s: f64,
}

/// A uniform grid over the time stamps of a log; applies to any number of signals.
#[derive(Debug, Clone, PartialEq)]
pub struct Resampler {
    start_s: f64,
    rate_hz: f64,
    /// Indices of the samples on the full grid, with the points in gaps counted.
    ticks: Vec<usize>,
    instants: Instants,
    segments: Vec<Range<usize>>,
    gaps: Vec<Gap>,
}

/// A step longer than this many median steps contains missing rows.
const LONGEST_STEP: f64 = 1.8;
/// Relative difference from the mean step up to which the median step counts as typical. A grid that much faster or
/// slower than the rows loses nothing, and a median is a round number that late rows do not move.
const TYPICAL_WITHIN: f64 = 0.1;
/// Largest number of grid samples per row; more would be invented.
pub const MOST_PER_ROW: f64 = 10.0;

/// The natural sampling rate of a log, Hz: one over the median time step, or over the mean step if the median is not
/// typical (stamps in whole milliseconds of a log at 400 Hz are 2 and 3 ms apart).
///
/// Errors: fewer than two time stamps, time that does not increase, time stamps in bursts.
pub fn natural_rate_hz(time_s: &[f64]) -> Result<f64, SignalError> {
    check_time(time_s)?;
    let mut steps: Vec<f64> = time_s.windows(2).map(|t| t[1] - t[0]).collect();
    // `check_time` guarantees two stamps.
    let median_s = median(&mut steps).unwrap_or(f64::NAN);
    let single = steps.iter().filter(|step_s| **step_s <= LONGEST_STEP * median_s);
    let (sum_s, count) =
        single.fold((0.0_f64, 0_usize), |(sum_s, n), step_s| (sum_s + step_s, n + 1));
    let mean_s = sum_s / count as f64;
    let is_typical = (mean_s / median_s - 1.0).abs() <= TYPICAL_WITHIN;
    let step_s = if is_typical { median_s } else { mean_s };
    // Differences of large time stamps carry rounding; no clock is known to more than nine digits.
    let rate_hz = 1.0 / step_s;
    let unit = 10f64.powi(rate_hz.log10().floor() as i32 - 8);
    let rate_hz = (rate_hz / unit).round() * unit;
    let longest_s = bridged_gap_s(rate_hz);
    let covered_s: f64 = steps.iter().map(|step_s| step_s.min(longest_s)).sum();
    let rows_hz = steps.len() as f64 / covered_s;
    if rate_hz > MOST_PER_ROW * rows_hz {
        return Err(SignalError::Bursts { rate_hz, rows_hz });
    }
    Ok(rate_hz)
}

/// The longest gap that is bridged in a log of `rate_hz`, s: ten samples or, in a faster log, the duration of ten
/// samples at 125 Hz. How far a motion can be interpolated depends on the motion, not on the sampling rate.
pub fn bridged_gap_s(rate_hz: f64) -> f64 {
    10.0 / rate_hz.min(125.0)
}

/// Stretches between neighbouring time stamps that are longer than `limit_s`.
pub fn gaps(time_s: &[f64], limit_s: f64) -> Vec<Gap> {
    time_s
        .windows(2)
        .filter(|t| t[1] - t[0] > limit_s)
        .map(|t| Gap { start_s: t[0], end_s: t[1] })
        .collect()
}

pub(super) fn check_time(time_s: &[f64]) -> Result<(), SignalError> {
    enough("a time grid", time_s.len(), 2)?;
    let fails = |t: &[f64]| !(t[1] - t[0] > 0.0 && (t[1] - t[0]).is_finite());
    match time_s.windows(2).position(fails) {
        Some(k) => {
            Err(SignalError::Time { index: k + 1, before_s: time_s[k], after_s: time_s[k + 1] })
        }
        None => Ok(()),
    }
}

impl Resampler {
    /// Grid at `rate_hz` over strictly increasing `time_s`; nothing is interpolated between time
    /// stamps further apart than `longest_gap_s`.
    pub fn new(time_s: &[f64], rate_hz: f64, longest_gap_s: f64) -> Result<Self, SignalError> {
        check_time(time_s)?;
        checked_rate_hz(rate_hz)?;
        if longest_gap_s.is_nan() || longest_gap_s <= 0.0 {
            return Err(SignalError::GapLimit { limit_s: longest_gap_s });
        }
        let start_s = time_s[0];
        let (mut ticks, mut places) = (Vec::new(), Vec::new());
        let mut segments = Vec::new();
        let mut segment_start = 0;
        for (left, t) in time_s.windows(2).enumerate() {
            let step_s = t[1] - t[0];
            if step_s > longest_gap_s {
                // A grid point exactly on the time stamp before the gap needs no interpolation.
                push_on_stamp(&mut ticks, &mut places, left, (t[0] - start_s) * rate_hz);
                close_segment(&mut segments, &mut segment_start, ticks.len());
                continue;
            }
            let first = ticks.last().map_or(0, |tick| tick + 1);
            let first = first.max(((t[0] - start_s) * rate_hz - ROUNDING_TICKS).ceil() as usize);
            let offset_s = t[0] - start_s;
            let inside = (first..)
                .map(|tick| (tick, tick as f64 / rate_hz - offset_s))
                .take_while(|(_, dt)| *dt * rate_hz < step_s * rate_hz - ROUNDING_TICKS);
            for (tick, dt) in inside {
                ticks.push(tick);
                places.push(Bracket { left, u: (dt / step_s).max(0.0) });
            }
        }
        let last = time_s.len() - 1;
        push_on_stamp(&mut ticks, &mut places, last, (time_s[last] - start_s) * rate_hz);
        close_segment(&mut segments, &mut segment_start, ticks.len());
        let gaps = gaps(time_s, longest_gap_s);
        let instants = Instants::of(time_s.to_vec(), places);
        Ok(Self { start_s, rate_hz, ticks, instants, segments, gaps })
    }

    /// The positions of the grid samples among the time stamps, from which signals are interpolated.
    pub fn instants(&self) -> &Instants {
        &self.instants
    }

    /// Number of samples on the grid, without those in gaps.
    pub fn samples(&self) -> usize {
        self.ticks.len()
    }

    /// Rate of the grid, Hz.
    pub fn rate_hz(&self) -> f64 {
        self.rate_hz
    }

    /// Times of the samples, s, on the same clock as the time stamps.
    pub fn time_s(&self) -> Vec<f64> {
        self.ticks.iter().map(|tick| self.start_s + *tick as f64 / self.rate_hz).collect()
    }

    /// Ranges of samples without a gap inside; one range if there is no gap.
    pub fn segments(&self) -> &[Range<usize>] {
        &self.segments
    }

    /// The segment with the most samples; the last one if several are equally long.
    pub fn longest_segment(&self) -> Range<usize> {
        self.segments.iter().max_by_key(|s| s.len()).cloned().unwrap_or(0..0)
    }

    /// Gaps that were not bridged.
    pub fn gaps(&self) -> &[Gap] {
        &self.gaps
    }
}

/// Distance from a time stamp, in grid steps, below which a grid point coincides with it; allows for rounding of t ·
/// f_s.
const ROUNDING_TICKS: f64 = 1e-6;

/// Adds the grid point that coincides with time stamp `index`, which lies `after` ticks after the first one, if there
/// is such a point and it is new.
fn push_on_stamp(ticks: &mut Vec<usize>, places: &mut Vec<Bracket>, index: usize, after: f64) {
    let tick = after.round() as usize;
    let is_new = ticks.last().is_none_or(|last| *last < tick);
    if (after - after.round()).abs() <= ROUNDING_TICKS && is_new {
        ticks.push(tick);
        places.push(Bracket { left: index, u: 0.0 });
    }
}

fn close_segment(segments: &mut Vec<Range<usize>>, start: &mut usize, end: usize) {
    if end > *start {
        segments.push(*start..end);
    }
    *start = end;
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_uniform_log_comes_back_bit_for_bit() {
        let time_s: Vec<f64> = (0..1000).map(|k| 838.465 + k as f64 * 0.008).collect();
        let rate = natural_rate_hz(&time_s).unwrap();
        assert!((rate - 125.0).abs() < 1e-8);
        let y: Vec<f64> = (0..1000).map(|k| (k as f64 * 0.37).sin()).collect();
        let grid = Resampler::new(&time_s, 125.0, 0.1).unwrap();
        assert_eq!(grid.samples(), 1000);
        assert_eq!(grid.segments(), std::slice::from_ref(&(0..1000)));
        for (k, v) in grid.instants().linear(&y).unwrap().iter().enumerate() {
            // Time stamps at 838 s are rounded to 1e-13 s.
            assert!((v - y[k]).abs() < 1e-9);
        }
    }

    #[test]
    fn rounded_stamps_and_missing_rows_leave_the_rate() {
        fn rate(stamps: impl Iterator<Item = f64>) -> f64 {
            natural_rate_hz(&stamps.collect::<Vec<f64>>()).unwrap()
        }
        // 400 Hz in whole milliseconds: steps of 2 and 3 ms, either of which may be the median, and a pause of one
        // second.
        let pause_ms = |k: usize| if k > 600 { 1000.0 } else { 0.0 };
        let rounded = |k: usize| (2.5 * k as f64 + pause_ms(k)).round() / 1e3;
        for rows in [1000, 1001] {
            let found_hz = rate((0..rows).map(rounded));
            assert!((found_hz / 400.0 - 1.0).abs() < 1e-3, "{rows} rows: {found_hz} Hz");
        }
        // With steps of 10, 10 and 12 ms the natural step is 10 ms; in a log without every fifth row it is 8 ms.
        let uneven = |k: usize| 0.01 * k as f64 + 0.002 * (k / 3) as f64;
        assert!((rate((0..1000).map(uneven)) - 100.0).abs() < 1e-6);
        let kept = (0..1000).filter(|k| k % 5 != 0);
        assert!((rate(kept.map(|k| 0.008 * k as f64)) - 125.0).abs() < 1e-6);
    }

    #[test]
    fn stamps_in_bursts_are_refused_and_pauses_are_not() {
        // Eight rows at a time, stamped on arrival.
        let bursts: Vec<f64> =
            (0..1000).map(|k| 0.064 * (k / 8) as f64 + 5e-6 * (k % 8) as f64).collect();
        match natural_rate_hz(&bursts) {
            Err(SignalError::Bursts { rate_hz, rows_hz }) => {
                assert!((rate_hz / 2e5 - 1.0).abs() < 1e-6, "{rate_hz} Hz");
                assert!((rows_hz / 125.0 - 1.0).abs() < 0.01, "{rows_hz} Hz");
            }
            other => panic!("{other:?}"),
        }
        for rate_hz in [125.0, 1000.0] {
            let stamp = |k: usize| k as f64 / rate_hz + 1000.0 * (k / 100) as f64;
            let paused: Vec<f64> = (0..1000).map(stamp).collect();
            assert!((natural_rate_hz(&paused).unwrap() / rate_hz - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn cubic_resampling_is_exact_for_cubics_and_fourth_order_for_the_rest() {
        let worst = |step_s: f64, q: fn(f64) -> f64, qd: fn(f64) -> f64| {
            let n = (4.0 / step_s) as usize;
            let t: Vec<f64> = (0..n)
                .map(|k| step_s * (k as f64 + 0.3 * ((k * 7919) % 11) as f64 / 11.0))
                .collect();
            let values: Vec<f64> = t.iter().map(|t| q(*t)).collect();
            let slopes: Vec<f64> = t.iter().map(|t| qd(*t)).collect();
            let grid = Resampler::new(&t, 1000.0, 1.0).unwrap();
            let y = grid.instants().hermite(&values, &slopes).unwrap();
            y.iter().zip(grid.time_s()).map(|(y, t)| (y - q(t)).abs()).fold(0.0, f64::max)
        };
        assert!(worst(0.04, |t| t * t * t - t, |t| 3.0 * t * t - 1.0) < 1e-12);
        let coarse = worst(0.04, |t| (3.0 * t).sin(), |t| 3.0 * (3.0 * t).cos());
        // The longest step is 0.04 (1 + 0.3·10/11).
        assert!(coarse < (0.04_f64 * 1.273).powi(4) / 384.0 * 81.0 * 1.01);
        let fine = worst(0.02, |t| (3.0 * t).sin(), |t| 3.0 * (3.0 * t).cos());
        assert!((coarse / fine).log2() > 3.7);
    }

    #[test]
    fn gaps_are_reported_and_not_bridged() {
        let time_s: Vec<f64> =
            (0..100).filter(|k| !(40..60).contains(k)).map(|k| 5.0 + k as f64 * 0.01).collect();
        let y: Vec<f64> = time_s.iter().map(|t| 2.0 * t).collect();
        let grid = Resampler::new(&time_s, 100.0, 0.05).unwrap();
        assert_eq!(grid.gaps().len(), 1);
        assert!((grid.gaps()[0].start_s - 5.39).abs() < 1e-12);
        assert!((grid.gaps()[0].end_s - 5.60).abs() < 1e-12);
        assert_eq!(grid.segments(), [0..40, 40..80]);
        for (t, v) in grid.time_s().iter().zip(grid.instants().linear(&y).unwrap()) {
            assert!((v - 2.0 * t).abs() < 1e-12);
            assert!(*t < 5.391 || *t > 5.599, "a sample was invented at {t} s");
        }
        // With a limit above its length the gap is bridged and not reported.
        let bridged = Resampler::new(&time_s, 100.0, 0.3).unwrap();
        assert_eq!((bridged.samples(), bridged.gaps().len()), (100, 0));
    }

    #[test]
    fn time_that_stands_or_runs_backwards_is_refused_with_its_place() {
        let refused = |t: &[f64]| Resampler::new(t, 100.0, 1.0).unwrap_err();
        assert_eq!(
            refused(&[0.0, 0.01, 0.01]),
            SignalError::Time { index: 2, before_s: 0.01, after_s: 0.01 }
        );
        assert!(matches!(refused(&[0.0, -0.01]), SignalError::Time { index: 1, .. }));
        assert!(matches!(refused(&[0.0, f64::NAN]), SignalError::Time { index: 1, .. }));
        assert!(matches!(refused(&[0.0]), SignalError::TooFewSamples { .. }));
        let limit = Resampler::new(&[0.0, 1.0], 100.0, 0.0).unwrap_err();
        assert!(matches!(limit, SignalError::GapLimit { .. }));
    }
}
