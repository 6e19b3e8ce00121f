//! The counterpart of a named cause in the plant.
//!
//! Diagnosis and plant use the same physical quantities in the same units, and share nothing else: a size that was
//! fitted to a log enters the equations of motion. Where a family and its effect differ in meaning, this file says so.

use crate::diagnose::Kind;
use crate::diagnose::candidates::elasticity::ON_MOTOR;
use crate::diagnose::candidates::load_friction::{MOTOR_SIDE, ROTOR};
use crate::diagnose::candidates::stribeck::{RATIONAL, STEEP_AT_REST};
use crate::diagnose::candidates::time_skew::LOW_PASS;
use crate::plant::PlantConfig;
use crate::plant::faults::{self, Effect, Fall};

/// What happens to a cause when the simulation is extended by it.
#[derive(Debug, Clone, PartialEq)]
pub enum Counterpart {
    /// It is part of the fitted model, and acts in the simulated arm.
    InTheModel(Effect),
    /// It acts on the readings. The log was freed of it before the model was fitted, so that a replay does without it,
    /// while a scenario that is to produce such logs includes it.
    OfTheRecord(Effect),
    /// It is not simulated, for this reason.
    None(&'static str),
}

/// Reasons why a cause is not simulated.
const IN_THE_PARAMETERS: &str = "the identified parameters hold it already";
const ONE_EVENT: &str =
    "it happened once: no property of the arm, taken out of the log before the fit";
const NO_SUCH_SIZE: &str = "the size that was found is none that the simulated effect can have";
const NO_SUCH_LAW: &str = "the simulated arm has no friction of this law";
const NO_LOW_PASS: &str = "the simulated arm reads its torque without a low-pass";
const OTHER_ROTOR: &str =
    "the simulated arm has the rotor of the robot's file, with which its gear carries another load";
const INCOMPLETE: &str = "the log does not tell all of its numbers";

/// Stiffest bristles that are simulated, 1/rad. Friction then turns round within 0.1 mrad, less than a joint moves in
/// one sample where its direction is in doubt, so that no log distinguishes stiffer bristles.
const STIFFEST_PER_RAD: f64 = 1e4;

/// Sharpest reversal of friction that is simulated, rad/s: a joint that accelerates at 1 rad/s² passes through it
/// within a millisecond.
const SHARPEST_RAD_S: f64 = 1e-3;

/// A cause as diagnosed.
#[derive(Debug, Clone, Copy)]
pub struct Found<'a> {
    /// Its family.
    pub kind: Kind,
    /// Joint, from 1; `None`: the arm as a whole.
    pub joint: Option<usize>,
    /// Variant of the family's law.
    pub variant: usize,
    /// Names of its physical parameters, with SI values.
    pub quantities: &'a [(&'static str, f64)],
}

