//! Colours: the same meaning has the same colour in every figure of a report.
//!
//! The qualitative colours are those of M. Okabe and K. Ito, "Color Universal Design" (2008), which remain
//! distinguishable under the common colour-vision deficiencies. Their yellow is left out because thin yellow lines
//! vanish on white paper; the other colours are slightly darkened for the same reason.

use crate::report::Status;

/// An sRGB colour.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Colour {
    /// Red, 0 to 255.
    pub red: u8,
    /// Green, 0 to 255.
    pub green: u8,
    /// Blue, 0 to 255.
    pub blue: u8,
}

impl Colour {
    const fn rgb(red: u8, green: u8, blue: u8) -> Self {
        Self { red, green, blue }
    }

    /// Measured, true or given values: what the robot did.
    pub const MEASURED: Self = Self::rgb(0x33, 0x3d, 0x47);
    /// Values computed by the model.
    pub const MODEL: Self = Self::rgb(0xd5, 0x5e, 0x00);
    /// A reference in the background.
    pub const REFERENCE: Self = Self::rgb(0x8a, 0x94, 0x9e);
    /// Before a change.
    pub const BEFORE: Self = Self::rgb(0xd5, 0x5e, 0x00);
    /// After a change.
    pub const AFTER: Self = Self::rgb(0x00, 0x6b, 0xac);

    pub(super) const INK: Self = Self::rgb(0x1f, 0x29, 0x33);
    pub(super) const MUTED: Self = Self::rgb(0x5f, 0x6b, 0x76);
    pub(super) const AXIS: Self = Self::rgb(0xa3, 0xac, 0xb5);
    pub(super) const GRID: Self = Self::rgb(0xe6, 0xe9, 0xec);
    pub(super) const GRID_MINOR: Self = Self::rgb(0xf2, 0xf4, 0xf5);
    pub(super) const STRIPE: Self = Self::rgb(0xf6, 0xf8, 0xf9);
    pub(super) const PAPER: Self = Self::rgb(0xff, 0xff, 0xff);

    /// Colour of series `k` (0-based); repeats after [`Colour::DISTINCT`].
    pub fn series(k: usize) -> Self {
        SERIES[k % SERIES.len()]
    }

    /// Number of distinguishable series colours.
    pub const DISTINCT: usize = SERIES.len();

    /// Colour of a verdict.
    pub fn status(status: Status) -> Self {
        match status {
            Status::Good => Self::rgb(0x0b, 0x7a, 0x5b),
            Status::Warn => Self::rgb(0xc2, 0x7c, 0x00),
            Status::Bad => Self::rgb(0xc0, 0x39, 0x2b),
        }
    }

    /// Mixture of two colours: `self` at `fraction` 0, `other` at 1.
    pub(super) fn towards(self, other: Self, fraction: f64) -> Self {
        let mix =
            |a: u8, b: u8| (f64::from(a) + (f64::from(b) - f64::from(a)) * fraction).round() as u8;
        Self::rgb(
            mix(self.red, other.red),
            mix(self.green, other.green),
            mix(self.blue, other.blue),
        )
    }
}

const SERIES: [Colour; 7] = [
    Colour::rgb(0x00, 0x6b, 0xac),
    Colour::rgb(0xd5, 0x5e, 0x00),
    Colour::rgb(0x00, 0x8f, 0x6b),
    Colour::rgb(0xb8, 0x5c, 0x94),
    Colour::rgb(0xd4, 0x90, 0x00),
    Colour::rgb(0x3f, 0xa3, 0xdb),
    Colour::rgb(0x33, 0x3d, 0x47),
];
