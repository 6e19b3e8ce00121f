//! Closing the loop: the causes that were found go back into the simulation, which replays the motion of the log.
//!
//! Enters: a [`Finding`]. Leaves: the simulation without and with the causes ([`ExtendedSimulation`]), and a
//! [`Replay`], which says how far their torque and motion are from those of the log and of logs that nothing was fitted
//! to.
//!
//! The model that is fitted to a log is a sum of torques along the recorded motion. In the replay, the causes act as
//! physics in the integration of the equations of motion ([`plant::faults`](crate::plant::faults)), under a controller
//! that does not know of them. The two share no formula: reproducing the torque of the log tests the diagnosis rather
//! than repeating the fit.

mod counterpart;
mod course;
mod error;
mod fitted;
mod simulated;

use serde::Serialize;

use super::diagnoser::Diagnoser;
use super::finding::Finding;
use super::held_out::Validation;
use super::rms::rms_where;
use crate::plant::faults::Effect;
use crate::robot::JointSignals;

pub use counterpart::{Counterpart, DiagnosedCause};
pub(super) use course::measured_nm;
pub use error::ReplayError;
pub use fitted::Fitted;
pub use simulated::{ExtendedSimulation, NotReplayed, SimulatedArm};

use course::Course;

/// Comparison of a simulation with logs, without and with the causes that were found.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Replay {
    /// The simulated causes, with their parameters as in scenarios.
    pub effects: Vec<Effect>,
    /// The causes that are not simulated.
    pub not_replayed: Vec<NotReplayed>,
    /// Distance of the simulated arms from the identified ones (rms over the base parameters, in standard deviations of
    /// what the log says), without and with the causes. 0 where the identified parameters are those of a physically
    /// possible arm; up to 1, the distance is within the noise.
    pub arm_distance: [f64; 2],
    /// The log that was diagnosed.
    pub log: ReplayedLog,
    /// Logs that nothing was fitted to.
    pub held_out: Vec<ReplayedLog>,
}

/// Replay of one log.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct ReplayedLog {
    /// Name of the log.
    pub log: String,
    /// Noise of the compared torque (the mean over the periods) by the scatter of the torque between periods, rms per
    /// joint, Nm; null for a single run. It does not hold the noise of the encoders, whose readings the simulation
    /// follows.
    pub noise_nm: Option<Vec<f64>>,
    /// Without the causes.
    pub before: Distance,
    /// With them.
    pub after: Distance,
    /// Share of the explainable mean square of the torque (beyond the noise, with every joint in units of its noise)
    /// that the causes remove; null for a single run.
    pub removed_fraction: Option<f64>,
    /// Courses of the torque, for plots.
    #[serde(skip)]
    pub course: Torques,
}

/// Distance of a simulation from a log.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Distance {
    /// Logged minus simulated torque along the same motion, rms per joint, Nm.
    pub torque_rms_nm: Vec<f64>,
    /// Logged minus simulated angle, rms per joint, rad, where the simulation's own controller follows the logged
    /// motion. It depends on that controller; the difference between before and after shows how the causes affect the
    /// motion.
    pub tracking_rms_rad: Vec<f64>,
    /// The remaining difference in the run whose torque is compared, rad.
    pub motion_rms_rad: Vec<f64>,
}

/// Torque along a replayed motion.
#[derive(Debug, Clone, PartialEq)]
pub struct Torques {
    /// Time of each sample from the start of the period or run, s.
    pub time_s: Vec<f64>,
    /// Logged, Nm.
    pub measured_nm: JointSignals,
    /// Simulated without the causes, Nm.
    pub before_nm: JointSignals,
    /// Simulated with them, Nm.
    pub after_nm: JointSignals,
}

