//! Writes identified numbers into the URDF that the arm came from.

mod markup;
mod share;
#[cfg(test)]
mod tests;

use std::path::Path;

use roxmltree::{Document, Node, ParsingOptions};
use thiserror::Error;

use self::markup::{Edits, Margins, child};
use self::share::Share;
use super::xml::{about_com, escaped, numbers, tensor};
use super::{ExportError, check_numbers};
use crate::robot::{Arm, Drive, LinkInertia, UrdfLink};

pub use self::share::{Rescaling, Unfit};

/// A URDF rewritten with the numbers of another arm of the same design.
#[derive(Debug, Clone, PartialEq)]
pub struct OwnUrdf {
    /// The text of the file.
    pub text: String,
    /// Bodies with links whose inertia was scaled to fit into them; `Display` puts each into words.
    pub rescalings: Vec<Rescaling>,
    /// One mesh file that is given relative to the folder of the URDF, where there is any.
    pub relative_mesh: Option<String>,
}

/// A URDF that the numbers of an arm cannot be written into.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum OwnUrdfError {
    /// The arm cannot be written into any URDF.
    #[error(transparent)]
    Arm(#[from] ExportError),
    /// The text is not strictly valid XML.
    #[error("{file}: cannot be rewritten, it is no proper XML: {message}; mend it there")]
    Xml {
        /// The file.
        file: String,
        /// The parser's message, with line and column.
        message: String,
    },
    /// A link or joint of the arm is not in the file.
    #[error(
        "{file}: the {kind} \"{name}\" is not there; give the file from which the arm was read"
    )]
    Missing {
        /// The file.
        file: String,
        /// `link` or `joint`.
        kind: &'static str,
        /// Its name.
        name: String,
    },
    /// No link is directly behind one of the joints.
    #[error(
        "{file}: no link of it is moved by joint \"{joint}\"; give the file from which the arm was read"
    )]
    NothingMoved {
        /// The file.
        file: String,
        /// The joint.
        joint: String,
    },
}

/// The URDF `text` with the bodies and the friction of `arm`, which was read from it with these `links`; `source` names
/// it in messages.
///
/// - `<inertial>`: one link of each body, the bearer, gets the inertia of the body less that of the links fixed to it,
///   which keep their own. The bearer is the link directly behind the joint, or the first link with mass if that one
///   has none. Where no body can have the remaining inertia, that of the other links is multiplied by one factor, about
///   the largest that leaves a possible one (a [`Rescaling`]).
/// - `<dynamics>` of the arm's joints: `damping` is rv, `friction` is rc.
/// - `name`: a robot without a name gets that of the arm.
/// - Everything else stays the same, byte for byte. What a URDF has no place for is in the
///   [`drive_file`](super::drive_file).
///
/// # Errors
///
/// [`OwnUrdfError`] for an arm that could not run, and for a text that is not the arm's URDF.
pub fn own_urdf(
    text: &str,
    source: &str,
    arm: &Arm,
    links: &[UrdfLink],
) -> Result<OwnUrdf, OwnUrdfError> {
    check_numbers(arm)?;
    let file = || source.to_owned();
    // A document type declaration is skipped, as it is when a URDF is read.
    let options = ParsingOptions { allow_dtd: true, ..ParsingOptions::default() };
    let document = Document::parse_with_options(text, options)
        .map_err(|e| OwnUrdfError::Xml { file: file(), message: e.to_string() })?;
    let robot = document.root_element();
    let find = |kind: &'static str, name: &str| {
        robot
            .children()
            .find(|node| node.has_tag_name(kind) && node.attribute("name") == Some(name))
            .ok_or_else(|| OwnUrdfError::Missing { file: file(), kind, name: name.to_owned() })
    };
    let mut edits = Edits::new(text);
    if robot.attribute("name").unwrap_or_default().is_empty() {
        // It would be called after its new file, and the drive file and the results name the arm.
        let name = escaped(&arm.name).replace('\'', "&apos;");
        edits.set_attributes(robot, &[("name", name)]);
    }
    let mut rescalings = Vec::new();
    for (number, joint) in arm.joints.iter().enumerate() {
        let body: Vec<&UrdfLink> = links.iter().filter(|link| link.body == number + 1).collect();
        let Some(share) = Share::of(joint, &body) else {
            return Err(OwnUrdfError::NothingMoved { file: file(), joint: joint.name.clone() });
        };
        write_inertial(&mut edits, find("link", &share.bearer.name)?, &share.inertia);
        for (link, inertia) in &share.scaled {
            write_inertial(&mut edits, find("link", &link.name)?, inertia);
        }
        rescalings.extend(share.rescaling);
        write_dynamics(&mut edits, find("joint", &joint.name)?, &joint.drive);
    }
    let relative_mesh = robot
        .descendants()
        .filter(|node| node.has_tag_name("mesh"))
        .filter_map(|mesh| mesh.attribute("filename"))
        .find(|name| !name.contains("://") && !Path::new(name).is_absolute())
        .map(str::to_owned);
    Ok(OwnUrdf { text: edits.applied(), rescalings, relative_mesh })
}

fn write_inertial(edits: &mut Edits<'_>, link: Node<'_, '_>, inertia: &LinkInertia) {
    let prefix = edits.prefix(link);
    let write = |margins: &Margins| inertial(inertia, prefix, margins);
    match child(link, "inertial") {
        Some(old) => edits.replace(old, write),
        None => edits.put_first(link, write),
    }
}

/// The `<inertial>` element, about the centre of mass in the link's axes.
fn inertial(link: &LinkInertia, prefix: &str, Margins { own, inner }: &Margins) -> String {
    let (mass_kg, com, central) = about_com(link);
    format!(
        "<{prefix}inertial>{inner}<{prefix}origin xyz=\"{}\" rpy=\"0 0 0\"/>{inner}<{prefix}mass value=\"{mass_kg}\"/>{inner}\
         <{prefix}inertia {}/>{own}</{prefix}inertial>",
        numbers(com.iter()),
        tensor(&central)
    )
}

fn write_dynamics(edits: &mut Edits<'_>, joint: Node<'_, '_>, drive: &Drive) {
    let damping = numbers([&drive.viscous_nm_s_rad]);
    let friction = numbers([&drive.coulomb_nm]);
    match child(joint, "dynamics") {
        Some(old) => edits.set_attributes(old, &[("damping", damping), ("friction", friction)]),
        None => {
            let prefix = edits.prefix(joint);
            let new = format!("<{prefix}dynamics damping=\"{damping}\" friction=\"{friction}\"/>");
            edits.put_last(joint, new);
        }
    }
}
