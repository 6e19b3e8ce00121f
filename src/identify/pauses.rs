//! Pauses of a joint between its moves.

use std::ops::Range;

use super::prediction::resting_joints;
use crate::cumulative_sum::accumulate;
use crate::robot::JointSignals;

/// The samples, or rows, of each pause of one joint.
pub type Pauses = Vec<Vec<usize>>;

/// A joint pauses where its speed stays below this share of the width ε over which friction turns round, ...
const STILL: f64 = 0.25;
/// ... for this long, s. A joint that reverses at 0.05 rad/s² or more is faster by then, for the ε of 0.02 rad/s that the
/// built-in arms have: no reversal of a designed motion is as slow.
pub(super) const LONG_S: f64 = 0.2;
/// Most pauses in a period. Cycles of moves have 10 to 30. Many more are pieces of a pause in which the velocity is not
/// free of its noise; and for every shape of a law, the columns of so many would fill gigabytes.
const MOST: usize = 60;
/// How far a low-pass smears a row, in periods of its cut-off: the default one follows a step to within 7 % from there on.
const SMEARED: f64 = 0.5;
/// Velocities of a single run are averaged over this time before and behind each row, s.
const SMOOTH_S: f64 = 0.025;

/// The samples of each pause of joint `j` along one period of the velocities `qd_rad_s`, sampled at `rate_hz`; ε is
/// `epsilon_rad_s`. None for a joint that does not move, whose slow stretches lie between no moves; and where there are
/// more than 60.
pub fn pauses(qd_rad_s: &JointSignals, j: usize, rate_hz: f64, epsilon_rad_s: f64) -> Pauses {
    if resting_joints(qd_rad_s).contains(&j) {
        return Vec::new();
    }
    let least = (LONG_S * rate_hz).ceil() as usize;
    slow_runs(qd_rad_s.joint(j), STILL * epsilon_rad_s, least)
}

/// The rows of each pause of joint `j` along a single run, whose rows have the velocities `qd_rad_s` and have passed a
/// low-pass of `cutoff_hz`; the rest as in [`pauses`]. Rows beside a pause in which the low-pass still shows it are
/// part of it. There may be any number of pauses.
pub(super) fn pauses_of_run(
    qd_rad_s: &JointSignals,
    j: usize,
    rate_hz: f64,
    epsilon_rad_s: f64,
    cutoff_hz: f64,
) -> Pauses {
    if resting_joints(qd_rad_s).contains(&j) {
        return Vec::new();
    }
    let least = (LONG_S * rate_hz).ceil() as usize;
    let beside = (SMEARED * rate_hz / cutoff_hz).ceil() as usize;
    // The velocities of a single run are as noisy as they were recorded.
    let qd = moving_mean(qd_rad_s.joint(j), (SMOOTH_S * rate_hz) as usize);
    let is_slow = |k: usize| qd[k].abs() < STILL * epsilon_rad_s;
    let mut is_left_out = vec![false; qd.len()];
    for run in runs_where(0..qd.len(), least, is_slow) {
        let with_margins = run.start.saturating_sub(beside)..(run.end + beside).min(qd.len());
        is_left_out[with_margins].fill(true);
    }
    // Margins of two pauses may overlap.
    runs_where(0..qd.len(), 1, |k| is_left_out[k]).into_iter().map(Iterator::collect).collect()
}

/// Mean of `y` over up to `beside` samples before and behind each sample.
fn moving_mean(y: &[f64], beside: usize) -> Vec<f64> {
    let mut sums = [&[0.0], y].concat();
    accumulate(&mut sums);
    let mean = |k: usize| {
        let (from, to) = (k.saturating_sub(beside), (k + beside + 1).min(y.len()));
        (sums[to] - sums[from]) / (to - from) as f64
    };
    (0..y.len()).map(mean).collect()
}

/// The samples of each run of at least `least` of the periodic velocities `qd_rad_s` that stay below `limit_rad_s`; none
/// if there are more than 60.
fn slow_runs(qd_rad_s: &[f64], limit_rad_s: f64, least: usize) -> Pauses {
    let n = qd_rad_s.len();
    let is_slow = |k: usize| qd_rad_s[k % n].abs() < limit_rad_s;
    // From the end of a move on, no pause is cut in two by the end of the period.
    let Some(first) = (0..n).find(|k| !is_slow(*k)) else { return Vec::new() };
    let runs = runs_where(first..first + n, least, is_slow);
    if runs.len() > MOST {
        return Vec::new();
    }
    runs.into_iter().map(|run| run.map(|k| k % n).collect()).collect()
}

/// The runs of at least `least` of the `samples` that are so.
fn runs_where(
    samples: Range<usize>,
    least: usize,
    is_so: impl Fn(usize) -> bool,
) -> Vec<Range<usize>> {
    let mut runs = Vec::new();
    let mut k = samples.start;
    while k < samples.end {
        let end = (k..samples.end).find(|k| !is_so(*k)).unwrap_or(samples.end);
        if end - k >= least {
            runs.push(k..end);
        }
        k = end + 1;
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of three slow runs, one of which closes the period and begins the next, the shortest is no pause.
    #[test]
    fn pauses_are_long_and_go_round() {
        let qd = [0.0, 0.1, 1.0, -0.1, 0.0, -1.0, 0.0, 0.0, -0.1, 1.0, 0.0, 0.1];
        assert_eq!(slow_runs(&qd, 0.5, 3), [vec![6, 7, 8], vec![10, 11, 0, 1]]);
    }

    /// Ten rows per second and a cut-off of 5 Hz: a pause has two rows or more, and one on either side. A run does not go
    /// round, and margins of two pauses that meet make one.
    #[test]
    fn pauses_of_a_run_have_margins_and_end_with_it() {
        let mut qd = vec![1.0; 40];
        for pause in [10..15, 17..20, 32..40] {
            qd[pause].fill(0.0);
        }
        let qd_rad_s = JointSignals::from_fn(1, 40, |_, k| qd[k]);
        let pauses = pauses_of_run(&qd_rad_s, 0, 10.0, 0.02, 5.0);
        assert_eq!(pauses, [(9..21).collect::<Vec<_>>(), (31..40).collect()]);
    }

    #[test]
    fn ends_have_fewer_neighbours() {
        assert_eq!(moving_mean(&[3.0, 0.0, 0.0, 6.0], 1), [1.5, 1.0, 2.0, 3.0]);
    }

    #[test]
    fn a_joint_that_never_moves_has_no_pauses_between_moves() {
        assert!(slow_runs(&[0.0; 10], 0.5, 3).is_empty());
    }

    /// Pauses of three samples, each behind a move of one.
    #[test]
    fn too_many_pauses_are_none() {
        let qd = |count: usize| [1.0, 0.0, 0.0, 0.0].repeat(count);
        assert_eq!(slow_runs(&qd(MOST), 0.5, 3).len(), MOST);
        assert!(slow_runs(&qd(MOST + 1), 0.5, 3).is_empty());
    }
}
