//! The plant under construction: what the effects have put into it so far.

use super::effect::{Complaint, require};
use super::friction::Friction;
use super::gear::{Backlash, Elasticity, EncoderSide, Ripple, Transmission};
use super::readings::ReadingFault;
use super::surroundings::{Contact, Spring};
use super::timing::Timing;
use crate::robot::Arm;

/// Everything an effect can act on.
#[derive(Debug, Clone)]
pub(super) struct Assembly {
    /// The true arm. Friction is in `joints`, not here.
    pub(super) arm: Arm,
    /// Mechanics of each joint.
    pub(super) joints: Vec<JointMechanics>,
    /// Pushes on the flange.
    pub(super) flange_contacts: Vec<Contact>,
    /// When the channels are read.
    pub(super) timing: Timing,
    /// What becomes of the readings, in this order, each with its effect's number from 0.
    pub(super) readings: Vec<(u8, ReadingFault)>,
    /// Number of the effect being installed, from 0.
    pub(super) number: u8,
}

/// One joint from the current of its motor to its link.
#[derive(Debug, Clone)]
pub(super) struct JointMechanics {
    /// Reflected rotor inertia, kg m².
    pub(super) rotor_inertia_kg_m2: f64,
    /// Friction, on the motor's side of the gear.
    pub(super) friction: Friction,
    /// How its gear gives way, as asked for.
    pub(super) elasticity: Option<Elasticity>,
    /// The play of its gear, as asked for.
    pub(super) backlash: Option<Backlash>,
    /// What gives way between rotor and link; `None`: nothing.
    pub(super) transmission: Option<Transmission>,
    /// Which side of the transmission the encoder sits on.
    pub(super) encoder: EncoderSide,
    /// Torque ripples.
    pub(super) ripples: Vec<Ripple>,
    /// Logged torque over true torque, minus 1.
    pub(super) gain_error: f64,
    /// Logged minus true torque, Nm.
    pub(super) offset_nm: f64,
    /// Share of its friction that the controller feeds forward.
    pub(super) fed_forward: f64,
    /// Largest torque the reading can show, Nm.
    pub(super) reading_limit_nm: f64,
    /// Reading of the encoder minus its true angle, rad.
    pub(super) encoder_offset_rad: f64,
    /// Springs between the link and its surroundings.
    pub(super) springs: Vec<Spring>,
    /// Things touched by this joint alone.
    pub(super) contacts: Vec<Contact>,
}

impl Assembly {
    /// The nominal arm, its friction fed forward as the controller's configuration says.
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

    /// Complains of joint `index` (from 0) whose drive has no torque limit, by which a fault is sized.
    pub(super) fn require_torque_limit(&self, index: usize) -> Result<(), Complaint> {
        let limit_nm = self.arm.joints[index].limits.torque_nm;
        require(
            limit_nm.is_finite(),
            "torque_nm",
            limit_nm,
            "of the arm's joint must be a finite limit",
        )
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
