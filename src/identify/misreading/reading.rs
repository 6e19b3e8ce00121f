//! A log as it may be read, and how well the arm fits it.

use nalgebra::Vector3;
use serde::Serialize;

use super::change::{Change, other_gravity};
use crate::base::{BaseSet, Parameterisation};
use crate::dynamics::{Model, Motion, Parameter, ParameterLayout};
use crate::identify::columns::ColumnPlan;
use crate::identify::fit::{Fitter, Weighting};
use crate::identify::identifier::Regression;
use crate::identify::options::Options;
use crate::identify::problem::{Assembler, Problem};
use crate::identify::whiten::smoothed;
use crate::robot::{Arm, JointSignals};
use crate::signal::{Scratch, ZeroPhase, mean_period};

/// Motion and torque at some instants, and how the arm is mounted.
#[derive(Debug, Clone)]
pub struct Reading {
    motion: Motion,
    torque_nm: JointSignals,
    /// `None`: as described.
    gravity_m_s2: Option<[f64; 3]>,
}

/// Instants that are looked at: ten equations for each parameter.
const INSTANTS: usize = 400;

impl Reading {
    /// Of the log in `regression`: the mean period, or the run behind the low-pass of `options`; `None` where that cannot be made.
    pub fn of(regression: &Regression, options: &Options) -> Option<Self> {
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
            return Some(Self {
                motion: of_motion(motion),
                torque_nm: thinned(&mean),
                gravity_m_s2: None,
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
            torque_nm: thinned(&torque_nm),
            gravity_m_s2: None,
        })
    }

    /// Read with `change` as well.
    pub fn with(&self, change: Change) -> Self {
        let mut other = self.clone();
        let Motion { q_rad, qd_rad_s, qdd_rad_s2 } = &mut other.motion;
        let torque_nm = &mut other.torque_nm;
        match change {
            Change::JointsExchanged { joints } => {
                for signals in [q_rad, qd_rad_s, qdd_rad_s2, torque_nm] {
                    signals.exchange(joints);
                }
            }
            Change::TorquesExchanged { joints } => torque_nm.exchange(joints),
            Change::MotionsExchanged { joints } => {
                for signals in [q_rad, qd_rad_s, qdd_rad_s2] {
                    signals.exchange(joints);
                }
            }
            Change::TorqueReversed { joints: [j] } => torque_nm.reverse(j),
            Change::AllTorquesReversed => {
                (0..torque_nm.joints()).for_each(|j| torque_nm.reverse(j));
            }
            Change::JointReversed { joints: [j] } => {
                for signals in [q_rad, qd_rad_s, qdd_rad_s2, torque_nm] {
                    signals.reverse(j);
                }
            }
            Change::MotionReversed { joints: [j] } => {
                for signals in [q_rad, qd_rad_s, qdd_rad_s2] {
                    signals.reverse(j);
                }
            }
            Change::ZeroTurned { joints: [j], add_rad } => {
                q_rad.joint_mut(j).iter_mut().for_each(|q| *q += add_rad);
            }
            Change::Mounted { gravity_m_s2 } => other.gravity_m_s2 = Some(gravity_m_s2),
        }
        other
    }
}

/// Share of the torque (rms) that friction has where it counts: what is less may be another law.
const FRICTION: f64 = 0.1;
/// Share of the torque (rms) that may be left where friction is to be believed: noise that hides a joint's torque has no sign.
const KNOWN: f64 = 0.3;
/// What friction that pushes is worth in a misfit: a residual ten times as large.
const PUSHES: f64 = 2.0 * std::f64::consts::LN_10;

/// How well an arm fits a log, joint by joint.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Match {
    /// Share of the torque (rms) that the model leaves.
    pub left: Vec<f64>,
    /// Whether Coulomb friction is negative, and a tenth of the torque or more.
    pub friction_pushes: Vec<bool>,
}

impl Match {
    /// ln (‖e_j‖² / ‖τ_j‖²) of joint `j`, and more where friction pushes.
    pub(super) fn misfit_of(&self, j: usize) -> f64 {
        let pushes = if self.friction_pushes[j] { PUSHES } else { 0.0 };
        2.0 * self.left[j].max(f64::MIN_POSITIVE).ln() + pushes
    }

    /// Of all joints.
    pub(super) fn misfit(&self) -> f64 {
        (0..self.left.len()).map(|j| self.misfit_of(j)).sum()
    }
}

/// What it takes to fit an arm to readings, for every way in which it may be mounted.
pub struct Bench {
    mountings: Vec<Mounting>,
}

struct Mounting {
    gravity_m_s2: Option<[f64; 3]>,
    model: Model,
    set: BaseSet,
}

impl Bench {
    /// For the arm as described; `None` for one without a base set.
    pub fn new(arm: &Arm) -> Option<Self> {
        Some(Self { mountings: vec![Mounting::of(arm, None)?] })
    }

    /// For all other mountings as well.
    pub fn add_mountings(&mut self, arm: &Arm) {
        let others = other_gravity(arm).into_iter();
        self.mountings.extend(others.filter_map(|gravity| Mounting::of(arm, Some(gravity))));
    }

    /// How well the full model fits `reading`; `None` where the motion that is read does not tell all its parameters.
    pub fn fit(&self, reading: &Reading) -> Option<Match> {
        let mut mountings = self.mountings.iter();
        let Mounting { model, set, .. } =
            mountings.find(|m| m.gravity_m_s2 == reading.gravity_m_s2)?;
        let mut problem = Problem::new(ColumnPlan::new(model, set), 0.0);
        let Reading { motion, torque_nm, .. } = reading;
        Assembler::new(model).assemble(&mut problem, model, motion, torque_nm);
        let fit = Fitter::new(&problem).fit(&problem, set, Weighting::PerJoint).ok()?;
        let squares = fit.residual_squares.iter().zip(&fit.torque_squares);
        let left: Vec<f64> = squares.map(|(residual, torque)| (residual / torque).sqrt()).collect();
        let layout = ParameterLayout::new(model.dof());
        let pushes = |j: usize| {
            let is_friction =
                |k: &usize| set.column(*k)[0].0 == layout.index(Parameter::Coulomb(j));
            let Some(k) = (0..set.rank()).find(is_friction) else { return false };
            let sign = motion.qd_rad_s.joint(j).iter().map(|qd| model.friction_sign(*qd).powi(2));
            let friction_nm = fit.theta[k] * sign.sum::<f64>().sqrt();
            left[j] < KNOWN && friction_nm < -FRICTION * fit.torque_squares[j].sqrt()
        };
        let friction_pushes: Vec<bool> = (0..model.dof()).map(pushes).collect();
        left.iter().all(|share| share.is_finite()).then_some(Match { left, friction_pushes })
    }
}

impl Mounting {
    fn of(arm: &Arm, gravity_m_s2: Option<[f64; 3]>) -> Option<Self> {
        let arm = Arm {
            gravity_m_s2: gravity_m_s2.map_or(arm.gravity_m_s2, Vector3::from),
            ..arm.clone()
        };
        let set =
            BaseSet::find(&arm, Parameterisation::full(arm.dof(), arm.torque_offsets)).ok()?;
        Some(Self { gravity_m_s2, model: Model::new(&arm), set })
    }
}
