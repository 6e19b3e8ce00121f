//! Why nothing could be replayed.

use thiserror::Error;

use crate::diagnose::DiagnoseError;
use crate::identify::IdentifyError;
use crate::identify::physical::PhysicalError;
use crate::plant::PlantError;
use crate::signal::SignalError;

/// No replay, with the numbers that say why.
#[derive(Debug, Error)]
pub enum ReplayError {
    /// No arm that can exist is near what was identified.
    #[error("the identified arm cannot be simulated: {0}")]
    Physical(#[from] PhysicalError),
    /// The plant refuses the effects, or does not get through the motion.
    #[error("the simulation with what was found does not run: {0}")]
    Plant(#[from] PlantError),
    /// A held-out log.
    #[error(transparent)]
    Identify(#[from] IdentifyError),
    /// The same.
    #[error(transparent)]
    Diagnose(#[from] DiagnoseError),
    /// A filter.
    #[error(transparent)]
    Signal(#[from] SignalError),
}
