//! Finds out whether a log fits its arm when it is read differently: columns in another order, other signs, other
//! zeros, another mounting.
//!
//! With a mistake in the description of a log, nothing found is a property of the arm, and a diagnosis would state
//! nonsense with great certainty. Logs and descriptions of arms differ in practice in a few ways ([`Change`]). Among
//! these, the search looks for the fewest changes that make the model fit:
//!
//! minimise Σ_j ln (‖e_j‖² / ‖τ_j‖²) + γ (1 − cos φ) + λ × changes.
//!
//! The first term is the likelihood of torques whose noise is not known, joint by joint. e_j is the residual of the
//! full set of base parameters; it counts as ten times as large where the identified friction pushes instead of
//! braking. φ is the angle between the identified and the described first moments of the base set. If all torques
//! have the other sign, the parameters change and the residual does not. That sign is therefore decided by friction,
//! which brakes, and where there is next to none by gravity, which pulls as described. Parameters cannot stand in for
//! the changes: the right changes reduce the residual by far more than any friction law does.
//!
//! A current is multiplied by the gain of the joint for which it is read: read for another joint, it gets another
//! gain.
//!
//! Enters: the arm and a log laid out for regression. Leaves: a [`Misreading`], or nothing.

mod bench;
mod change;
mod reading;
mod search;

use serde::Serialize;

pub use bench::Match;
pub use change::{Change, Channels};

use super::options::Options;
use super::regression::Regression;
use crate::log::Layout;
use crate::robot::Arm;
use bench::Bench;
use reading::Reading;

/// A different reading of a log with which it fits its arm.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Misreading {
    /// The changes with which the log has to be read: places, signs, zeros, and how the arm is mounted.
    pub changes: Vec<Change>,
    /// How well the arm fits the log as it is read.
    pub as_read: Match,
    /// How well the arm fits the log with the changes.
    pub otherwise: Match,
    #[serde(skip)]
    reading: Reading,
    /// Whether the fits are of the mean period; otherwise of a single run behind the low-pass.
    #[serde(skip)]
    is_of_mean_period: bool,
}

/// Residual share of a joint's torque (rms, without noise) up to which the model counts as explaining that joint.
const EXPLAINED: f64 = 0.03;
/// Residual share of a joint's torque (rms) up to which the model explains practically everything: no sensor reads a
/// torque to a ten-thousandth. What is left is rounding, and so are differences between what two readings leave.
const ROUNDING: f64 = 1e-4;
/// Condition of the regressor, with columns of unit length, from which on a log does not determine the parameters:
/// the steps of a reading of 16 bits, 1.5e-5 of its range, are then enough to move a combination of them by as much as
/// it contributes. Signs of friction and of gravity found beyond it mean nothing.
const UNDETERMINED: f64 = 6.6e4;
/// Factor by which the rms residual has to fall, on average, for every joint that is read differently, and on at
/// least one joint. Friction laws and soft gears yield a factor of 1.5 on real arms, and wrong changes cost more on
/// other joints than they gain.
const FALLS: f64 = 3.0;
/// The same factor where gravity becomes the described one: friction and noise that remain hide part of the fall.
const RESTORED: f64 = 1.4;
/// Cosine between found and described first moments below which they have nothing to do with each other.
const STRANGE: f64 = 0.5;
/// Cosine above which found and described first moments belong to the same masses at the same places.
const DESCRIBED: f64 = 0.9;
/// Factor by which the residual of another joint may grow by chance.
const GROWS: f64 = 1.2;
/// A reading counts only if the model leaves less than this share of the torque (rms, without noise) on every joint
/// that the reading changes. A reading that turns the sign of friction and fits no better is not the right one.
const FITS: f64 = 0.5;

