//! What changed between two logs of the same arm: a body on the flange.
//!
//! Both logs share the base parameters and the effects that were found in the first. The second may have a body on the
//! flange (ten inertial parameters, about the last joint's frame) and friction of another size, because it may be from
//! another day. The motions need not be the same.
//!
//! A known mass M gives the scale of the drive gains: if all gains are off by a common factor, so is every identified
//! mass m̂, and the true gain is M/m̂ times the assumed one. Joint by joint, the torque of the body enters with a
//! factor a_j of its own (Gautier and Briot 2014, with the mass as the known quantity); 1/a_j is the scale of that
//! joint's gain.

mod body;
mod equations;
mod fit;
mod words;

use fit::Fit;
use serde::Serialize;

use super::candidates::Candidate;
use super::chance;
use super::error::DiagnoseError;
use super::extension::{Effect, Extension};
use super::kind::Kind;
use super::setup::Setup;
use super::verdict::{Cause, Estimate};
use crate::identify::Regression;

/// What a second log says about a body on the flange.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PayloadFinding {
    /// The log without the body.
    pub reference: String,
    /// Mass, kg; NaN (null) where the joints of this arm do not tell it from the body's other parameters.
    pub mass_kg: Estimate,
    /// First moments m·c about the last joint's frame, kg m; NaN (null) where the joints do not tell them.
    pub first_moment_kg_m: [Estimate; 3],
    /// Centre of mass in the last joint's frame, m; meaningful where the body is named.
    pub com_m: [Estimate; 3],
    /// Probability that chance alone gives a mass and first moments as large.
    pub probability: f64,
    /// Whether a body is named.
    pub is_named: bool,
    /// Common scale of all drive gains that follows from the known mass; null where no mass was given or no body is
    /// named.
    pub gain_scale: Option<Estimate>,
    /// The scale of each joint's own drive gain, likewise; written as null where the motions do not tell it.
    #[serde(serialize_with = "words::only_told")]
    pub joint_gain_scales: Option<Vec<Estimate>>,
    /// Change of Coulomb friction per joint from the first log to the second, Nm.
    pub coulomb_change_nm: Vec<Estimate>,
    /// Whether the periods of the second log show that something touched the arm. The torque of the touch was then
    /// replaced by the trimmed mean of the other periods. `false` if nothing was found or nothing looked for, as along
    /// a single run.
    #[serde(skip)]
    pub was_touched: bool,
}

/// What stays the same for both logs.
pub(super) struct Shared<'a> {
    pub(super) setup: Setup<'a>,
    pub(super) families: &'a [Box<dyn Candidate>],
    /// Base parameters and effects found in the first log.
    pub(super) extension: &'a Extension,
}

impl Shared<'_> {
    /// The error e of the torque constant of joint `j` (from 0 on) that the first log tells, as a fraction: the log shows
    /// (1 + e) times the torque. The scale of its gain is found beside it.
    fn gain_error(&self, j: usize) -> f64 {
        let is_gain = |effect: &&Effect| {
            self.families[effect.family].kind() == Kind::TorqueGain && effect.site == Some(j)
        };
        self.extension.effects.iter().filter(is_gain).flat_map(|effect| &effect.coefficients).sum()
    }
}

/// Compares the log of the regression `second` with that of `first`; `names` are the names of the two logs.
pub(super) fn between(
    shared: &Shared,
    first: &Regression,
    second: &Regression,
    names: [&str; 2],
    known_mass_kg: Option<f64>,
) -> Result<PayloadFinding, DiagnoseError> {
    let fit = Fit::of(shared, first, second, names[1])?;
    let (mass_kg, probability) = (fit.mass_kg(), fit.probability());
    let is_named = probability < chance::PAYLOAD && mass_kg.ci95[0] > 0.0;
    let known_kg = known_mass_kg.filter(|_| is_named);
    let mut joint_gain_scales =
        known_kg.map(|known| fit.joint_gain_scales(known, names[1])).transpose()?;
    for (j, scale) in joint_gain_scales.iter_mut().flatten().enumerate() {
        scale.scale(1.0 / (1.0 + shared.gain_error(j)));
    }
    Ok(PayloadFinding {
        reference: names[0].to_owned(),
        mass_kg,
        first_moment_kg_m: fit.first_moment_kg_m(),
        com_m: fit.com_m(),
        probability,
        is_named,
        gain_scale: known_kg.map(|known| fit.gain_scale(known)),
        joint_gain_scales,
        coulomb_change_nm: fit.coulomb_change_nm(),
        was_touched: false,
    })
}

impl PayloadFinding {
    /// Whether the second log carries something else than the first, beyond what chance explains.
    pub fn differs(&self) -> bool {
        self.probability < chance::PAYLOAD
    }

    /// The finding as a cause, if a body is named.
    pub fn cause(&self) -> Option<Cause> {
        if !self.is_named {
            return None;
        }
        let sigma = 0.25 * (self.mass_kg.ci95[1] - self.mass_kg.ci95[0]);
        let [x, y, z] = self.com_m.clone();
        let all =
            [("mass_kg", self.mass_kg.clone()), ("com_x_m", x), ("com_y_m", y), ("com_z_m", z)];
        let parameters: Vec<_> =
            all.into_iter().filter(|(_, estimate)| !estimate.value.is_nan()).collect();
        let strength = self.mass_kg.value / sigma;
        Some(Cause {
            confidence: 1.0 - self.probability,
            ..Cause::certain(Kind::Payload, None, "a body on the flange", strength, &parameters)
        })
    }
}
