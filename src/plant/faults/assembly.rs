//! The plant under construction, into which the effects are installed one by one.

use super::effect::{Complaint, require};
use super::friction::Friction;
use super::gear::{Backlash, Elasticity, EncoderSide, Ripple, Transmission};
use super::readings::ReadingFault;
use super::surroundings::{Contact, Spring};
use super::timing::Timing;
use crate::robot::Arm;

/// Everything that an effect can change.
#[derive(Debug, Clone)]
pub(super) struct Assembly {
    /// The true arm, except for its friction, which is in `joints`.
    pub(super) arm: Arm,
    /// Mechanics of each joint.
    pub(super) joints: Vec<JointMechanics>,
    /// Contact forces on the flange.
    pub(super) flange_contacts: Vec<Contact>,
    /// Instants at which the channels are read.
    pub(super) timing: Timing,
    /// Faults of the readings, in the order of application, each with the number of its effect, from 0.
    pub(super) readings: Vec<(u8, ReadingFault)>,
    /// Number of the effect being installed, from 0.
    pub(super) number: u8,
}

/// Mechanics of one joint, from the current of its motor to its link.
#[derive(Debug, Clone)]
pub(super) struct JointMechanics {
    /// Reflected rotor inertia, kg m².
    pub(super) rotor_inertia_kg_m2: f64,
    /// Friction on the motor side of the gear.
    pub(super) friction: Friction,
    /// The elasticity of the gear, as specified by the effect.
    pub(super) elasticity: Option<Elasticity>,
    /// The play of the gear, as specified by the effect.
    pub(super) backlash: Option<Backlash>,
    /// The compliant transmission between rotor and link; `None` if the gear is rigid.
    pub(super) transmission: Option<Transmission>,
    /// Side of the transmission on which the encoder sits.
    pub(super) encoder: EncoderSide,
    /// Torque ripples.
    pub(super) ripples: Vec<Ripple>,
    /// Logged torque over true torque, minus 1.
    pub(super) gain_error: f64,
    /// Logged minus true torque, Nm.
    pub(super) offset_nm: f64,
    /// Share of the joint's nominal friction that the controller feeds forward.
    pub(super) fed_forward: f64,
    /// Largest torque the reading can show, Nm.
    pub(super) reading_limit_nm: f64,
    /// Reading of the encoder minus its true angle, rad.
    pub(super) encoder_offset_rad: f64,
    /// Springs between the link and its surroundings.
    pub(super) springs: Vec<Spring>,
    /// Contacts that act on this joint alone.
    pub(super) contacts: Vec<Contact>,
}

impl Assembly {
    /// The arm without effects. `friction_feedforward` is the share of friction that the controller feeds forward.
    pub(super) fn new(arm: &Arm, friction_feedforward: f64) -> Self {
        let mechanics = |joint: &crate::robot::Joint| JointMechanics {
            rotor_inertia_kg_m2: joint.drive.rotor_inertia_kg_m2,
            friction: Friction::nominal(&joint.drive, arm.friction_epsilon_rad_s),
            elasticity: None,
            backlash: None,
            transmission: None,
            encoder: EncoderSide::Motor,
            ripples: Vec::new(),
            gain_error: 0.0,
            offset_nm: 0.0,
            fed_forward: friction_feedforward,
            reading_limit_nm: f64::INFINITY,
            encoder_offset_rad: 0.0,
            springs: Vec::new(),
            contacts: Vec::new(),
        };
        Self {
            joints: arm.joints.iter().map(mechanics).collect(),
            flange_contacts: Vec::new(),
            timing: Timing::exact(arm.dof()),
            readings: Vec::new(),
            number: 0,
            arm: arm.clone(),
        }
    }

    /// Complains if the drive of joint `index` (from 0) has no finite torque limit, which some effects need for their
    /// size.
    pub(super) fn require_torque_limit(&self, index: usize) -> Result<(), Complaint> {
        let limit_nm = self.arm.joints[index].limits.torque_nm;
        require(
            limit_nm.is_finite(),
            "torque_nm",
            limit_nm,
            "of the arm's joint must be a finite limit",
        )
    }

    /// Reach of the arm: the sum of its link lengths, m.
    pub(super) fn reach_m(&self) -> f64 {
        self.arm.joints.iter().map(|joint| joint.placement.translation_m.norm()).sum()
    }

    /// Mechanics of joint `joint`, from 1.
    pub(super) fn joint(&mut self, joint: usize) -> &mut JointMechanics {
        &mut self.joints[joint - 1]
    }

    /// Indices of `joint` (from 1), or of all joints.
    pub(super) fn indices(&self, joint: Option<usize>) -> std::ops::Range<usize> {
        match joint {
            Some(joint) => joint - 1..joint,
            None => 0..self.joints.len(),
        }
    }
}
