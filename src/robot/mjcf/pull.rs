//! Tendons and actuators at sites, which act on joints but are not read.

use super::compiler::Compiler;
use super::defaults::{ACTUATORS, Defaults};
use super::element::Element;
use super::equality::active;
use super::fault::MjcfFault;
use super::joint::POWERS;
use super::notice::MjcfNotice;
use crate::robot::urdf::unless_empty;

/// Something that pulls, and the joints and sites at which it pulls.
struct Pull {
    /// Its name, or its place in the file.
    name: String,
    joints: Vec<String>,
    sites: Vec<String>,
}

/// Everything in a file that pulls at joints without being an actuator of one of them.
pub(super) struct Pulls {
    tendons: Vec<Pull>,
    actuators: Vec<Pull>,
}

impl Pulls {
    /// Collects them from a file.
    pub(super) fn of(
        root: &Element,
        compiler: &Compiler,
        defaults: &Defaults,
    ) -> Result<Self, MjcfFault> {
        let mut used: Vec<String> = Vec::new();
        let mut actuators = Vec::new();
        let sections = root.each("actuator").flat_map(|section| &section.children);
        for actuator in sections.filter(|one| ACTUATORS.contains(&one.tag.as_str())) {
            used.extend(actuator.text("tendon").map(str::to_owned));
            let sites = attributes(actuator, &["site", "slidersite", "cranksite"]);
            if !sites.is_empty() {
                actuators.push(Pull { name: name(actuator), joints: Vec::new(), sites });
            }
        }
        for equality in active(root, defaults, "tendon")? {
            used.extend(attributes(&equality, &["tendon1", "tendon2"]));
        }
        let mut tendons = Vec::new();
        for tendon in root.each("tendon").flat_map(|section| &section.children) {
            let tendon = defaults.complete(tendon, None)?;
            let is_used = tendon.text("name").is_some_and(|name| used.iter().any(|u| u == name));
            if is_used || pulls_itself(&tendon, compiler)? {
                let at = |tag: &str| -> Vec<String> {
                    let parts = tendon.each(tag).filter_map(|part| part.text(tag));
                    parts.map(str::to_owned).collect()
                };
                let (joints, sites) = (at("joint"), at("site"));
                tendons.push(Pull { name: name(&tendon), joints, sites });
            }
        }
        Ok(Self { tendons, actuators })
    }

    /// Notices about those that pull at one of the arm's joints, or at a site that moves with the arm.
    pub(super) fn notices(
        &self,
        is_joint: impl Fn(&str) -> bool,
        moves: impl Fn(&str) -> bool,
    ) -> Vec<MjcfNotice> {
        let names = |pulls: &[Pull]| -> Vec<String> {
            let at_arm = pulls.iter().filter(|pull| {
                pull.joints.iter().any(|joint| is_joint(joint))
                    || pull.sites.iter().any(|site| moves(site))
            });
            at_arm.map(|pull| pull.name.clone()).collect()
        };
        let tendons = unless_empty(names(&self.tendons), |tendons| MjcfNotice::Tendons { tendons });
        let actuators = unless_empty(names(&self.actuators), |actuators| {
            MjcfNotice::SiteActuators { actuators }
        });
        tendons.into_iter().chain(actuators).collect()
    }
}

/// The name of an element, or its place if it has none.
fn name(element: &Element) -> String {
    element.text("name").map_or_else(|| element.place(), str::to_owned)
}

/// The values of those attributes that are given.
fn attributes(element: &Element, names: &[&str]) -> Vec<String> {
    names.iter().filter_map(|name| element.text(name)).map(str::to_owned).collect()
}

/// Whether a tendon acts on its joints without anything that drives or constrains it; one that does not may serve as a
/// sensor.
fn pulls_itself(tendon: &Element, compiler: &Compiler) -> Result<bool, MjcfFault> {
    for attribute in ["stiffness", "damping"] {
        let powers = tendon.up_to(attribute, POWERS)?.unwrap_or_default();
        if powers.iter().any(|power| *power != 0.0) {
            return Ok(true);
        }
    }
    Ok(tendon.not_negative("frictionloss")? > 0.0
        || tendon.not_negative("armature")? > 0.0
        || compiler.limit(tendon, "limited", "range")?.is_some())
}
