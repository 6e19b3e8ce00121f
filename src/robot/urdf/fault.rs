//! What makes a URDF unusable as an arm.

use thiserror::Error;

/// A URDF that is well-formed, but no serial arm of rigid bodies.
#[derive(Debug, Clone, PartialEq, Error)]
pub enum UrdfFault {
    /// No link at all.
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
    /// A link hangs on two joints, or a loop has no beginning.
    #[error(
        "the chain is closed at link \"{link}\" (joints \"{first}\" and \"{second}\"); an arm is open: remove one of them"
    )]
    ClosedChain {
        /// Where it closes.
        link: String,
        /// One joint that leads there.
        first: String,
        /// The other.
        second: String,
    },
    /// Links that no joint connects to the rest.
    #[error(
        "the links \"{first}\" and \"{second}\" are not connected; every link but the root needs a joint to its parent"
    )]
    Disconnected {
        /// A link of one part.
        first: String,
        /// A link of another.
        second: String,
    },
    /// Two moving joints on one body.
    #[error(
        "the chain branches behind \"{body}\": joints \"{first}\" and \"{second}\" both move; make the one that is not part of the arm fixed"
    )]
    Branched {
        /// Link or joint whose body carries both.
        body: String,
        /// One moving joint.
        first: String,
        /// The other.
        second: String,
    },
    /// A moving joint that is not a single rotation.
    #[error(
        "joint \"{joint}\" is {kind}; only revolute, continuous and fixed joints are understood: make it fixed or take it out"
    )]
    JointType {
        /// The joint.
        joint: String,
        /// Its type.
        kind: &'static str,
    },
    /// A joint that copies another.
    #[error(
        "joint \"{joint}\" mimics \"{of}\"; coupled joints are not understood: make it fixed or take it out"
    )]
    Mimic {
        /// The joint.
        joint: String,
        /// The joint it follows.
        of: String,
    },
    /// Only fixed joints.
    #[error("no joint moves; an arm needs at least one revolute joint")]
    NothingMoves,
    /// An axis without a direction, or whose length shows that something else was meant.
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
        /// What.
        quantity: &'static str,
        /// The value.
        value: f64,
    },
    /// A value on the wrong side of zero.
    #[error("{place}: {quantity} = {value} must not be negative")]
    Negative {
        /// Link or joint.
        place: String,
        /// What.
        quantity: &'static str,
        /// The value.
        value: f64,
    },
    /// Lower limit not below the upper one.
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
    /// Moments of inertia without mass.
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
