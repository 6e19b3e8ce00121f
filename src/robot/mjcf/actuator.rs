//! What actuators say of the torque that joints can have.

use std::collections::HashMap;

use super::compiler::Compiler;
use super::defaults::{ACTUATORS, Defaults};
use super::element::Element;
use super::fault::MjcfFault;
use super::joint::smaller;

/// Numbers of `gear`: a joint has one, a site six.
const GEARS: usize = 6;

/// The largest torque (Nm, or N) of each joint that an actuator limits, by name. `forcerange` is that of the actuator, a motor
/// without one gives what `ctrlrange` lets it be asked for; the joint has it times `gear`.
pub(super) fn efforts(
    root: &Element,
    compiler: &Compiler,
    defaults: &Defaults,
) -> Result<HashMap<String, f64>, MjcfFault> {
    let mut efforts = HashMap::new();
    let actuators = root.each("actuator").flat_map(|section| &section.children);
    for actuator in actuators.filter(|one| ACTUATORS.contains(&one.tag.as_str())) {
        let actuator = defaults.complete(actuator, None)?;
        let Some(joint) = actuator.text("joint").or(actuator.text("jointinparent")) else {
            continue;
        };
        let mut range = compiler.limit(&actuator, "forcelimited", "forcerange")?;
        if range.is_none() && actuator.tag == "motor" {
            range = compiler.limit(&actuator, "ctrllimited", "ctrlrange")?;
        }
        let gear = actuator.up_to("gear", GEARS)?.map_or(1.0, |gear| gear[0]);
        if let Some(range) = range {
            // Of several actuators of one drive (position, velocity) the strongest counts.
            let effort: &mut f64 = efforts.entry(joint.to_owned()).or_default();
            *effort = effort.max(smaller(range) * gear.abs());
        }
    }
    Ok(efforts)
}
