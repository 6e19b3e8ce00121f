//! The small part of XML that is needed to write it.

use nalgebra::{Matrix3, Vector3};

use crate::robot::{FixedFrame, LinkInertia};

/// Escapes text for a quoted attribute.
pub fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            c => out.push(c),
        }
    }
    out
}

/// Numbers separated by blanks, each with as many digits as it takes to read it back exactly.
pub fn numbers<'a>(values: impl IntoIterator<Item = &'a f64>) -> String {
    // −0 + 0 = 0: zero is written without a sign.
    let texts: Vec<String> = values.into_iter().map(|v| (v + 0.0).to_string()).collect();
    texts.join(" ")
}

/// Mass, centre of mass and the inertia tensor about it, for a body with mass.
pub fn about_com(link: &LinkInertia) -> (f64, Vector3<f64>, Matrix3<f64>) {
    let com = link.com_m().unwrap_or_default();
    (link.mass_kg(), com, link.inertia_com_kg_m2().unwrap_or_default())
}

/// The attributes of a URDF's `<inertia>`.
pub fn tensor(i: &Matrix3<f64>) -> String {
    format!(
        "ixx=\"{}\" ixy=\"{}\" ixz=\"{}\" iyy=\"{}\" iyz=\"{}\" izz=\"{}\"",
        numbers([&i[(0, 0)]]),
        numbers([&i[(0, 1)]]),
        numbers([&i[(0, 2)]]),
        numbers([&i[(1, 1)]]),
        numbers([&i[(1, 2)]]),
        numbers([&i[(2, 2)]]),
    )
}

/// The frames that are fixed in body `body`.
pub fn frames_of(frames: &[FixedFrame], body: usize) -> impl Iterator<Item = &FixedFrame> {
    frames.iter().filter(move |frame| frame.body == body)
}
