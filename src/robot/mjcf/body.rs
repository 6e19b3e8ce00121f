//! Conversion of the bodies of an MJCF into links and joints.

use std::collections::{HashMap, HashSet};

use nalgebra::Vector3;
use urdf_rs::{Axis, Dynamics, Inertial, JointLimit, JointType, Link, LinkName, Pose, Robot, Vec3};

use super::actuator::Actuated;
use super::collision::{MeshAssets, shape};
use super::compiler::Compiler;
use super::defaults::Defaults;
use super::element::Element;
use super::fault::MjcfFault;
use super::geom::stretch;
use super::inertia::BodyInertia;
use super::joint::Joint;
use super::notice::LeftOut;
use super::pose::{pose, shift};
use crate::robot::arm::Placement;
use crate::robot::shapes::LinkShape;

/// The body that contains all others.
const WORLD: &str = "world";

/// An element of a body, with the `<frame>` elements around it resolved.
pub(super) struct Part<'a> {
    pub element: &'a Element,
    /// Pose in the body of the innermost `<frame>` around the element.
    pub frame: Placement,
    /// The default class of elements that name none.
    pub childclass: Option<&'a str>,
}

/// The link of a body. Its axes are those of the body, its origin is the anchor of the last joint that moves the body.
struct Hold {
    link: String,
    anchor_m: Vector3<f64>,
}

/// The links and joints that an MJCF is converted into.
pub(super) struct Bodies<'a> {
    compiler: &'a Compiler,
    defaults: &'a Defaults,
    /// Contributions of the actuators, by joint.
    actuated: &'a HashMap<String, Actuated>,
    /// Meshes by name.
    meshes: &'a MeshAssets,
    /// All links, still without inertia, and all joints.
    pub robot: Robot,
    /// The inertia of each link, or the reason why it is not known, which matters only if the link moves.
    pub inertias: Vec<Result<Inertial, MjcfFault>>,
    /// Names of joints that are taken.
    joint_names: HashSet<String>,
    /// Fixed joints for the named sites.
    sites: Vec<urdf_rs::Joint>,
    /// The link on which each site is.
    pub links_of_sites: HashMap<String, String>,
    /// Sites with the same name as a body.
    pub namesakes: Vec<String>,
    /// Free joints, which are locked.
    pub free: Vec<String>,
    /// Rotor inertia by joint, kg m².
    pub armature_kg_m2: HashMap<String, f64>,
    /// Positions of joints in the pose of the file, rad or m.
    pub references: HashMap<String, f64>,
    /// Properties of joints that an arm does not have.
    pub left_out: Vec<(LeftOut, String)>,
    /// Names that were made up for bodies without one.
    pub unnamed: HashSet<String>,
    /// Bodies whose weight is compensated.
    pub weightless: HashSet<String>,
    /// Number of equalities that connect bodies in addition to the joints.
    pub loops: usize,
    /// Collision shapes of the links.
    pub shapes: Vec<LinkShape>,
}

impl<'a> Bodies<'a> {
    /// Everything in the `<worldbody>` of `root`, whose joints have the `joint_names`.
    pub(super) fn of(
        root: &Element,
        compiler: &'a Compiler,
        defaults: &'a Defaults,
        actuated: &'a HashMap<String, Actuated>,
        meshes: &'a MeshAssets,
        joint_names: HashSet<String>,
    ) -> Result<Self, MjcfFault> {
        let mut bodies = Self {
            compiler,
            defaults,
            actuated,
            meshes,
            robot: Robot {
                name: root.text("model").unwrap_or_default().to_owned(),
                version: None,
                links: Vec::new(),
                joints: Vec::new(),
                materials: Vec::new(),
            },
            inertias: Vec::new(),
            joint_names,
            sites: Vec::new(),
            links_of_sites: HashMap::new(),
            namesakes: Vec::new(),
            free: Vec::new(),
            armature_kg_m2: HashMap::new(),
            references: HashMap::new(),
            left_out: Vec::new(),
            unnamed: HashSet::new(),
            weightless: HashSet::new(),
            loops: 0,
            shapes: Vec::new(),
        };
        bodies.link(WORLD.to_owned(), Ok(Inertial::default()));
        let world = Hold { link: WORLD.to_owned(), anchor_m: Vector3::zeros() };
        for section in root.each("worldbody") {
            let parts = bodies.parts(section, section.text("childclass"))?;
            bodies.inner(&parts, &world)?;
        }
        bodies.add_sites();
        Ok(bodies)
    }

