//! Contributions of actuators to their joints.

use std::collections::{HashMap, HashSet};

use super::compiler::Compiler;
use super::defaults::{ACTUATORS, Defaults};
use super::element::Element;
use super::fault::MjcfFault;
use super::joint::{POWERS, smaller};

/// Largest number of values of `gear`: one for a joint, six for a site.
const GEARS: usize = 6;
/// Largest number of values of `gainprm`.
const GAINS: usize = 10;

/// The combined contribution of all actuators of a joint.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Actuated {
    /// Largest torque, Nm, or force, N; infinite if one of them has no limit.
    pub effort: f64,
    /// Rotor inertia at the joint, kg m².
    pub armature_kg_m2: f64,
    /// Damping at the joint, Nm s/rad.
    pub damping: f64,
}

/// The contributions by name of the joint, which must be one of those that the file has `named`.
///
/// MuJoCo limits the input of an actuator (`ctrlrange`) and its output (`forcerange`). The joint receives the output
/// times `gear`, summed over its actuators. Rotors and dampers of actuators turn with the motor: the joint has their
/// inertia and damping times `gear`².
pub(super) fn actuated(
    root: &Element,
    compiler: &Compiler,
    defaults: &Defaults,
    named: &HashSet<String>,
) -> Result<HashMap<String, Actuated>, MjcfFault> {
    let mut actuated: HashMap<String, Actuated> = HashMap::new();
    let actuators = root.each("actuator").flat_map(|section| &section.children);
    for actuator in actuators.filter(|one| ACTUATORS.contains(&one.tag.as_str())) {
        let actuator = defaults.complete(actuator, None)?;
        let Some(joint) = actuator.text("joint").or(actuator.text("jointinparent")) else {
            continue;
        };
        actuator.refuse_unknown_joint(joint, named)?;
        let gear = actuator.up_to("gear", GEARS)?.map_or(1.0, |gear| gear[0]).abs();
        // An actuator that is not connected limits nothing.
        if gear == 0.0 {
            continue;
        }
        let largest = |range: Option<[f64; 2]>| range.map_or(f64::INFINITY, smaller);
        let mut force = largest(compiler.limit(&actuator, "forcelimited", "forcerange")?);
        if let Some(gain) = gain_of_a_motor(&actuator)? {
            let asked = largest(compiler.limit(&actuator, "ctrllimited", "ctrlrange")?);
            force = if gain > 0.0 { force.min(gain * asked) } else { 0.0 };
        }
        let damping = actuator.up_to("damping", POWERS)?.map_or(0.0, |damping| damping[0]);
        actuator.refuse_negative("damping", damping)?;
        let joint = actuated.entry(joint.to_owned()).or_default();
        joint.effort += gear * force;
        joint.armature_kg_m2 += gear * gear * actuator.not_negative("armature")?;
        joint.damping += gear * gear * damping;
    }
    Ok(actuated)
}

/// Output per unit of input of an actuator whose output is proportional to its input; `None` for all others. MuJoCo
/// itself writes motors as `<general>`.
fn gain_of_a_motor(actuator: &Element) -> Result<Option<f64>, MjcfFault> {
    let is_plain =
        |attribute: &str, plain: &str| actuator.text(attribute).is_none_or(|kind| kind == plain);
    match actuator.tag.as_str() {
        "motor" => Ok(Some(1.0)),
        "general"
            if is_plain("biastype", "none")
                && is_plain("dyntype", "none")
                && is_plain("gaintype", "fixed") =>
        {
            Ok(Some(actuator.up_to("gainprm", GAINS)?.map_or(1.0, |gain| gain[0].abs())))
        }
        _ => Ok(None),
    }
}
