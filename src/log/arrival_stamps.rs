//! Repairs time stamps that say when a row arrived, not when it was sampled.
//!
//! A controller samples evenly and sends each row over a network to a program, which reads its own clock as the row
//! arrives. Such stamps are late by a time of their own each, and for some rows the next one has arrived first. Rows of
//! which none was lost lie on the straight line through all stamps. The motion decides whether they were sampled there:
//! if the sampling itself was uneven, the angles follow from the velocities on the stamps as they are. Logs of which rows
//! were lost, or whose clock was set, are left to [`stamp_pieces`](super::stamp_pieces).

use super::account::LogWarning;
use super::clean::Motion;
use super::even_stamps::{FEWEST_ROWS, StampLine, spread};
use crate::median::median;

/// A step scatters if it differs from the usual step by more than this fraction of it, ...
const SCATTERS: f64 = 0.1;
/// ... and stamps are times of arrival if at least this fraction of the steps does. A recorder that is late now and then
/// is repaired where it is late.
const COMMON: f64 = 0.2;
/// Rows among which one in [`PROMPT`] is looked for that was hardly late, to see whether it is as late everywhere. Such a
/// row is known far better than the typical one, because lateness has no upper end.
pub(super) const WINDOW: usize = 128;
const PROMPT: usize = 10;
/// A row that was lost moves all later stamps by one step. Half of that, between windows, is no scatter.
pub(super) const LOST: f64 = 0.5;
/// Rows over which the usual step is taken that does not depend on the rest of the log.
const STRETCH: usize = 32;

/// Returns even stamps for rows whose own stamps scatter about them, and the warning that reports the repair; `None` if
/// few of them do, if rows or time were lost, or if the motion does not tell that the rows were sampled evenly.
pub(super) fn arrival_stamps(motion: &Motion) -> Option<(Vec<f64>, LogWarning)> {
    if motion.rows() < FEWEST_ROWS {
        return None;
    }
    let line = StampLine::through(motion)?;
    let (off_s, step_s) = (&line.off_s, line.step_s);
    let scatters = |pair: &&[f64]| (pair[1] - pair[0]).abs() > SCATTERS * step_s;
    let scattered = off_s.windows(2).filter(scatters).count();
    if (scattered as f64) < COMMON * (off_s.len() - 1) as f64 {
        return None;
    }
    let is_as_late_everywhere = wander_s(off_s) <= LOST * step_s;
    let warning = LogWarning::ArrivalStamps { rms_s: line.rms_s(), rate_hz: 1.0 / step_s };
    (is_as_late_everywhere && line.is_told_by(motion)).then_some((line.even_s, warning))
}

/// Whether many of the rows come earlier or later after the row before than usual. That usual step is the one of short
/// stretches, which neither single bursts of rows nor a clock that was set change.
pub(super) fn scatter_is_common(motion: &Motion) -> bool {
    let (time_s, row, rows) = (motion.time_s, motion.row, motion.rows());
    if rows < FEWEST_ROWS {
        return false;
    }
    let step_s = |from: usize, to: usize| {
        (time_s[to] - time_s[from]) / row[to].abs_diff(row[from]).max(1) as f64
    };
    let mut steps_s: Vec<f64> = (STRETCH..rows).map(|k| step_s(k - STRETCH, k)).collect();
    let usual_s = median(&mut steps_s).unwrap_or(0.0);
    let scatters = |k: &usize| (step_s(k - 1, *k) - usual_s).abs() > SCATTERS * usual_s;
    let scattered = (1..rows).filter(scatters).count();
    usual_s > 0.0 && scattered as f64 >= COMMON * (rows - 1) as f64
}

/// Lateness of the promptest rows of a window, s; all windows have rows.
pub(super) fn prompt_s(window: &[f64]) -> f64 {
    let mut off_s = window.to_vec();
    *off_s.select_nth_unstable_by(window.len() / PROMPT, f64::total_cmp).1
}

