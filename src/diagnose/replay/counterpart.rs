//! The counterpart of a named cause in the plant.
//!
//! Diagnosis and plant use the same physical quantities in the same units, and share nothing else: a size that was
//! fitted to a log enters the equations of motion. Where a family and its effect differ in meaning, this file says so:
//! at the family, or here, where it is a matter of several.
//!
//! - **The drive is the plant's own.** Several laws of the diagnosis have variants for how a drive answers them
//!   (friction that turns round over another range of speeds, presliding). Their numbers enter the plant, whose
//!   controller feeds forward a share of the friction of the robot's file in any case. A variant that is another law
//!   than any of the plant's has no counterpart.
//! - **Gears are the plant's own** in what the diagnosis fits and does not report: an elastic gear swings by the
//!   stiffness by which it bends, and play ends at flanks of the plant's usual stiffness.
//! - **Faults of the record** were found by what they do to readings. The plant has them where it does the same; their
//!   rows are drawn anew.

use crate::diagnose::candidates::elasticity::{ON_MOTOR, damping_ratio};
use crate::diagnose::candidates::load_friction::{MOTOR_SIDE, ROTOR};
use crate::diagnose::candidates::presliding::HELD;
use crate::diagnose::candidates::stribeck::{RATIONAL, STEEP_AT_REST};
use crate::diagnose::candidates::time_skew::LOW_PASS;
use crate::diagnose::{Channel, Kind, RecordFault};
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
const OTHER_ROWS: &str =
    "the simulated record loses whole rows or repeats them, or repeats all readings of a joint";
const OTHER_CHANNEL: &str = "the simulated record has wild readings of the torque alone";
const OTHER_ROTOR: &str =
    "the simulated arm has the rotor of the robot's file, with which its gear carries another load";
const UNKNOWN_AT_REST: &str =
    "how much friction a joint holds at rest depends on how it came to rest, which no law tells";
const INCOMPLETE: &str = "the log does not tell all of its numbers";

/// Stiffest bristles that are simulated, 1/rad. Friction then turns round within 0.1 mrad, less than a joint moves in
/// one sample where its direction is in doubt, so that no log distinguishes stiffer bristles.
const STIFFEST_PER_RAD: f64 = 1e4;

/// Sharpest reversal of friction that is simulated, rad/s: a joint that accelerates at 1 rad/s² passes through it
/// within a millisecond.
const SHARPEST_RAD_S: f64 = 1e-3;

/// A cause as diagnosed.
#[derive(Debug, Clone, Copy)]
pub struct DiagnosedCause<'a> {
    /// Its family.
    pub kind: Kind,
    /// Joint, from 1; `None`: the arm as a whole.
    pub joint: Option<usize>,
    /// Variant of the family's law.
    pub variant: usize,
    /// What a fault of the record did to the readings; `None` for other causes.
    pub record_fault: Option<&'a RecordFault>,
    /// Names of its physical parameters, with SI values.
    pub quantities: &'a [(&'static str, f64)],
}

