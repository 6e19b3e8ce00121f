//! Repairs the time stamps of rows that a recorder held back and then wrote in one burst.
//!
//! Such rows are stamped with the time of writing. A burst shows as one long time step followed by as many tiny steps
//! as rows were held back; after it the clock is right again. Taken at face value, it looks like a gap plus a stalled
//! clock, and its time is counted twice. The motion decides whether the rows were sampled evenly: if the control loop
//! itself hung and caught up, the rows were sampled at the times stamped on them, and the angles agree with the
//! integrated velocities on the stamps as they are.

use std::ops::Range;

use super::account::LogWarning;
use super::clean::Motion;
use super::even_stamps::{FEWEST_ROWS, defect, row_defect, told_rows};
use crate::median::median_step;

/// A burst begins with a row that is late by at least this fraction of the sampling interval. Ordinary stamps are less
/// late.
const LATE: f64 = 0.75;
/// Time steps within a burst are shorter than this fraction of the sampling interval.
const TINY: f64 = 0.5;
/// After the burst the clock is right again to within this fraction of the interval; otherwise rows or time were lost.
const BALANCED: f64 = 0.3;
/// Two candidate end rows whose clock errors round to the same multiple of this fraction of the interval count as
/// equal; the first one then ends the burst.
const ALIKE: f64 = 0.02;
/// Only steps that differ from the median step by less than this fraction of it enter the estimate of the sampling
/// interval.
const ORDINARY: f64 = 0.5;
/// Evenly spaced stamps are accepted if they reduce the mismatch between angles and velocities to this fraction.
const BETTER: f64 = 0.5;
/// A burst is decisive only if its mismatch exceeds this many times the mismatch of typical rows.
const USUAL: f64 = 2.0;

/// The verdict of the motion on one burst.
#[derive(Clone, Copy, PartialEq)]
enum Answer {
    /// The rows were sampled evenly.
    Even,
    /// The rows were sampled at the times stamped on them.
    AsStamped,
    /// Undecided: the arm hardly moves there, or a row is garbage.
    Open,
}

/// Returns the time stamps with each late burst spread evenly between the rows before and after it, and the warning
/// that reports the repair; `None` if no burst is repaired.
pub(super) fn late_bursts(motion: &Motion) -> Option<(Vec<f64>, LogWarning)> {
    if motion.rows() < FEWEST_ROWS {
        return None;
    }
    let found = bursts(motion, apart_s(motion.time_s)?);
    if found.is_empty() {
        return None;
    }
    let mut even_s = motion.time_s.to_vec();
    for burst in &found {
        lay_evenly(&mut even_s[burst.start - 1..=burst.end], &motion.row[burst.start - 1..]);
    }
    let answers = answers(motion, &even_s, &found);
    let count = |wanted: Answer| answers.iter().filter(|answer| **answer == wanted).count();
    // Undecided bursts follow the majority, since one recorder wrote them all.
    let most_are_even = count(Answer::Even) >= count(Answer::AsStamped);
    let is_even = |answer: Answer| match answer {
        Answer::Even => true,
        Answer::AsStamped => false,
        Answer::Open => most_are_even,
    };
    let mut time_s = motion.time_s.to_vec();
    let (mut rows, mut bursts, mut first, mut latest_s) = (0, 0, None, 0.0_f64);
    for (burst, _) in found.into_iter().zip(&answers).filter(|(_, answer)| is_even(**answer)) {
        rows += burst.len();
        bursts += 1;
        first = first.or(Some(burst.start - 1));
        for k in burst {
            latest_s = latest_s.max(motion.time_s[k] - even_s[k]);
            time_s[k] = even_s[k];
        }
    }
    let after_row = motion.row[first?];
    Some((time_s, LogWarning::LateBursts { rows, bursts, after_row, latest_s }))
}

