//! What can stop a simulation.

use thiserror::Error;

/// A plant that cannot be built, a configuration that cannot be run, or a run that broke down.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum PlantError {
    /// A link that no mass distribution has. The engine would clamp it silently.
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
    /// The engine holds another inertia tensor than the one it was given.
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
    /// A setting outside its range.
    #[error("{key} = {value}: {requirement}")]
    Setting {
        /// The key in the scenario.
        key: &'static str,
        /// The value found.
        value: f64,
        /// What it must be.
        requirement: &'static str,
    },
    /// Friction is too steep, or a gear too stiff, for the step: the integration would chatter.
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
    /// A hidden effect whose numbers make no sense.
    #[error("effect {number} ({kind}): {key} = {value}: {requirement}")]
    Effect {
        /// Its place among the scenario's effects, from 1.
        number: usize,
        /// Its kind.
        kind: &'static str,
        /// The key.
        key: &'static str,
        /// The value found.
        value: f64,
        /// What it must be.
        requirement: &'static str,
    },
    /// Effects that together turn friction of a joint into a drive.
    #[error(
        "joint {joint}: the effects leave {torque_nm:.3} Nm of friction at {qd_rad_s:.3} rad/s, which \
         would drive the joint instead of slowing it"
    )]
    FrictionDrives {
        /// Joint, from 1.
        joint: usize,
        /// Speed at which it does, rad/s.
        qd_rad_s: f64,
        /// Friction there, Nm.
        torque_nm: f64,
    },
    /// A list with one entry per joint has another length.
    #[error("{what} has {found} joints, the arm has {expected}")]
    Joints {
        /// What has the wrong length.
        what: &'static str,
        /// Its length.
        found: usize,
        /// Joints of the arm.
        expected: usize,
    },
    /// The state left the finite numbers.
    #[error(
        "the simulation broke down at t = {time_s} s: joint {joint} at {q_rad} rad, {qd_rad_s} rad/s"
    )]
    Diverged {
        /// Time, s.
        time_s: f64,
        /// Joint, from 1.
        joint: usize,
        /// Its angle, rad.
        q_rad: f64,
        /// Its speed, rad/s.
        qd_rad_s: f64,
    },
}
