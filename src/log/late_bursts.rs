//! Rows that a recorder kept back and then wrote all at once, with the time at which it wrote them.
//!
//! Such stamps are a long step and behind it as many tiny ones as rows were kept back; then the clock is right again. Read as they
//! stand they are a gap and a clock that stalls, and count their time twice. Whether rows were recorded evenly, the motion tells: in a
//! loop that hung and caught up they were read when their stamps say, and there angles follow from velocities with the stamps as they are.

use std::ops::Range;

use super::account::LogWarning;
use super::clean::Motion;
use super::even_stamps::{FEWEST_ROWS, defect, row_defect, told_rows};
use crate::median::median_step;

/// A burst begins with a row that is late by this much of what rows are apart. Ordinary stamps are late by less.
const LATE: f64 = 0.75;
/// Steps within a burst are a smaller share of that.
const TINY: f64 = 0.5;
/// And behind it the clock is right again to this one: where it is not, rows were lost or time was.
const BALANCED: f64 = 0.3;
/// Of two rows at which it is, as far as this share of what rows are apart tells, the first ends the burst.
const ALIKE: f64 = 0.02;
/// Steps that differ from the usual one by less than this share of it tell what rows are apart.
const ORDINARY: f64 = 0.5;
/// Angles follow from velocities this much better on even stamps, where they tell anything.
const BETTER: f64 = 0.5;
/// They tell something where they are off by more than so many times what they are in most rows.
const USUAL: f64 = 2.0;

/// What the motion says of a burst.
#[derive(Clone, Copy, PartialEq)]
enum Answer {
    /// Its rows were recorded evenly.
    Even,
    /// They were recorded when their stamps say.
    AsStamped,
    /// The arm hardly moves there, or a row is garbage.
    Open,
}

/// Stamps of which bursts lie evenly between the rows before and behind them, and what to say of it; `None` where there are none.
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
    // What is open is as most of the others are: one recorder wrote them all.
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

/// What rows are apart, s: mean of the usual steps. Where a recorder writes nothing but bursts most steps are tiny, and that of all counts.
fn apart_s(time_s: &[f64]) -> Option<f64> {
    let typical_s = median_step(time_s)?;
    let mean_s = (time_s.last()? - time_s.first()?) / (time_s.len() - 1) as f64;
    if typical_s < TINY * mean_s {
        return Some(mean_s);
    }
    let steps = time_s.windows(2).map(|pair| pair[1] - pair[0]);
    let usual = steps.filter(|step| (step / typical_s - 1.0).abs() < ORDINARY);
    let (sum_s, count) = usual.fold((0.0, 0.0), |(sum_s, count), step| (sum_s + step, count + 1.0));
    // Of an even number of steps the median may be none of them.
    Some(if count > 0.0 { sum_s / count } else { typical_s })
}

/// The late rows of every burst of rows that are `apart_s`: the row before them and the one behind have stamps that are right.
fn bursts(motion: &Motion, apart_s: f64) -> Vec<Range<usize>> {
    let (t, row) = (motion.time_s, motion.row);
    // How much later row b is than its place in the file behind row a has it, in rows.
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
        // Rows are written between two others as well: then the last step is a part of a usual one.
        let ends = [before + 1 + tiny, before + 2 + tiny];
        // A clock that goes back was wrong, not late.
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

/// Lays stamps evenly between the first and the last of them, as `rows` have their places in the file.
fn lay_evenly(time_s: &mut [f64], rows: &[usize]) {
    let last = time_s.len() - 1;
    let place = |k: usize| (rows[k] - rows[0]) as f64;
    let (from_s, span_s) = (time_s[0], time_s[last] - time_s[0]);
    for (k, t) in time_s.iter_mut().enumerate().take(last).skip(1) {
        *t = from_s + place(k) / place(last) * span_s;
    }
}

/// What the motion says of each of the `found` bursts beside stamps that lie evenly in all of them.
fn answers(motion: &Motion, even_s: &[f64], found: &[Range<usize>]) -> Vec<Answer> {
    let evenly = Motion { time_s: even_s, ..*motion };
    // Many bursts, or many that are none, are what most rows have on one of the two.
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

    /// Two joints as they were read, and the stamps that they were given.
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

        /// Without the rows `lost`: set aside, or not written at all.
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

    /// Between −1 and 1, without a pattern.
    fn chance(k: usize) -> f64 {
        ((k * 7919) % 1009) as f64 / 504.0 - 1.0
    }

    /// Stamps of rows that are kept back: (first, how many) of every burst, written 98 % of the way to the next row.
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

    /// Stamps that are off by up to an eighth of a step beside them, and a row that was set aside in one of them.
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

    /// All rows are written in blocks, so that most steps are tiny.
    #[test]
    fn a_recorder_that_writes_nothing_but_bursts() {
        let blocks = |k: usize| STEP_S * (k.div_ceil(8) * 8) as f64 + 1e-5 * ((k + 7) % 8) as f64;
        let stamps_s: Vec<f64> = (0..ROWS).map(blocks).collect();
        let (time_s, _) = Recorded::new(&even(), &stamps_s).mended(true).unwrap();
        // Behind the last block nothing tells that the clock is right again.
        for (t, truth) in time_s.iter().zip(even()).take(ROWS - 7) {
            assert!((t - truth).abs() < 1e-4, "{t} {truth}");
        }
    }

    /// An arm at rest tells nothing against it.
    #[test]
    fn bursts_of_an_arm_at_rest() {
        let mut recorded = Recorded::new(&even(), &kept_back(&even(), &BURSTS));
        recorded.q = vec![(0..ROWS).map(|k| 1e-5 * chance(k)).collect()];
        recorded.qd = vec![(0..ROWS).map(|k| 1e-3 * chance(k + 3)).collect()];
        let (time_s, _) = recorded.mended(true).unwrap();
        assert!(time_s.iter().zip(even()).all(|(t, truth)| (t - truth).abs() < 1e-12));
    }

    /// A loop that hangs and catches up reads its rows when their stamps say.
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
        // A clock that stalls: the time that it loses is never regained.
        let lost: Vec<f64> = (0..ROWS).map(|k| even_s[k] + 0.02 * (k / 100) as f64).collect();
        assert!(is_left(&lost, &even_s));
        // One that stands for ten rows and goes on from there.
        let stood = |k: usize| STEP_S * (k.min(200) + k.saturating_sub(210)) as f64;
        let stamps_s: Vec<f64> = (0..ROWS).map(|k| stood(k) + 1e-6 * k as f64).collect();
        assert!(is_left(&even_s, &stamps_s));
        // Rows that are missing, alone and many beside each other, also behind stamps that are a little late.
        let lost: Vec<usize> = [50, 80, 82, 300].into_iter().chain(400..420).collect();
        for stamps_s in [&even_s, &jittered] {
            let recorded = Recorded::new(&even_s, stamps_s).without(&lost, true);
            assert!(recorded.mended(true).is_none());
        }
    }
}
