//! Remarks that are collected joint by joint and link by link, and reported in one line for each subject.

use super::notice::UrdfNotice;

/// Remarks by subject.
#[derive(Debug, Default)]
pub(super) struct Remarks {
    /// Joints without end stops.
    pub endless: Vec<String>,
    /// Joints whose frame differs from that of the link, with their axes in the link's frame.
    pub turned: Vec<(String, [f64; 3])>,
    /// Joints whose axis was not a unit vector, with its length.
    pub normalised: Vec<(String, f64)>,
    /// Joints and links with an angle that was rounded to a multiple of π/2, and its deviation from that, rad.
    pub right_angles: Vec<(String, f64)>,
}

impl Remarks {
    /// One notice for each subject.
    pub(super) fn notices(self) -> Vec<UrdfNotice> {
        let Self { endless, turned, normalised, right_angles } = self;
        let mut notices = Vec::new();
        if !endless.is_empty() {
            notices.push(UrdfNotice::Continuous { joints: endless });
        }
        if !turned.is_empty() {
            notices.push(UrdfNotice::Reoriented { joints: turned });
        }
        if !normalised.is_empty() {
            notices.push(UrdfNotice::AxisNormalised { joints: normalised });
        }
        if !right_angles.is_empty() {
            let off_rad = right_angles.iter().map(|(_, off_rad)| *off_rad).fold(0.0, f64::max);
            let mut places: Vec<String> = Vec::new();
            for (place, _) in right_angles {
                if !places.contains(&place) {
                    places.push(place);
                }
            }
            notices.push(UrdfNotice::RightAngles { places, off_rad });
        }
        notices
    }
}
