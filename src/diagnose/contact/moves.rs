//! Where the arm did not move as in the other periods.
//!
//! A drive yields to what pushes the arm, by tens of microradians where its torque tells nothing yet, and is back within a few
//! tenths of a second. The angles do not tell what it was; they tell where to look.

use std::ops::Range;

use super::are_near;
use super::repeats::Repeats;
use crate::diagnose::friction_drift::FrictionDrift;
use crate::median::robust_sigma;
use crate::robot::JointSignals;
use crate::signal::{SignalError, cubic_at};

/// What is a move is so many times as high as noise is not: friction and its feedback bring noise into torques and angles alike, and pushes
/// of 7 σ in the torque are two to eight times as high.
const CLEARLY: f64 = 1.5;
/// Moves at most. Where there are more the periods are not alike, and none is a place of its own.
const MOST: usize = 10;
/// The middle of a push lies within half the length of what it does to the angles, and this much more, s.
const YIELDS_S: f64 = 0.5;
/// Angles that scatter by less than this, rad, differ by their last digits: encoders resolve a microradian at best.
const LEAST_RAD: f64 = 1e-6;

/// A place where the arm moved otherwise than in the other periods.
pub(super) struct Move {
    /// Samples of the window among which the middle is of what moved it.
    pub(super) centres: Range<usize>,
    /// Joints (0-based) that moved.
    pub(super) joints: Vec<usize>,
}

impl Move {
    /// Takes in another part of itself.
    fn join(&mut self, centres: Range<usize>, joints: Vec<usize>) {
        self.centres.start = self.centres.start.min(centres.start);
        self.centres.end = self.centres.end.max(centres.end);
        self.joints.extend(joints);
        self.joints.sort_unstable();
        self.joints.dedup();
    }
}

impl Repeats {
    /// Where the angles `q_rad` differ from those of the other periods as noise does not, nor the `drift` of friction to which
    /// drives yield; and that, if it had to be made.
    pub(super) fn find_moves(
        &self,
        q_rad: JointSignals,
        drift: impl FnOnce() -> Result<FrictionDrift, SignalError>,
    ) -> Result<(Vec<Move>, Option<FrictionDrift>), SignalError> {
        let mut angles = Self {
            signals: q_rad,
            // What turns at 3 rad/s² bends by 24 µrad between samples at 125 Hz: as much as encoders scatter.
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
            // It moves the mean of the others.
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

    /// Six periods of 1000.3 samples behind 1.5 s that are none of them, angles known to 20 µrad; each move is its middle, s, its length,
    /// s, its joint and height, rad.
    fn moves(seed: u64, moved: &[(f64, f64, usize, f64)]) -> Vec<Move> {
        moves_beside(seed, moved, |_, _| 0.0)
    }

    /// The same of drives that yield besides by `yields_rad(q̇, t)` to friction.
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

    /// Also of a period that is no whole number of samples: straight lines between them would be off by up to two σ of the noise.
    #[test]
    fn an_arm_that_repeats_has_none() {
        assert!((0..10).all(|seed| moves(seed, &[]).is_empty()));
    }

    /// A long move is found once, where it is, and leaves no mirror image in the mean of the other periods.
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

    /// Drives yield to friction that warms up as they do to a push, all along a period: that is no place of its own.
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