impl Diagnoser<'_> {
    /// The simulation without and with the causes that were found.
    pub fn extended_simulation(
        &self,
        finding: &Finding,
    ) -> Result<ExtendedSimulation, ReplayError> {
        ExtendedSimulation::new(self.arm, self.set, &self.families, finding)
    }

    /// Replays the log behind `finding` and the logs `held_out` with the simulation, without and with the causes.
    pub fn replay(
        &mut self,
        finding: &Finding,
        held_out: &[Validation],
    ) -> Result<Replay, ReplayError> {
        let simulation = self.extended_simulation(finding)?;
        let noise = finding.identification.replicates.as_ref().map(|r| &r.sigma[..]);
        let course = Course {
            scene: &finding.scene,
            measured_nm: &finding.measured_nm,
            samples: &finding.samples,
            options: &self.options,
        };
        let log = simulation.replay(&course, noise, &finding.diagnosis.log)?;
        let mut others = Vec::with_capacity(held_out.len());
        for other in held_out {
            let regression = self.identifier.regression(&other.measurement)?;
            let prepared = &regression.prepared;
            let scene = finding.extension.scene(&self.families, (self.arm, self.set), prepared);
            let samples: Vec<usize> =
                (0..regression.problem.samples).map(|row| regression.sample(row)).collect();
            let course = Course {
                scene: &scene,
                measured_nm: &measured_nm(&regression),
                samples: &samples,
                options: &self.options,
            };
            let noise = prepared.replicates.as_ref().map(|r| &r.sigma[..]);
            others.push(simulation.replay(&course, noise, other.measurement.source)?);
        }
        let ExtendedSimulation { null, extended, effects, not_replayed, .. } = simulation;
        Ok(Replay {
            effects,
            not_replayed,
            arm_distance: [null.distance, extended.distance],
            log,
            held_out: others,
        })
    }
}

impl ExtendedSimulation {
    fn replay(
        &self,
        course: &Course,
        noise_of_a_sample_nm: Option<&[f64]>,
        log: &str,
    ) -> Result<ReplayedLog, ReplayError> {
        let nominal = &self.null.arm;
        let (before, after) = std::thread::scope(|scope| {
            let before = scope.spawn(|| course.replay(&self.null, &[], nominal));
            let after = course.replay(&self.extended, &self.effects, nominal);
            (before.join(), after)
        });
        let before = before.unwrap_or_else(|panic| std::panic::resume_unwind(panic))?;
        let after = after?;
        let measured_nm = course.measured_nm;
        let distance = |replayed: &course::Replayed| Distance {
            torque_rms_nm: (0..measured_nm.joints())
                .map(|j| {
                    let pairs = measured_nm.joint(j).iter().zip(replayed.torque_nm.joint(j));
                    rms_where(&pairs.map(|(m, s)| m - s).collect::<Vec<_>>(), |_| true)
                })
                .collect(),
            tracking_rms_rad: replayed.tracking_rms_rad.clone(),
            motion_rms_rad: replayed.motion_rms_rad.clone(),
        };
        let (left, right) = (distance(&before), distance(&after));
        let noise_nm = noise_of_a_sample_nm.map(|sigma| {
            let periods = course.scene.periods as f64;
            sigma.iter().map(|sigma| sigma / periods.sqrt()).collect::<Vec<f64>>()
        });
        let removed_fraction = noise_nm.as_deref().and_then(|noise_nm| {
            removed_fraction(&left.torque_rms_nm, &right.torque_rms_nm, noise_nm)
        });
        let rate_hz = course.scene.rate_hz;
        Ok(ReplayedLog {
            log: log.to_owned(),
            noise_nm,
            before: left,
            after: right,
            removed_fraction,
            course: Torques {
                time_s: course.samples.iter().map(|&k| k as f64 / rate_hz).collect(),
                measured_nm: measured_nm.clone(),
                before_nm: before.torque_nm,
                after_nm: after.torque_nm,
            },
        })
    }
}

/// Share of the explainable mean square that is removed: Σ (b² − a²)/σ² over Σ (b² − σ²)/σ², with b before, a after;
/// `None` where there was nothing to explain, or periods that are alike show no noise σ.
fn removed_fraction(before_nm: &[f64], after_nm: &[f64], noise_nm: &[f64]) -> Option<f64> {
    let (mut removed, mut explainable) = (0.0, 0.0);
    for ((before, after), noise) in before_nm.iter().zip(after_nm).zip(noise_nm) {
        removed += (before.powi(2) - after.powi(2)) / noise.powi(2);
        explainable += (before.powi(2) - noise.powi(2)) / noise.powi(2);
    }
    let is_known = noise_nm.iter().all(|noise| *noise > 0.0);
    (is_known && explainable > 0.0).then(|| removed / explainable)
}

/// Distance from the identified arm, in σ per parameter, below which the simulated arm counts as the identified one: it
/// adds a quarter to the mean square that the noise of the parameters makes.
const WORTH_SAYING: f64 = 0.5;

