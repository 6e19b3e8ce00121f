//! Effects that can be hidden in the simulated arm; each is an `[[effect]]` table of a scenario.
//!
//! Input: the nominal arm and a list of [`Effect`]s, in any combination. Output: a [`FaultyPlant`], which runs like a
//! [`Plant`](super::Plant) and afterwards spoils the readings of a trial.
//!
//! Every effect is produced where it physically arises. Friction, gears, drives and the surroundings act in the
//! integration of the equations of motion ([`HiddenDrivetrain`]); bodies, lengths and gravity change the true arm;
//! timing and reading errors act on the recording. No effect simply adds a term to the logged torque. The controller
//! and the null model that is identified stay nominal.
//!
//! # Signs
//! With a positive size, a torque effect requires more torque from the drive at positive speed, angle or torque, and
//! so raises the logged torque by this amount. The logged torque is i_G k I with the nominal k.
//!
//! # Location of the encoders
//! On the motor side of an elastic gear or of a backlash, unless the effect says `encoder = "link"`.
//!
//! | kind | acts in | keys besides `joint` |
//! |---|---|---|
//! | [`stribeck`](Stribeck) | friction | `extra_nm`, `vs_rad_s`, (`exponent`, `fall`) |
//! | [`nonlinear_viscous`](NonlinearViscous) | friction | `amplitude_nm`, `exponent` |
//! | [`asymmetric_friction`](AsymmetricFriction) | friction | `coulomb_nm`, `viscous_nm_s_rad` |
//! | [`load_friction`](LoadFriction) | friction | `mu` |
//! | [`presliding`](Presliding) | friction, state | `stiffness_per_rad`, (`damping_s`) |
//! | [`reversal_width`](ReversalWidth) | friction; no `joint`: all | `width_rad_s` |
//! | [`position_friction`](PositionFriction) | friction | `amplitude_nm`, `phase_rad` |
//! | [`thermal_drift`](ThermalDrift) | friction, state | `fraction`, `time_constant_s` |
//! | [`friction_change`](FrictionChange) | friction | `coulomb_nm`, `viscous_nm_s_rad` |
//! | [`ripple`](Ripple) | gear | `amplitude_nm`, `order_per_turn`, `phase_rad` |
//! | [`elasticity`](Elasticity) | gear, states | `stiffness_nm_rad`, (`damping_ratio`, `encoder`) |
//! | [`backlash`](Backlash) | gear, states | `gap_rad`, (`stiffness_nm_rad`, `damping_ratio`, `encoder`) |
//! | [`torque_gain`](TorqueGain) | drive | `error_fraction` |
//! | [`current_offset`](CurrentOffset) | drive | `offset_nm` |
//! | [`saturation`](Saturation) | reading | `limit_nm` |
//! | [`feed_forward`](FeedForward) | controller | `share_less` |
//! | [`spring`](Spring) | surroundings | `stiffness_nm_rad`, `rest_rad` |
//! | [`contact`](Contact) | surroundings; no `joint`: at the flange | `start_s`, `end_s`, `peak_nm` |
//! | [`payload`](Payload) | arm | `mass_kg`, `com_x_m`, `com_y_m`, `com_z_m` |
//! | [`link_length`](LinkLength) | arm | `error_m` |
//! | [`gravity`](Gravity) | arm | `g_m_s2` |
//! | [`base_tilt`](BaseTilt) | arm | `tilt_x_rad`, `tilt_y_rad` |
//! | [`encoder_offset`](EncoderOffset) | encoder, seen by the controller | `offset_rad` |
//! | [`time_skew`](TimeSkew) | recording; no `joint`: all | `delay_s` |
//! | [`velocity_lag`](VelocityLag) | recording; no `joint`: all | `delay_s` |
//! | [`clock_fault`](ClockFault) | recording | `lost_s`, `every_rows` |
//! | [`quantisation`](Quantisation) | reading; no `joint`: all | `step`, (`channel`) |
//! | [`outliers`](Outliers) | reading; no `joint`: all | `fraction` |
//! | [`dropped_samples`](DroppedSamples) | reading; no `joint`: whole rows | `fraction`, (`repeat`) |

mod arm;
mod assembly;
mod drive;
mod drivetrain;
mod effect;
mod friction;
mod gear;
mod plant;
mod readings;
mod surroundings;
mod timing;

pub use arm::{BaseTilt, EncoderOffset, Gravity, LinkLength, Payload};
pub use drive::{CurrentOffset, FeedForward, Saturation, TorqueGain};
pub use drivetrain::HiddenDrivetrain;
pub use effect::Effect;
pub use friction::{
    AsymmetricFriction, Fall, FrictionChange, LoadFriction, NonlinearViscous, PositionFriction,
    Presliding, ReversalWidth, Stribeck, ThermalDrift,
};
pub use gear::{Backlash, Elasticity, EncoderSide, Ripple};
pub use plant::FaultyPlant;
pub use readings::{DroppedSamples, Outliers, Quantisation, ReadingChannel};
pub use surroundings::{Contact, Spring};
pub use timing::{ClockFault, TimeSkew, VelocityLag};
