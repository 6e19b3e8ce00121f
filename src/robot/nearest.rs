//! Nearest points of segments and boxes, from which the distances of capsules are computed.

use nalgebra::Vector3;
use rapier3d::math::{Pose, Vector as ParryVector};
use rapier3d::parry::query::ClosestPoints;
use rapier3d::parry::query::details::closest_points_segment_segment;
use rapier3d::parry::shape::Segment;

use super::arm::CellBox;

/// Nearest points of a segment and a box; both are the same point where the segment enters the box.
///
/// The squared distance of p(s) = a + s d from the box is convex in s, with slope 2 d·(p − clamp(p)): the zero of the
/// slope is found by bisection, down to the last bit.
pub(crate) fn nearest_to_box(
    ends: &[Vector3<f64>; 2],
    of: &CellBox,
) -> (Vector3<f64>, Vector3<f64>) {
    let d = ends[1] - ends[0];
    let at = |s: f64| {
        let p = ends[0] + d * s;
        (p, p.sup(&of.low_m).inf(&of.high_m))
    };
    let slope = |s: f64| {
        let (p, nearest) = at(s);
        d.dot(&(p - nearest))
    };
    if slope(0.0) >= 0.0 {
        return at(0.0);
    }
    if slope(1.0) <= 0.0 {
        return at(1.0);
    }
    let (mut low, mut high) = (0.0, 1.0);
    for _ in 0..f64::MANTISSA_DIGITS {
        let middle = 0.5 * (low + high);
        if slope(middle) < 0.0 { low = middle } else { high = middle }
    }
    at(high)
}

/// Nearest points of two segments given by their ends.
pub(crate) fn nearest_points(
    one: &[Vector3<f64>; 2],
    other: &[Vector3<f64>; 2],
) -> (Vector3<f64>, Vector3<f64>) {
    let parry = |v: &Vector3<f64>| ParryVector::new(v.x, v.y, v.z);
    let back = |v: ParryVector| Vector3::new(v.x, v.y, v.z);
    let segment = |ends: &[Vector3<f64>; 2]| Segment::new(parry(&ends[0]), parry(&ends[1]));
    let found =
        closest_points_segment_segment(&Pose::identity(), &segment(one), &segment(other), f64::MAX);
    match found {
        ClosestPoints::WithinMargin(p1, p2) => (back(p1), back(p2)),
        // Only for coordinates so large that the squared distance overflows.
        ClosestPoints::Intersecting | ClosestPoints::Disjoint => (one[0], other[0]),
    }
}
