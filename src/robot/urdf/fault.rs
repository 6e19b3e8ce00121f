//! Faults that make a URDF unusable as an arm.

use thiserror::Error;

use super::obstacle::Obstacle;
use super::words::listed;

/// A well-formed URDF that does not describe a serial arm of rigid bodies.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum UrdfFault {
    /// The file has no link.
    #[error("it has no <link>; is it a URDF? (expand .xacro files first)")]
    NoLinks,
    /// A name is used twice.
    #[error("the {kind} \"{name}\" is there twice; names must be unique")]
    Duplicate {
        /// `link` or `joint`.
        kind: &'static str,
        /// The name.
        name: String,
    },
    /// A name that other files cannot hold.
    #[error(
        "the name of the {kind} {name:?} has a control character (a line break or the like), which other programs cannot read: \
         rename it"
    )]
    ControlCharacter {
        /// `robot`, `link`, `joint` or the like.
        kind: &'static str,
        /// The name.
        name: String,
    },
    /// A joint names a link that does not exist.
    #[error("joint \"{joint}\": its {role} link \"{link}\" is not in the file")]
    UnknownLink {
        /// The joint.
        joint: String,
        /// `parent` or `child`.
        role: &'static str,
        /// The missing link.
        link: String,
    },
    /// A link has two parent joints, or a loop has no beginning.
    #[error(
        "the chain is closed at link \"{link}\" (joints \"{first}\" and \"{second}\"); an arm is open: remove one of them"
    )]
    ClosedChain {
        /// The link at which the chain closes.
        link: String,
        /// One joint that leads to it.
        first: String,
        /// The other.
        second: String,
    },
    /// Links that no joint connects to the others.
    #[error(
        "the links \"{first}\" and \"{second}\" are not connected; every link but the root needs a joint to its parent"
    )]
    Disconnected {
        /// A link of one part.
        first: String,
        /// A link of another.
        second: String,
    },
    /// The moving joints are not one chain of revolute joints.
    #[error("{}", not_one_chain(obstacles, proposal.as_deref()))]
    NotOneChain {
        /// Everything that prevents such a chain.
        obstacles: Vec<Obstacle>,
        /// File and last link of what is likely the arm, as `FILE.urdf#LINK`.
        proposal: Option<String>,
    },
    /// The last link of the arm is not in the file.
    #[error("there is no link \"{link}\"; {}", to_choose_from(choice))]
    NoSuchLink {
        /// What was asked for.
        link: String,
        /// Links with which an arm can end.
        choice: Vec<String>,
    },
    /// Joints between the root and the last link of the arm that an arm does not have.
    #[error(
        "on the way to link \"{last}\", {}; there only revolute and continuous joints that follow no other are \
         understood: name a link that is not behind these, or make them fixed in a copy of the file",
        list(obstacles)
    )]
    OnTheWay {
        /// The last link of the arm.
        last: String,
        /// All of these joints.
        obstacles: Vec<Obstacle>,
    },
    /// A locked joint mimics a joint that does not exist, or in the end itself.
    #[error(
        "joint \"{joint}\" mimics \"{of}\", which is not in the file or follows it in turn: where does it stand? Make it \
         fixed in a copy of the file"
    )]
    MimicsNothing {
        /// The joint.
        joint: String,
        /// The joint it follows.
        of: String,
    },
    /// All joints are fixed.
    #[error("no joint moves; an arm needs at least one revolute joint")]
    NothingMoves,
    /// The link named as the last of the arm is part of the base.
    #[error(
        "link \"{link}\" stands still: no joint moves on the way to it from the root link \"{root}\"; {}",
        to_choose_from(choice)
    )]
    NothingMovesUpTo {
        /// The link that was named.
        link: String,
        /// The root link.
        root: String,
        /// Links with which an arm can end.
        choice: Vec<String>,
    },
    /// An axis of zero length, or whose length shows that something else was meant.
    #[error("joint \"{joint}\": the axis ({}, {}, {}) has length {length}; it must be a unit vector", axis[0], axis[1], axis[2])]
    Axis {
        /// The joint.
        joint: String,
        /// As written.
        axis: [f64; 3],
        /// Its Euclidean length.
        length: f64,
    },
    /// A number that is not finite.
    #[error("{place}: {quantity} = {value} is not a number to calculate with")]
    NotFinite {
        /// Link or joint.
        place: String,
        /// The quantity.
        quantity: &'static str,
        /// The value.
        value: f64,
    },
    /// A negative value of a quantity that must not be negative.
    #[error("{place}: {quantity} = {value} must not be negative")]
    Negative {
        /// Link or joint.
        place: String,
        /// The quantity.
        quantity: &'static str,
        /// The value.
        value: f64,
    },
    /// The lower limit is not below the upper one.
    #[error(
        "joint \"{joint}\": lower = {lower_rad} and upper = {upper_rad} rad leave no range; give <limit lower= upper= velocity= effort=>, or make the joint continuous"
    )]
    Range {
        /// The joint.
        joint: String,
        /// As written; 0 where missing.
        lower_rad: f64,
        /// As written; 0 where missing.
        upper_rad: f64,
    },
    /// The soft limits leave nothing of the range.
    #[error(
        "joint \"{joint}\": its soft limits {} to {} rad (<safety_controller>) leave nothing of its range {} to {} rad; correct one of them",
        soft[0], soft[1], range[0], range[1]
    )]
    SoftRange {
        /// The joint.
        joint: String,
        /// Its range, rad.
        range: [f64; 2],
        /// The soft limits as written, rad; 0 where missing.
        soft: [f64; 2],
    },
    /// A moving body without mass.
    #[error(
        "link \"{link}\", moved by joint \"{joint}\", has no mass (no <inertial>, or mass 0), nor has any link fixed to it; give it the manufacturer's <inertial>"
    )]
    NoMass {
        /// The link behind the joint.
        link: String,
        /// The joint.
        joint: String,
    },
    /// A link with moments of inertia but no mass.
    #[error(
        "link \"{link}\" has moments of inertia, but mass 0; give its mass, or take out <inertial>"
    )]
    InertiaWithoutMass {
        /// The link.
        link: String,
    },
    /// A principal moment of inertia is not positive.
    #[error(
        "link \"{link}\": the inertia matrix is not positive definite: principal moments {:.6e}, {:.6e}, {:.6e} kg m2; check the signs and the products ixy, ixz, iyz",
        principal_kg_m2[0], principal_kg_m2[1], principal_kg_m2[2]
    )]
    NotPositiveDefinite {
        /// The link.
        link: String,
        /// Principal moments about the centre of mass, ascending.
        principal_kg_m2: [f64; 3],
    },
    /// The principal moments are those of a plate without thickness.
    #[error("link \"{link}\": {}", infinitely_thin(principal_kg_m2))]
    InfinitelyThin {
        /// The link.
        link: String,
        /// Principal moments about the centre of mass, ascending.
        principal_kg_m2: [f64; 3],
    },
    /// No distribution of mass has these principal moments.
    #[error(
        "link \"{link}\": principal moments {:.6e}, {:.6e}, {:.6e} kg m2 violate the triangle inequality (each must be less than the sum of the other two): no body has them; check the inertia matrix and the frame it is given in",
        principal_kg_m2[0], principal_kg_m2[1], principal_kg_m2[2]
    )]
    Triangle {
        /// The link.
        link: String,
        /// Principal moments about the centre of mass, ascending.
        principal_kg_m2: [f64; 3],
    },
}

