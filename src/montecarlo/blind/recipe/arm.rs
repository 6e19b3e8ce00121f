//! Recipes of the arm's geometry and surroundings.

use super::{Draw, Recipe};
use crate::plant::faults::{
    BaseTilt, Contact, Effect, EncoderOffset, Gravity, LinkLength, Payload, Spring,
};

impl Draw<'_> {
    pub(super) fn base_tilt(&mut self) -> Recipe {
        let angle = self.angle_rad();
        Recipe::linear(0.005, 0.1, move |s| {
            let (tilt_x_rad, tilt_y_rad) = (s * angle.cos(), s * angle.sin());
            Effect::BaseTilt(BaseTilt { tilt_x_rad, tilt_y_rad })
        })
    }

    pub(super) fn gravity(&mut self) -> Recipe {
        let (sign, nominal) = (self.sign(), self.around.arm.gravity_m_s2.norm());
        Recipe::linear(0.002, 0.05, move |s| {
            Effect::Gravity(Gravity { g_m_s2: nominal * (1.0 + sign * s) })
        })
    }

    pub(super) fn payload(&mut self) -> Recipe {
        let [com_x_m, com_y_m] = [0, 1].map(|_| self.uniform([-0.05, 0.05]));
        let com_z_m = self.uniform([0.02, 0.12]);
        Recipe::linear(0.05, 5.0, move |mass_kg| {
            Effect::Payload(Payload { mass_kg, com_x_m, com_y_m, com_z_m })
        })
    }

    pub(super) fn link_length(&mut self) -> Recipe {
        let (joint, sign) = (self.joint, self.sign());
        Recipe::linear(0.001, 0.02, move |s| {
            Effect::LinkLength(LinkLength { joint, error_m: sign * s })
        })
    }

    pub(super) fn encoder_offset(&mut self) -> Recipe {
        let (joint, sign) = (self.joint, self.sign());
        Recipe::linear(0.002, 0.05, move |s| {
            Effect::EncoderOffset(EncoderOffset { joint, offset_rad: sign * s })
        })
    }

    pub(super) fn spring(&mut self) -> Recipe {
        let joint = self.joint;
        let rest_rad = self.uniform([-1.0, 1.0]);
        Recipe::linear(0.02, 5.0, move |stiffness_nm_rad| {
            Effect::Spring(Spring { joint, stiffness_nm_rad, rest_rad })
        })
    }

    /// A push, somewhere within the whole periods.
    pub(super) fn contact(&mut self) -> Recipe {
        let (joint, peak_nm) = (self.site, self.peak_nm());
        let duration_s = self.log_uniform([0.2, 2.0]);
        let [begin_s, end_s] = self.around.window_s;
        let start_s = self.uniform([begin_s, end_s - duration_s]);
        let sign = self.sign();
        Recipe::linear(0.05 * peak_nm, 0.5 * peak_nm, move |s| {
            let end_s = start_s + duration_s;
            Effect::Contact(Contact { joint, start_s, end_s, peak_nm: sign * s })
        })
    }
}
