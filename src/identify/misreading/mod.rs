//! Whether a log fits its arm when it is read otherwise: columns in another order, signs, zeros, mounting.
//!
//! A mistake in the description of a log leaves no rigid body, no friction and no drive as it is, and what a diagnosis would find of
//! it is nonsense of great certainty. Of the few ways in which logs and descriptions of arms differ in practice ([`Change`])
//! those are looked for that make the model fit, as few as are found to:
//!
//! minimise Σ_j ln (‖e_j‖² / ‖τ_j‖²) + γ (1 − cos φ) + λ × changes,   the likelihood of torques whose noise is not known, joint by joint,
//!
//! e_j the residual of the full set of base parameters, and ten times as large where friction comes out as something that pushes; φ the
//! angle between the first moments of the base set that are found and those described. All torques together with the other sign are other
//! parameters and no other residual: that sign is told by friction, which brakes, and where there is next to none by gravity, which pulls
//! as described. Parameters cannot stand in for the changes, so that the right ones are told by a residual that falls by far more than
//! any law of friction takes from it.
//!
//! Currents belong to the drive in whose column they are put: what is read in another column is multiplied by another gain.
//!
//! Enters: the arm and a log laid out for regression. Leaves: a [`Misreading`], or nothing.

mod bench;
mod change;
mod reading;
mod search;

use serde::Serialize;

pub use bench::Match;
pub use change::{Change, Channels};

use super::identifier::Regression;
use super::options::Options;
use crate::log::Layout;
use crate::robot::Arm;
use bench::Bench;
use reading::Reading;

/// A log that fits its arm when it is read otherwise.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Misreading {
    /// How it has to be read: places, signs, zeros, and how the arm is mounted.
    pub changes: Vec<Change>,
    /// How well the arm fits the log as it is read.
    pub as_read: Match,
    /// How well with the changes.
    pub otherwise: Match,
    #[serde(skip)]
    reading: Reading,
}

/// Share of the torque (rms, noise apart) up to which the model explains a joint, whatever is read otherwise.
const EXPLAINED: f64 = 0.03;
/// Factor by which the rms residual of a joint has to fall for every joint that is read otherwise, and that of one joint at
/// least: laws of friction and soft gears bring 1.5 on real arms, and wrong changes take more elsewhere than they bring.
const FALLS: f64 = 3.0;
/// The same where gravity becomes the description's: what friction and noise leave covers part of the fall.
const RESTORED: f64 = 1.4;
/// Cosine between first moments found and described below which they have nothing to do with each other.
const STRANGE: f64 = 0.5;
/// Cosine from which on they are the same masses, at the same places.
const DESCRIBED: f64 = 0.9;
/// Factor by which that of another joint may grow, which is noise.
const GROWS: f64 = 1.2;
/// Share of the torque (rms, noise apart) of which a reading leaves less on every joint that it is about: one that turns the sign of friction and
/// fits no better is another mistake.
const FITS: f64 = 0.5;

impl Misreading {
    /// Of the log in `regression`, whose torques are currents times `drive_gain_nm_a` where there are such gains, one for each joint;
    /// `None` where the model explains it, or no change makes it.
    pub fn of(
        arm: &Arm,
        regression: &Regression,
        options: &Options,
        drive_gain_nm_a: Option<&[f64]>,
    ) -> Option<Self> {
        let mut bench = Bench::new(arm, regression, options, drive_gain_nm_a)?;
        let as_read = bench.fit(&Reading::as_read(arm.dof()))?;
        if !as_read.leaves_more_than(EXPLAINED) && !as_read.is_clearly_turned() {
            return None;
        }
        bench.add_mountings(arm);
        let (reading, otherwise) = search::best(arm, &bench, &as_read);
        let found = Self { changes: reading.changes(), as_read, otherwise, reading };
        if !found.is_convincing() && !found.is_read_turned() {
            return None;
        }
        let Self { as_read, otherwise, reading, .. } = found;
        let (reading, otherwise) = search::told_by_sign(reading, otherwise, &bench);
        Some(Self { changes: reading.changes(), as_read, otherwise, reading })
    }

    /// The lines of a layout with which the log is read as it was recorded, `layout` being the one it is read with; `None` where it is
    /// the arm that is mounted otherwise, and no more.
    pub fn layout(&self, layout: &Layout) -> Option<String> {
        let counting = self.reading.counting();
        (!counting.is_as_described()).then(|| layout.recounted(counting))
    }

    /// Whether it is as it is read, or nearly so, but for the sign of all torques.
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
            // What stands in another joint's column is another torque: its share may be larger.
            && (0..gains.len()).all(|j| has_moved(j) || gains[j] > -GROWS.ln())
    }

    /// Whether gravity has nothing to do with the description's as the log is read, and is the description's otherwise, though the arm
    /// is mounted as described.
    fn restores_gravity(&self) -> bool {
        let is_mounted = self.changes.iter().any(|change| matches!(change, Change::Mounted { .. }));
        !is_mounted && self.as_read.gravity() < STRANGE && self.otherwise.gravity() > DESCRIBED
    }

    /// Joints (0-based) whose channels are read otherwise; all where the arm is mounted otherwise.
    fn joints(&self) -> Vec<usize> {
        let all = 0..self.as_read.left.len();
        all.filter(|j| self.changes.iter().any(|change| change.is_about(*j))).collect()
    }

    /// What is wrong and how to put it right, in words.
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
        let pairs = self.as_read.left.iter().zip(&self.otherwise.left);
        let gain = match pairs.into_iter().any(|(read, otherwise)| *read > GROWS * otherwise) {
            true => format!(
                "the model leaves {} of the torque{there} in place of {}{pushing}",
                range(&self.otherwise),
                range(&self.as_read)
            ),
            // Of an arm whose torques all have the other sign, parameters do as well.
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

/// One, one and another, or a list with an "and" before its last.
fn listed(changes: &[Change]) -> String {
    let words: Vec<String> = changes.iter().map(Change::to_string).collect();
    match &words[..] {
        [all @ .., last] if !all.is_empty() => format!("{} and {last}", all.join(", ")),
        words => words.concat(),
    }
}
