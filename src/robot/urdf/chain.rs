//! Selection of one chain of bodies in the tree of a URDF.

use urdf_rs::{Joint, JointType, Link};

use super::fault::UrdfFault;
use super::obstacle::Obstacle;
use super::tree::Tree;
use super::words::FEW;

/// Links that move as one rigid body, in the order in which the joints between them are reached from the first.
#[derive(Debug)]
pub(super) struct Body<'a> {
    /// The moving joint in front of the body; `None` for the base.
    pub joint: Option<&'a Joint>,
    /// Its links, the one directly behind the joint first. Each comes with the fixed or locked joint that holds it and
    /// the position of its parent in this list (`None` for the first).
    pub links: Vec<(&'a Link, Option<(&'a Joint, usize)>)>,
    /// Position in `links` of the link that carries the next moving joint.
    pub next_parent: usize,
}

/// The base, then one body per joint of `moving`. These joints are ordered from the root on; all other joints stand
/// still.
pub(super) fn bodies<'a>(tree: &Tree<'a>, moving: &[&'a Joint]) -> Vec<Body<'a>> {
    let in_front = std::iter::once(None).chain(moving.iter().copied().map(Some));
    let behind = moving.iter().copied().map(Some).chain(std::iter::once(None));
    in_front.zip(behind).map(|(joint, next)| body(tree, joint, next)).collect()
}

/// The body behind `joint`, up to the joint `next`.
fn body<'a>(tree: &Tree<'a>, joint: Option<&'a Joint>, next: Option<&Joint>) -> Body<'a> {
    let first = joint.map_or(tree.root(), |joint| tree.behind(joint));
    let mut body = Body { joint, links: vec![(first, None)], next_parent: 0 };
    let mut at = 0;
    while at < body.links.len() {
        for &child in tree.joints_on(body.links[at].0) {
            if next.is_some_and(|next| next.name == child.name) {
                body.next_parent = at;
            } else {
                body.links.push((tree.behind(child), Some((child, at))));
            }
        }
        at += 1;
    }
    body
}

/// The joints that move the link `last`, from the root on. `is_arm` tells whether an arm that ends with a given link
/// can be read; only such links are proposed in an error.
pub(super) fn joints_up_to<'a>(
    tree: &Tree<'a>,
    last: &str,
    is_arm: impl Fn(&str) -> bool,
) -> Result<Vec<&'a Joint>, UrdfFault> {
    let Some(link) = tree.link(last) else {
        let choice = choice(tree, is_arm);
        return Err(UrdfFault::NoSuchLink { link: last.to_owned(), choice });
    };
    let joints = moving_on_way(tree, link);
    let obstacles: Vec<Obstacle> = joints.iter().filter_map(|joint| Obstacle::of(joint)).collect();
    if !obstacles.is_empty() {
        return Err(UrdfFault::OnTheWay { last: last.to_owned(), obstacles });
    }
    if joints.is_empty() {
        let (link, root) = (last.to_owned(), tree.root().name.clone());
        return Err(UrdfFault::NothingMovesUpTo { link, root, choice: choice(tree, is_arm) });
    }
    Ok(joints)
}

/// The joints between the root and `link` that are not fixed.
fn moving_on_way<'a>(tree: &Tree<'a>, link: &Link) -> Vec<&'a Joint> {
    let mut joints = tree.way_to(link);
    joints.retain(|joint| joint.joint_type != JointType::Fixed);
    joints
}

