//! Measures how well an arm fits a log under a given reading.

use nalgebra::Vector3;
use serde::Serialize;

use super::change::other_gravity;
use super::reading::Reading;
use super::{EXPLAINED, ROUNDING};
use crate::base::ColumnPlan;
use crate::base::{BaseSet, Parameterisation};
use crate::dynamics::{Model, Motion, Parameter, ParameterLayout};
use crate::identify::fit::{Fitter, Weighting};
use crate::identify::options::Options;
use crate::identify::problem::{Assembler, Problem};
use crate::identify::quality::Condition;
use crate::identify::regression::Regression;
use crate::identify::whiten::smoothed;
use crate::robot::{Arm, JointSignals};
use crate::signal::{Replicates, Scratch, ZeroPhase, mean_period};

/// Least share of the torque (rms) that friction must have for its sign to count; a smaller share may be due to
/// another friction law.
const FRICTION: f64 = 0.1;
/// Largest residual share of the torque (rms) at which the sign of friction is believed: noise that hides a joint's
/// torque has no sign.
const KNOWN: f64 = 0.3;
/// Misfit added for friction that pushes: that of a residual ten times as large.
const PUSHES: f64 = 2.0 * std::f64::consts::LN_10;
/// Misfit added for gravity that has nothing to do with the described one: that of a residual ten times as large. The
/// description of an arm may be wrong about its masses, but hardly about where they are.
const GRAVITY: f64 = 2.0 * std::f64::consts::LN_10;
/// Mean share of the torque (rms) of all joints above which the sign of friction counts for more than that of
/// gravity. Friction brakes any arm; gravity pulls as described only if the mounting is described correctly.
const TELLS: f64 = 0.02;
/// Cosine above which gravity is the described one.
const CLEAR: f64 = 0.9;

/// How well an arm fits a log, joint by joint.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Match {
    /// Share of each joint's torque (rms) that the model leaves.
    pub left: Vec<f64>,
    /// Whether Coulomb and viscous friction do positive work on the joint and amount to a tenth of the torque or
    /// more, while the model leaves less than 30 % of it.
    pub friction_pushes: Vec<bool>,
    /// `left` without the noise that the log itself shows.
    #[serde(skip)]
    beyond_noise: Vec<f64>,
    /// Mean share of the torque (rms) that is friction; negative where it pushes.
    #[serde(skip)]
    friction: f64,
    /// Cosine of the angle between the found and the described first moments.
    #[serde(skip)]
    gravity: f64,
}

impl Match {
    /// ln (‖e_j‖² / ‖τ_j‖²) of joint `j`, increased where friction pushes.
    pub(super) fn misfit_of(&self, j: usize) -> f64 {
        let pushes = if self.friction_pushes[j] { PUSHES } else { 0.0 };
        2.0 * self.left[j].max(f64::MIN_POSITIVE).ln() + pushes
    }

    /// Sum of the misfits of all joints, and an addition that grows as gravity departs from the described one.
    pub(super) fn misfit(&self) -> f64 {
        let of_joints: f64 = (0..self.left.len()).map(|j| self.misfit_of(j)).sum();
        of_joints + GRAVITY * (1.0 - self.gravity)
    }

    /// Cosine of the angle between the found and the described first moments; 0 where none are described.
    pub(super) fn gravity(&self) -> f64 {
        self.gravity
    }

    /// Share of joint `j`'s torque (rms) that the model leaves, without noise.
    pub(super) fn beyond_noise(&self, j: usize) -> f64 {
        self.beyond_noise[j]
    }

    /// Number of joints on which the model leaves more than `share` of the torque, without noise.
    pub(super) fn joints_left_by(&self, share: f64) -> usize {
        self.beyond_noise.iter().filter(|left| **left > share).count()
    }

    /// Whether the model leaves more than `share` of the torque of any joint, without noise, or friction pushes a
    /// joint.
    pub(super) fn leaves_more_than(&self, share: f64) -> bool {
        self.beyond_noise.iter().any(|left| *left > share) || self.friction_pushes.contains(&true)
    }

    /// Whether the log may have to be read differently: the model leaves part of it, or something pushes. Where the
    /// model leaves nothing but rounding, only the sign of all torques can be wrong.
    pub(super) fn calls_for_another(&self) -> bool {
        let is_recorded = self.left.iter().any(|left| *left > ROUNDING);
        self.is_clearly_turned() || (is_recorded && self.leaves_more_than(EXPLAINED))
    }

    /// Whether all torques should have the other sign, with which the model fits equally well: friction decides, or
    /// gravity where there is next to no friction.
    pub(super) fn is_turned(&self) -> bool {
        self.sign() < 0.0
    }

    /// Whether [`Self::is_turned`] holds beyond doubt: friction is more than noise, or gravity is the described one
    /// with the other sign.
    pub(super) fn is_clearly_turned(&self) -> bool {
        self.is_turned() && (self.friction < -TELLS || self.gravity < -CLEAR)
    }

    fn sign(&self) -> f64 {
        if self.friction.abs() > TELLS { self.friction } else { self.gravity }
    }
}

