//! Places where the arm did not move as in the other periods.
//!
//! A drive yields to a push on the arm by tens of microradians, even where its torque does not reveal the push yet, and
//! is back within a few tenths of a second. The angles do not tell what moved the arm; they tell where to look.

use std::ops::Range;

use super::are_near;
use super::repeats::Repeats;
use crate::identify::FrictionDrift;
use crate::median::robust_sigma;
use crate::robot::JointSignals;
use crate::signal::{SignalError, cubic_at};

/// A move has to be this many times higher than the threshold for noise: friction and feedback bring noise into torques
/// and angles alike, and pushes of 7 σ in the torque are two to eight times as high.
const CLEARLY: f64 = 1.5;
/// Maximum number of moves. If there are more, the periods are not alike, and none of the places is special.
const MOST: usize = 10;
/// The middle of a push lies within half the length of its effect on the angles, plus this, s.
const YIELDS_S: f64 = 0.5;
/// Angles that scatter by less than this, rad, differ only in their last digits: encoders resolve a microradian at
/// best.
const LEAST_RAD: f64 = 1e-6;

/// A place where the arm moved differently than in the other periods.
pub(super) struct Move {
    /// Samples of the window that may be the middle of what moved it.
    pub(super) centres: Range<usize>,
    /// Joints (0-based) that moved.
    pub(super) joints: Vec<usize>,
}

impl Move {
    /// Merges with another part of the same move.
    fn join(&mut self, centres: Range<usize>, joints: Vec<usize>) {
        self.centres.start = self.centres.start.min(centres.start);
        self.centres.end = self.centres.end.max(centres.end);
        self.joints.extend(joints);
        self.joints.sort_unstable();
        self.joints.dedup();
    }
}

