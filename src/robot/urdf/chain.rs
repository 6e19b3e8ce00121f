//! The tree of a URDF as one chain of bodies.

use std::collections::{HashMap, HashSet};

use urdf_rs::{Joint, JointType, Link, Robot};

use super::fault::UrdfFault;

/// Links that move as one, in the order in which fixed joints reach them.
#[derive(Debug, Default)]
pub(super) struct Body<'a> {
    /// The moving joint in front; `None` for the base.
    pub joint: Option<&'a Joint>,
    /// Its links, the one behind the joint first, each with the fixed joint that holds it and the
    /// position of its parent in this list (`None` for the first).
    pub links: Vec<(&'a Link, Option<(&'a Joint, usize)>)>,
    /// Position in `links` of the link that the next moving joint hangs on.
    pub next_parent: usize,
}

/// Base first, then one body per moving joint.
pub(super) fn bodies(robot: &Robot) -> Result<Vec<Body<'_>>, UrdfFault> {
    let links = links_by_name(robot)?;
    let children = children_by_link(robot, &links)?;
    let mut link = root(robot, &links)?;
    let mut joint = None;
    let mut chain = Vec::new();
    loop {
        let (body, next) = collect(link, joint, &links, &children)?;
        chain.push(body);
        let Some(moving) = next else { break };
        link = links[moving.child.link.as_str()];
        joint = Some(moving);
    }
    if chain.len() == 1 {
        return Err(UrdfFault::NothingMoves);
    }
    Ok(chain)
}

fn links_by_name(robot: &Robot) -> Result<HashMap<&str, &Link>, UrdfFault> {
    if robot.links.is_empty() {
        return Err(UrdfFault::NoLinks);
    }
    let mut links = HashMap::new();
    for link in &robot.links {
        if links.insert(link.name.as_str(), link).is_some() {
            return Err(UrdfFault::Duplicate { kind: "link", name: link.name.clone() });
        }
    }
    Ok(links)
}

/// Joints by the link they hang on, in the file's order.
fn children_by_link<'a>(
    robot: &'a Robot,
    links: &HashMap<&str, &Link>,
) -> Result<HashMap<&'a str, Vec<&'a Joint>>, UrdfFault> {
    let mut names = HashSet::new();
    let mut children: HashMap<&str, Vec<&Joint>> = HashMap::new();
    for joint in &robot.joints {
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

/// The one link without a parent, after making sure that every other link leads back to it.
fn root<'a>(robot: &'a Robot, links: &HashMap<&str, &'a Link>) -> Result<&'a Link, UrdfFault> {
    let mut holder: HashMap<&str, &Joint> = HashMap::new();
    for joint in &robot.joints {
        if let Some(first) = holder.insert(joint.child.link.as_str(), joint) {
            return Err(UrdfFault::ClosedChain {
                link: joint.child.link.clone(),
                first: first.name.clone(),
                second: joint.name.clone(),
            });
        }
    }
    let mut root: Option<&Link> = None;
    for link in &robot.links {
        let mut top = link;
        let mut steps = 0;
        while let Some(joint) = holder.get(top.name.as_str()) {
            steps += 1;
            if steps > robot.links.len() {
                let parent = joint.parent.link.as_str();
                return Err(UrdfFault::ClosedChain {
                    link: parent.to_owned(),
                    first: holder[parent].name.clone(),
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

/// The body that begins at `first`, and the moving joint on it.
fn collect<'a>(
    first: &'a Link,
    joint: Option<&'a Joint>,
    links: &HashMap<&str, &'a Link>,
    children: &HashMap<&str, Vec<&'a Joint>>,
) -> Result<(Body<'a>, Option<&'a Joint>), UrdfFault> {
    let mut body = Body { joint, links: vec![(first, None)], next_parent: 0 };
    let mut next: Option<&Joint> = None;
    let mut at = 0;
    while at < body.links.len() {
        let link = body.links[at].0;
        for child in children.get(link.name.as_str()).into_iter().flatten() {
            if !moves(child)? {
                body.links.push((links[child.child.link.as_str()], Some((child, at))));
            } else if let Some(other) = next {
                return Err(UrdfFault::Branched {
                    body: first.name.clone(),
                    first: other.name.clone(),
                    second: child.name.clone(),
                });
            } else {
                next = Some(child);
                body.next_parent = at;
            }
        }
        at += 1;
    }
    Ok((body, next))
}

fn moves(joint: &Joint) -> Result<bool, UrdfFault> {
    let kind = match joint.joint_type {
        JointType::Fixed => return Ok(false),
        JointType::Revolute | JointType::Continuous => match &joint.mimic {
            None => return Ok(true),
            Some(mimic) => {
                return Err(UrdfFault::Mimic {
                    joint: joint.name.clone(),
                    of: mimic.joint.clone(),
                });
            }
        },
        JointType::Prismatic => "prismatic",
        JointType::Floating => "floating",
        JointType::Planar => "planar",
        JointType::Spherical => "spherical",
    };
    Err(UrdfFault::JointType { joint: joint.name.clone(), kind })
}
