//! What makes an MJCF unusable as an arm.

use thiserror::Error;

use super::words::arm_fault;
use crate::robot::urdf::UrdfFault;

/// What to do with a model that only MuJoCo itself can work out.
const COMPILE: &str = "put saveinertial=\"true\" into <compiler>, load the model in MuJoCo and save it (mj_saveLastXML): what it writes then is read here";

/// A text that is no MJCF, or one that is not of a serial arm of rigid bodies. A `place` is such as `line 12: joint "elbow"`.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum MjcfFault {
    /// It is not XML.
    #[error("{file}not readable as XML: {message}")]
    Xml {
        /// The included file and a colon; empty for the main one.
        file: String,
        /// The parser's message, with line and column.
        message: String,
    },
    /// It is the XML of something else.
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
    /// Elements inside elements without end.
    #[error("{place} is nested too deeply")]
    TooDeep {
        /// The element.
        place: String,
    },
    /// An attribute that has to be there.
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
    /// A number that is not finite, or larger than any of an arm.
    #[error("{place}: {attribute} = {value:?} is not a number to calculate with")]
    NotFinite {
        /// The element.
        place: String,
        /// The attribute.
        attribute: &'static str,
        /// The value.
        value: f64,
    },
    /// Too many numbers, or too few.
    #[error("{place}: {attribute} has {found} numbers instead of {needed}")]
    Count {
        /// The element.
        place: String,
        /// The attribute.
        attribute: &'static str,
        /// How many there are.
        found: usize,
        /// How many there should be, or may be at most.
        needed: usize,
    },
    /// A value on the wrong side of zero.
    #[error("{place}: {attribute} = {value} must not be negative")]
    Negative {
        /// The element.
        place: String,
        /// The attribute.
        attribute: &'static str,
        /// The value.
        value: f64,
    },
    /// A word that means nothing there.
    #[error("{place}: {attribute}=\"{value}\" is none of {choice}")]
    Keyword {
        /// The element.
        place: String,
        /// The attribute.
        attribute: &'static str,
        /// As written.
        value: String,
        /// What may be written.
        choice: &'static str,
    },
    /// Two attributes that say the same in different ways.
    #[error("{place} has both {first} and {second}; leave one of them out")]
    Both {
        /// The element.
        place: String,
        /// The first.
        first: &'static str,
        /// The second.
        second: &'static str,
    },
    /// A vector without length.
    #[error("{place}: {attribute} is zero, it has no direction")]
    NoDirection {
        /// The element.
        place: String,
        /// The attribute.
        attribute: &'static str,
    },
    /// Lower limit not below the upper one.
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
    /// A range of which it is not said whether it limits.
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
    /// A solid without extent.
    #[error("{place}: number {number} of size is {size_m}; it must be positive")]
    Size {
        /// The geom.
        place: String,
        /// Which of its sizes, from 1 on.
        number: usize,
        /// As written; 0 where missing.
        size_m: f64,
    },
    /// A default class that is not in the file.
    #[error("{place}: there is no <default class=\"{class}\">")]
    UnknownClass {
        /// The element.
        place: String,
        /// The class.
        class: String,
    },
    /// A mesh that is not in the file.
    #[error("{place}: there is no <mesh> \"{mesh}\" in <asset>")]
    UnknownMesh {
        /// The geom.
        place: String,
        /// The mesh.
        mesh: String,
    },
    /// Something that only MuJoCo itself works out.
    #[error("{place}: {what} not read; {}", COMPILE)]
    Unread {
        /// The element.
        place: String,
        /// Such as "copies (replicate) are".
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
        /// Where the geom stands.
        geom: String,
    },
    /// Bodies and joints that are no serial arm.
    #[error("{}", arm_fault(.0))]
    Arm(UrdfFault),
}