/// Data and models for fitting an arm to different readings of a log, for every mounting of the arm.
pub struct Bench {
    motion: Motion,
    /// Torques or currents as they were logged: a current that is read for another joint gets that joint's gain.
    effort: JointSignals,
    /// Noise (rms) of the logged torques or currents, as far as it is known.
    noise: Vec<f64>,
    /// Gain from logged values to torques, joint by joint, Nm/A; 1 where they are logged in Nm.
    gain: Vec<f64>,
    is_of_mean_period: bool,
    mountings: Vec<Mounting>,
}

/// The log as a reading has it, laid out for the arm as that reading mounts it.
struct LaidOut<'a> {
    mounting: &'a Mounting,
    motion: Motion,
    problem: Problem,
}

struct Mounting {
    gravity_m_s2: Option<[f64; 3]>,
    model: Model,
    set: BaseSet,
    /// The first moments among the base parameters: index and described value.
    first_moments: Vec<(usize, f64)>,
}

/// Number of instants used: fifteen equations for each parameter of an arm of six joints, and fast enough to try a
/// thousand readings a second.
const INSTANTS: usize = 150;

impl Bench {
    /// Prepares the log in `regression` for the arm as described: its mean period, or a single run behind the
    /// low-pass of `options`. `drive_gain_nm_a` holds the gains of logged currents. `None` for an arm without a base
    /// set, and where the low-pass cannot be made.
    pub fn new(
        arm: &Arm,
        regression: &Regression,
        options: &Options,
        drive_gain_nm_a: Option<&[f64]>,
    ) -> Option<Self> {
        let gain = drive_gain_nm_a.map_or_else(|| vec![1.0; arm.dof()], <[f64]>::to_vec);
        let as_logged = |torque_nm: &JointSignals| {
            torque_nm.map_joints(|j, y| y.iter().map(|nm| nm / gain[j]).collect())
        };
        let mountings = vec![Mounting::of(arm, None)?];
        let Regression { prepared, .. } = regression;
        let (motion, torque_nm) = (&prepared.motion, &prepared.torque_nm);
        let n = motion.samples();
        let every = n.div_ceil(INSTANTS);
        let thinned =
            |y: &JointSignals| y.map_joints(|_, y| y.iter().copied().step_by(every).collect());
        let of_motion = |motion: &Motion| Motion {
            q_rad: thinned(&motion.q_rad),
            qd_rad_s: thinned(&motion.qd_rad_s),
            qdd_rad_s2: thinned(&motion.qdd_rad_s2),
        };
        if torque_nm.samples() > n {
            let mean = torque_nm.map_joints(|_, y| mean_period(y, n));
            let of_mean = |r: &Replicates| {
                let sigma = r.sigma.iter().zip(&gain).map(|(nm, gain)| nm / gain);
                sigma.map(|sigma| sigma / (r.periods as f64).sqrt()).collect()
            };
            return Some(Self {
                motion: of_motion(motion),
                effort: as_logged(&thinned(&mean)),
                noise: prepared.replicates.as_ref().map_or(vec![0.0; arm.dof()], of_mean),
                gain,
                is_of_mean_period: true,
                mountings,
            });
        }
        let Options { cutoff_hz, order, .. } = *options;
        let rate_hz = prepared.processing.rate_hz;
        let mut scratch = Scratch::default();
        let smooth = smoothed(motion, false, rate_hz, cutoff_hz, order, &mut scratch).ok()?;
        let filter = ZeroPhase::new(cutoff_hz, order, rate_hz).ok()?;
        let mut torque_nm = torque_nm.clone();
        for j in 0..torque_nm.joints() {
            filter.filter_in_place(torque_nm.joint_mut(j), &mut scratch).ok()?;
        }
        Some(Self {
            motion: of_motion(&smooth),
            effort: as_logged(&thinned(&torque_nm)),
            noise: vec![0.0; arm.dof()],
            gain,
            is_of_mean_period: false,
            mountings,
        })
    }

    /// Whether the mean period is fitted; otherwise it is a single run behind the low-pass.
    pub fn is_of_mean_period(&self) -> bool {
        self.is_of_mean_period
    }

    /// Adds models for all other mountings.
    pub fn add_mountings(&mut self, arm: &Arm) {
        let others = other_gravity(arm).into_iter();
        self.mountings.extend(others.filter_map(|gravity| Mounting::of(arm, Some(gravity))));
    }