impl Repeats {
    /// Finds where the angles `q_rad` differ from those of the other periods by more than noise, or the `drift` of
    /// friction, to which drives yield, would make them. Also returns the drift if it had to be computed.
    pub(super) fn find_moves(
        &self,
        q_rad: JointSignals,
        drift: impl FnOnce() -> Result<FrictionDrift, SignalError>,
    ) -> Result<(Vec<Move>, Option<FrictionDrift>), SignalError> {
        let mut angles = Self {
            signals: q_rad,
            // A joint that accelerates at 3 rad/s² deviates by 24 µrad from a straight line between samples at 125 Hz:
            // as much as encoders scatter.
            between_samples: cubic_at,
            joints: self.joints.clone(),
            window: self.window.clone(),
            drift: None,
            moves: Vec::new(),
            ..*self
        };
        let mut aside = vec![false; angles.signals.samples()];
        let deviations = angles.deviations(&aside, &[]);
        let scatters = |row: &usize| {
            let mut sizes: Vec<f64> = deviations.joint(*row).iter().map(|d| d.abs()).collect();
            robust_sigma(&mut sizes) > LEAST_RAD
        };
        angles.joints =
            (0..self.joints.len()).filter(scatters).map(|row| self.joints[row]).collect();
        if angles.search(&aside, &[], &[], CLEARLY)?.is_none() {
            return Ok((Vec::new(), None));
        }
        angles.drift = Some(drift()?);
        let mut seen: Vec<Range<usize>> = Vec::new();
        let mut moves: Vec<Move> = Vec::new();
        while let Some(found) = angles.search(&aside, &[], &seen, CLEARLY)? {
            let reach = ((0.5 * found.length_s + YIELDS_S) * self.rate_hz) as usize;
            let centres =
                found.centre.saturating_sub(reach)..(found.centre + reach).min(self.window.len());
            let in_log = |k: usize| self.window.start + k;
            // The move shifts the mean of the other periods.
            aside[in_log(centres.start)..in_log(centres.end)].fill(true);
            seen.push(in_log(centres.start)..in_log(centres.end));
            let joints = found.felt.iter().map(|row| angles.joints[*row]).collect();
            match moves.iter().position(|m| are_near(&m.centres, &centres, 0)) {
                Some(longer) => moves[longer].join(centres, joints),
                None if moves.len() == MOST => return Ok((Vec::new(), angles.drift)),
                None => moves.push(Move { centres, joints }),
            }
        }
        Ok((moves, angles.drift))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{SeedableRng, rngs::ChaCha8Rng};
    use rand_distr::{Distribution, StandardNormal};

    const RATE_HZ: f64 = 100.0;

    /// Moves in six periods of 1000.3 samples, preceded by 1.5 s that do not belong to them, with angles known to 20
    /// µrad. Each entry of `moved` is the middle, s, the length, s, the joint and the height, rad.
    fn moves(seed: u64, moved: &[(f64, f64, usize, f64)]) -> Vec<Move> {
        moves_beside(seed, moved, |_, _| 0.0)
    }

    /// The same, with drives that also yield to friction by `yields_rad(q̇, t)`.
    fn moves_beside(
        seed: u64,
        moved: &[(f64, f64, usize, f64)],
        yields_rad: impl Fn(f64, f64) -> f64,
    ) -> Vec<Move> {
        const PERIOD: f64 = 1000.3;
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let window = 150..150 + (6.0 * PERIOD) as usize;
        let phase = |k: usize| std::f64::consts::TAU * k as f64 / PERIOD;
        let qd_rad_s = JointSignals::from_fn(2, window.end, |j, k| {
            let turns = (phase(k) + j as f64).cos() - 3.0 * (3.0 * phase(k)).sin();
            turns * std::f64::consts::TAU * RATE_HZ / PERIOD
        });
        let q_rad = JointSignals::from_fn(2, window.end, |j, k| {
            let phase = phase(k);
            let noise: f64 = StandardNormal.sample(&mut rng);
            let push = |&(at_s, length_s, joint, rad): &(f64, f64, usize, f64)| {
                let u = 2.0 * (k as f64 / RATE_HZ - at_s) / length_s;
                if joint == j { rad * (1.0 - u * u).max(0.0) } else { 0.0 }
            };
            (phase + j as f64).sin()
                + (3.0 * phase).cos()
                + 2e-5 * noise
                + moved.iter().map(push).sum::<f64>()
                + yields_rad(qd_rad_s.joint(j)[k], k as f64 / RATE_HZ)
        });
        let torques = Repeats {
            signals: JointSignals::zeros(2, window.end),
            between_samples: cubic_at,
            joints: vec![0, 1],
            window,
            period: PERIOD,
            rate_hz: RATE_HZ,
            drift: None,
            moves: Vec::new(),
        };
        let qd_rad_s = qd_rad_s.slice(torques.window.clone());
        let drift = || Ok(FrictionDrift::beside_others(qd_rad_s, PERIOD));
        torques.find_moves(q_rad, drift).unwrap().0
    }

    /// No move is found, even if the period is not a whole number of samples: linear interpolation would be off by up
    /// to two σ of the noise.
    #[test]
    fn an_arm_that_repeats_has_none() {
        assert!((0..10).all(|seed| moves(seed, &[]).is_empty()));
    }

    /// A long move is found once, in the right place, and leaves no mirror image in the mean of the other periods.
    #[test]
    fn a_move_is_found_on_its_joint() {
        for seed in 0..10 {
            let found = moves(seed, &[(33.0, 2.0, 1, 1e-3)]);
            assert_eq!(found.len(), 1);
            assert_eq!(found[0].joints, [1]);
            // The window begins at 1.5 s.
            assert!(found[0].centres.contains(&3150), "{:?}", found[0].centres);
        }
    }

    /// Drives yield to friction that warms up as they do to a push, but all along a period: this is no place of its
    /// own.
    #[test]
    fn friction_that_drifts_moves_nothing() {
        let fades = |qd: f64, t_s: f64| 3e-4 * (qd / 0.02).tanh() * (-t_s / 15.0).exp();
        for seed in 0..5 {
            assert!(moves_beside(seed, &[], fades).is_empty());
            let found = moves_beside(seed, &[(33.0, 2.0, 1, 1e-3)], fades);
            assert!(found.iter().any(|own| own.centres.contains(&3150)));
        }
    }

    #[test]
    fn an_arm_that_never_repeats_has_none_either() {
        let often: Vec<_> = (0..15).map(|k| (3.0 + 3.7 * f64::from(k), 0.3, 0, 3e-3)).collect();
        assert!(moves(1, &often).is_empty());
        assert_eq!(moves(1, &often[..4]).len(), 4);
    }
}