impl Found<'_> {
    fn value(&self, name: &str) -> Option<f64> {
        let found = self.quantities.iter().find(|(known, _)| *known == name);
        found.map(|(_, value)| *value).filter(|value| value.is_finite())
    }

    /// The counterpart in the plant.
    pub fn counterpart(&self) -> Counterpart {
        self.effect().unwrap_or(Counterpart::None(INCOMPLETE))
    }

    /// `None` where a number is missing.
    fn effect(&self) -> Option<Counterpart> {
        let value = |name| self.value(name);
        let in_the_model = |effect| Some(Counterpart::InTheModel(effect));
        let of_the_record = |effect| Some(Counterpart::OfTheRecord(effect));
        match self.kind {
            Kind::Stribeck => in_the_model(Effect::Stribeck(faults::Stribeck {
                joint: self.joint?,
                extra_nm: value("extra_nm")?,
                vs_rad_s: value("vs_rad_s")?,
                exponent: if self.variant == STEEP_AT_REST { 1 } else { 2 },
                fall: if self.variant == RATIONAL { Fall::Rational } else { Fall::Exponential },
            })),
            // Laws that the plant does not have. Most of them are fitted to single runs only.
            Kind::NonlinearViscous if value("speed_rad_s").is_some() => {
                Some(Counterpart::None(NO_SUCH_LAW))
            }
            Kind::LoadFriction
                if self.variant == MOTOR_SIDE
                    || value("exponent").or(value("mu_bending")).is_some() =>
            {
                Some(Counterpart::None(NO_SUCH_LAW))
            }
            Kind::NonlinearViscous => {
                in_the_model(Effect::NonlinearViscous(faults::NonlinearViscous {
                    joint: self.joint?,
                    amplitude_nm: value("amplitude_nm")?,
                    exponent: value("exponent")?,
                }))
            }
            Kind::AsymmetricFriction => {
                in_the_model(Effect::AsymmetricFriction(faults::AsymmetricFriction {
                    joint: self.joint?,
                    // Unknown where the null model fits an offset, which the arm already has.
                    coulomb_nm: value("coulomb_nm").unwrap_or(0.0),
                    viscous_nm_s_rad: value("viscous_nm_s_rad")?,
                }))
            }
            Kind::LoadFriction if self.variant == ROTOR => Some(Counterpart::None(OTHER_ROTOR)),
            Kind::LoadFriction => match value("mu")? {
                mu if (0.0..=0.5).contains(&mu) => {
                    let joint = self.joint?;
                    in_the_model(Effect::LoadFriction(faults::LoadFriction { joint, mu }))
                }
                _ => Some(Counterpart::None(NO_SUCH_SIZE)),
            },
            // Sliding friction is the arm's own. The value that the family fits to the reversals alone is the same
            // quantity, known less well.
            Kind::Presliding => in_the_model(Effect::Presliding(faults::Presliding {
                joint: self.joint?,
                stiffness_per_rad: value("stiffness_per_rad")?.min(STIFFEST_PER_RAD),
                damping_s: value("damping_s").unwrap_or(0.0).max(0.0),
            })),
            Kind::ReversalWidth => in_the_model(Effect::ReversalWidth(faults::ReversalWidth {
                joint: self.joint,
                width_rad_s: value("width_rad_s")?.max(SHARPEST_RAD_S),
            })),
            Kind::PositionFriction => {
                in_the_model(Effect::PositionFriction(faults::PositionFriction {
                    joint: self.joint?,
                    amplitude_nm: value("amplitude_nm")?,
                    phase_rad: value("phase_rad")?,
                }))
            }
            Kind::ThermalDrift => match value("fraction")? {
                fraction if fraction > -0.5 && fraction <= 1.0 => {
                    in_the_model(Effect::ThermalDrift(faults::ThermalDrift {
                        joint: self.joint?,
                        fraction,
                        time_constant_s: value("time_constant_s")?,
                    }))
                }
                _ => Some(Counterpart::None(NO_SUCH_SIZE)),
            },
            Kind::Ripple => in_the_model(Effect::Ripple(faults::Ripple {
                joint: self.joint?,
                amplitude_nm: value("amplitude_nm")?,
                order_per_turn: value("order_per_turn")?,
                phase_rad: value("phase_rad")?,
            })),
            Kind::Elasticity => {
                let stiffness_nm_rad = value("stiffness_nm_rad")?;
                let on_motor = self.variant < ON_MOTOR;
                let encoder =
                    if on_motor { faults::EncoderSide::Motor } else { faults::EncoderSide::Link };
                in_the_model(Effect::Elasticity(faults::Elasticity::new(
                    self.joint?,
                    stiffness_nm_rad,
                    encoder,
                )))
            }
            Kind::Backlash => in_the_model(Effect::Backlash(faults::Backlash::new(
                self.joint?,
                value("gap_rad")?,
            ))),
            Kind::TorqueGain => match value("error_fraction")? {
                error_fraction if (-0.5..=1.0).contains(&error_fraction) => {
                    let joint = self.joint?;
                    in_the_model(Effect::TorqueGain(faults::TorqueGain { joint, error_fraction }))
                }
                _ => Some(Counterpart::None(NO_SUCH_SIZE)),
            },
            Kind::CurrentOffset => in_the_model(Effect::CurrentOffset(faults::CurrentOffset {
                joint: self.joint?,
                offset_nm: value("offset_nm")?,
            })),
            Kind::Saturation => in_the_model(Effect::Saturation(faults::Saturation {
                joint: self.joint?,
                limit_nm: value("limit_nm")?,
            })),
            // No drive feeds forward less than nothing.
            Kind::FeedForward => in_the_model(Effect::FeedForward(faults::FeedForward {
                joint: self.joint?,
                share_less: value("share_less")?.min(PlantConfig::default().friction_feedforward),
            })),
            Kind::TimeSkew if self.variant == LOW_PASS => Some(Counterpart::None(NO_LOW_PASS)),
            Kind::TimeSkew => in_the_model(Effect::TimeSkew(faults::TimeSkew {
                joint: self.joint,
                delay_s: value("delay_s")?,
            })),
            Kind::EncoderOffset => in_the_model(Effect::EncoderOffset(faults::EncoderOffset {
                joint: self.joint?,
                offset_rad: value("offset_rad")?,
            })),
            Kind::BaseTilt => in_the_model(Effect::BaseTilt(faults::BaseTilt {
                // A direction that the log does not determine is left as it is in the model.
                tilt_x_rad: value("tilt_x_rad").unwrap_or(0.0),
                tilt_y_rad: value("tilt_y_rad").unwrap_or(0.0),
            })),
            Kind::Gravity => {
                in_the_model(Effect::Gravity(faults::Gravity { g_m_s2: value("g_m_s2")? }))
            }
            Kind::LinkLength => in_the_model(Effect::LinkLength(faults::LinkLength {
                joint: self.joint?,
                error_m: value("error_m")?,
            })),
            Kind::Spring => self.spring(),
            Kind::VelocityLag => of_the_record(Effect::VelocityLag(faults::VelocityLag {
                joint: self.joint,
                delay_s: value("delay_s")?,
            })),
            Kind::ClockFault => of_the_record(Effect::ClockFault(faults::ClockFault {
                lost_s: value("lost_s")?,
                every_rows: value("every_rows")? as usize,
            })),
            Kind::DroppedSamples => of_the_record(Effect::DroppedSamples(faults::DroppedSamples {
                joint: self.joint,
                fraction: value("fraction")?,
                repeat: true,
            })),
            Kind::Quantisation => of_the_record(Effect::Quantisation(faults::Quantisation {
                joint: self.joint,
                step: value("step")?,
                channel: faults::ReadingChannel::Torque,
            })),
            Kind::Outliers => of_the_record(Effect::Outliers(faults::Outliers {
                joint: self.joint,
                fraction: value("fraction")?,
            })),
            Kind::Contact => Some(Counterpart::None(ONE_EVENT)),
            Kind::Payload | Kind::FrictionChange => Some(Counterpart::None(IN_THE_PARAMETERS)),
        }
    }

    /// Counterpart of a spring. Where the null model absorbs its angle dependence, only its pull at zero remains, a
    /// constant torque. Where the offset of the null model absorbs its pull at zero, its rest angle is taken as zero.
    fn spring(&self) -> Option<Counterpart> {
        let joint = self.joint?;
        if let Some(offset_nm) = self.value("pull_at_zero_nm") {
            let offset = faults::CurrentOffset { joint, offset_nm };
            return Some(Counterpart::InTheModel(Effect::CurrentOffset(offset)));
        }
        let stiffness_nm_rad = self.value("stiffness_nm_rad")?;
        if stiffness_nm_rad < 0.0 {
            return Some(Counterpart::None(NO_SUCH_SIZE));
        }
        let rest_rad = self.value("rest_rad").unwrap_or(0.0);
        let spring = faults::Spring { joint, stiffness_nm_rad, rest_rad };
        Some(Counterpart::InTheModel(Effect::Spring(spring)))
    }
}
