//! The paper's section IV-B: from the channels of a log to the equations (16).

use std::ops::Range;

use serde::Serialize;

use crate::base::BaseSet;
use crate::dynamics::{Model, Motion};
use crate::identify::{Assembler, ColumnPlan, Problem};
use crate::plant::Measured;
use crate::robot::JointSignals;
use crate::signal::{PaperDifferentiator, PaperReading, Scratch, SignalError, ZeroPhase};

/// How accelerations are made of a log by (33), y = s/(s/ω + 1) u, run forward and backward.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Acceleration {
    /// What must be meant: the derivative of the velocity behind a low-pass without phase,
    /// jω/(1 + (ω/ω_c)²).
    Intended,
    /// As printed, u the velocity: −d²q̇/dt² behind the low-pass.
    LiteralFromVelocity,
    /// As printed, u the angle: −q̈ behind the low-pass.
    LiteralFromAngle,
}

/// The paper's processing of a log: angles and velocities as they were logged, accelerations by (33).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PaperEquations {
    /// Corner frequency f of (33), Hz; 10 in the paper.
    pub cutoff_hz: f64,
    /// How (33) is read.
    pub acceleration: Acceleration,
    /// Whether the torque goes through the same low-pass 1/(1 + (ω/ω_c)²). The paper does not say
    /// that it does.
    pub torque_filtered: bool,
}

impl PaperEquations {
    /// As in section IV-B.
    pub const PAPER: Self =
        Self { cutoff_hz: 10.0, acceleration: Acceleration::Intended, torque_filtered: false };

    /// Θ_B and torque of the samples `filtered` of `log`, of which the rows `kept` (counted within
    /// `filtered`) become equations: what lies between them takes up the filters' ends.
    pub fn assemble(
        &self,
        model: &Model,
        set: &BaseSet,
        log: &Measured,
        rate_hz: f64,
        filtered: Range<usize>,
        kept: Range<usize>,
    ) -> Result<Problem, SignalError> {
        let q_rad = log.q_rad.slice(filtered.clone());
        let qd_rad_s = log.qd_rad_s.slice(filtered.clone());
        let mut torque_nm = log.torque_nm.slice(filtered);
        let (reading, source) = match self.acceleration {
            Acceleration::Intended => (PaperReading::Intended, &qd_rad_s),
            Acceleration::LiteralFromVelocity => (PaperReading::Literal, &qd_rad_s),
            Acceleration::LiteralFromAngle => (PaperReading::Literal, &q_rad),
        };
        let differentiator = PaperDifferentiator::new(reading, self.cutoff_hz, rate_hz)?;
        let mut scratch = Scratch::default();
        let mut qdd_rad_s2 = JointSignals::zeros(source.joints(), source.samples());
        for j in 0..source.joints() {
            let qdd = differentiator.apply(source.joint(j), &mut scratch)?;
            qdd_rad_s2.joint_mut(j).copy_from_slice(&qdd);
        }
        if self.torque_filtered {
            let low_pass = ZeroPhase::with_single_pass_cutoff(self.cutoff_hz, 1, rate_hz)?;
            for j in 0..torque_nm.joints() {
                low_pass.filter_in_place(torque_nm.joint_mut(j), &mut scratch)?;
            }
        }
        let motion = Motion { q_rad, qd_rad_s, qdd_rad_s2 }.slice(kept.clone());
        let mut problem = Problem::new(ColumnPlan::new(model, set), rate_hz);
        let torque_nm = torque_nm.slice(kept);
        Assembler::new(model).assemble(&mut problem, model, &motion, &torque_nm);
        Ok(problem)
    }
}