impl Misreading {
    /// Searches for a misreading of the log in `regression`. `drive_gain_nm_a` holds one gain for each joint where
    /// the torques are currents times gains. `None` where the model explains the log, or no change makes it do so, and
    /// where the motion does not determine the parameters that would tell.
    pub fn of(
        arm: &Arm,
        regression: &Regression,
        options: &Options,
        drive_gain_nm_a: Option<&[f64]>,
    ) -> Option<Self> {
        let mut bench = Bench::new(arm, regression, options, drive_gain_nm_a)?;
        let described = Reading::as_read(arm.dof());
        let as_read = bench.fit(&described)?;
        if !as_read.calls_for_another() || bench.condition(&described)? > UNDETERMINED {
            return None;
        }
        bench.add_mountings(arm);
        let (reading, otherwise) = search::best(arm, &bench, &as_read);
        let is_of_mean_period = bench.is_of_mean_period();
        let changes = reading.changes();
        let found = Self { changes, as_read, otherwise, reading, is_of_mean_period };
        if !found.is_convincing() && !found.is_read_turned() {
            return None;
        }
        let Self { as_read, otherwise, reading, .. } = found;
        let (reading, otherwise) = search::told_by_sign(reading, otherwise, &bench);
        Some(Self { changes: reading.changes(), as_read, otherwise, reading, is_of_mean_period })
    }

    /// The lines of a layout that reads the log as it was recorded, where `layout` is the one it is read with; `None`
    /// where only the mounting of the arm differs.
    pub fn layout(&self, layout: &Layout) -> Option<String> {
        let counting = self.reading.counting();
        (!counting.is_as_described()).then(|| layout.recounted(counting))
    }

    /// Whether the log is read correctly except for the sign of all torques.
    fn is_read_turned(&self) -> bool {
        let turned = [Change::AllTorquesReversed];
        (self.changes.is_empty() || self.changes == turned) && self.as_read.is_clearly_turned()
    }

    fn is_convincing(&self) -> bool {
        let gain = |j: usize| 0.5 * (self.as_read.misfit_of(j) - self.otherwise.misfit_of(j));
        let gains: Vec<f64> = (0..self.as_read.left.len()).map(gain).collect();
        let largest = gains.iter().fold(0.0, |a: f64, gain| a.max(*gain));
        let all: f64 = gains.iter().sum();
        let joints = self.joints();
        let least = if self.restores_gravity() { RESTORED } else { FALLS };
        let has_moved = |j: usize| self.changes.iter().any(|change| change.moves_torque_of(j));
        largest > least.ln()
            && all > least.ln() * joints.len() as f64
            && joints.iter().all(|j| self.otherwise.beyond_noise(*j) < FITS)
            // The torque of another column is another torque: its residual share may be larger.
            && (0..gains.len()).all(|j| has_moved(j) || gains[j] > -GROWS.ln())
    }

    /// Whether gravity has nothing to do with the described one as the log is read, and is the described one after
    /// the changes, with the arm mounted as described.
    fn restores_gravity(&self) -> bool {
        let is_mounted = self.changes.iter().any(|change| matches!(change, Change::Mounted { .. }));
        !is_mounted && self.as_read.gravity() < STRANGE && self.otherwise.gravity() > DESCRIBED
    }

    /// Joints (0-based) whose channels are read differently; all joints where the mounting differs.
    fn joints(&self) -> Vec<usize> {
        let all = 0..self.as_read.left.len();
        all.filter(|j| self.changes.iter().any(|change| change.is_about(*j))).collect()
    }

