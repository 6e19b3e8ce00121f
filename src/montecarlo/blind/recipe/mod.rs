//! How the effects of a family are made: their shapes are drawn here, and the range of their sizes is stated.
//!
//! Input: a [`Kind`], the site, and the [`Surroundings`] of the trial. Output: a [`Recipe`], from which
//! [`case`](super::case) makes the effect at the size that has the strength it wants.

mod arm;
mod drivetrain;
mod friction;
mod record;

use rand::RngExt;
use rand::rngs::ChaCha8Rng;

use crate::diagnose::Kind;
use crate::plant::SensorConfig;
use crate::plant::faults::Effect;
use crate::robot::{Arm, Drive, JointSignals};

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
    /// Draws the shape of an effect of `kind` at `site`, a joint from 1 or the arm as a whole.
    pub fn draw(
        kind: Kind,
        site: Option<usize>,
        around: &Surroundings,
        rng: &mut ChaCha8Rng,
    ) -> Self {
        let mut draw = Draw { site, joint: site.unwrap_or(1), around, rng };
        match kind {
            Kind::Stribeck => draw.stribeck(),
            Kind::NonlinearViscous => draw.nonlinear_viscous(),
            Kind::AsymmetricFriction => draw.asymmetric_friction(),
            Kind::LoadFriction => draw.load_friction(),
            Kind::Presliding => draw.presliding(),
            Kind::ReversalWidth => draw.reversal_width(),
            Kind::PositionFriction => draw.position_friction(),
            Kind::ThermalDrift => draw.thermal_drift(),
            Kind::FrictionChange => draw.friction_change(),
            Kind::Ripple => draw.ripple(),
            Kind::Elasticity => draw.elasticity(),
            Kind::Backlash => draw.backlash(),
            Kind::TorqueGain => draw.torque_gain(),
            Kind::CurrentOffset => draw.current_offset(),
            Kind::Saturation => draw.saturation(),
            Kind::FeedForward => draw.feed_forward(),
            Kind::BaseTilt => draw.base_tilt(),
            Kind::Gravity => draw.gravity(),
            Kind::Payload => draw.payload(),
            Kind::LinkLength => draw.link_length(),
            Kind::EncoderOffset => draw.encoder_offset(),
            Kind::Spring => draw.spring(),
            Kind::Contact => draw.contact(),
            Kind::TimeSkew => draw.time_skew(),
            Kind::VelocityLag => draw.velocity_lag(),
            Kind::ClockFault => draw.clock_fault(),
            Kind::DroppedSamples => draw.dropped_samples(),
            Kind::Quantisation => draw.quantisation(),
            Kind::Outliers => draw.outliers(),
        }
    }

    /// The effect with this `size`.
    pub fn effect(&self, size: f64) -> Effect {
        (self.make)(size)
    }

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

    /// An effect that has no size.
    fn of_one_size(make: impl Fn() -> Effect + 'static) -> Self {
        Self::linear(1.0, 1.0, move |_| make())
    }
}

/// One draw of a shape. The families are in the files of this folder, each with what is drawn of it and why.
struct Draw<'a> {
    site: Option<usize>,
    /// The joint of the site, from 1; 1 for the arm as a whole.
    joint: usize,
    around: &'a Surroundings<'a>,
    rng: &'a mut ChaCha8Rng,
}

impl Draw<'_> {
    fn drive(&self) -> &Drive {
        &self.around.arm.joints[self.joint - 1].drive
    }

    /// Largest torque of the joint along the motion, or of any joint for the arm as a whole.
    fn peak_nm(&self) -> f64 {
        let peak = |j: usize| {
            self.around.clean_torque_nm.joint(j - 1).iter().fold(0.0f64, |a, t| a.max(t.abs()))
        };
        match self.site {
            Some(joint) => peak(joint),
            None => (1..=self.around.arm.dof()).map(peak).fold(0.0, f64::max),
        }
    }

    fn uniform(&mut self, [low, high]: [f64; 2]) -> f64 {
        low + (high - low) * self.rng.random::<f64>()
    }

    fn log_uniform(&mut self, range: [f64; 2]) -> f64 {
        log_uniform(self.rng, range)
    }

    fn chance(&mut self, probability: f64) -> bool {
        chance(self.rng, probability)
    }

    fn sign(&mut self) -> f64 {
        if self.chance(0.5) { 1.0 } else { -1.0 }
    }

    /// An angle anywhere on the circle, rad.
    fn angle_rad(&mut self) -> f64 {
        self.uniform([-std::f64::consts::PI, std::f64::consts::PI])
    }
}

/// Draws a number that is uniformly distributed on a logarithmic scale.
pub(super) fn log_uniform(rng: &mut ChaCha8Rng, [low, high]: [f64; 2]) -> f64 {
    low * (high / low).powf(rng.random::<f64>())
}

/// Draws `true` with the given probability.
pub(super) fn chance(rng: &mut ChaCha8Rng, probability: f64) -> bool {
    rng.random::<f64>() < probability
}
