//! Families of hidden effects: which effects are hidden, where, and in which range of sizes.

use std::f64::consts::PI;

use rand::RngExt;
use rand::rngs::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::diagnose::Kind;
use crate::plant::SensorConfig;
use crate::plant::faults::{
    AsymmetricFriction, Backlash, BaseTilt, ClockFault, Contact, CurrentOffset, DroppedSamples,
    Effect, Elasticity, EncoderOffset, EncoderSide, Fall, FeedForward, FrictionChange, Gravity,
    LinkLength, LoadFriction, NonlinearViscous, Outliers, Payload, PositionFriction, Presliding,
    Quantisation, ReadingChannel, ReversalWidth, Ripple, Saturation, Spring, Stribeck,
    ThermalDrift, TimeSkew, TorqueGain, VelocityLag,
};
use crate::robot::{Arm, JointSignals};

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

/// Circumstances of a trial from which shapes and sizes are derived.
pub(super) struct Surroundings<'a> {
    /// The nominal arm.
    pub arm: &'a Arm,
    /// Torque of the arm without effects along the same motion, Nm.
    pub clean_torque_nm: &'a JointSignals,
    /// Begin and end of the whole periods, s.
    pub window_s: [f64; 2],
    /// The sensors of the trial.
    pub sensors: &'a SensorConfig,
}

/// An effect whose shape has been drawn, and whose size is still free.
pub(super) struct Recipe {
    make: Box<dyn Fn(f64) -> Effect>,
    /// The size tried first.
    pub start: f64,
    /// Smallest size; sizes outside `least` … `most` make no sense or need too small an integration step.
    pub least: f64,
    /// Largest size; see `least`.
    pub most: f64,
    /// Exponent p of the approximate law √λ ∝ sizeᵖ.
    pub power: f64,
    /// Whether √λ is proportional to the size.
    pub linear: bool,
}

impl Recipe {
    fn linear(start: f64, most: f64, make: impl Fn(f64) -> Effect + 'static) -> Self {
        Self { make: Box::new(make), start, least: 0.0, most, power: 1.0, linear: true }
    }

    fn growing(
        start: f64,
        [least, most]: [f64; 2],
        power: f64,
        make: impl Fn(f64) -> Effect + 'static,
    ) -> Self {
        Self { make: Box::new(make), start, least, most, power, linear: false }
    }

    /// The effect with this `size`.
    pub fn effect(&self, size: f64) -> Effect {
        (self.make)(size)
    }
}

/// Draws a number that is uniformly distributed on a logarithmic scale.
pub(super) fn log_uniform(rng: &mut ChaCha8Rng, [low, high]: [f64; 2]) -> f64 {
    low * (high / low).powf(rng.random::<f64>())
}

/// Draws a uniformly distributed number.
fn uniform(rng: &mut ChaCha8Rng, low: f64, high: f64) -> f64 {
    low + (high - low) * rng.random::<f64>()
}

/// Draws `true` with the given probability.
pub(super) fn chance(rng: &mut ChaCha8Rng, probability: f64) -> bool {
    rng.random::<f64>() < probability
}

fn sign(rng: &mut ChaCha8Rng) -> f64 {
    if chance(rng, 0.5) { 1.0 } else { -1.0 }
}

impl Family {
    /// Whether the family is one of the `known` families of the dictionary and its effects are seen in the residual.
    pub(super) fn can_be_withheld(&self, known: &[Kind]) -> bool {
        self.judged == Judged::Residual && known.contains(&self.kind)
    }

