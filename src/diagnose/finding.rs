//! A diagnosis together with what it rests on.

use super::extension::Extension;
use super::scene::Scene;
use super::verdict::Diagnosis;
use crate::identify::Identification;
use crate::robot::JointSignals;

/// A diagnosis with the data from which it was made, for plots.
pub struct Finding {
    /// The diagnosis itself.
    pub diagnosis: Diagnosis,
    /// The null model's identification.
    pub identification: Identification,
    /// Motion and predictions along the log.
    pub scene: Scene,
    /// The extended model.
    pub extension: Extension,
    /// Residual of the null model, one period or the run, Nm.
    pub before_nm: JointSignals,
    /// Residual of the extended model, Nm.
    pub after_nm: JointSignals,
    /// Logged torque: the mean period, or the run behind its low-pass, Nm.
    pub measured_nm: JointSignals,
    /// The sample of the scene that belongs to each residual.
    pub samples: Vec<usize>,
}
