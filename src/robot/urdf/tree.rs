//! The links and joints of a URDF as a tree.

use std::collections::{HashMap, HashSet};

use urdf_rs::{Joint, Link, Robot};

use super::fault::{UrdfFault, plain_name};

/// Links that are all connected to one root, each by one joint to its parent.
pub(super) struct Tree<'a> {
    robot: &'a Robot,
    links: HashMap<&'a str, &'a Link>,
    /// Joints by their parent link, in the file's order.
    children: HashMap<&'a str, Vec<&'a Joint>>,
    /// Joints by their child link.
    holders: HashMap<&'a str, &'a Joint>,
    root: &'a Link,
}

impl<'a> Tree<'a> {
    /// The tree of a file, or the reason why it is none.
    pub(super) fn of(robot: &'a Robot) -> Result<Self, UrdfFault> {
        let links = links_by_name(robot)?;
        let children = children_by_link(robot, &links)?;
        let holders = holders_by_link(robot)?;
        let root = root(robot, &links, &holders)?;
        Ok(Self { robot, links, children, holders, root })
    }

    /// The link without a parent.
    pub(super) fn root(&self) -> &'a Link {
        self.root
    }

    /// All links, in the file's order.
    pub(super) fn all_links(&self) -> &'a [Link] {
        &self.robot.links
    }

    /// All joints, in the file's order.
    pub(super) fn joints(&self) -> &'a [Joint] {
        &self.robot.joints
    }

    /// The joint of this name.
    pub(super) fn joint(&self, name: &str) -> Option<&'a Joint> {
        self.joints().iter().find(|joint| joint.name == name)
    }

    /// The link of this name.
    pub(super) fn link(&self, name: &str) -> Option<&'a Link> {
        self.links.get(name).copied()
    }

    /// The child link of `joint`.
    pub(super) fn behind(&self, joint: &Joint) -> &'a Link {
        self.links[joint.child.link.as_str()]
    }

    /// The joints whose parent is `link`.
    pub(super) fn joints_on(&self, link: &Link) -> &[&'a Joint] {
        self.children.get(link.name.as_str()).map(Vec::as_slice).unwrap_or_default()
    }

    /// The joints from the root to `link`.
    pub(super) fn way_to(&self, link: &Link) -> Vec<&'a Joint> {
        let mut way = Vec::new();
        let mut name = link.name.as_str();
        while let Some(&joint) = self.holders.get(name) {
            way.push(joint);
            name = joint.parent.link.as_str();
        }
        way.reverse();
        way
    }

    /// Whether another joint mimics `joint`.
    pub(super) fn is_mimicked(&self, joint: &Joint) -> bool {
        self.joints()
            .iter()
            .any(|other| other.mimic.as_ref().is_some_and(|mimic| mimic.joint == joint.name))
    }
}

fn links_by_name(robot: &Robot) -> Result<HashMap<&str, &Link>, UrdfFault> {
    if robot.links.is_empty() {
        return Err(UrdfFault::NoLinks);
    }
    let mut links = HashMap::new();
    for link in &robot.links {
        plain_name("link", &link.name)?;
        if links.insert(link.name.as_str(), link).is_some() {
            return Err(UrdfFault::Duplicate { kind: "link", name: link.name.clone() });
        }
    }
    Ok(links)
}

fn children_by_link<'a>(
    robot: &'a Robot,
    links: &HashMap<&str, &Link>,
) -> Result<HashMap<&'a str, Vec<&'a Joint>>, UrdfFault> {
    let mut names = HashSet::new();
    let mut children: HashMap<&str, Vec<&Joint>> = HashMap::new();
    for joint in &robot.joints {
        plain_name("joint", &joint.name)?;
        if !names.insert(joint.name.as_str()) {
            return Err(UrdfFault::Duplicate { kind: "joint", name: joint.name.clone() });
        }
        for (role, end) in [("parent", &joint.parent), ("child", &joint.child)] {
            if !links.contains_key(end.link.as_str()) {
                return Err(UrdfFault::UnknownLink {
                    joint: joint.name.clone(),
                    role,
                    link: end.link.clone(),
                });
            }
        }
        children.entry(joint.parent.link.as_str()).or_default().push(joint);
    }
    Ok(children)
}

fn holders_by_link(robot: &Robot) -> Result<HashMap<&str, &Joint>, UrdfFault> {
    let mut holders: HashMap<&str, &Joint> = HashMap::new();
    for joint in &robot.joints {
        if let Some(first) = holders.insert(joint.child.link.as_str(), joint) {
            return Err(UrdfFault::ClosedChain {
                link: joint.child.link.clone(),
                first: first.name.clone(),
                second: joint.name.clone(),
            });
        }
    }
    Ok(holders)
}

/// The one link without a parent, after checking that every other link leads back to it.
fn root<'a>(
    robot: &'a Robot,
    links: &HashMap<&str, &'a Link>,
    holders: &HashMap<&str, &Joint>,
) -> Result<&'a Link, UrdfFault> {
    let mut root: Option<&Link> = None;
    for link in &robot.links {
        let mut top = link;
        let mut steps = 0;
        while let Some(joint) = holders.get(top.name.as_str()) {
            steps += 1;
            if steps > robot.links.len() {
                let parent = joint.parent.link.as_str();
                return Err(UrdfFault::ClosedChain {
                    link: parent.to_owned(),
                    first: holders[parent].name.clone(),
                    second: joint.name.clone(),
                });
            }
            top = links[joint.parent.link.as_str()];
        }
        match root {
            Some(known) if known.name != top.name => {
                return Err(UrdfFault::Disconnected {
                    first: known.name.clone(),
                    second: top.name.clone(),
                });
            }
            _ => root = Some(top),
        }
    }
    root.ok_or(UrdfFault::NoLinks)
}
