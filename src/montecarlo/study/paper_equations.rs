//! The paper's section IV-B: how the channels of a log become the equations (16).

use std::ops::Range;

use serde::Serialize;

use crate::base::{BaseSet, ColumnPlan};
use crate::dynamics::{Model, Motion};
use crate::identify::{Assembler, Problem};
use crate::plant::Measured;
use crate::robot::JointSignals;
use crate::signal::{PaperDifferentiator, PaperReading, Scratch, SignalError, ZeroPhase};

/// How (33), y = s/(s/ω + 1) u, run forward and backward, is used to compute accelerations from a log.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Acceleration {
    /// The reading that must be meant: the derivative of the velocity through a zero-phase low-pass, jω/(1 + (ω/ω_c)²).
    Intended,
    /// As printed, with u the velocity: the low-passed −d²q̇/dt².
    LiteralFromVelocity,
    /// As printed, with u the angle: the low-passed −q̈.
    LiteralFromAngle,
}

/// The paper's processing of a log: angles and velocities as logged, accelerations by (33).
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct PaperEquations {
    /// Corner frequency f of (33), Hz; 10 in the paper.
    pub cutoff_hz: f64,
    /// Interpretation of (33).
    pub acceleration: Acceleration,
    /// Whether the torque goes through the same low-pass 1/(1 + (ω/ω_c)²). The paper does not mention such a filter.
    pub torque_filtered: bool,
}

impl PaperEquations {
    /// The settings of section IV-B.
    pub const PAPER: Self =
        Self { cutoff_hz: 10.0, acceleration: Acceleration::Intended, torque_filtered: false };

    /// Assembles Θ_B and the torque. The filters run over the samples `filtered` of `log`, but only the rows `kept`
    /// (counted within `filtered`) become equations, so that the samples outside `kept` absorb the end effects of the
    /// filters.
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
