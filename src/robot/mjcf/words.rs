//! Faults of the conversion into an arm, in the terms of MJCF: the checks themselves are those for URDFs.

use crate::robot::urdf::{Obstacle, UrdfFault, infinitely_thin, listed};

/// The message for a fault that was found in the bodies and joints of an MJCF.
pub(super) fn arm_fault(fault: &UrdfFault) -> String {
    match fault {
        UrdfFault::Duplicate { kind: "link", name } => {
            format!("the body \"{name}\" is there twice; names must be unique")
        }
        UrdfFault::ControlCharacter { kind: "link", name } => {
            UrdfFault::ControlCharacter { kind: "body", name: name.clone() }.to_string()
        }
        UrdfFault::NotOneChain { obstacles, proposal } => {
            let obstacles = list(obstacles);
            let remedy = match proposal {
                Some(proposal) => format!(
                    "name the last body of the arm behind the file, for example {proposal}: joints that are not on the way to \
                     it are taken as locked"
                ),
                None => "no arm of hinges begins at the world: take joints that are in its way out of a copy of the file"
                    .to_owned(),
            };
            format!("the joints are not one chain of hinges: {obstacles}; {remedy}")
        }
        UrdfFault::NoSuchLink { link, choice } => {
            format!("there is no body or site \"{link}\"; {}", to_choose_from(choice))
        }
        UrdfFault::OnTheWay { last, obstacles } => format!(
            "on the way to \"{last}\", {}; there only hinges that follow no other joint are understood: name a body that is \
             not behind these, or take the joint out of a copy of the file",
            list(obstacles)
        ),
        UrdfFault::MimicsNothing { joint, of } => format!(
            "joint \"{joint}\" follows \"{of}\" by an <equality>, which is not in the file or follows it in turn: where does it \
             stand? Take the joint out of a copy of the file"
        ),
        UrdfFault::NothingMoves => "no hinge is in it; an arm needs at least one".to_owned(),
        UrdfFault::NothingMovesUpTo { link, choice, .. } => format!(
            "\"{link}\" stands still: no joint moves on the way to it from the world; {}",
            to_choose_from(choice)
        ),
        UrdfFault::NoMass { link, joint } => format!(
            "body \"{link}\", moved by joint \"{joint}\", has no mass (no <inertial> and no geom that has mass), nor has any \
             body without joints in it; give it the manufacturer's <inertial>. (Between two joints of one body there is nothing \
             that has mass: give each joint a body.)"
        ),
        UrdfFault::InertiaWithoutMass { link } => format!(
            "body \"{link}\" has moments of inertia, but mass 0; give its mass, or take out <inertial>"
        ),
        UrdfFault::NotPositiveDefinite { link, principal_kg_m2 } => format!(
            "body \"{link}\": the inertia matrix is not positive definite: principal moments {} kg m2; check the signs, and the \
             order of fullinertia: xx yy zz xy xz yz",
            moments(principal_kg_m2)
        ),
        UrdfFault::InfinitelyThin { link, principal_kg_m2 } => {
            format!("body \"{link}\": {}", infinitely_thin(principal_kg_m2))
        }
        UrdfFault::Triangle { link, principal_kg_m2 } => format!(
            "body \"{link}\": principal moments {} kg m2 violate the triangle inequality (each must be less than the sum of the \
             other two): no body has them; check the moments, and the frame in which they are given",
            moments(principal_kg_m2)
        ),
        other => other.to_string(),
    }
}

fn to_choose_from(bodies: &[String]) -> String {
    match bodies {
        [] => "no body of the file ends an arm of hinges that begins at the world".to_owned(),
        bodies => format!(
            "name the last body of the arm: {}, or one that moves on the way to them",
            listed(bodies)
        ),
    }
}

fn moments([small, middle, large]: &[f64; 3]) -> String {
    format!("{small:.6e}, {middle:.6e}, {large:.6e}")
}

fn list(obstacles: &[Obstacle]) -> String {
    let words: Vec<String> = obstacles.iter().map(obstacle).collect();
    words.join(", ")
}

fn obstacle(obstacle: &Obstacle) -> String {
    match obstacle {
        Obstacle::JointType { joint, kind } => {
            let kind = match *kind {
                "prismatic" => "a slide",
                "spherical" => "a ball",
                other => other,
            };
            format!("joint \"{joint}\" is {kind}")
        }
        Obstacle::Mimic { joint, of } => {
            format!("joint \"{joint}\" follows \"{of}\" by an <equality>")
        }
        branch => branch.to_string(),
    }
}
