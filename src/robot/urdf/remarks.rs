//! What is remarked of one joint or link after the other, and told of all of them in one line.

use super::notice::UrdfNotice;

/// Remarks by matter.
#[derive(Debug, Default)]
pub(super) struct Remarks {
    /// Joints without end stops.
    pub endless: Vec<String>,
    /// Joints whose frame is not the link's, with their axes in that.
    pub turned: Vec<(String, [f64; 3])>,
    /// Joints whose axis was no unit vector, with its length.
    pub normalised: Vec<(String, f64)>,
    /// Joints and links of which an angle was made a multiple of π/2, and how far it was from that, rad.
    pub right_angles: Vec<(String, f64)>,
}

impl Remarks {
    /// A line for each matter.
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
