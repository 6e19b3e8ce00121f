//! Where a joint rests between its moves, in a motion that repeats.

use super::scene::Scene;
use crate::identify::resting_joints;

/// A joint rests where its speed stays below this share of the width ε over which friction turns round, ...
const STILL: f64 = 0.25;
/// ... for this long, s. A joint that reverses at 0.05 rad/s² or more is faster by then, for the ε of 0.02 rad/s that the
/// built-in arms have: no reversal of a designed motion is as slow.
const LONG_S: f64 = 0.2;
/// Most rests in a period. Cycles of moves have 10 to 30. Many more are pieces of a rest in which the velocity is not free
/// of its noise, and the columns of so many, for every shape of a law, would fill gigabytes.
const MOST: usize = 60;

/// One at the samples of each rest of joint `j`, zero elsewhere. Empty for a single run, whose velocities are not freed
/// of noise; for a joint that does not move, whose slow stretches lie between no moves; and where there are more than
/// [`MOST`].
pub fn rests(scene: &Scene, j: usize) -> Vec<Vec<f64>> {
    let qd_rad_s = &scene.motion.qd_rad_s;
    if !scene.periodic || resting_joints(qd_rad_s).contains(&j) {
        return Vec::new();
    }
    let limit_rad_s = STILL * scene.arm.friction_epsilon_rad_s;
    let least = (LONG_S * scene.rate_hz).ceil() as usize;
    slow_runs(qd_rad_s.joint(j), limit_rad_s, least)
}

/// One at the samples of each run of at least `least` of the periodic velocities `qd_rad_s` that stay below
/// `limit_rad_s`, zero elsewhere; empty if there are more than [`MOST`].
fn slow_runs(qd_rad_s: &[f64], limit_rad_s: f64, least: usize) -> Vec<Vec<f64>> {
    let n = qd_rad_s.len();
    let is_slow = |k: usize| qd_rad_s[k % n].abs() < limit_rad_s;
    // From the end of a move on, no rest is cut in two by the end of the period.
    let Some(first) = (0..n).find(|k| !is_slow(*k)) else { return Vec::new() };
    let mut runs = Vec::new();
    let mut k = first;
    while k < first + n {
        let end = (k..first + n).find(|k| !is_slow(*k)).unwrap_or(first + n);
        if end - k >= least {
            runs.push(k..end);
        }
        k = end + 1;
    }
    if runs.len() > MOST {
        return Vec::new();
    }
    let of_run = |run: std::ops::Range<usize>| {
        let mut rest = vec![0.0; n];
        run.for_each(|k| rest[k % n] = 1.0);
        rest
    };
    runs.into_iter().map(of_run).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of three slow runs, one of which closes the period and begins the next, the shortest is no rest.
    #[test]
    fn rests_are_long_and_go_round() {
        let qd = [0.0, 0.1, 1.0, -0.1, 0.0, -1.0, 0.0, 0.0, -0.1, 1.0, 0.0, 0.1];
        let rests = slow_runs(&qd, 0.5, 3);
        let of = |samples: &[usize]| -> Vec<f64> {
            (0..qd.len()).map(|k| f64::from(u8::from(samples.contains(&k)))).collect()
        };
        assert_eq!(rests, [of(&[6, 7, 8]), of(&[10, 11, 0, 1])]);
    }

    #[test]
    fn a_joint_that_never_moves_has_no_rests_between_moves() {
        assert!(slow_runs(&[0.0; 10], 0.5, 3).is_empty());
    }

    /// Rests of three samples, each behind a move of one.
    #[test]
    fn too_many_rests_are_none() {
        let qd = |count: usize| [1.0, 0.0, 0.0, 0.0].repeat(count);
        assert_eq!(slow_runs(&qd(MOST), 0.5, 3).len(), MOST);
        assert!(slow_runs(&qd(MOST + 1), 0.5, 3).is_empty());
    }
}
