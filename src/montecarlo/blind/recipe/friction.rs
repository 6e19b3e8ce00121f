//! Recipes of friction.

use super::{Draw, Recipe};
use crate::plant::faults::{
    AsymmetricFriction, Effect, Fall, FrictionChange, LoadFriction, NonlinearViscous,
    PositionFriction, Presliding, ReversalWidth, Stribeck, ThermalDrift,
};

/// Highest speed of the motions, rad/s.
const FASTEST_RAD_S: f64 = 3.0;

impl Draw<'_> {
    pub(super) fn stribeck(&mut self) -> Recipe {
        let (joint, coulomb_nm) = (self.joint, self.drive().coulomb_nm);
        let vs_rad_s = self.log_uniform([0.03, 0.3]);
        Recipe::linear(0.1 * coulomb_nm, 0.8 * coulomb_nm, move |extra_nm| {
            let fall = Fall::Exponential;
            Effect::Stribeck(Stribeck { joint, extra_nm, vs_rad_s, exponent: 2, fall })
        })
    }

    /// Concave or convex; at the highest speed, at most half of the viscous friction.
    pub(super) fn nonlinear_viscous(&mut self) -> Recipe {
        let joint = self.joint;
        let range = if self.chance(0.5) { [0.4, 0.7] } else { [1.5, 3.0] };
        let exponent = self.uniform(range);
        let sign = self.sign();
        let most = 0.5 * self.drive().viscous_nm_s_rad * FASTEST_RAD_S.powf(1.0 - exponent);
        Recipe::linear(0.2 * most, most, move |s| {
            let amplitude_nm = sign * s;
            Effect::NonlinearViscous(NonlinearViscous { joint, amplitude_nm, exponent })
        })
    }

    pub(super) fn asymmetric_friction(&mut self) -> Recipe {
        let joint = self.joint;
        let friction = self.share_of_friction();
        Recipe::linear(0.05, 0.5, move |s| {
            let [coulomb_nm, viscous_nm_s_rad] = friction(s);
            Effect::AsymmetricFriction(AsymmetricFriction { joint, coulomb_nm, viscous_nm_s_rad })
        })
    }

    pub(super) fn friction_change(&mut self) -> Recipe {
        let joint = self.joint;
        let friction = self.share_of_friction();
        Recipe::linear(0.05, 0.5, move |s| {
            let [coulomb_nm, viscous_nm_s_rad] = friction(s);
            Effect::FrictionChange(FrictionChange { joint, coulomb_nm, viscous_nm_s_rad })
        })
    }

    /// A share of the joint's Coulomb and viscous friction, in any mixture of the two, as a function of its size.
    fn share_of_friction(&mut self) -> impl Fn(f64) -> [f64; 2] + 'static {
        let angle = self.angle_rad();
        let drive = self.drive();
        let (coulomb_nm, viscous_nm_s_rad) = (drive.coulomb_nm, drive.viscous_nm_s_rad);
        move |s| [s * coulomb_nm * angle.cos(), s * viscous_nm_s_rad * angle.sin()]
    }

    pub(super) fn load_friction(&mut self) -> Recipe {
        let joint = self.joint;
        Recipe::linear(0.01, 0.3, move |mu| Effect::LoadFriction(LoadFriction { joint, mu }))
    }

    /// The bristles of gears deflect by 0.1 mrad or more before they slip.
    pub(super) fn presliding(&mut self) -> Recipe {
        let joint = self.joint;
        Recipe::growing(1e-3, [1.0 / 10_000.0, 1.0 / 30.0], 1.0, move |s| {
            Effect::Presliding(Presliding::new(joint, 1.0 / s))
        })
    }

    /// The reversal becomes up to twenty times as sharp or up to ten times as gradual.
    pub(super) fn reversal_width(&mut self) -> Recipe {
        let (joint, epsilon) = (self.site, self.around.arm.friction_epsilon_rad_s);
        let (sign, most) = if self.chance(0.5) { (-1.0, 0.95) } else { (1.0, 9.0) };
        Recipe::growing(0.5, [0.01, most], 1.0, move |s| {
            let width_rad_s = epsilon * (1.0 + sign * s);
            Effect::ReversalWidth(ReversalWidth { joint, width_rad_s })
        })
    }

    pub(super) fn position_friction(&mut self) -> Recipe {
        let (joint, coulomb_nm) = (self.joint, self.drive().coulomb_nm);
        let phase_rad = self.angle_rad();
        Recipe::linear(0.05 * coulomb_nm, 0.6 * coulomb_nm, move |amplitude_nm| {
            Effect::PositionFriction(PositionFriction { joint, amplitude_nm, phase_rad })
        })
    }

    pub(super) fn thermal_drift(&mut self) -> Recipe {
        let (joint, sign) = (self.joint, self.sign());
        let time_constant_s = self.log_uniform([20.0, 200.0]);
        Recipe::linear(0.1, 0.45, move |s| {
            let fraction = sign * s;
            Effect::ThermalDrift(ThermalDrift { joint, fraction, time_constant_s })
        })
    }
}
