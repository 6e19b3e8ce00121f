//! Faults that make an MJCF unusable as an arm.

use thiserror::Error;

use super::words::arm_fault;
use crate::robot::urdf::UrdfFault;

/// Advice for a model that only MuJoCo itself can process.
const COMPILE: &str = "put saveinertial=\"true\" into <compiler>, load the model in MuJoCo and save it (mj_saveLastXML): what it writes then is read here";

/// A text that is not an MJCF, or not one of a serial arm of rigid bodies. A `place` reads like
/// `line 12: joint "elbow"`.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum MjcfFault {
    /// The text is not XML.
    #[error("{file}not readable as XML: {message}")]
    Xml {
        /// The included file and a colon; empty for the main one.
        file: String,
        /// The parser's message, with line and column.
        message: String,
    },
    /// The text is XML, but not an MJCF.
    #[error("{place}: an MJCF begins with <mujoco>; is it one?")]
    NotMjcf {
        /// The first element.
        place: String,
    },
    /// An included file that cannot be read.
    #[error("{place}: {file}: {reason}")]
    Include {
        /// The `<include>`.
        place: String,
        /// The file.
        file: String,
        /// Why.
        reason: String,
    },
    /// A file that is included twice, or includes itself.
    #[error("{place}: {file} is there already; MuJoCo includes a file once")]
    IncludedTwice {
        /// The second `<include>`.
        place: String,
        /// The file.
        file: String,
    },
    /// Elements are nested too deeply.
    #[error("{place} is nested too deeply")]
    TooDeep {
        /// The element.
        place: String,
    },
    /// A mandatory attribute is missing.
    #[error("{place}: {attribute} is missing")]
    Missing {
        /// The element.
        place: String,
        /// The attribute.
        attribute: &'static str,
    },
    /// A word where a number should be.
    #[error("{place}: {attribute}: \"{word}\" is no number")]
    NoNumber {
        /// The element.
        place: String,
        /// The attribute.
        attribute: &'static str,
        /// The word.
        word: String,
    },
    /// A number that is not finite, or too large for any quantity of an arm.
    #[error("{place}: {attribute} = {value:?} is not a number to calculate with")]
    NotFinite {
        /// The element.
        place: String,
        /// The attribute.
        attribute: &'static str,
        /// The value.
        value: f64,
    },
    /// An attribute with too many or too few numbers.
    #[error("{place}: {attribute} has {found} numbers instead of {needed}")]
    Count {
        /// The element.
        place: String,
        /// The attribute.
        attribute: &'static str,
        /// How many there are.
        found: usize,
        /// How many there should be, exactly or at most.
        needed: usize,
    },
    /// A negative value of a quantity that must not be negative.
    #[error("{place}: {attribute} = {value} must not be negative")]
    Negative {
        /// The element.
        place: String,
        /// The attribute.
        attribute: &'static str,
        /// The value.
        value: f64,
    },
    /// A word that is not allowed there.
    #[error("{place}: {attribute}=\"{value}\" is none of {choice}")]
    Keyword {
        /// The element.
        place: String,
        /// The attribute.
        attribute: &'static str,
        /// As written.
        value: String,
        /// The allowed words.
        choice: &'static str,
    },
    /// Two attributes that give the same quantity in different ways.
    #[error("{place} has both {first} and {second}; leave one of them out")]
    Both {
        /// The element.
        place: String,
        /// The first.
        first: &'static str,
        /// The second.
        second: &'static str,
    },
    /// A vector of zero length.
    #[error("{place}: {attribute} is zero, it has no direction")]
    NoDirection {
        /// The element.
        place: String,
        /// The attribute.
        attribute: &'static str,
    },
    /// The lower limit is not below the upper one.
    #[error(
        "{place}: {attribute}=\"{lower} {upper}\" leaves no range; the first number must be the smaller one"
    )]
    Range {
        /// The element.
        place: String,
        /// The attribute.
        attribute: &'static str,
        /// As written; 0 where missing.
        lower: f64,
        /// As written; 0 where missing.
        upper: f64,
    },
    /// A range without the attribute that says whether it is a limit.
    #[error(
        "{place} has {range} but not {limited}, and <compiler> says autolimits=\"false\", which MuJoCo refuses too; write {limited}=\"true\" where \
         the range is a limit, {limited}=\"false\" where it is none"
    )]
    LimitLeftOpen {
        /// The element.
        place: String,
        /// The attribute with the range.
        range: &'static str,
        /// The attribute that is missing.
        limited: &'static str,
    },
    /// A size of a solid that is not positive.
    #[error("{place}: number {number} of size is {size_m}; it must be positive")]
    Size {
        /// The geom.
        place: String,
        /// Which of its sizes, from 1 on.
        number: usize,
        /// As written; 0 where missing.
        size_m: f64,
    },
    /// An unknown default class.
    #[error("{place}: there is no <default class=\"{class}\">")]
    UnknownClass {
        /// The element.
        place: String,
        /// The class.
        class: String,
    },
    /// An unknown joint.
    #[error("{place}: there is no joint \"{joint}\" in <worldbody>; correct the name")]
    UnknownJoint {
        /// The element that names it.
        place: String,
        /// The joint.
        joint: String,
    },
    /// An unknown mesh.
    #[error("{place}: there is no <mesh> \"{mesh}\" in <asset>")]
    UnknownMesh {
        /// The geom.
        place: String,
        /// The mesh.
        mesh: String,
    },
    /// Something that only MuJoCo itself can process.
    #[error("{place}: {what} not read; {}", COMPILE)]
    Unread {
        /// The element.
        place: String,
        /// What is not read, with its verb, such as "copies are".
        what: &'static str,
    },
    /// A moving body whose inertia would have to come from a mesh.
    #[error(
        "body \"{body}\" has no <inertial>, and the mass of its geom ({geom}) would have to come from a mesh, which is not read; \
         give the body its <inertial>, or {}",
        COMPILE
    )]
    Mesh {
        /// The body.
        body: String,
        /// Line of the geom.
        geom: String,
    },
    /// Bodies and joints that do not form a serial arm.
    #[error("{}", arm_fault(.0))]
    Arm(UrdfFault),
}
