//! Recipes of gears and drives.

use rand::RngExt;

use super::{Draw, Recipe};
use crate::plant::faults::{
    Backlash, CurrentOffset, Effect, Elasticity, EncoderSide, FeedForward, Ripple, Saturation,
    TorqueGain,
};

impl Draw<'_> {
    /// Once or twice per turn of the wave generator, or the cogging of a motor at any order.
    pub(super) fn ripple(&mut self) -> Recipe {
        let (joint, coulomb_nm) = (self.joint, self.drive().coulomb_nm);
        let order_per_turn = match self.rng.random_range(0..3) {
            0 => 101.0,
            1 => 202.0,
            _ => self.uniform([60.0, 250.0]),
        };
        let phase_rad = self.angle_rad();
        Recipe::linear(0.01 * coulomb_nm, 0.5 * coulomb_nm, move |amplitude_nm| {
            Effect::Ripple(Ripple { joint, amplitude_nm, order_per_turn, phase_rad })
        })
    }

    pub(super) fn elasticity(&mut self) -> Recipe {
        let joint = self.joint;
        Recipe::growing(1.0 / 15_000.0, [1e-6, 1.0 / 2000.0], 1.0, move |s| {
            Effect::Elasticity(Elasticity {
                joint,
                stiffness_nm_rad: 1.0 / s,
                damping_ratio: 0.05,
                encoder: EncoderSide::Motor,
            })
        })
    }

    /// Each crossing of the gap leaves the rotor without load for a moment, which is visible at gaps too small to be
    /// seen in the angle. A gap below the encoder noise of 2e-5 rad does not count as play.
    pub(super) fn backlash(&mut self) -> Recipe {
        let joint = self.joint;
        Recipe::growing(2e-5, [2e-5, 0.02], 0.6, move |gap_rad| {
            Effect::Backlash(Backlash::new(joint, gap_rad))
        })
    }

    pub(super) fn torque_gain(&mut self) -> Recipe {
        let (joint, sign) = (self.joint, self.sign());
        Recipe::linear(0.02, 0.2, move |s| {
            Effect::TorqueGain(TorqueGain { joint, error_fraction: sign * s })
        })
    }

    pub(super) fn current_offset(&mut self) -> Recipe {
        let (joint, coulomb_nm) = (self.joint, self.drive().coulomb_nm);
        let sign = self.sign();
        Recipe::linear(0.05 * coulomb_nm, coulomb_nm, move |s| {
            Effect::CurrentOffset(CurrentOffset { joint, offset_nm: sign * s })
        })
    }

    pub(super) fn saturation(&mut self) -> Recipe {
        let (joint, peak_nm) = (self.joint, self.peak_nm());
        Recipe::growing(0.1, [1e-3, 0.6], 1.5, move |s| {
            Effect::Saturation(Saturation { joint, limit_nm: peak_nm * (1.0 - s) })
        })
    }

    pub(super) fn feed_forward(&mut self) -> Recipe {
        let joint = self.joint;
        Recipe::linear(0.1, 0.9, move |share_less| {
            Effect::FeedForward(FeedForward { joint, share_less })
        })
    }
}
