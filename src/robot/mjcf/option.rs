//! Physics settings of a file: its `<option>`.

use nalgebra::Vector3;
use urdf_rs::Robot;

use super::element::Element;
use super::fault::MjcfFault;
use super::notice::LeftOut;

/// MuJoCo's default gravity, in the world frame, m/s².
const USUAL_GRAVITY_M_S2: [f64; 3] = [0.0, 0.0, -9.81];

/// The settings that matter to an arm.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Options {
    /// Gravity in the world frame, m/s².
    pub gravity_m_s2: Vector3<f64>,
    /// Whether bodies move in a medium that drags at them.
    pub has_medium: bool,
    /// Whether damping is switched off.
    is_undamped: bool,
    /// Whether dry friction is switched off.
    is_without_dry_friction: bool,
}

impl Default for Options {
    fn default() -> Self {
        Self {
            gravity_m_s2: USUAL_GRAVITY_M_S2.into(),
            has_medium: false,
            is_undamped: false,
            is_without_dry_friction: false,
        }
    }
}

impl Options {
    /// The combined settings of all `<option>` elements of a file.
    pub(super) fn of(root: &Element) -> Result<Self, MjcfFault> {
        let usual = Self::default();
        let Some(said) = root.settings("option") else { return Ok(usual) };
        let flags: Vec<&Element> =
            root.each("option").flat_map(|option| option.each("flag")).collect();
        let is_off = |flag: &str| flags.iter().any(|one| one.text(flag) == Some("disable"));
        let given = said.numbers::<3>("gravity")?.map(Vector3::from);
        Ok(Self {
            gravity_m_s2: if is_off("gravity") {
                Vector3::zeros()
            } else {
                given.unwrap_or(usual.gravity_m_s2)
            },
            has_medium: said.not_negative("density")? > 0.0
                || said.not_negative("viscosity")? > 0.0,
            // Older versions of MuJoCo have one flag for springs and dampers.
            is_undamped: is_off("damper") || is_off("passive"),
            // In MuJoCo, dry friction is one of the constraints.
            is_without_dry_friction: is_off("frictionloss") || is_off("constraint"),
        })
    }

    /// Sets damping and dry friction that are switched off to zero, and returns the joints that had any.
    pub(super) fn switch_off(&self, robot: &mut Robot) -> Vec<(LeftOut, String)> {
        let mut had = Vec::new();
        for joint in &mut robot.joints {
            let Some(dynamics) = joint.dynamics.as_mut() else { continue };
            let before = (dynamics.damping, dynamics.friction);
            if self.is_undamped {
                dynamics.damping = 0.0;
            }
            if self.is_without_dry_friction {
                dynamics.friction = 0.0;
            }
            if (dynamics.damping, dynamics.friction) != before {
                had.push((LeftOut::SwitchedOff, joint.name.clone()));
            }
        }
        had
    }
}
