//! What stays the same from log to log.

use crate::base::BaseSet;
use crate::identify::Options;
use crate::robot::Arm;

/// The arm whose logs are diagnosed, and how they are read.
#[derive(Clone, Copy)]
pub struct Setup<'a> {
    /// The arm as it is described.
    pub arm: &'a Arm,
    /// The base parameters of the null model.
    pub set: &'a BaseSet,
    /// How logs are processed.
    pub options: &'a Options,
}
