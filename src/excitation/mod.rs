//! How an arm is moved so that its parameters show.
//!
//! Enters: limits and clearance of an arm. Leaves: a [`Reference`] that a controller can follow.

mod reference;

pub use reference::Reference;