/// Links with which an arm can end; if there are many, only those that carry none of the others.
fn choice(tree: &Tree<'_>, is_arm: impl Fn(&str) -> bool) -> Vec<String> {
    let can_be_last = |link: &&Link| {
        let joints = moving_on_way(tree, link);
        // `is_arm` is asked only about links that move: for a link that does not, reading the arm would call this
        // function again.
        !joints.is_empty()
            && joints.iter().all(|joint| Obstacle::of(joint).is_none())
            && is_arm(&link.name)
    };
    let links: Vec<&Link> = tree.all_links().iter().filter(can_be_last).collect();
    let carries_another = |link: &&Link| {
        let mut behind = tree.joints_on(link).iter().map(|joint| tree.behind(joint));
        behind.any(|next| links.iter().any(|other| other.name == next.name))
    };
    // An error lists all links if they are few.
    let are_many = links.len() > FEW;
    let named = links.iter().copied().filter(|link| !are_many || !carries_another(link));
    named.map(|link| link.name.clone()).collect()
}

/// All moving joints, if they form one chain of revolute joints; `file` is the beginning of a proposed `FILE#LINK`.
pub(super) fn all_joints<'a>(tree: &Tree<'a>, file: &str) -> Result<Vec<&'a Joint>, UrdfFault> {
    let mut moving = Vec::new();
    let mut obstacles = Vec::new();
    let mut branches = Vec::new();
    let mut firsts = vec![tree.root()];
    let mut at = 0;
    while at < firsts.len() {
        let first = firsts[at];
        let (_, joints) = rigid(tree, first);
        let turning: Vec<&Joint> =
            joints.iter().copied().filter(|joint| Obstacle::of(joint).is_none()).collect();
        if turning.len() > 1 {
            let joints = turning.iter().map(|joint| joint.name.clone()).collect();
            branches.push(Obstacle::Branch { body: first.name.clone(), joints });
        }
        for joint in joints {
            obstacles.extend(Obstacle::of(joint));
            firsts.push(tree.behind(joint));
            moving.push(joint);
        }
        at += 1;
    }
    obstacles.append(&mut branches);
    if !obstacles.is_empty() {
        let proposal = last_link(tree).map(|link| format!("{file}#{}", link.name));
        return Err(UrdfFault::NotOneChain { obstacles, proposal });
    }
    if moving.is_empty() {
        return Err(UrdfFault::NothingMoves);
    }
    Ok(moving)
}

/// The links that fixed joints connect to `first`, each with the number of these joints, and the moving joints that
/// these links carry.
fn rigid<'a>(tree: &Tree<'a>, first: &'a Link) -> (Vec<(&'a Link, usize)>, Vec<&'a Joint>) {
    let mut links = vec![(first, 0)];
    let mut moving = Vec::new();
    let mut at = 0;
    while at < links.len() {
        let (link, fixed) = links[at];
        for &joint in tree.joints_on(link) {
            if joint.joint_type == JointType::Fixed {
                links.push((tree.behind(joint), fixed + 1));
            } else {
                moving.push(joint);
            }
        }
        at += 1;
    }
    (links, moving)
}

/// The last link of what is likely the arm: of the last body in the longest chain of revolute joints that begins at the
/// root, the link behind the most fixed joints. Of equals, the first.
fn last_link<'a>(tree: &Tree<'a>) -> Option<&'a Link> {
    let mut bodies: Vec<(&Link, Option<&Joint>, usize)> = vec![(tree.root(), None, 0)];
    let mut best: Option<(&Link, usize)> = None;
    let mut at = 0;
    while at < bodies.len() {
        let (first, joint, count) = bodies[at];
        let (links, joints) = rigid(tree, first);
        // A joint at the end of a chain that other joints mimic drives a gripper.
        let may_be_last = joint.is_some_and(|joint| !tree.is_mimicked(joint));
        if may_be_last && best.is_none_or(|(_, most)| count > most) {
            let last = links.iter().rev().max_by_key(|(_, fixed)| *fixed);
            best = last.map(|(link, _)| (*link, count));
        }
        let turning = joints.into_iter().filter(|joint| Obstacle::of(joint).is_none());
        bodies.extend(turning.map(|joint| (tree.behind(joint), Some(joint), count + 1)));
        at += 1;
    }
    best.map(|(link, _)| link)
}
