//! Effects of the drives: errors of the current reading, of the torque constant and of the feed-forward.

use serde::{Deserialize, Serialize};

use super::assembly::Assembly;
use super::effect::{Complaint, Fault, finite, positive, require};

/// A torque constant that deviates from its nominal value: the torque that controller and log compute from the current
/// with the nominal i_G k is (1 + e) times the true torque. The true constant is k/(1 + e).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TorqueGain {
    /// Joint, from 1.
    pub joint: usize,
    /// e, between −0.5 and 1.
    pub error_fraction: f64,
}

impl Fault for TorqueGain {
    fn joint(&self) -> Option<usize> {
        Some(self.joint)
    }

    fn check(&self) -> Result<(), Complaint> {
        let ok = (-0.5..=1.0).contains(&self.error_fraction);
        require(ok, "error_fraction", self.error_fraction, "must be between -0.5 and 1")
    }

    fn install(&self, assembly: &mut Assembly) -> Result<(), Complaint> {
        let joint = assembly.joint(self.joint);
        joint.gain_error = (1.0 + joint.gain_error) * (1.0 + self.error_fraction) - 1.0;
        Ok(())
    }
}

/// A current sensor with a zero offset. The current loop holds the *reading* at the value that the controller commands,
/// so that the log shows the command, while the drive delivers o less.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CurrentOffset {
    /// Joint, from 1.
    pub joint: usize,
    /// o: reading minus truth, as a torque at the joint, Nm.
    pub offset_nm: f64,
}

impl Fault for CurrentOffset {
    fn joint(&self) -> Option<usize> {
        Some(self.joint)
    }

    fn check(&self) -> Result<(), Complaint> {
        finite("offset_nm", self.offset_nm)
    }

    fn install(&self, assembly: &mut Assembly) -> Result<(), Complaint> {
        assembly.joint(self.joint).offset_nm += self.offset_nm;
        Ok(())
    }
}

/// A drive that feeds forward another share of its friction than the controller's
/// [`friction_feedforward`](crate::plant::PlantConfig::friction_feedforward): the share is smaller by Δ.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FeedForward {
    /// Joint, from 1.
    pub joint: usize,
    /// Δ; negative if the drive feeds more forward.
    pub share_less: f64,
}

impl Fault for FeedForward {
    fn joint(&self) -> Option<usize> {
        Some(self.joint)
    }

    fn check(&self) -> Result<(), Complaint> {
        finite("share_less", self.share_less)
    }

    fn install(&self, assembly: &mut Assembly) -> Result<(), Complaint> {
        let fed_forward = &mut assembly.joint(self.joint).fed_forward;
        *fed_forward -= self.share_less;
        let is_share = (0.0..=2.0).contains(fed_forward);
        let requirement =
            "must leave a share between 0 and 2 of the controller's friction_feedforward";
        require(is_share, "share_less", self.share_less, requirement)
    }
}

/// A current reading that saturates at a limit although the current itself exceeds it: the log shows clamp(τ, ±limit).
/// (A drive that cannot deliver the commanded torque is modelled by the arm's limit `torque_nm` instead; its log is
/// correct.)
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Saturation {
    /// Joint, from 1.
    pub joint: usize,
    /// Largest torque that can be read, Nm.
    pub limit_nm: f64,
}

impl Fault for Saturation {
    fn joint(&self) -> Option<usize> {
        Some(self.joint)
    }

    fn check(&self) -> Result<(), Complaint> {
        positive("limit_nm", self.limit_nm)
    }

    fn install(&self, assembly: &mut Assembly) -> Result<(), Complaint> {
        let limit = &mut assembly.joint(self.joint).reading_limit_nm;
        *limit = limit.min(self.limit_nm);
        Ok(())
    }
}
