//! Recipes of faults in the record: its clock, its lags and its readings.

use rand::RngExt;

use super::{Draw, Recipe};
use crate::plant::faults::{
    ClockFault, DroppedSamples, Effect, Outliers, Quantisation, ReadingChannel, TimeSkew,
    VelocityLag,
};

impl Draw<'_> {
    pub(super) fn time_skew(&mut self) -> Recipe {
        let (joint, sign) = (self.site, self.sign());
        Recipe::linear(0.001, 0.03, move |s| {
            Effect::TimeSkew(TimeSkew { joint, delay_s: sign * s })
        })
    }

    pub(super) fn velocity_lag(&mut self) -> Recipe {
        let joint = self.site;
        Recipe::linear(0.002, 0.04, move |delay_s| {
            Effect::VelocityLag(VelocityLag { joint, delay_s })
        })
    }

    pub(super) fn clock_fault(&mut self) -> Recipe {
        let lost_s = self.log_uniform([0.008, 0.05]);
        let every_rows = self.rng.random_range(200..1000);
        Recipe::of_one_size(move || Effect::ClockFault(ClockFault { lost_s, every_rows }))
    }

    pub(super) fn dropped_samples(&mut self) -> Recipe {
        let (fraction, repeat) = (self.log_uniform([0.005, 0.05]), self.chance(0.5));
        Recipe::of_one_size(move || {
            Effect::DroppedSamples(DroppedSamples { joint: None, fraction, repeat })
        })
    }

    /// Steps of several standard deviations of the torque's noise.
    pub(super) fn quantisation(&mut self) -> Recipe {
        let joint = self.site;
        let sd_nm = self.around.sensors.torque_sd_per_joint_nm(self.around.arm.dof());
        let sd_nm = sd_nm.ok().and_then(|sd| sd.get(self.joint - 1).copied()).unwrap_or(1.0);
        let step = sd_nm * self.log_uniform([4.0, 15.0]);
        Recipe::of_one_size(move || {
            Effect::Quantisation(Quantisation { joint, step, channel: ReadingChannel::Torque })
        })
    }

    pub(super) fn outliers(&mut self) -> Recipe {
        let joint = self.site;
        let fraction = self.log_uniform([1e-3, 2e-2]);
        Recipe::of_one_size(move || Effect::Outliers(Outliers { joint, fraction }))
    }
}
