//! Pauses of a joint between its moves, in a motion that repeats.

use super::prediction::resting_joints;
use crate::robot::JointSignals;

/// A joint pauses where its speed stays below this share of the width ε over which friction turns round, ...
const STILL: f64 = 0.25;
/// ... for this long, s. A joint that reverses at 0.05 rad/s² or more is faster by then, for the ε of 0.02 rad/s that the
/// built-in arms have: no reversal of a designed motion is as slow.
pub(super) const LONG_S: f64 = 0.2;
/// Most pauses in a period. Cycles of moves have 10 to 30. Many more are pieces of a pause in which the velocity is not
/// free of its noise; and for every shape of a law, the columns of so many would fill gigabytes.
const MOST: usize = 60;

/// The samples of each pause of joint `j` along one period of the velocities `qd_rad_s`, sampled at `rate_hz`; ε is
/// `epsilon_rad_s`. None for a joint that does not move, whose slow stretches lie between no moves; and where there are
/// more than 60.
pub fn pauses(
    qd_rad_s: &JointSignals,
    j: usize,
    rate_hz: f64,
    epsilon_rad_s: f64,
) -> Vec<Vec<usize>> {
    if resting_joints(qd_rad_s).contains(&j) {
        return Vec::new();
    }
    let least = (LONG_S * rate_hz).ceil() as usize;
    slow_runs(qd_rad_s.joint(j), STILL * epsilon_rad_s, least)
}

/// The samples of each run of at least `least` of the periodic velocities `qd_rad_s` that stay below `limit_rad_s`; none
/// if there are more than 60.
fn slow_runs(qd_rad_s: &[f64], limit_rad_s: f64, least: usize) -> Vec<Vec<usize>> {
    let n = qd_rad_s.len();
    let is_slow = |k: usize| qd_rad_s[k % n].abs() < limit_rad_s;
    // From the end of a move on, no pause is cut in two by the end of the period.
    let Some(first) = (0..n).find(|k| !is_slow(*k)) else { return Vec::new() };
    let mut runs = Vec::new();
    let mut k = first;
    while k < first + n {
        let end = (k..first + n).find(|k| !is_slow(*k)).unwrap_or(first + n);
        if end - k >= least {
            runs.push((k..end).map(|k| k % n).collect());
        }
        k = end + 1;
    }
    if runs.len() > MOST { Vec::new() } else { runs }
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
