//! Constraints between joints or bodies: `<equality>`.

use std::collections::{HashMap, HashSet};

use urdf_rs::{Mimic, Robot};

use super::defaults::Defaults;
use super::element::Element;
use super::fault::MjcfFault;
use super::notice::LeftOut;

/// Largest number of values of `polycoef`.
const COEFFICIENTS: usize = 5;

/// Gives the joints of `robot` that follow others their `mimic`, and returns what is left out of the constraints.
/// `references` are the positions of the joints in the pose of the file, which has `named` these joints.
pub(super) fn couple(
    root: &Element,
    defaults: &Defaults,
    named: &HashSet<String>,
    robot: &mut Robot,
    references: &HashMap<String, f64>,
) -> Result<Vec<(LeftOut, String)>, MjcfFault> {
    let mut left_out = Vec::new();
    let reference = |joint: &str| references.get(joint).copied().unwrap_or(0.0);
    for joint in active(root, defaults, "joint")? {
        let name = joint.required("joint1")?;
        for joint_name in std::iter::once(name).chain(joint.text("joint2")) {
            joint.refuse_unknown_joint(joint_name, named)?;
        }
        let coefficients = joint.up_to("polycoef", COEFFICIENTS)?;
        let coefficients = coefficients.unwrap_or_else(|| vec![0.0, 1.0]);
        let Some(followed) = joint.text("joint2") else {
            left_out.push((LeftOut::Held, name.to_owned()));
            continue;
        };
        if coefficients.iter().skip(2).any(|higher| *higher != 0.0) {
            left_out.push((LeftOut::Curve, name.to_owned()));
        }
        let offset = coefficients[0];
        let multiplier = coefficients.get(1).copied().unwrap_or(1.0);
        let mimic = Mimic {
            joint: followed.to_owned(),
            multiplier: Some(multiplier),
            // `polycoef` relates displacements of the joints from the pose of the file.
            offset: Some(reference(name) + offset - multiplier * reference(followed)),
        };
        if let Some(follower) = robot.joints.iter_mut().find(|joint| joint.name == name) {
            follower.mimic = Some(mimic);
        }
    }
    Ok(left_out)
}

/// Number of equalities that connect bodies in addition to the joints.
pub(super) fn loops(root: &Element, defaults: &Defaults) -> Result<usize, MjcfFault> {
    Ok(active(root, defaults, "connect")?.len() + active(root, defaults, "weld")?.len())
}

/// Equalities of this `kind` that are not switched off, completed with the defaults of their classes.
pub(super) fn active(
    root: &Element,
    defaults: &Defaults,
    kind: &str,
) -> Result<Vec<Element>, MjcfFault> {
    let mut active = Vec::new();
    for equality in root.each("equality").flat_map(|section| section.each(kind)) {
        let equality = defaults.complete_equality(equality)?;
        if equality.switch("active")? != Some(false) {
            active.push(equality);
        }
    }
    Ok(active)
}
