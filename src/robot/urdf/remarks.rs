//! Remarks that are collected joint by joint and link by link, and reported in one line for each subject.

use super::notice::UrdfNotice;
use super::words::unless_empty;
use crate::robot::angles::RightAngles;

/// Remarks by subject.
#[derive(Debug, Default)]
pub(super) struct Remarks {
    /// Joints without end stops.
    pub endless: Vec<String>,
    /// Joints whose range is narrowed by soft limits, and the range that is left, rad.
    pub soft: Vec<(String, [f64; 2])>,
    /// Joints whose range is more than an arm can turn, rad.
    pub wide: Vec<(String, [f64; 2])>,
    /// Joints whose frame differs from that of the link, with their axes in the link's frame.
    pub turned: Vec<(String, [f64; 3])>,
    /// Joints whose axis was not a unit vector, with its length.
    pub normalised: Vec<(String, f64)>,
    /// Angles near multiples of π/2.
    pub right_angles: RightAngles,
}

impl Remarks {
    /// One notice for each subject.
    pub(super) fn notices(self) -> Vec<UrdfNotice> {
        let Self { endless, soft, wide, turned, normalised, right_angles } = self;
        let mut notices = Vec::new();
        notices.extend(unless_empty(endless, |joints| UrdfNotice::Continuous { joints }));
        notices.extend(unless_empty(soft, |joints| UrdfNotice::SoftLimits { joints }));
        notices.extend(unless_empty(wide, |joints| UrdfNotice::WideRanges { joints }));
        notices.extend(unless_empty(turned, |joints| UrdfNotice::Reoriented { joints }));
        notices.extend(unless_empty(normalised, |joints| UrdfNotice::AxisNormalised { joints }));
        notices.extend(right_angles.notices());
        notices
    }
}
