//! Preparation of samples for drawing: gaps, decimation and clipping, all in pixels.

use std::collections::HashSet;

use super::canvas::{Point, Rect};

/// Runs of consecutive points without a gap.
pub(super) fn runs(points: impl Iterator<Item = Option<Point>>) -> Vec<Vec<Point>> {
    let mut runs = vec![Vec::new()];
    for point in points {
        match (point, runs.last_mut()) {
            (Some(point), Some(run)) => run.push(point),
            (None, Some(run)) if !run.is_empty() => runs.push(Vec::new()),
            _ => {}
        }
    }
    runs.retain(|run| !run.is_empty());
    runs
}

/// Decimates a line without changing its appearance.
///
/// A time series (abscissae never decrease) keeps the lowest and the highest point of every bucket of `bucket_px`, in
/// their order, so that no peak is lost. Any other curve drops points closer than half a bucket to the last point kept.
/// Both keep their ends.
pub(super) fn thin_line(run: &[Point], bucket_px: f64) -> Vec<Point> {
    let (Some(&first), Some(&last)) = (run.first(), run.last()) else { return Vec::new() };
    let mut kept = vec![first];
    if run.windows(2).all(|pair| pair[0].0 <= pair[1].0) {
        for bucket in run.chunk_by(|a, b| (a.0 / bucket_px).floor() == (b.0 / bucket_px).floor()) {
            let mut extremes = [0, 0];
            for (k, point) in bucket.iter().enumerate() {
                if point.1 < bucket[extremes[0]].1 {
                    extremes[0] = k;
                }
                if point.1 > bucket[extremes[1]].1 {
                    extremes[1] = k;
                }
            }
            extremes.sort_unstable();
            kept.extend(extremes.map(|k| bucket[k]));
        }
    } else {
        let mut previous = first;
        for &point in run {
            if (point.0 - previous.0).abs().max((point.1 - previous.1).abs()) >= 0.5 * bucket_px {
                kept.push(point);
                previous = point;
            }
        }
    }
    kept.push(last);
    kept.dedup();
    kept
}

/// Decimates a cloud to at most `limit` points while its shape and outliers remain: keeps the first point in every cell
/// of a grid, which is coarsened until few enough points are left.
pub(super) fn thin_dots(points: &[Point], limit: usize) -> Vec<Point> {
    if points.len() <= limit {
        return points.to_vec();
    }
    let mut cell_px = 1.0;
    loop {
        let mut seen = HashSet::new();
        let cell = |(x, y): &Point| ((x / cell_px).floor() as i64, (y / cell_px).floor() as i64);
        let kept: Vec<Point> =
            points.iter().filter(|point| seen.insert(cell(point))).copied().collect();
        if kept.len() <= limit.max(4) {
            return kept;
        }
        cell_px *= 1.25;
    }
}

/// The parts of a line that lie inside `area`.
pub(super) fn clip(run: &[Point], area: &Rect) -> Vec<Vec<Point>> {
    if run.iter().all(|&point| inside(point, area)) {
        return vec![run.to_vec()];
    }
    let mut parts: Vec<Vec<Point>> = Vec::new();
    for pair in run.windows(2) {
        let Some((from, to)) = clip_segment(pair[0], pair[1], area) else { continue };
        match parts.last_mut() {
            Some(part) if part.last() == Some(&from) => part.push(to),
            _ => parts.push(vec![from, to]),
        }
    }
    parts
}

/// Whether a point lies in `area`, its edges included.
pub(super) fn inside((x, y): Point, area: &Rect) -> bool {
    (area.left..=area.right).contains(&x) && (area.top..=area.bottom).contains(&y)
}

/// Clips a segment to a rectangle (Liang–Barsky), by the range of its parameter t in 0 to 1.
fn clip_segment(a: Point, b: Point, area: &Rect) -> Option<(Point, Point)> {
    let (dx, dy) = (b.0 - a.0, b.1 - a.1);
    let (mut enter, mut leave) = (0.0f64, 1.0f64);
    let edges = [
        (-dx, a.0 - area.left),
        (dx, area.right - a.0),
        (-dy, a.1 - area.top),
        (dy, area.bottom - a.1),
    ];
    for (towards, room) in edges {
        if towards == 0.0 {
            if room < 0.0 {
                return None;
            }
        } else if towards < 0.0 {
            enter = enter.max(room / towards);
        } else {
            leave = leave.min(room / towards);
        }
    }
    if enter > leave {
        return None;
    }
    // Unclipped ends are returned unchanged, so that consecutive segments join.
    let at = |t: f64| (a.0 + t * dx, a.1 + t * dy);
    let from = if enter == 0.0 { a } else { at(enter) };
    let to = if leave == 1.0 { b } else { at(leave) };
    Some((from, to))
}

#[cfg(test)]
mod tests {
    use super::*;

    const AREA: Rect = Rect { left: 0.0, top: 0.0, right: 10.0, bottom: 10.0 };

    #[test]
    fn a_single_sample_peak_survives_thinning() {
        let mut points: Vec<Point> = (0..100_000).map(|k| (k as f64 * 1e-3, 5.0)).collect();
        points[54_321].1 = -7.0;
        let thin = thin_line(&points, 1.0);
        assert!(thin.len() < 250, "{}", thin.len());
        assert!(thin.iter().any(|p| p.1 == -7.0));
        assert_eq!((thin[0], thin[thin.len() - 1]), (points[0], points[99_999]));
    }

    #[test]
    fn an_outlier_of_a_cloud_survives_thinning() {
        let mut points: Vec<Point> =
            (0..20_000).map(|k| (500.0 + (k % 141) as f64, 90.0 + (k % 97) as f64)).collect();
        points[7_777] = (3.0, 4.0);
        let thin = thin_dots(&points, 300);
        assert!(thin.len() <= 300 && thin.len() > 100, "{}", thin.len());
        assert!(thin.contains(&(3.0, 4.0)));
    }

    #[test]
    fn a_gap_separates_two_runs() {
        let points = [Some((0.0, 0.0)), None, None, Some((1.0, 1.0)), Some((2.0, 1.0)), None];
        assert_eq!(runs(points.into_iter()), [vec![(0.0, 0.0)], vec![(1.0, 1.0), (2.0, 1.0)]]);
    }

    #[test]
    fn a_line_that_leaves_and_returns_is_cut_at_the_edge() {
        let parts = clip(&[(5.0, 5.0), (5.0, 15.0), (6.0, 15.0), (6.0, 5.0)], &AREA);
        assert_eq!(parts, [vec![(5.0, 5.0), (5.0, 10.0)], vec![(6.0, 10.0), (6.0, 5.0)]]);
    }

    #[test]
    fn a_segment_through_the_area_keeps_its_middle() {
        assert_eq!(clip(&[(-5.0, 5.0), (15.0, 5.0)], &AREA), [vec![(0.0, 5.0), (10.0, 5.0)]]);
    }

    #[test]
    fn a_closed_curve_keeps_its_shape() {
        let circle: Vec<Point> = (0..=10_000)
            .map(|k| (k as f64 / 10_000.0 * std::f64::consts::TAU).sin_cos())
            .map(|(s, c)| (100.0 * c, 100.0 * s))
            .collect();
        let thin = thin_line(&circle, 1.0);
        assert!(thin.len() < 1400);
        assert!(thin.iter().all(|p| (p.0.hypot(p.1) - 100.0).abs() < 1e-9));
    }
}
