//! Errors of simulations.

use thiserror::Error;

/// Why a plant cannot be built, a configuration cannot be run, or a run broke down.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum PlantError {
    /// The inertia of a link is not that of any mass distribution. The engine would silently clamp it.
    #[error(
        "joint {joint}: no body has mass {mass_kg} kg and principal moments {principal_kg_m2:?} \
         kg m2 (smallest eigenvalue of the pseudo-inertia {margin:.3e}, must be positive)"
    )]
    Inertia {
        /// Joint, from 1.
        joint: usize,
        /// Mass of the link, kg.
        mass_kg: f64,
        /// Principal moments about the centre of mass, kg m², ascending.
        principal_kg_m2: [f64; 3],
        /// Smallest eigenvalue of the pseudo-inertia.
        margin: f64,
    },
    /// The engine holds a different inertia tensor from the one it was given.
    #[error(
        "joint {joint}: the engine changed the inertia tensor by {difference_kg_m2:.3e} kg m2 \
         (largest entry), more than round-off"
    )]
    InertiaNotKept {
        /// Joint, from 1.
        joint: usize,
        /// Largest difference of an entry, kg m².
        difference_kg_m2: f64,
    },
    /// A setting is outside its range.
    #[error("{key} = {value}: {requirement}")]
    Setting {
        /// The key in the scenario.
        key: &'static str,
        /// The value found.
        value: f64,
        /// Condition that the value must meet.
        requirement: &'static str,
    },
    /// Friction is too steep, or a gear too stiff, for the integration step: the integration would chatter.
    #[error(
        "step_s = {step_s}: the joint mechanics (friction at standstill, bristles, gears) are as fast \
         as {decay_per_s:.0} /s, which needs a step of at most {longest_s:.2e} s, a larger \
         friction_epsilon_rad_s or less stiffness"
    )]
    StepTooLong {
        /// The step asked for, s.
        step_s: f64,
        /// Fastest decay, 1/s.
        decay_per_s: f64,
        /// The longest step accepted, s.
        longest_s: f64,
    },
    /// A parameter of a hidden effect makes no sense.
    #[error("effect {number} ({kind}): {key} = {value}: {requirement}")]
    Effect {
        /// Number of the effect within the scenario, from 1.
        number: usize,
        /// Kind of the effect.
        kind: &'static str,
        /// The key.
        key: &'static str,
        /// The value found.
        value: f64,
        /// Condition that the value must meet.
        requirement: &'static str,
    },
    /// The effects together make the friction of a joint drive the joint.
    #[error(
        "joint {joint}: the effects leave {torque_nm:.3} Nm of friction at {qd_rad_s:.3} rad/s, which \
         would drive the joint instead of slowing it"
    )]
    FrictionDrives {
        /// Joint, from 1.
        joint: usize,
        /// Speed at which it drives the joint, rad/s.
        qd_rad_s: f64,
        /// Friction at that speed, Nm.
        torque_nm: f64,
    },
    /// Bristles cannot hold the Stribeck friction of their joint.
    #[error(
        "joint {joint}: with presliding, Stribeck friction needs more Coulomb friction than it takes away, and \
         leaves {least_nm:.3} Nm"
    )]
    BristlesWithoutFriction {
        /// Joint, from 1.
        joint: usize,
        /// Least dry friction that is left, Nm.
        least_nm: f64,
    },
    /// A list with one entry per joint has another length.
    #[error("{what} has {found} joints, the arm has {expected}")]
    Joints {
        /// What has the wrong length.
        what: &'static str,
        /// Its number of entries.
        found: usize,
        /// Number of joints of the arm.
        expected: usize,
    },
    /// The state is no longer finite.
    #[error(
        "the simulation broke down at t = {time_s} s: joint {joint} at {q_rad} rad, {qd_rad_s} rad/s"
    )]
    Diverged {
        /// Time, s.
        time_s: f64,
        /// Joint, from 1.
        joint: usize,
        /// Angle of the joint, rad.
        q_rad: f64,
        /// Speed of the joint, rad/s.
        qd_rad_s: f64,
    },
}