/// How far the lateness `off_s` of the promptest rows wanders from window to window, s.
pub(super) fn wander_s(off_s: &[f64]) -> f64 {
    spread(off_s.chunks_exact(WINDOW.min(off_s.len())).map(prompt_s))
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng, rngs::ChaCha8Rng};

    pub(in crate::log) const ROWS: usize = 2000;
    pub(in crate::log) const STEP_S: f64 = 0.004;

    /// A joint that swings by 0.5 rad twice a second, sampled at `sampled_s` and stamped with `stamps_s`.
    fn repaired(sampled_s: &[f64], stamps_s: &[f64]) -> Option<Vec<f64>> {
        let omega = std::f64::consts::TAU * 2.0;
        let q = [sampled_s.iter().map(|t| 0.5 * (omega * t).sin()).collect::<Vec<f64>>()];
        let qd = [sampled_s.iter().map(|t| 0.5 * omega * (omega * t).cos()).collect::<Vec<f64>>()];
        let row: Vec<usize> = (2..ROWS + 2).collect();
        let motion = Motion { time_s: stamps_s, q: &q, qd: &qd, row: &row };
        arrival_stamps(&motion).map(|(time_s, _)| time_s)
    }

    /// Times of arrival: late by an exponential time of 3 ms, and never before the row in front.
    pub(in crate::log) fn arrivals(sampled_s: &[f64]) -> Vec<f64> {
        let mut rng = ChaCha8Rng::seed_from_u64(4);
        let mut last_s = 0.0f64;
        let late = |t: &f64| {
            last_s = last_s.max(t - 0.003 * (1.0 - rng.random::<f64>()).ln());
            last_s
        };
        sampled_s.iter().map(late).collect()
    }

    pub(in crate::log) fn even() -> Vec<f64> {
        (0..ROWS).map(|k| k as f64 * STEP_S).collect()
    }

    /// The line through 2000 stamps with a scatter of about 3 ms has steps that are right to 3 ms·√12/2000^1.5, 1.2·10⁻⁷ s;
    /// five times that over the log is 1.2 ms. All rows may be late by the same time.
    #[test]
    fn rows_are_put_where_they_were_sampled() {
        let sampled_s = even();
        let time_s = repaired(&sampled_s, &arrivals(&sampled_s)).expect("the motion tells");
        let late_s: Vec<f64> =
            time_s.iter().zip(&sampled_s).map(|(t, sampled)| t - sampled).collect();
        assert!(late_s.iter().all(|late| (late - late_s[0]).abs() < 1.2e-3), "{:?}", late_s.last());
        assert!((0.002..0.007).contains(&late_s[0]), "{}", late_s[0]);
    }

    /// The same stamps on rows that were sampled when they say.
    #[test]
    fn uneven_samples_keep_their_stamps() {
        let stamps_s = arrivals(&even());
        assert_eq!(repaired(&stamps_s, &stamps_s), None);
    }

    /// A row is missing in the middle: no line goes through what is left of the log, whether its stamps scatter or not.
    #[test]
    fn rows_that_were_lost_are_no_scatter() {
        let sampled_s: Vec<f64> =
            (0..ROWS).map(|k| (k + usize::from(k >= ROWS / 2)) as f64 * STEP_S).collect();
        assert!(repaired(&sampled_s, &sampled_s).is_none());
        assert!(repaired(&sampled_s, &arrivals(&sampled_s)).is_none());
    }

    /// A recorder that is late by half a step with every twentieth row is not one that scatters.
    #[test]
    fn rows_that_are_late_now_and_then_keep_their_stamps() {
        let sampled_s = even();
        let late = |(k, t): (usize, &f64)| if k % 20 == 7 { t + 0.5 * STEP_S } else { *t };
        let stamps_s: Vec<f64> = sampled_s.iter().enumerate().map(late).collect();
        assert_eq!(repaired(&sampled_s, &stamps_s), None);
    }

    /// Lost rows and a clock that is set are no scatter; times of arrival are.
    #[test]
    fn even_steps_do_not_scatter() {
        let scatters = |stamps_s: &[f64]| {
            let row: Vec<usize> = (2..stamps_s.len() + 2).collect();
            scatter_is_common(&Motion { time_s: stamps_s, q: &[], qd: &[], row: &row })
        };
        let mut stamps_s = even();
        stamps_s.drain(300..500);
        stamps_s.retain(|t| (t / STEP_S).round() % 50.0 != 0.0);
        stamps_s[1000..].iter_mut().for_each(|t| *t += 3600.0);
        assert!(!scatters(&stamps_s));
        assert!(scatters(&arrivals(&even())));
    }
}
