//! Families of hidden effects: which effects are hidden, where, and by what they can be seen.

use serde::{Deserialize, Serialize};

use crate::diagnose::Kind;

/// By what a diagnosis can see an effect.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Judged {
    /// By the residuals of the null model; the size of the effect is √λ.
    Residual,
    /// By comparison with a given simulation, because the null model absorbs the effect; its size is √λ_sim.
    Simulation,
    /// By the readings themselves; the effect has no size in units of the torque noise.
    Record,
}

/// A family of effects and the sites where it is hidden.
#[derive(Debug, Clone, Copy)]
pub struct Family {
    /// Name of the family.
    pub kind: Kind,
    /// By what its effects are seen at these sites.
    pub judged: Judged,
    /// Joints from 1; `None`: the arm as a whole.
    pub sites: &'static [Option<usize>],
}

/// Number of joints of the arms in which effects are hidden.
pub(super) const JOINTS: usize = 6;
const EACH: &[Option<usize>] = &[Some(1), Some(2), Some(3), Some(4), Some(5), Some(6)];
const EACH_AND_ALL: &[Option<usize>] =
    &[None, Some(1), Some(2), Some(3), Some(4), Some(5), Some(6)];
const ARM: &[Option<usize>] = &[None];

/// The families that are drawn, with equal chances. Effects that the parameters absorb but for a few percent of their
/// size are drawn twice: against a simulation, and by what they leave in the residual. At the sites where even the
/// largest leaves less than √λ = 4 (a gain of joint 6, an offset of joint 5) they are only drawn against a simulation.
pub const FAMILIES: [Family; 32] = [
    residual(Kind::Stribeck, EACH),
    residual(Kind::NonlinearViscous, EACH),
    residual(Kind::AsymmetricFriction, EACH),
    residual(Kind::LoadFriction, &[Some(2), Some(3), Some(4), Some(5)]),
    residual(Kind::Presliding, EACH),
    residual(Kind::PositionFriction, EACH),
    residual(Kind::ThermalDrift, EACH),
    residual(Kind::Ripple, EACH),
    residual(Kind::Elasticity, &[Some(2), Some(3)]),
    residual(Kind::Backlash, &[Some(1), Some(2), Some(3)]),
    residual(Kind::TorqueGain, &[Some(1), Some(2), Some(3), Some(4), Some(5)]),
    residual(Kind::CurrentOffset, EACH),
    residual(Kind::Saturation, EACH),
    residual(Kind::TimeSkew, EACH_AND_ALL),
    residual(Kind::VelocityLag, EACH_AND_ALL),
    residual(Kind::BaseTilt, ARM),
    residual(Kind::Spring, EACH),
    residual(Kind::Contact, EACH_AND_ALL),
    of_the_parameters(Kind::TorqueGain, &[Some(1), Some(4), Some(5), Some(6)]),
    of_the_parameters(Kind::EncoderOffset, &[Some(2), Some(3), Some(4), Some(5)]),
    of_the_parameters(Kind::Gravity, ARM),
    of_the_parameters(Kind::Payload, ARM),
    of_the_parameters(Kind::LinkLength, &[Some(3), Some(4)]),
    of_the_parameters(Kind::FrictionChange, EACH),
    of_the_record(Kind::ClockFault, ARM),
    of_the_record(Kind::DroppedSamples, ARM),
    of_the_record(Kind::Quantisation, EACH),
    of_the_record(Kind::Outliers, EACH),
    residual(Kind::ReversalWidth, EACH_AND_ALL),
    residual(Kind::EncoderOffset, &[Some(2), Some(3), Some(4)]),
    residual(Kind::Gravity, ARM),
    residual(Kind::LinkLength, &[Some(3), Some(4)]),
];

/// Families that are hidden only if a scenario names them. Whether a drive that feeds forward another share of friction
/// is named depends on how much the drives of the arm differ anyway, which √λ does not measure.
pub(super) const ON_REQUEST: [Family; 1] = [residual(Kind::FeedForward, EACH)];

const fn residual(kind: Kind, sites: &'static [Option<usize>]) -> Family {
    Family { kind, judged: Judged::Residual, sites }
}

const fn of_the_parameters(kind: Kind, sites: &'static [Option<usize>]) -> Family {
    Family { kind, judged: Judged::Simulation, sites }
}

const fn of_the_record(kind: Kind, sites: &'static [Option<usize>]) -> Family {
    Family { kind, judged: Judged::Record, sites }
}

/// Families whose torque a log distinguishes from that of `kind` hardly or not at all: a constant torque is also a
/// friction that differs by direction, and a spring far from its rest position. Gravity and the length of a link both
/// leave the weight of the links out of proportion to their inertia; what distinguishes them is seen when both are
/// known, and is too little to be seen as a rest of one beside the other. If `kind` is withheld, they are withheld too.
pub(super) fn kin(kind: Kind) -> &'static [Kind] {
    const CONSTANT: &[Kind] = &[Kind::CurrentOffset, Kind::AsymmetricFriction, Kind::Spring];
    const WEIGHT: &[Kind] = &[Kind::Gravity, Kind::LinkLength];
    [CONSTANT, WEIGHT].into_iter().find(|group| group.contains(&kind)).unwrap_or(&[])
}

impl Family {
    /// Whether the family is one of the `known` families of the dictionary and its effects are seen in the residual.
    pub(super) fn can_be_withheld(&self, known: &[Kind]) -> bool {
        self.judged == Judged::Residual && known.contains(&self.kind)
    }
}