/// Estimates the sampling interval, s: the mean of the steps close to the median. If the recorder writes nothing but
/// bursts, most steps are tiny, and the mean of all steps is used instead.
fn apart_s(time_s: &[f64]) -> Option<f64> {
    let typical_s = median_step(time_s)?;
    let mean_s = (time_s.last()? - time_s.first()?) / (time_s.len() - 1) as f64;
    if typical_s < TINY * mean_s {
        return Some(mean_s);
    }
    let steps = time_s.windows(2).map(|pair| pair[1] - pair[0]);
    let usual = steps.filter(|step| (step / typical_s - 1.0).abs() < ORDINARY);
    let (sum_s, count) = usual.fold((0.0, 0.0), |(sum_s, count), step| (sum_s + step, count + 1.0));
    // With an even number of steps the median may lie between two steps, so that no step is close to it.
    Some(if count > 0.0 { sum_s / count } else { typical_s })
}

/// Finds the bursts and returns the range of late rows of each; `apart_s` is the sampling interval. The row before a
/// burst and the row after it have correct stamps.
fn bursts(motion: &Motion, apart_s: f64) -> Vec<Range<usize>> {
    let (t, row) = (motion.time_s, motion.row);
    // Lateness of row b, in rows: its time after row a minus its distance from row a in the file.
    let late = |a: usize, b: usize| (t[b] - t[a]) / apart_s - (row[b] - row[a]) as f64;
    let is_tiny = |k: &usize| (0.0..TINY * apart_s).contains(&(t[*k] - t[*k - 1]));
    let mut out = Vec::new();
    let mut before = 0;
    while before + 2 < t.len() {
        if late(before, before + 1) < LATE {
            before += 1;
            continue;
        }
        let tiny = (before + 2..t.len()).take_while(is_tiny).count();
        // A burst may also be written between two sampling instants; then the step that ends it is shorter than a usual
        // one, and may itself count as tiny.
        let ends = [before + 1 + tiny, before + 2 + tiny];
        // A clock that runs backwards was wrong, not late.
        let is_end = |end: &usize| (before + 2..t.len()).contains(end) && t[*end] >= t[*end - 1];
        let ends = ends.into_iter().filter(is_end);
        let off = |end: &usize| (late(before, *end).abs() / ALIKE).round() * ALIKE;
        let end = ends.min_by(|a, b| off(a).total_cmp(&off(b)));
        match end.filter(|end| off(end) <= BALANCED) {
            Some(end) => {
                out.push(before + 1..end);
                before = end;
            }
            None => before += 1,
        }
    }
    out
}

/// Spaces the stamps evenly between the first and the last one, in proportion to the row numbers `rows` in the file.
fn lay_evenly(time_s: &mut [f64], rows: &[usize]) {
    let last = time_s.len() - 1;
    let place = |k: usize| (rows[k] - rows[0]) as f64;
    let (from_s, span_s) = (time_s[0], time_s[last] - time_s[0]);
    for (k, t) in time_s.iter_mut().enumerate().take(last).skip(1) {
        *t = from_s + place(k) / place(last) * span_s;
    }
}