/// What to do about the moments of a plate without thickness.
pub(in crate::robot) fn infinitely_thin([small, middle, large]: &[f64; 3]) -> String {
    format!(
        "principal moments {small:.6e}, {middle:.6e}, {large:.6e} kg m2 are those of an infinitely thin plate (the largest is the sum of the \
         others), and every body has a thickness: make the largest a little smaller, for example by 0.1 %"
    )
}

/// Refuses a name with control characters: XML has no place for most of them, and changes the others.
pub(in crate::robot) fn plain_name(kind: &'static str, name: &str) -> Result<(), UrdfFault> {
    if name.chars().any(char::is_control) {
        return Err(UrdfFault::ControlCharacter { kind, name: name.to_owned() });
    }
    Ok(())
}

/// Refuses NaN and infinite values.
pub(super) fn finite(place: &str, quantity: &'static str, value: f64) -> Result<(), UrdfFault> {
    if value.is_finite() {
        return Ok(());
    }
    Err(UrdfFault::NotFinite { place: place.to_owned(), quantity, value })
}

/// A name for messages, such as `joint "elbow"`.
pub(super) fn quoted(kind: &str, name: &str) -> String {
    format!("{kind} \"{name}\"")
}

fn list(obstacles: &[Obstacle]) -> String {
    let words: Vec<String> = obstacles.iter().map(ToString::to_string).collect();
    words.join(", ")
}

fn to_choose_from(links: &[String]) -> String {
    if links.is_empty() {
        return "no link of the file ends an arm of revolute joints that begins at the root link"
            .to_owned();
    }
    format!(
        "name the last link of the arm: {}, or one that moves on the way to them",
        listed(links)
    )
}

fn not_one_chain(obstacles: &[Obstacle], proposal: Option<&str>) -> String {
    let obstacles = list(obstacles);
    let remedy = match proposal {
        Some(proposal) => format!(
            "name the last link of the arm behind the file, for example {proposal}: joints that are not on the way to it are \
             taken as locked"
        ),
        None => "no arm of revolute joints begins at the root link: make what is in its way fixed in a copy of the file"
            .to_owned(),
    };
    format!("the joints that move are not one chain of revolute joints: {obstacles}; {remedy}")
}
