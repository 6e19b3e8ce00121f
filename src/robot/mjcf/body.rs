//! The bodies of an MJCF as links and joints.

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
use super::pose::{pose, rpy_rad, shift};
use crate::robot::arm::Placement;
use crate::robot::shapes::LinkShape;

/// The body around all others.
const WORLD: &str = "world";

/// An element of a body, without the `<frame>` around it.
pub(super) struct Part<'a> {
    pub element: &'a Element,
    /// Pose of that frame in the body.
    pub frame: Placement,
    /// The class of what names none.
    pub childclass: Option<&'a str>,
}

/// The link of a body: its axes are the body's, its origin is the anchor of the last joint that moves it.
struct Hold {
    link: String,
    anchor_m: Vector3<f64>,
}

/// What an MJCF says of bodies and joints.
pub(super) struct Bodies<'a> {
    compiler: &'a Compiler,
    defaults: &'a Defaults,
    /// What actuators give, by joint.
    actuated: &'a HashMap<String, Actuated>,
    /// Meshes by name.
    meshes: &'a MeshAssets,
    /// Links without inertia, and joints.
    pub robot: Robot,
    /// The inertia of each link, or why it is not known: that matters only where the link moves.
    pub inertias: Vec<Result<Inertial, MjcfFault>>,
    /// Names that joints have.
    joint_names: HashSet<String>,
    /// Named places on links.
    sites: Vec<urdf_rs::Joint>,
    /// The link that each of them is on.
    pub links_of_sites: HashMap<String, String>,
    /// Sites that are called as a body is.
    pub namesakes: Vec<String>,
    /// Free joints, which are locked.
    pub free: Vec<String>,
    /// Rotor inertia by joint, kg m².
    pub armature_kg_m2: HashMap<String, f64>,
    /// Positions of joints in the pose of the file, rad or m.
    pub references: HashMap<String, f64>,
    /// What joints have and an arm does not.
    pub left_out: Vec<(LeftOut, String)>,
    /// Bodies whose weight is taken away.
    pub weightless: HashSet<String>,
    /// Equalities that hold bodies together beside the joints.
    pub loops: usize,
    /// What links collide with.
    pub shapes: Vec<LinkShape>,
}

impl<'a> Bodies<'a> {
    /// All that is in the `<worldbody>` of `root`.
    pub(super) fn of(
        root: &Element,
        compiler: &'a Compiler,
        defaults: &'a Defaults,
        actuated: &'a HashMap<String, Actuated>,
        meshes: &'a MeshAssets,
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
            joint_names: HashSet::new(),
            sites: Vec::new(),
            links_of_sites: HashMap::new(),
            namesakes: Vec::new(),
            free: Vec::new(),
            armature_kg_m2: HashMap::new(),
            references: HashMap::new(),
            left_out: Vec::new(),
            weightless: HashSet::new(),
            loops: 0,
            shapes: Vec::new(),
        };
        bodies.link(WORLD.to_owned(), Ok(Inertial::default()));
        let world = Hold { link: WORLD.to_owned(), anchor_m: Vector3::zeros() };
        for section in root.each("worldbody") {
            collect_joint_names(section, &mut bodies.joint_names);
        }
        for section in root.each("worldbody") {
            let parts = bodies.parts(section, section.text("childclass"))?;
            bodies.inner(&parts, &world)?;
        }
        bodies.add_sites();
        Ok(bodies)
    }

    /// What is in an element, frames resolved.
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

    /// The sites, shapes and bodies among the parts of the body `hold`.
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
            // Several may stand in one line.
            None => format!("unnamed body {} ({})", self.robot.links.len(), element.line()),
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

    /// The joints between `parent` and the body `name`, which the file has at `pose` in the body of that.
    fn joints(
        &mut self,
        name: &str,
        pose: &Placement,
        parent: &Hold,
        parts: &[Part<'_>],
    ) -> Result<Hold, MjcfFault> {
        let joints: Vec<&Part<'_>> = parts.iter().filter(|part| is_joint(part.element)).collect();
        let mut at = Hold { link: parent.link.clone(), anchor_m: Vector3::zeros() };
        // Pose of the body, as far as joints have moved it, in the frame of the link at hand.
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

    /// What a joint without a name is called, `before` others of its body `body`: as no other one is.
    fn name_of_unnamed(&mut self, body: &str, before: usize) -> String {
        let mut names = (before + 1..).map(|number| match number {
            1 => format!("{body}_joint"),
            _ => format!("{body}_joint{number}"),
        });
        // Numbers do not run out.
        let name = names.find(|name| !self.joint_names.contains(name)).unwrap_or_default();
        self.joint_names.insert(name.clone());
        name
    }

    fn joint(&mut self, name: String, joint: Joint, origin: &Placement, parent: &str, child: &str) {
        let unlimited = Actuated { effort: f64::INFINITY, ..Actuated::default() };
        let actuated = self.actuated.get(&name).copied().unwrap_or(unlimited);
        let effort = joint.effort.min(actuated.effort);
        // URDF says 0 where there is no limit.
        let effort = if effort.is_finite() { effort } else { 0.0 };
        let damping = joint.dynamics.damping + actuated.damping;
        let armature_kg_m2 = joint.armature_kg_m2 + actuated.armature_kg_m2;
        self.armature_kg_m2.insert(name.clone(), armature_kg_m2);
        self.references.insert(name.clone(), joint.reference);
        self.left_out.extend(joint.left_out.iter().map(|what| (*what, name.clone())));
        let joint_type = match joint.kind {
            // It is the world's: what an arm floats on, or something that lies beside it.
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

    /// What is wrong with a shape is told where the links with shapes are: the arm is the same without it.
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

    /// A place with a name is a link without mass.
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

    /// Bodies and sites may share a name; then it is the body's.
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

/// Names of all joints in an element.
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

/// What holds the link `child` where it is.
fn fixed(child: &str, origin: &Placement, parent: &str) -> urdf_rs::Joint {
    joint_between(format!("{child} (fixed)"), origin, parent, child)
}

/// A joint that does not move yet.
fn joint_between(name: String, origin: &Placement, parent: &str, child: &str) -> urdf_rs::Joint {
    urdf_rs::Joint {
        name,
        joint_type: JointType::Fixed,
        origin: Pose {
            xyz: Vec3(origin.translation_m.into()),
            rpy: Vec3(rpy_rad(&origin.rotation)),
        },
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