/// Returns the verdict of the motion on each burst in `found`. `even_s` holds the stamps with all bursts spread evenly.
fn answers(motion: &Motion, even_s: &[f64], found: &[Range<usize>]) -> Vec<Answer> {
    let evenly = Motion { time_s: even_s, ..*motion };
    // With many bursts, or many false ones, typical rows fit only one of the two sets of stamps; the better set defines
    // the usual mismatch.
    let usual_rad = USUAL * defect(motion).min(defect(&evenly));
    let told = told_rows(motion);
    let answer = |burst: &Range<usize>| {
        let rows = burst.start.max(told.start)..(burst.end + 1).min(told.end);
        let of = |motion: &Motion| rows.clone().map(|k| row_defect(motion, k)).sum::<f64>();
        let (as_stamped, evenly) = (of(motion), of(&evenly));
        let usual_rad = usual_rad * rows.len() as f64;
        if as_stamped > usual_rad && evenly <= BETTER * as_stamped {
            Answer::Even
        } else if evenly > as_stamped + usual_rad {
            Answer::AsStamped
        } else {
            Answer::Open
        }
    };
    found.iter().map(answer).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_S: f64 = 0.004;
    const ROWS: usize = 600;

    /// Two joints sampled at known times, with the stamps written to the log.
    struct Recorded {
        stamps_s: Vec<f64>,
        q: Vec<Vec<f64>>,
        qd: Vec<Vec<f64>>,
        row: Vec<usize>,
    }

    impl Recorded {
        fn new(read_s: &[f64], stamps_s: &[f64]) -> Self {
            let of = |f: fn(f64) -> f64, scale: f64| -> Vec<f64> {
                read_s.iter().map(|t| scale * f(1.3 * t)).collect()
            };
            Self {
                stamps_s: stamps_s.to_vec(),
                q: vec![of(f64::sin, 1.0), of(f64::cos, 0.7)],
                qd: vec![of(f64::cos, 1.3), of(|x| -x.sin(), 1.3 * 0.7)],
                row: (2..read_s.len() + 2).collect(),
            }
        }

        /// Drops the rows `lost`. With `is_renumbered` they were never written to the file; otherwise they were set
        /// aside when reading.
        fn without(mut self, lost: &[usize], is_renumbered: bool) -> Self {
            let keep = |values: &mut Vec<f64>| {
                let kept = values.iter().enumerate().filter(|(k, _)| !lost.contains(k));
                *values = kept.map(|(_, value)| *value).collect();
            };
            keep(&mut self.stamps_s);
            self.q.iter_mut().for_each(keep);
            self.qd.iter_mut().for_each(keep);
            self.row.retain(|row| !lost.contains(&(row - 2)));
            if is_renumbered {
                self.row = (2..self.row.len() + 2).collect();
            }
            self
        }

        fn mended(&self, has_velocities: bool) -> Option<(Vec<f64>, LogWarning)> {
            late_bursts(&Motion {
                time_s: &self.stamps_s,
                q: &self.q,
                qd: if has_velocities { &self.qd[..] } else { &[] },
                row: &self.row,
            })
        }
    }

    fn even() -> Vec<f64> {
        (0..ROWS).map(|k| STEP_S * k as f64).collect()
    }

    /// Pseudo-random number between −1 and 1.
    fn chance(k: usize) -> f64 {
        ((k * 7919) % 1009) as f64 / 504.0 - 1.0
    }

    /// Stamps with bursts, each given as (first row, number of rows held back). The rows are stamped at 98 % of the way
    /// to the next regular row.
    fn kept_back(stamps_s: &[f64], bursts: &[(usize, usize)]) -> Vec<f64> {
        let mut out = stamps_s.to_vec();
        for &(first, count) in bursts {
            let written_s = stamps_s[first + count];
            for t in &mut out[first..first + count] {
                *t += 0.98 * (written_s - *t);
            }
        }
        out
    }

    const BURSTS: [(usize, usize); 5] = [(40, 4), (45, 2), (150, 10), (300, 30), (450, 1)];

    #[test]
    fn bursts_of_every_length_are_laid_evenly() {
        let recorded = Recorded::new(&even(), &kept_back(&even(), &BURSTS));
        for has_velocities in [true, false] {
            let (time_s, warning) = recorded.mended(has_velocities).unwrap();
            for (t, truth) in time_s.iter().zip(even()) {
                assert!((t - truth).abs() < 1e-12, "{t} {truth}");
            }
            let LogWarning::LateBursts { rows, bursts, after_row, latest_s } = warning else {
                panic!("{warning}")
            };
            assert_eq!((rows, bursts, after_row), (47, 5, 41));
            assert!((latest_s - 0.98 * 30.0 * STEP_S).abs() < 1e-9, "{latest_s}");
        }
    }

    /// Jitter of up to an eighth of a step on all stamps, and one row set aside within a burst.
    #[test]
    fn bursts_among_jittered_stamps() {
        let jittered: Vec<f64> =
            (0..ROWS).map(|k| STEP_S * (k as f64 + 0.125 * chance(k))).collect();
        let stamps_s = kept_back(&jittered, &BURSTS[2..4]);
        let recorded = Recorded::new(&even(), &stamps_s).without(&[310], false);
        let (time_s, _) = recorded.mended(true).unwrap();
        let truth = even().into_iter().enumerate().filter(|(k, _)| *k != 310);
        for (t, (k, truth)) in time_s.iter().zip(truth) {
            assert!((t - truth).abs() < 0.126 * STEP_S, "{k}: {t} {truth}");
        }
    }

    /// All rows are written in blocks, so most steps are tiny.
    #[test]
    fn a_recorder_that_writes_nothing_but_bursts() {
        let blocks = |k: usize| STEP_S * (k.div_ceil(8) * 8) as f64 + 1e-5 * ((k + 7) % 8) as f64;
        let stamps_s: Vec<f64> = (0..ROWS).map(blocks).collect();
        let (time_s, _) = Recorded::new(&even(), &stamps_s).mended(true).unwrap();
        // After the last block no further row shows that the clock is right again.
        for (t, truth) in time_s.iter().zip(even()).take(ROWS - 7) {
            assert!((t - truth).abs() < 1e-4, "{t} {truth}");
        }
    }

    /// An arm at rest gives no evidence against even sampling, so the bursts are spread evenly.
    #[test]
    fn bursts_of_an_arm_at_rest() {
        let mut recorded = Recorded::new(&even(), &kept_back(&even(), &BURSTS));
        recorded.q = vec![(0..ROWS).map(|k| 1e-5 * chance(k)).collect()];
        recorded.qd = vec![(0..ROWS).map(|k| 1e-3 * chance(k + 3)).collect()];
        let (time_s, _) = recorded.mended(true).unwrap();
        assert!(time_s.iter().zip(even()).all(|(t, truth)| (t - truth).abs() < 1e-12));
    }

    /// A control loop that hangs and catches up samples its rows at the times stamped on them, so the stamps stay.
    #[test]
    fn rows_that_were_read_late_stay() {
        let late = kept_back(&even(), &BURSTS);
        let recorded = Recorded::new(&late, &late);
        assert!(recorded.mended(true).is_none() && recorded.mended(false).is_none());
    }

    #[test]
    fn other_clocks_are_no_bursts() {
        let is_left = |read_s: &[f64], stamps_s: &[f64]| {
            Recorded::new(read_s, stamps_s).mended(true).is_none()
        };
        let even_s = even();
        assert!(is_left(&even_s, &even_s));
        let jittered: Vec<f64> =
            (0..ROWS).map(|k| STEP_S * (k as f64 + 0.35 * chance(k))).collect();
        assert!(is_left(&even_s, &jittered) && is_left(&jittered, &jittered));
        // A clock that stalls and never regains the lost time.
        let lost: Vec<f64> = (0..ROWS).map(|k| even_s[k] + 0.02 * (k / 100) as f64).collect();
        assert!(is_left(&lost, &even_s));
        // A clock that stands still for ten rows and continues from there.
        let stood = |k: usize| STEP_S * (k.min(200) + k.saturating_sub(210)) as f64;
        let stamps_s: Vec<f64> = (0..ROWS).map(|k| stood(k) + 1e-6 * k as f64).collect();
        assert!(is_left(&even_s, &stamps_s));
        // Missing rows, single and in long runs, with exact and with jittered stamps.
        let lost: Vec<usize> = [50, 80, 82, 300].into_iter().chain(400..420).collect();
        for stamps_s in [&even_s, &jittered] {
            let recorded = Recorded::new(&even_s, stamps_s).without(&lost, true);
            assert!(recorded.mended(true).is_none());
        }
    }
}
