//! Errors of the replay.

use thiserror::Error;

use crate::diagnose::DiagnoseError;
use crate::identify::IdentifyError;
use crate::identify::physical::PhysicalError;
use crate::plant::PlantError;
use crate::signal::SignalError;

/// Why nothing was replayed, with the numbers that say why.
#[derive(Debug, Error)]
pub enum ReplayError {
    /// No physically possible arm is near the identified one.
    #[error("the identified arm cannot be simulated: {0}")]
    Physical(#[from] PhysicalError),
    /// The plant rejects the effects, or does not complete the motion.
    #[error("the simulation with what was found does not run: {0}")]
    Plant(#[from] PlantError),
    /// A held-out log cannot be processed.
    #[error(transparent)]
    Identify(#[from] IdentifyError),
    /// The diagnosis of a log fails.
    #[error(transparent)]
    Diagnose(#[from] DiagnoseError),
    /// A filter cannot be applied.
    #[error(transparent)]
    Signal(#[from] SignalError),
}