    /// Draws the shape of an effect at `site`.
    pub(super) fn recipe(
        &self,
        site: Option<usize>,
        around: &Surroundings,
        rng: &mut ChaCha8Rng,
    ) -> Recipe {
        let joint = site.unwrap_or(1);
        let drive = &around.arm.joints[joint - 1].drive;
        let (coulomb, viscous) = (drive.coulomb_nm, drive.viscous_nm_s_rad);
        let peak = |j: usize| {
            around.clean_torque_nm.joint(j - 1).iter().fold(0.0f64, |a, t| a.max(t.abs()))
        };
        let peak_nm = match site {
            Some(joint) => peak(joint),
            None => (1..=around.arm.dof()).map(peak).fold(0.0, f64::max),
        };
        match self.kind {
            Kind::Stribeck => {
                let vs_rad_s = log_uniform(rng, [0.03, 0.3]);
                Recipe::linear(0.1 * coulomb, 0.8 * coulomb, move |s| {
                    let fall = Fall::Exponential;
                    Effect::Stribeck(Stribeck { joint, extra_nm: s, vs_rad_s, exponent: 2, fall })
                })
            }
            Kind::NonlinearViscous => {
                let exponent =
                    if chance(rng, 0.5) { uniform(rng, 0.4, 0.7) } else { uniform(rng, 1.5, 3.0) };
                let sign = sign(rng);
                // At 3 rad/s, the highest speed that occurs, at most half of the viscous friction.
                let most = 0.5 * viscous * 3f64.powf(1.0 - exponent);
                Recipe::linear(0.2 * most, most, move |s| {
                    let amplitude_nm = sign * s;
                    Effect::NonlinearViscous(NonlinearViscous { joint, amplitude_nm, exponent })
                })
            }
            Kind::AsymmetricFriction => {
                let angle = uniform(rng, -PI, PI);
                Recipe::linear(0.05, 0.5, move |s| {
                    Effect::AsymmetricFriction(AsymmetricFriction {
                        joint,
                        coulomb_nm: s * coulomb * angle.cos(),
                        viscous_nm_s_rad: s * viscous * angle.sin(),
                    })
                })
            }
            Kind::LoadFriction => Recipe::linear(0.01, 0.3, move |mu| {
                Effect::LoadFriction(LoadFriction { joint, mu })
            }),
            Kind::Presliding => {
                // The bristles of gears deflect by 0.1 mrad or more before they slip.
                Recipe::growing(1e-3, [1.0 / 10_000.0, 1.0 / 30.0], 1.0, move |s| {
                    Effect::Presliding(Presliding::new(joint, 1.0 / s))
                })
            }
            Kind::ReversalWidth => {
                let epsilon = around.arm.friction_epsilon_rad_s;
                // The reversal becomes up to twenty times as sharp or up to ten times as gradual.
                let (sign, most) = if chance(rng, 0.5) { (-1.0, 0.95) } else { (1.0, 9.0) };
                Recipe::growing(0.5, [0.01, most], 1.0, move |s| {
                    let width_rad_s = epsilon * (1.0 + sign * s);
                    Effect::ReversalWidth(ReversalWidth { joint: site, width_rad_s })
                })
            }
            Kind::PositionFriction => {
                let phase_rad = uniform(rng, -PI, PI);
                Recipe::linear(0.05 * coulomb, 0.6 * coulomb, move |amplitude_nm| {
                    Effect::PositionFriction(PositionFriction { joint, amplitude_nm, phase_rad })
                })
            }
            Kind::ThermalDrift => {
                let sign = sign(rng);
                let time_constant_s = log_uniform(rng, [20.0, 200.0]);
                Recipe::linear(0.1, 0.45, move |s| {
                    let fraction = sign * s;
                    Effect::ThermalDrift(ThermalDrift { joint, fraction, time_constant_s })
                })
            }
            Kind::Ripple => {
                // Once or twice per turn of the wave generator, or the cogging of a motor at any order.
                let order_per_turn = match rng.random_range(0..3) {
                    0 => 101.0,
                    1 => 202.0,
                    _ => uniform(rng, 60.0, 250.0),
                };
                let phase_rad = uniform(rng, -PI, PI);
                Recipe::linear(0.01 * coulomb, 0.5 * coulomb, move |amplitude_nm| {
                    Effect::Ripple(Ripple { joint, amplitude_nm, order_per_turn, phase_rad })
                })
            }
            Kind::Elasticity => {
                Recipe::growing(1.0 / 15_000.0, [1e-6, 1.0 / 2000.0], 1.0, move |s| {
                    Effect::Elasticity(Elasticity {
                        joint,
                        stiffness_nm_rad: 1.0 / s,
                        damping_ratio: 0.05,
                        encoder: EncoderSide::Motor,
                    })
                })
            }
            // Each crossing of the gap leaves the rotor without load for a moment, which is visible at gaps too small
            // to be seen in the angle. A gap below the encoder noise of 2e-5 rad does not count as play.
            Kind::Backlash => Recipe::growing(2e-5, [2e-5, 0.02], 0.6, move |gap_rad| {
                Effect::Backlash(Backlash::new(joint, gap_rad))
            }),
            Kind::TorqueGain => {
                let sign = sign(rng);
                Recipe::linear(0.02, 0.2, move |s| {
                    Effect::TorqueGain(TorqueGain { joint, error_fraction: sign * s })
                })
            }
            Kind::CurrentOffset => {
                let sign = sign(rng);
                Recipe::linear(0.05 * coulomb, coulomb, move |s| {
                    Effect::CurrentOffset(CurrentOffset { joint, offset_nm: sign * s })
                })
            }
            Kind::FeedForward => Recipe::linear(0.1, 0.9, move |share_less| {
                Effect::FeedForward(FeedForward { joint, share_less })
            }),
            Kind::Saturation => Recipe::growing(0.1, [1e-3, 0.6], 1.5, move |s| {
                Effect::Saturation(Saturation { joint, limit_nm: peak_nm * (1.0 - s) })
            }),
            Kind::TimeSkew => {
                let sign = sign(rng);
                Recipe::linear(0.001, 0.03, move |s| {
                    Effect::TimeSkew(TimeSkew { joint: site, delay_s: sign * s })
                })
            }
            Kind::VelocityLag => Recipe::linear(0.002, 0.04, move |delay_s| {
                Effect::VelocityLag(VelocityLag { joint: site, delay_s })
            }),
            Kind::EncoderOffset => {
                let sign = sign(rng);
                Recipe::linear(0.002, 0.05, move |s| {
                    Effect::EncoderOffset(EncoderOffset { joint, offset_rad: sign * s })
                })
            }
            Kind::BaseTilt => {
                let angle = uniform(rng, -PI, PI);
                Recipe::linear(0.005, 0.1, move |s| {
                    let (tilt_x_rad, tilt_y_rad) = (s * angle.cos(), s * angle.sin());
                    Effect::BaseTilt(BaseTilt { tilt_x_rad, tilt_y_rad })
                })
            }
            Kind::Gravity => {
                let (sign, nominal) = (sign(rng), around.arm.gravity_m_s2.norm());
                Recipe::linear(0.002, 0.05, move |s| {
                    Effect::Gravity(Gravity { g_m_s2: nominal * (1.0 + sign * s) })
                })
            }
            Kind::Payload => {
                let [com_x_m, com_y_m] = [0, 1].map(|_| uniform(rng, -0.05, 0.05));
                let com_z_m = uniform(rng, 0.02, 0.12);
                Recipe::linear(0.05, 5.0, move |mass_kg| {
                    Effect::Payload(Payload { mass_kg, com_x_m, com_y_m, com_z_m })
                })
            }
            Kind::LinkLength => {
                let sign = sign(rng);
                Recipe::linear(0.001, 0.02, move |s| {
                    Effect::LinkLength(LinkLength { joint, error_m: sign * s })
                })
            }
            Kind::Spring => {
                let rest_rad = uniform(rng, -1.0, 1.0);
                Recipe::linear(0.02, 5.0, move |stiffness_nm_rad| {
                    Effect::Spring(Spring { joint, stiffness_nm_rad, rest_rad })
                })
            }
            Kind::Contact => {
                let duration_s = log_uniform(rng, [0.2, 2.0]);
                let [begin_s, end_s] = around.window_s;
                let start_s = uniform(rng, begin_s, end_s - duration_s);
                let sign = sign(rng);
                Recipe::linear(0.05 * peak_nm, 0.5 * peak_nm, move |s| {
                    let end_s = start_s + duration_s;
                    Effect::Contact(Contact { joint: site, start_s, end_s, peak_nm: sign * s })
                })
            }
            Kind::FrictionChange => {
                let angle = uniform(rng, -PI, PI);
                Recipe::linear(0.05, 0.5, move |s| {
                    Effect::FrictionChange(FrictionChange {
                        joint,
                        coulomb_nm: s * coulomb * angle.cos(),
                        viscous_nm_s_rad: s * viscous * angle.sin(),
                    })
                })
            }
            Kind::ClockFault => {
                let lost_s = log_uniform(rng, [0.008, 0.05]);
                let every_rows = rng.random_range(200..1000);
                Recipe::linear(1.0, 1.0, move |_| {
                    Effect::ClockFault(ClockFault { lost_s, every_rows })
                })
            }
            Kind::DroppedSamples => {
                let (fraction, repeat) = (log_uniform(rng, [0.005, 0.05]), chance(rng, 0.5));
                Recipe::linear(1.0, 1.0, move |_| {
                    Effect::DroppedSamples(DroppedSamples { joint: None, fraction, repeat })
                })
            }
            Kind::Quantisation => {
                let sd = around.sensors.torque_sd_per_joint_nm(around.arm.dof());
                let sd = sd.ok().and_then(|sd| sd.get(joint - 1).copied()).unwrap_or(1.0);
                let step = sd * log_uniform(rng, [4.0, 15.0]);
                Recipe::linear(1.0, 1.0, move |_| {
                    let channel = ReadingChannel::Torque;
                    Effect::Quantisation(Quantisation { joint: site, step, channel })
                })
            }
            Kind::Outliers => {
                let fraction = log_uniform(rng, [1e-3, 2e-2]);
                Recipe::linear(1.0, 1.0, move |_| {
                    Effect::Outliers(Outliers { joint: site, fraction })
                })
            }
        }
    }
}