impl Replay {
    /// The replay in words.
    pub fn sentences(&self) -> Vec<String> {
        let mut out = Vec::new();
        for (log, place) in std::iter::once((&self.log, ""))
            .chain(self.held_out.iter().map(|log| (log, " on a log that was not used")))
        {
            let off =
                |j: usize| [&log.before, &log.after].map(|distance| distance.torque_rms_nm[j]);
            let j = log.worst_joint();
            let [before, after] = off(j);
            let mut text = format!(
                "Replayed in the simulator{place}, joint {}'s torque is off by {before:.2} Nm before and \
                 {after:.2} Nm after",
                j + 1
            );
            if let Some(noise) = &log.noise_nm {
                text += &format!(" (torque noise of the mean {:.2} Nm)", noise[j]);
            }
            if let Some(share) = log.removed_fraction {
                text += &format!(
                    "; over all joints that removes {:.0} % of what the noise leaves to explain",
                    100.0 * share
                );
            }
            out.push(text + ".");
            if let Some(j) = log.spoilt_joint() {
                let [before, after] = off(j);
                out.push(format!(
                    "Joint {}'s is off by more with the causes: {before:.2} Nm before and {after:.2} Nm after.",
                    j + 1
                ));
            }
        }
        for NotReplayed { kind, joint, reason } in &self.not_replayed {
            let place = joint.map_or(String::new(), |j| format!(" at joint {j}"));
            out.push(format!("Not in the simulation as an effect: {kind}{place}: {reason}."));
        }
        let [_, extended] = self.arm_distance;
        if extended > WORTH_SAYING {
            out.push(format!(
                "No arm that can exist has the parameters that were identified with the causes; the nearest one, \
                 which is simulated, is {extended:.1} σ per parameter away."
            ));
        }
        out
    }
}

/// Ratio of the error after to that before from which on a joint counts as worse.
const WORSE: f64 = 1.1;

impl ReplayedLog {
    /// Mean square that the causes remove from the torque error of joint `j`, in units of its noise where that is known.
    fn gain(&self, j: usize) -> f64 {
        self.off(j) - self.in_noise(j, self.after.torque_rms_nm[j])
    }

    /// Mean square of the torque error of joint `j` without the causes, in units of its noise where that is known.
    fn off(&self, j: usize) -> f64 {
        self.in_noise(j, self.before.torque_rms_nm[j])
    }

    /// Square of a torque of joint `j`, in units of its noise where that is known.
    fn in_noise(&self, j: usize, torque_nm: f64) -> f64 {
        let noise_nm = self.noise_nm.as_ref().filter(|noise| noise.iter().all(|n| *n > 0.0));
        (torque_nm / noise_nm.map_or(1.0, |n| n[j])).powi(2)
    }

    /// The joint (0-based) whose torque improves most, in units of its noise where that is known.
    pub fn worst_joint(&self) -> usize {
        let joints = 0..self.before.torque_rms_nm.len();
        // Where nothing was named, the joint that is farthest off.
        let is_alike = self.before.torque_rms_nm == self.after.torque_rms_nm;
        let of = |j: usize| if is_alike { self.off(j) } else { self.gain(j) };
        joints.max_by(|&a, &b| of(a).total_cmp(&of(b))).unwrap_or(0)
    }

    /// The joint (0-based) that the causes make worst by far, if they make any worse.
    fn spoilt_joint(&self) -> Option<usize> {
        let rms = |distance: &Distance, j: usize| distance.torque_rms_nm[j];
        let joints = 0..self.before.torque_rms_nm.len();
        joints
            .filter(|&j| rms(&self.after, j) > WORSE * rms(&self.before, j))
            .min_by(|&a, &b| self.gain(a).total_cmp(&self.gain(b)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_share_is_told_only_beside_noise() {
        // (4 − 1)/(4 − 0.25) of what stands above the noise.
        let share = removed_fraction(&[2.0], &[1.0], &[0.5]).unwrap();
        assert!((share - 3.0 / 3.75).abs() < 1e-15, "{share}");
        assert_eq!(removed_fraction(&[2.0, 1.0], &[1.0, 1.0], &[0.5, 0.0]), None);
        assert_eq!(removed_fraction(&[0.5], &[0.5], &[0.5]), None);
    }
}
