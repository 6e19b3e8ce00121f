//! Right angles in files that print them with few digits.
//!
//! Axes that are parallel only up to the digits printed blur which parameters are identifiable.

use std::f64::consts::FRAC_PI_2;

use super::urdf::{UrdfNotice, unless_empty};

/// Half a unit of the fourth decimal: files print 1.5708 and 3.1416.
const PRINTED_RAD: f64 = 5e-5;
/// A smaller deviation from a right angle is not reported: it is the rounding of a number with many digits, and at the
/// end of an arm of 2 m it amounts to 2 nm.
const WORTH_SAYING_RAD: f64 = 1e-9;
/// An angle up to here from a right angle may be one, printed as 1.57 or 3.14, or a calibrated one.
const DOUBTFUL_RAD: f64 = 2e-3;

/// The angles of a file that are near multiples of π/2.
#[derive(Debug, Default)]
pub(super) struct RightAngles {
    /// Places of the angles that were taken as such a multiple, and their deviations from it, rad.
    taken: Vec<(String, f64)>,
    /// Places of the angles that were taken literally, the angles, and the multiples beside them, rad.
    literal: Vec<(String, f64, f64)>,
}

impl RightAngles {
    /// The angle that `written_rad` at `place` stands for.
    pub(super) fn read(&mut self, written_rad: f64, place: &str) -> f64 {
        let quarter_turns = (written_rad / FRAC_PI_2).round();
        let right_rad = quarter_turns * FRAC_PI_2;
        let off_rad = (written_rad - right_rad).abs();
        if off_rad < PRINTED_RAD {
            if off_rad > WORTH_SAYING_RAD {
                self.taken.push((place.to_owned(), off_rad));
            }
            return right_rad;
        }
        // Zero is never printed as anything else.
        if off_rad < DOUBTFUL_RAD && quarter_turns != 0.0 {
            self.literal.push((place.to_owned(), written_rad, right_rad));
        }
        written_rad
    }

    /// One notice about each kind.
    pub(super) fn notices(self) -> impl Iterator<Item = UrdfNotice> {
        let off_rad = self.taken.iter().map(|(_, off_rad)| *off_rad).fold(0.0, f64::max);
        let mut places: Vec<String> = Vec::new();
        for (place, _) in self.taken {
            if !places.contains(&place) {
                places.push(place);
            }
        }
        let taken = unless_empty(places, |places| UrdfNotice::RightAngles { places, off_rad });
        let literal = unless_empty(self.literal, |angles| UrdfNotice::NearRightAngles { angles });
        taken.into_iter().chain(literal)
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use super::*;

    /// The notices about an angle, and the angle that it stands for.
    fn read(written_rad: f64) -> (f64, Vec<String>) {
        let mut angles = RightAngles::default();
        let angle_rad = angles.read(written_rad, "joint \"j\"");
        (angle_rad, angles.notices().map(|notice| notice.to_string()).collect())
    }

    #[test]
    #[expect(clippy::approx_constant, reason = "printed digits are what is read")]
    fn a_right_angle_to_four_digits_is_one_and_one_to_two_digits_is_told() {
        for (written_rad, right_rad) in [(1.5708, FRAC_PI_2), (-3.1416, -PI), (3e-5, 0.0)] {
            let (angle_rad, told) = read(written_rad);
            assert_eq!((angle_rad, told.len()), (right_rad, 1), "{written_rad}: {told:?}");
            assert!(told[0].contains("are taken as these: joint \"j\""), "{told:?}");
        }
        for (written_rad, right) in [(1.57, "1.5707963"), (-3.14, "-3.1415927")] {
            let (angle_rad, told) = read(written_rad);
            assert_eq!((angle_rad, told.len()), (written_rad, 1), "{told:?}");
            let words = format!("joint \"j\" {written_rad} (of a right angle write {right})");
            assert!(told[0].ends_with(&words), "{told:?}");
        }
        for written_rad in [FRAC_PI_2, 0.0, 1e-3, 1.55] {
            assert_eq!(read(written_rad), (written_rad, Vec::new()));
        }
    }
}
