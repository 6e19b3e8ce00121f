//! The speeds over which dry friction reverses.

use serde::{Deserialize, Serialize};

use super::super::assembly::Assembly;
use super::super::effect::{Complaint, Fault, positive};

/// Dry friction that reverses over another range of speeds than the robot file says: tanh(q̇/w) in place of tanh(q̇/ε).
/// The controller feeds forward the friction of the file. Of several widths for one joint, the last replaces the others:
/// a joint that differs from the rest of the arm stands behind it.
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::robot::Arm;

    #[test]
    fn a_joint_may_differ_from_the_rest() {
        let mut assembly = Assembly::new(&Arm::built_in("ur5").unwrap(), 1.0);
        for (joint, width_rad_s) in [(None, 0.04), (Some(3), 0.06)] {
            ReversalWidth { joint, width_rad_s }.install(&mut assembly).unwrap();
        }
        let widths: Vec<f64> =
            assembly.joints.iter().map(|joint| joint.friction.epsilon_rad_s).collect();
        assert_eq!(widths, [0.04, 0.04, 0.06, 0.04, 0.04, 0.04]);
    }
}
