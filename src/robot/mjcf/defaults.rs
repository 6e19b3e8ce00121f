//! Default classes: attributes that elements take over by the name of a class.

use std::collections::HashMap;

use super::element::{Attributes, Element, fill};
use super::fault::MjcfFault;

/// The class of elements that name none.
const MAIN: &str = "main";

/// All kinds of equalities share one set of defaults.
const EQUALITY: &str = "equality";

/// Tags of actuators, for all of which MuJoCo keeps one set of defaults.
pub(super) const ACTUATORS: [&str; 11] = [
    "general",
    "motor",
    "position",
    "velocity",
    "intvelocity",
    "damper",
    "cylinder",
    "muscle",
    "adhesion",
    "dcmotor",
    "pid",
];

/// Attributes by kind of element.
type Class = HashMap<&'static str, Attributes>;

/// The classes of a file, each including what it inherits from the classes around it.
#[derive(Debug)]
pub(super) struct Defaults {
    classes: HashMap<String, Class>,
}

impl Defaults {
    /// The classes in all `<default>` elements of a file.
    pub(super) fn of(root: &Element) -> Result<Self, MjcfFault> {
        let mut defaults = Self { classes: HashMap::from([(MAIN.to_owned(), Class::new())]) };
        for section in root.each("default") {
            defaults.read(section, MAIN)?;
        }
        Ok(defaults)
    }

    fn read(&mut self, section: &Element, name: &str) -> Result<(), MjcfFault> {
        let mut class = self.classes.get(name).cloned().unwrap_or_default();
        for element in &section.children {
            if let Some(kind) = kind(&element.tag) {
                let mut given = element.attributes.clone();
                let before = class.entry(kind).or_default();
                fill(&mut given, before);
                *before = given;
            }
        }
        self.classes.insert(name.to_owned(), class.clone());
        for inner in section.each("default") {
            let name = inner.required("class")?;
            self.classes.entry(name.to_owned()).or_insert_with(|| class.clone());
            self.read(inner, name)?;
        }
        Ok(())
    }

    /// The element completed with the attributes of its class; `childclass` applies to elements that name no class.
    pub(super) fn complete(
        &self,
        element: &Element,
        childclass: Option<&str>,
    ) -> Result<Element, MjcfFault> {
        self.complete_as(kind(&element.tag), element, childclass)
    }

    /// Completes an equality, whose tag may be that of another kind of element.
    pub(super) fn complete_equality(&self, equality: &Element) -> Result<Element, MjcfFault> {
        self.complete_as(Some(EQUALITY), equality, None)
    }

    fn complete_as(
        &self,
        kind: Option<&str>,
        element: &Element,
        childclass: Option<&str>,
    ) -> Result<Element, MjcfFault> {
        let name = element.text("class").or(childclass).unwrap_or(MAIN);
        let Some(class) = self.classes.get(name) else {
            let class = name.to_owned();
            return Err(MjcfFault::UnknownClass { place: element.place(), class });
        };
        let mut complete = element.clone();
        if let Some(defaults) = kind.and_then(|kind| class.get(kind)) {
            fill(&mut complete.attributes, defaults);
        }
        Ok(complete)
    }
}

/// The kind of an element, if defaults for it matter.
fn kind(tag: &str) -> Option<&'static str> {
    match tag {
        "joint" => Some("joint"),
        "geom" => Some("geom"),
        "site" => Some("site"),
        "mesh" => Some("mesh"),
        // In `<default>` there is only one tag for all of them.
        "fixed" | "spatial" | "tendon" => Some("tendon"),
        EQUALITY => Some(EQUALITY),
        _ if ACTUATORS.contains(&tag) => Some("actuator"),
        _ => None,
    }
}
