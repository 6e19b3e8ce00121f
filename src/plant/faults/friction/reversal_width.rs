//! The speeds over which dry friction reverses.

use serde::{Deserialize, Serialize};

use super::super::assembly::Assembly;
use super::super::effect::{Complaint, Fault, positive};

/// Dry friction that reverses over another range of speeds than the robot file says: tanh(q̇/w) in place of tanh(q̇/ε).
/// The controller feeds forward the friction of the file.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ReversalWidth {
    /// Joint, from 1; if left out, all joints.
    pub joint: Option<usize>,
    /// Width w, rad/s.
    pub width_rad_s: f64,
}

impl Fault for ReversalWidth {
    fn joint(&self) -> Option<usize> {
        self.joint
    }

    fn check(&self) -> Result<(), Complaint> {
        positive("width_rad_s", self.width_rad_s)
    }

    fn install(&self, assembly: &mut Assembly) -> Result<(), Complaint> {
        for j in assembly.indices(self.joint) {
            assembly.joints[j].friction.epsilon_rad_s = self.width_rad_s;
        }
        Ok(())
    }
}