    /// The elements in `element`, with `<frame>` elements resolved.
    fn parts<'e>(
        &self,
        element: &'e Element,
        childclass: Option<&'e str>,
    ) -> Result<Vec<Part<'e>>, MjcfFault> {
        let mut parts = Vec::new();
        for child in &element.children {
            match child.tag.as_str() {
                "frame" => {
                    let own = pose(child, self.compiler)?;
                    let childclass = child.text("childclass").or(childclass);
                    for part in self.parts(child, childclass)? {
                        parts.push(Part { frame: own.compose(&part.frame), ..part });
                    }
                }
                "replicate" => return Err(child.unread("copies are")),
                "attach" => return Err(child.unread("other models in this one are")),
                "composite" | "flexcomp" => return Err(child.unread("deformable bodies are")),
                _ => parts.push(Part { element: child, frame: Placement::identity(), childclass }),
            }
        }
        Ok(parts)
    }

    /// Converts the sites, shapes and bodies among the parts of the body `hold`.
    fn inner(&mut self, parts: &[Part<'_>], hold: &Hold) -> Result<(), MjcfFault> {
        for part in parts {
            match part.element.tag.as_str() {
                "site" => self.site(part, hold)?,
                "body" => self.body(part, hold)?,
                "geom" => self.geom(part, hold),
                _ => {}
            }
        }
        Ok(())
    }

    fn body(&mut self, body: &Part<'_>, parent: &Hold) -> Result<(), MjcfFault> {
        let Part { element, frame, childclass } = body;
        let name = match element.text("name") {
            Some(name) => name.to_owned(),
            None => {
                // The number distinguishes several on one line.
                let count = self.robot.links.len();
                let name = format!("unnamed body {count} ({})", element.line());
                self.unnamed.insert(name.clone());
                name
            }
        };
        let parts = self.parts(element, element.text("childclass").or(*childclass))?;
        let pose = frame.compose(&pose(element, self.compiler)?);
        let hold = self.joints(&name, &pose, parent, &parts)?;
        let inertia = BodyInertia::of(&name, &parts, self.compiler, self.defaults);
        if element.number("gravcomp")?.is_some_and(|share| share != 0.0) {
            self.weightless.insert(name.clone());
        }
        self.link(name, inertia.map(|inertia| inertia.about(&hold.anchor_m)));
        self.inner(&parts, &hold)
    }

    /// Converts the joints between `parent` and the body `name`, whose pose in the parent body is `pose` in the file.
    fn joints(
        &mut self,
        name: &str,
        pose: &Placement,
        parent: &Hold,
        parts: &[Part<'_>],
    ) -> Result<Hold, MjcfFault> {
        let joints: Vec<&Part<'_>> = parts.iter().filter(|part| is_joint(part.element)).collect();
        let mut at = Hold { link: parent.link.clone(), anchor_m: Vector3::zeros() };
        // Pose of the body, as moved by the joints so far, in the frame of the current link.
        let mut body = shift(-parent.anchor_m).compose(pose);
        for (before, part) in joints.iter().enumerate() {
            let element = self.defaults.complete(part.element, part.childclass)?;
            let joint = Joint::of(&element, &part.frame, self.compiler)?;
            let joint_name = match element.text("name") {
                Some(name) => name.to_owned(),
                None => self.name_of_unnamed(name, before),
            };
            let origin = body.compose(&shift(joint.anchor_m)).compose(&joint.at_zero());
            let link = if before + 1 == joints.len() {
                name.to_owned()
            } else {
                let between = format!("{name} behind {joint_name}");
                self.link(between.clone(), Ok(Inertial::default()));
                between
            };
            body = shift(-joint.anchor_m);
            let anchor_m = joint.anchor_m;
            self.joint(joint_name, joint, &origin, &at.link, &link);
            at = Hold { link, anchor_m };
        }
        if joints.is_empty() {
            self.robot.joints.push(fixed(name, &body, &at.link));
            at.link = name.to_owned();
        }
        Ok(at)
    }

    /// A unique name for a joint without one, with `before` other joints in front of it in the body `body`.
    fn name_of_unnamed(&mut self, body: &str, before: usize) -> String {
        let mut names = (before + 1..).map(|number| match number {
            1 => format!("{body}_joint"),
            _ => format!("{body}_joint{number}"),
        });
        // The iterator is endless.
        let name = names.find(|name| !self.joint_names.contains(name)).unwrap_or_default();
        self.joint_names.insert(name.clone());
        name
    }

    fn joint(&mut self, name: String, joint: Joint, origin: &Placement, parent: &str, child: &str) {
        let unlimited = Actuated { effort: f64::INFINITY, ..Actuated::default() };
        let actuated = self.actuated.get(&name).copied().unwrap_or(unlimited);
        let effort = joint.effort.min(actuated.effort);
        // In a URDF, 0 means no limit.
        let effort = if effort.is_finite() { effort } else { 0.0 };
        let damping = joint.dynamics.damping + actuated.damping;
        let armature_kg_m2 = joint.armature_kg_m2 + actuated.armature_kg_m2;
        self.armature_kg_m2.insert(name.clone(), armature_kg_m2);
        self.references.insert(name.clone(), joint.reference);
        self.left_out.extend(joint.left_out.iter().map(|what| (*what, name.clone())));
        let joint_type = match joint.kind {
            // Free joints connect bodies to the world: a floating base of the arm, or an object beside it.
            JointType::Floating => {
                self.free.push(name.clone());
                JointType::Fixed
            }
            kind => kind,
        };
        self.robot.joints.push(urdf_rs::Joint {
            joint_type,
            axis: Axis { xyz: Vec3(joint.axis.into()) },
            limit: JointLimit { effort, ..joint.limit },
            dynamics: Some(Dynamics { damping, ..joint.dynamics }),
            ..joint_between(name, origin, parent, child)
        });
    }

    /// Records the collision shape of a geom. A fault is only recorded, to be reported with the shapes: the arm is the
    /// same without it.
    fn geom(&mut self, part: &Part<'_>, hold: &Hold) {
        let geom = self.defaults.complete(part.element, part.childclass);
        let found = geom.and_then(|geom| shape(&geom, self.compiler, self.meshes));
        let (own, shape) = match found {
            Ok(None) => return,
            Ok(Some((own, shape))) => (own, Ok(shape)),
            Err(fault) => (Placement::identity(), Err(fault.to_string())),
        };
        let placement = shift(-hold.anchor_m).compose(&part.frame.compose(&own));
        self.shapes.push(LinkShape { link: hold.link.clone(), placement, shape });
    }

    /// Records a named site as a link without mass.
    fn site(&mut self, part: &Part<'_>, hold: &Hold) -> Result<(), MjcfFault> {
        let site = self.defaults.complete(part.element, part.childclass)?;
        let Some(name) = site.text("name") else { return Ok(()) };
        let kind = site.text("type").unwrap_or("sphere");
        let (own, _) = stretch(&site, kind, self.compiler)?;
        let own = part.frame.compose(&own);
        self.links_of_sites.insert(name.to_owned(), hold.link.clone());
        self.sites.push(fixed(name, &shift(-hold.anchor_m).compose(&own), &hold.link));
        Ok(())
    }

    /// Adds the sites as links. If a body has the same name as a site, the name means the body.
    fn add_sites(&mut self) {
        let bodies: HashSet<String> =
            self.robot.links.iter().map(|link| link.name.clone()).collect();
        let mut names = HashSet::new();
        for site in std::mem::take(&mut self.sites) {
            let name = site.child.link.clone();
            if bodies.contains(&name) {
                self.namesakes.push(name);
            } else if names.insert(name.clone()) {
                self.link(name, Ok(Inertial::default()));
                self.robot.joints.push(site);
            }
        }
    }

    fn link(&mut self, name: String, inertia: Result<Inertial, MjcfFault>) {
        let inertial = Inertial::default();
        self.robot.links.push(Link { name, inertial, visual: Vec::new(), collision: Vec::new() });
        self.inertias.push(inertia);
    }
}

/// The names of all joints in the `<worldbody>` of `root`.
pub(super) fn joint_names(root: &Element) -> HashSet<String> {
    let mut names = HashSet::new();
    for section in root.each("worldbody") {
        collect_joint_names(section, &mut names);
    }
    names
}

/// Collects the names of all joints in an element.
fn collect_joint_names(element: &Element, names: &mut HashSet<String>) {
    for child in &element.children {
        if is_joint(child) {
            names.extend(child.text("name").map(str::to_owned));
        }
        collect_joint_names(child, names);
    }
}

fn is_joint(element: &Element) -> bool {
    matches!(element.tag.as_str(), "joint" | "freejoint")
}

/// The fixed joint that connects the link `child` to `parent`.
fn fixed(child: &str, origin: &Placement, parent: &str) -> urdf_rs::Joint {
    joint_between(format!("{child} (fixed)"), origin, parent, child)
}

/// A fixed joint, to be given its type by the caller.
fn joint_between(name: String, origin: &Placement, parent: &str, child: &str) -> urdf_rs::Joint {
    urdf_rs::Joint {
        name,
        joint_type: JointType::Fixed,
        origin: Pose { xyz: Vec3(origin.translation_m.into()), rpy: Vec3(origin.rpy_rad()) },
        parent: LinkName { link: parent.to_owned() },
        child: LinkName { link: child.to_owned() },
        axis: Axis::default(),
        limit: JointLimit::default(),
        calibration: None,
        dynamics: None,
        mimic: None,
        safety_controller: None,
    }
}