    /// Lays out the log as read by `reading`; `None` where there is no model for its mounting.
    fn lay_out(&self, reading: &Reading) -> Option<LaidOut<'_>> {
        let mut mountings = self.mountings.iter();
        let mounting = mountings.find(|m| m.gravity_m_s2 == reading.gravity_m_s2())?;
        let Mounting { model, set, .. } = mounting;
        let counting = reading.counting();
        let motion = Motion {
            q_rad: counting.angles(&self.motion.q_rad),
            qd_rad_s: counting.rates(&self.motion.qd_rad_s),
            qdd_rad_s2: counting.rates(&self.motion.qdd_rad_s2),
        };
        let effort = counting.torques(&self.effort);
        let torque_nm =
            effort.map_joints(|j, y| y.iter().map(|effort| self.gain[j] * effort).collect());
        let mut problem = Problem::new(ColumnPlan::new(model, set), 0.0);
        Assembler::new(model).assemble(&mut problem, model, &motion, &torque_nm);
        Some(LaidOut { mounting, motion, problem })
    }

    /// Condition of the full model's regressor along the motion as read by `reading`, with columns of unit length;
    /// `None` where the regressor is singular.
    pub fn condition(&self, reading: &Reading) -> Option<f64> {
        let LaidOut { mounting, problem, .. } = self.lay_out(reading)?;
        Some(Condition::of(&problem, &mounting.set).ok()?.scaled)
    }

    /// Fits the full model to the log as read by `reading`; `None` where the motion read so does not determine all
    /// parameters.
    pub fn fit(&self, reading: &Reading) -> Option<Match> {
        let LaidOut { mounting, motion, problem } = self.lay_out(reading)?;
        let Mounting { model, set, first_moments, .. } = mounting;
        let counting = reading.counting();
        let fit = Fitter::new(&problem).fit(&problem, set, Weighting::PerJoint).ok()?;
        let theta = &fit.theta;
        let squares = fit.residual_squares.iter().zip(&fit.torque_squares);
        let left: Vec<f64> = squares.map(|(residual, torque)| (residual / torque).sqrt()).collect();
        if !left.iter().all(|share| share.is_finite()) {
            return None;
        }
        let samples = motion.samples() as f64;
        let beyond_noise = (0..model.dof()).map(|j| {
            // The noise belongs to the logged channel that is read for this joint.
            let noise_nm = self.gain[j] * self.noise[counting.torque()[j].joint];
            let noise = noise_nm * noise_nm * samples / fit.torque_squares[j];
            (left[j].powi(2) - noise).max(0.0).sqrt()
        });
        let beyond_noise = beyond_noise.collect();
        let value = |parameter| set.index_of(parameter).map_or(0.0, |k| theta[k]);
        let friction_of = |j: usize| {
            let (coulomb_nm, viscous) =
                (value(Parameter::Coulomb(j)), value(Parameter::Viscous(j)));
            let (mut square, mut power_w) = (0.0, 0.0);
            for qd_rad_s in motion.qd_rad_s.joint(j) {
                let nm = coulomb_nm * model.friction_sign(*qd_rad_s) + viscous * qd_rad_s;
                square += nm * nm;
                power_w += nm * qd_rad_s;
            }
            (square / fit.torque_squares[j]).sqrt().copysign(power_w)
        };
        let friction: Vec<f64> = (0..model.dof()).map(friction_of).collect();
        let pushes = |(left, friction): (&f64, &f64)| *left < KNOWN && *friction < -FRICTION;
        let friction_pushes = left.iter().zip(&friction).map(pushes).collect();
        let friction = friction.iter().sum::<f64>() / friction.len() as f64;
        let gravity = cosine(first_moments, theta);
        Some(Match { left, friction_pushes, beyond_noise, friction, gravity })
    }
}

/// Cosine of the angle between the described values and the found values at their indices; 0 where either has no
/// length.
fn cosine(described: &[(usize, f64)], found: &[f64]) -> f64 {
    let sum = |f: &dyn Fn(f64, f64) -> f64| {
        described.iter().map(|(k, value)| f(*value, found[*k])).sum::<f64>()
    };
    let lengths = (sum(&|a, _| a * a) * sum(&|_, b| b * b)).sqrt();
    if lengths > 0.0 { sum(&|a, b| a * b) / lengths } else { 0.0 }
}

impl Mounting {
    fn of(arm: &Arm, gravity_m_s2: Option<[f64; 3]>) -> Option<Self> {
        let arm = Arm {
            gravity_m_s2: gravity_m_s2.map_or(arm.gravity_m_s2, Vector3::from),
            ..arm.clone()
        };
        let set =
            BaseSet::find(&arm, Parameterisation::full(arm.dof(), arm.torque_offsets)).ok()?;
        let model = Model::new(&arm);
        let nominal = set.values(&model.standard_parameters());
        let layout = ParameterLayout::new(arm.dof());
        let first_moments = set.first_moments(&layout).map(|k| (k, nominal[k])).collect();
        Some(Self { gravity_m_s2, model, set, first_moments })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Friction that pushes calls for another reading where the residual was recorded, and not where it is rounding;
    /// the sign of all torques shows without a residual.
    #[test]
    fn what_rounding_leaves_calls_for_no_other_reading() {
        let pushed = |left: f64, friction: f64| Match {
            left: vec![left; 2],
            friction_pushes: vec![false, true],
            beyond_noise: vec![left; 2],
            friction,
            gravity: 1.0,
        };
        assert!(pushed(1e-2, 0.1).calls_for_another());
        assert!(!pushed(1e-7, 0.1).calls_for_another());
        assert!(pushed(1e-7, -0.1).calls_for_another());
    }
}
