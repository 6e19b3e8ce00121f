//! Effects of the surroundings: forces that pull or push from outside.

use std::f64::consts::PI;

use serde::{Deserialize, Serialize};

use super::assembly::Assembly;
use super::effect::{Complaint, Fault, finite, not_negative, require};

/// A cable or dress pack across a joint: it pulls the link back to its rest angle with the torque k (q − q₀).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Spring {
    /// Joint, from 1.
    pub joint: usize,
    /// k, Nm/rad.
    pub stiffness_nm_rad: f64,
    /// q₀, rad.
    pub rest_rad: f64,
}

impl Spring {
    /// Torque against positive motion at link angle `q_rad`, Nm.
    #[inline]
    pub(super) fn resistance_nm(&self, q_rad: f64) -> f64 {
        self.stiffness_nm_rad * (q_rad - self.rest_rad)
    }
}

impl Fault for Spring {
    fn joint(&self) -> Option<usize> {
        Some(self.joint)
    }

    fn check(&self) -> Result<(), Complaint> {
        not_negative("stiffness_nm_rad", self.stiffness_nm_rad)?;
        finite("rest_rad", self.rest_rad)
    }

    fn install(&self, assembly: &mut Assembly) -> Result<(), Complaint> {
        assembly.joint(self.joint).springs.push(*self);
        Ok(())
    }
}

/// A contact during the motion: a push that rises and falls as sin²(π (t − t₀)/(t₁ − t₀)).
///
/// With a `joint`, it is a torque with the given peak against the joint's positive motion. Without a `joint`, it is a
/// force on the flange (the origin of the last joint's frame) along −(1, 1, 1)/√3 of the base. The peak of the force is
/// `peak_nm` divided by the arm's reach (the sum of its link lengths), so that no joint feels more than `peak_nm`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Contact {
    /// Joint, from 1; if left out, the contact is at the flange.
    pub joint: Option<usize>,
    /// Start t₀ on the log's clock, s.
    pub start_s: f64,
    /// End t₁, s.
    pub end_s: f64,
    /// Peak, Nm.
    pub peak_nm: f64,
}

impl Contact {
    /// Size of the push at `time_s`, Nm; zero before t₀ and after t₁.
    #[inline]
    pub(super) fn push_nm(&self, time_s: f64) -> f64 {
        if time_s <= self.start_s || time_s >= self.end_s {
            return 0.0;
        }
        let phase = (time_s - self.start_s) / (self.end_s - self.start_s);
        self.peak_nm * (PI * phase).sin().powi(2)
    }
}

impl Fault for Contact {
    fn joint(&self) -> Option<usize> {
        self.joint
    }

    fn check(&self) -> Result<(), Complaint> {
        not_negative("start_s", self.start_s)?;
        finite("peak_nm", self.peak_nm)?;
        let ok = self.end_s > self.start_s && self.end_s.is_finite();
        require(ok, "end_s", self.end_s, "must be after start_s")
    }

    fn install(&self, assembly: &mut Assembly) -> Result<(), Complaint> {
        match self.joint {
            Some(joint) => assembly.joint(joint).contacts.push(*self),
            None => {
                let has_lever = "needs an arm with lengths if it acts on the flange: give a joint";
                require(assembly.reach_m() > 0.0, "peak_nm", self.peak_nm, has_lever)?;
                assembly.flange_contacts.push(*self);
            }
        }
        Ok(())
    }
}