impl DiagnosedCause<'_> {
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
        match self.kind {
            Kind::Stribeck
            | Kind::NonlinearViscous
            | Kind::AsymmetricFriction
            | Kind::LoadFriction
            | Kind::Presliding
            | Kind::ReversalWidth
            | Kind::PositionFriction
            | Kind::ThermalDrift => self.of_friction(),
            Kind::Ripple | Kind::Elasticity | Kind::Backlash => self.of_gear(),
            Kind::TorqueGain | Kind::CurrentOffset | Kind::Saturation | Kind::FeedForward => {
                self.of_drive()
            }
            Kind::EncoderOffset
            | Kind::BaseTilt
            | Kind::Gravity
            | Kind::LinkLength
            | Kind::Spring => self.of_arm(),
            Kind::TimeSkew
            | Kind::VelocityLag
            | Kind::ClockFault
            | Kind::DroppedSamples
            | Kind::Quantisation
            | Kind::Outliers => self.of_record(),
            Kind::Contact => Some(Counterpart::None(ONE_EVENT)),
            Kind::Payload | Kind::FrictionChange => Some(Counterpart::None(IN_THE_PARAMETERS)),
        }
    }

    /// Counterpart of a law of friction.
    fn of_friction(&self) -> Option<Counterpart> {
        let value = |name| self.value(name);
        let effect = match self.kind {
            Kind::Stribeck => Effect::Stribeck(faults::Stribeck {
                joint: self.joint?,
                extra_nm: value("extra_nm")?,
                vs_rad_s: value("vs_rad_s")?,
                exponent: if self.variant == STEEP_AT_REST { 1 } else { 2 },
                fall: if self.variant == RATIONAL { Fall::Rational } else { Fall::Exponential },
            }),
            // The law that rises around a speed, which is fitted to single runs only.
            Kind::NonlinearViscous if value("speed_rad_s").is_some() => {
                return Some(Counterpart::None(NO_SUCH_LAW));
            }
            Kind::NonlinearViscous => Effect::NonlinearViscous(faults::NonlinearViscous {
                joint: self.joint?,
                amplitude_nm: value("amplitude_nm")?,
                exponent: value("exponent")?,
            }),
            // At standstill the plant has none. The law that is fitted to single runs, whose noise hides what is there,
            // keeps its dry part.
            Kind::AsymmetricFriction => Effect::AsymmetricFriction(faults::AsymmetricFriction {
                joint: self.joint?,
                // Unknown where the null model fits an offset, which the arm already has.
                coulomb_nm: value("coulomb_nm").unwrap_or(0.0),
                viscous_nm_s_rad: value("viscous_nm_s_rad")?,
            }),
            Kind::LoadFriction => return self.of_load(),
            // Sliding friction is the arm's own. The value that the family fits to the reversals alone is the same
            // quantity, known less well.
            Kind::Presliding if self.variant == HELD => {
                return Some(Counterpart::None(UNKNOWN_AT_REST));
            }
            Kind::Presliding => Effect::Presliding(faults::Presliding {
                joint: self.joint?,
                stiffness_per_rad: value("stiffness_per_rad")?.min(STIFFEST_PER_RAD),
                damping_s: value("damping_s").unwrap_or(0.0).max(0.0),
            }),
            // In the model, the width of a joint adds to that of the arm; in the plant it replaces it. `Fitted` adds
            // both.
            Kind::ReversalWidth => Effect::ReversalWidth(faults::ReversalWidth {
                joint: self.joint,
                width_rad_s: value("width_rad_s")?.max(SHARPEST_RAD_S),
            }),
            Kind::PositionFriction => Effect::PositionFriction(faults::PositionFriction {
                joint: self.joint?,
                amplitude_nm: value("amplitude_nm")?,
                phase_rad: value("phase_rad")?,
            }),
            // The plant heats by the power of friction, the family by time: the same along a motion whose power hardly
            // changes within the time constant.
            Kind::ThermalDrift => match value("fraction")? {
                fraction if fraction > -0.5 && fraction <= 1.0 => {
                    Effect::ThermalDrift(faults::ThermalDrift {
                        joint: self.joint?,
                        fraction,
                        time_constant_s: value("time_constant_s")?,
                    })
                }
                _ => return Some(Counterpart::None(NO_SUCH_SIZE)),
            },
            // Of other groups.
            _ => return None,
        };
        Some(Counterpart::InTheModel(effect))
    }

    /// Counterpart of friction that grows with load. The plant's grows in proportion to the torque that the gear
    /// transmits, with the rotor of the robot's file.
    fn of_load(&self) -> Option<Counterpart> {
        let is_another_law = self.variant == MOTOR_SIDE
            || self.value("exponent").or(self.value("mu_bending")).is_some();
        if is_another_law {
            return Some(Counterpart::None(NO_SUCH_LAW));
        }
        if self.variant == ROTOR {
            return Some(Counterpart::None(OTHER_ROTOR));
        }
        let mu = self.value("mu")?;
        if !(0.0..=0.5).contains(&mu) {
            return Some(Counterpart::None(NO_SUCH_SIZE));
        }
        let joint = self.joint?;
        let effect = Effect::LoadFriction(faults::LoadFriction { joint, mu });
        Some(Counterpart::InTheModel(effect))
    }

    /// Counterpart of an effect of a gear.
    fn of_gear(&self) -> Option<Counterpart> {
        let value = |name| self.value(name);
        let effect = match self.kind {
            // The plant's ripple acts on rotor and links, and its own drive answers it where that is fast enough. A
            // current that moves nothing, which the log cannot tell from a ripple that is answered at once, is not in
            // the plant.
            Kind::Ripple => Effect::Ripple(faults::Ripple {
                joint: self.joint?,
                amplitude_nm: value("amplitude_nm")?,
                order_per_turn: value("order_per_turn")?,
                phase_rad: value("phase_rad")?,
            }),
            // The stiffness is that by which the gear bends. The one at which its swing was fitted, which also depends
            // on the drive, is not reported.
            Kind::Elasticity => {
                let on_motor = self.variant < ON_MOTOR;
                Effect::Elasticity(faults::Elasticity {
                    joint: self.joint?,
                    stiffness_nm_rad: value("stiffness_nm_rad")?,
                    damping_ratio: damping_ratio(self.variant),
                    encoder: if on_motor {
                        faults::EncoderSide::Motor
                    } else {
                        faults::EncoderSide::Link
                    },
                })
            }
            // The flanks behind which the flight was fitted are one of many that fit, and are not reported: the plant
            // has its usual ones, or the spring of the joint's elasticity.
            Kind::Backlash => {
                Effect::Backlash(faults::Backlash::new(self.joint?, value("gap_rad")?))
            }
            // Of other groups.
            _ => return None,
        };
        Some(Counterpart::InTheModel(effect))
    }

    /// Counterpart of an effect of a drive.
    fn of_drive(&self) -> Option<Counterpart> {
        let value = |name| self.value(name);
        let effect = match self.kind {
            Kind::TorqueGain => match value("error_fraction")? {
                error_fraction if (-0.5..=1.0).contains(&error_fraction) => {
                    let joint = self.joint?;
                    Effect::TorqueGain(faults::TorqueGain { joint, error_fraction })
                }
                _ => return Some(Counterpart::None(NO_SUCH_SIZE)),
            },
            // Unequal Coulomb friction, which looks the same, becomes an offset of the current as well.
            Kind::CurrentOffset => Effect::CurrentOffset(faults::CurrentOffset {
                joint: self.joint?,
                offset_nm: value("offset_nm")?,
            }),
            // The plant cuts all of the torque off, and in a scenario the noise with it, also where the noise of the
            // log came behind the limit. A replay has no noise.
            Kind::Saturation => Effect::Saturation(faults::Saturation {
                joint: self.joint?,
                limit_nm: value("limit_nm")?,
            }),
            // Less than the other drives of the log feed forward, and in the plant less than its controller does. No
            // drive feeds forward less than nothing.
            Kind::FeedForward => Effect::FeedForward(faults::FeedForward {
                joint: self.joint?,
                share_less: value("share_less")?.min(PlantConfig::default().friction_feedforward),
            }),
            // Of other groups.
            _ => return None,
        };
        Some(Counterpart::InTheModel(effect))
    }

    /// Counterpart of an arm that is not built or mounted as its file says, or that something pulls.
    fn of_arm(&self) -> Option<Counterpart> {
        let value = |name| self.value(name);
        let effect = match self.kind {
            Kind::EncoderOffset => Effect::EncoderOffset(faults::EncoderOffset {
                joint: self.joint?,
                offset_rad: value("offset_rad")?,
            }),
            Kind::BaseTilt => Effect::BaseTilt(faults::BaseTilt {
                // A direction that the log does not determine is left as it is in the model.
                tilt_x_rad: value("tilt_x_rad").unwrap_or(0.0),
                tilt_y_rad: value("tilt_y_rad").unwrap_or(0.0),
            }),
            Kind::Gravity => Effect::Gravity(faults::Gravity { g_m_s2: value("g_m_s2")? }),
            Kind::LinkLength => Effect::LinkLength(faults::LinkLength {
                joint: self.joint?,
                error_m: value("error_m")?,
            }),
            Kind::Spring => return self.of_spring(),
            // Of other groups.
            _ => return None,
        };
        Some(Counterpart::InTheModel(effect))
    }

    /// Counterpart of a record that does not show what the arm does.
    fn of_record(&self) -> Option<Counterpart> {
        let value = |name| self.value(name);
        let effect = match self.kind {
            Kind::TimeSkew if self.variant == LOW_PASS => {
                return Some(Counterpart::None(NO_LOW_PASS));
            }
            Kind::TimeSkew => {
                let skew = faults::TimeSkew { joint: self.joint, delay_s: value("delay_s")? };
                return Some(Counterpart::InTheModel(Effect::TimeSkew(skew)));
            }
            // The lag of the diagnosis is a delay, that of the plant a low-pass of this time constant: the same at the
            // frequencies of a motion.
            Kind::VelocityLag => Effect::VelocityLag(faults::VelocityLag {
                joint: self.joint,
                delay_s: value("delay_s")?,
            }),
            Kind::ClockFault => Effect::ClockFault(faults::ClockFault {
                lost_s: value("lost_s")?,
                every_rows: value("every_rows")? as usize,
            }),
            // The plant leaves whole rows out or repeats them, or repeats angle, velocity and torque of one joint
            // together.
            Kind::DroppedSamples => {
                let repeat = match self.record_fault {
                    Some(RecordFault::MissingRows) => false,
                    Some(RecordFault::RepeatedRows) => true,
                    _ => return Some(Counterpart::None(OTHER_ROWS)),
                };
                Effect::DroppedSamples(faults::DroppedSamples {
                    joint: self.joint,
                    fraction: value("fraction")?,
                    repeat,
                })
            }
            // The diagnosis looks at the torque only. Its steps may begin anywhere, those of the plant are multiples of
            // one.
            Kind::Quantisation => Effect::Quantisation(faults::Quantisation {
                joint: self.joint,
                step: value("step")?,
                channel: faults::ReadingChannel::Torque,
            }),
            // How far off they are is not reported: those of the plant are anywhere within the limits of the drive.
            Kind::Outliers => match self.record_fault {
                Some(RecordFault::WildReadings(of)) if of[..] == [Channel::Torque] => {
                    let fraction = value("fraction")?;
                    Effect::Outliers(faults::Outliers { joint: self.joint, fraction })
                }
                _ => return Some(Counterpart::None(OTHER_CHANNEL)),
            },
            // Of other groups.
            _ => return None,
        };
        Some(Counterpart::OfTheRecord(effect))
    }

    /// Counterpart of a spring. Where the null model absorbs its angle dependence, only its pull at zero remains, a
    /// constant torque. Where the offset of the null model absorbs its pull at zero, its rest angle is taken as zero.
    fn of_spring(&self) -> Option<Counterpart> {
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::plant::faults::{DroppedSamples, Outliers};

    /// A fault of the record that spoils a hundredth of the readings.
    fn counterpart(fault: &RecordFault, joint: Option<usize>) -> Counterpart {
        let (kind, record_fault, quantities) = (fault.kind(), Some(fault), &[("fraction", 0.01)]);
        DiagnosedCause { kind, joint, variant: 0, record_fault, quantities }.counterpart()
    }

    #[test]
    fn rows_are_lost_as_they_were() {
        let lost = |joint: Option<usize>, repeat: bool| {
            let fraction = 0.01;
            let rows = DroppedSamples { joint, fraction, repeat };
            Counterpart::OfTheRecord(Effect::DroppedSamples(rows))
        };
        assert_eq!(counterpart(&RecordFault::MissingRows, None), lost(None, false));
        assert_eq!(counterpart(&RecordFault::RepeatedRows, None), lost(None, true));
        assert_eq!(counterpart(&RecordFault::RepeatedRows, Some(3)), lost(Some(3), true));
        let angles = RecordFault::RepeatedReadings(vec![Channel::Angle]);
        for (fault, joint) in [(angles, Some(3)), (RecordFault::MissingOrRepeatedRows, None)] {
            assert_eq!(counterpart(&fault, joint), Counterpart::None(OTHER_ROWS));
        }
    }

    #[test]
    fn wild_angles_are_no_wild_torques() {
        let (joint, fraction) = (Some(3), 0.01);
        let of_torque = Effect::Outliers(Outliers { joint, fraction });
        let of = |channels: &[Channel]| {
            counterpart(&RecordFault::WildReadings(channels.to_vec()), joint)
        };
        let [angle, velocity, torque] = Channel::ALL;
        assert_eq!(of(&[torque]), Counterpart::OfTheRecord(of_torque));
        for others in [&[angle][..], &[velocity], &[angle, torque]] {
            assert_eq!(of(others), Counterpart::None(OTHER_CHANNEL));
        }
    }
}