    /// States what is wrong and how to correct it, in words.
    pub fn sentence(&self) -> String {
        let joints = self.joints();
        let range = |fit: &Match| {
            let shares = joints.iter().map(|j| 100.0 * fit.left[*j]);
            let (low, high) = shares.fold((f64::INFINITY, 0f64), |(l, h), p| (l.min(p), h.max(p)));
            match high - low < 0.05 {
                true => format!("{high:.1} %"),
                false => format!("{low:.1} to {high:.1} %"),
            }
        };
        let pushed = (0..self.as_read.left.len()).filter(|j| self.as_read.friction_pushes[*j]);
        let pushed: Vec<String> = pushed.map(|j| (j + 1).to_string()).collect();
        let pushing = match pushed.len() {
            0 => String::new(),
            _ => format!(" (as it is read, friction pushes joint {})", pushed.join(", ")),
        };
        let mut remedies: Vec<&str> = Vec::new();
        for remedy in self.changes.iter().map(Change::remedy) {
            if !remedies.contains(&remedy) {
                remedies.push(remedy);
            }
        }
        let there = if joints.len() == self.as_read.left.len() { "" } else { " there" };
        // A log is identified with other weights and with all of its samples, of which the model leaves other shares.
        let fitted = match self.is_of_mean_period {
            true => "fitted to the mean period",
            false => "fitted to the run behind the low-pass",
        };
        let pairs = self.as_read.left.iter().zip(&self.otherwise.left);
        let gain = match pairs.into_iter().any(|(read, otherwise)| *read > GROWS * otherwise) {
            true => format!(
                "the model, {fitted}, leaves {} of the torque{there} in place of {}{pushing}",
                range(&self.otherwise),
                range(&self.as_read)
            ),
            // With all torques reversed the model fits as well, by other parameters: the residual shows no gain.
            false if !pushing.is_empty() => format!("friction brakes{pushing}"),
            false => "gravity pulls, and friction brakes, as they do".to_owned(),
        };
        format!(
            "The log is not read as it was recorded: with {} {gain}. {}",
            listed(&self.changes),
            remedies.join(" ")
        )
    }
}

/// Joins the changes in words: "one", "one and another", or a list with "and" before the last.
fn listed(changes: &[Change]) -> String {
    let words: Vec<String> = changes.iter().map(Change::to_string).collect();
    match &words[..] {
        [all @ .., last] if !all.is_empty() => format!("{} and {last}", all.join(", ")),
        words => words.concat(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    use crate::base::{BaseSet, ColumnPlan, Parameterisation};
    use crate::dynamics::{Model, Motion};
    use crate::identify::{Assembler, Identifier, Measurement, Problem};
    use crate::robot::{JointSignals, read_urdf};

    /// What is found in four swings of a beam by `size_rad`, with an `overtone`, whose torque has the other sign.
    fn of_turned_torque(size_rad: f64, overtone: f64) -> Option<Misreading> {
        const SAMPLES: usize = 2000;
        let text = include_str!("../../../tests/other_arms/one_joint.urdf");
        let arm = read_urdf(text, "one_joint.urdf").unwrap().arm;
        let set = BaseSet::find(&arm, Parameterisation::full(1, arm.torque_offsets)).unwrap();
        let model = Model::new(&arm);
        let time_s: Vec<f64> = (0..SAMPLES).map(|k| 0.008 * k as f64).collect();
        let derivative = |power: i32, f: fn(f64) -> f64| {
            let wave = |omega: f64, s: f64| size_rad * omega.powi(power) * f(omega * s);
            JointSignals::from_fn(1, SAMPLES, |_, k| {
                wave(TAU / 4.0, time_s[k]) + overtone * wave(3.0 * TAU / 4.0, time_s[k])
            })
        };
        let motion = Motion {
            q_rad: derivative(0, f64::sin),
            qd_rad_s: derivative(1, f64::cos),
            qdd_rad_s2: derivative(2, |phase| -phase.sin()),
        };
        let mut problem = Problem::new(ColumnPlan::new(&model, &set), 125.0);
        let none = JointSignals::zeros(1, SAMPLES);
        Assembler::new(&model).assemble(&mut problem, &model, &motion, &none);
        let mut nm = vec![0.0; SAMPLES];
        problem.predict(0, &set.values(&model.standard_parameters()), &mut nm);
        let m = Measurement {
            source: "turned",
            time_s: &time_s,
            q_rad: &motion.q_rad,
            qd_rad_s: &motion.qd_rad_s,
            torque_nm: &JointSignals::from_fn(1, SAMPLES, |_, k| -nm[k]),
        };
        let options = Options::default();
        let regression = Identifier::new(&model, &set, options.clone()).regression(&m).unwrap();
        Misreading::of(&arm, &regression, &options, None)
    }

    /// Along a swing so small that gravity, inertia and an offset look alike, signs mean nothing.
    #[test]
    fn a_motion_that_determines_nothing_is_not_called_misread() {
        assert!(of_turned_torque(0.8, 0.3).is_some());
        assert_eq!(of_turned_torque(0.03, 0.0), None);
    }
}
