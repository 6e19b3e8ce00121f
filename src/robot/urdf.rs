//! Arms from URDF files.

use super::arm::Arm;
use super::error::RobotError;

/// The arm described by a URDF text; `source` names it in messages.
pub fn arm_from_urdf(_text: &str, source: &str) -> Result<Arm, RobotError> {
    Err(RobotError::Urdf { file: source.to_owned(), message: "not read yet".into() })
}
