//! Grouping of the shapes of one body into common capsules.

use nalgebra::Vector3;

use super::enclosure::{Ball, Enclosure, outermost};

/// Shapes inside one common capsule.
#[derive(Debug, Clone)]
pub(super) struct Group {
    /// The link of the first of these shapes.
    pub link: String,
    balls: Vec<Ball>,
    /// The outermost balls. Those of a union of groups are among the outermost balls of its groups.
    few: Vec<Ball>,
    /// Candidate directions of the capsule.
    axes: Vec<Vector3<f64>>,
    pub enclosure: Enclosure,
}

/// Two capsules are merged if the common one has at most this many times their total volume; for overlapping capsules
/// it can be less than their total.
const WORTH: f64 = 1.25;
/// At most this many axes are kept, the first ones.
const AXES: usize = 12;
/// A body with more shapes than this begins with one capsule per link.
const MANY: usize = 40;

impl Group {
    /// The group of one shape on `link`, with its `balls` and axes; `None` without any ball.
    pub(super) fn of(link: String, balls: Vec<Ball>, axes: Vec<Vector3<f64>>) -> Option<Self> {
        let few = outermost(&balls);
        let enclosure = Enclosure::by(&few, &balls, &axes)?;
        Some(Self { link, balls, few, axes, enclosure })
    }

    /// A capsule around both capsules.
    fn around(&self, other: &Self) -> Option<Enclosure> {
        let ends = [self.enclosure.balls(), other.enclosure.balls()].concat();
        let directions = [self, other].map(|one| {
            let [from, to] = one.enclosure.ends_m;
            (to - from).try_normalize(1e-9)
        });
        let directions: Vec<Vector3<f64>> = directions.into_iter().flatten().collect();
        Enclosure::of(&ends, &directions)
    }

    /// Volume of the capsule around both, relative to their total volume.
    fn growth(&self, other: &Self) -> f64 {
        let apart_m3 = self.enclosure.volume_m3() + other.enclosure.volume_m3();
        self.around(other).map_or(f64::INFINITY, |both| both.volume_m3() / apart_m3)
    }

    fn take_in(&mut self, other: Self) {
        let around = self.around(&other);
        self.balls.extend(other.balls);
        self.few = outermost(&[&self.few[..], &other.few[..]].concat());
        self.axes.extend(other.axes);
        self.axes.truncate(AXES);
        let found = Enclosure::by(&self.few, &self.balls, &self.axes);
        let found = around.into_iter().chain(found);
        let smallest = found.min_by(|a, b| a.volume_m3().total_cmp(&b.volume_m3()));
        self.enclosure = smallest.unwrap_or(self.enclosure);
    }
}

/// Merges the groups of a body pair by pair, always the pair whose volume grows least, as long as there are more than
/// `most` groups or the common capsule is hardly larger than the two.
pub(super) fn merged(mut groups: Vec<Group>, most: usize) -> Vec<Group> {
    if groups.len() > MANY {
        groups = by_link(groups);
    }
    loop {
        let numbers = 0..groups.len();
        let pairs = numbers.flat_map(|j| (0..j).map(move |i| (i, j)));
        let growths = pairs.map(|(i, j)| (groups[i].growth(&groups[j]), i, j));
        let Some((growth, i, j)) = growths.min_by(|a, b| a.0.total_cmp(&b.0)) else {
            return groups;
        };
        if growth > WORTH && groups.len() <= most {
            return groups;
        }
        // The later of the two is removed, so that the earlier one keeps its position.
        let other = groups.remove(j);
        groups[i].take_in(other);
    }
}

/// Merges consecutive groups of the same link.
fn by_link(groups: Vec<Group>) -> Vec<Group> {
    let mut links: Vec<Group> = Vec::new();
    for group in groups {
        match links.last_mut().filter(|last| last.link == group.link) {
            Some(last) => last.take_in(group),
            None => links.push(group),
        }
    }
    links
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ball(link: &str, at_m: [f64; 3], radius_m: f64) -> Group {
        let balls = vec![Ball { centre_m: Vector3::from(at_m), radius_m }];
        Group::of(link.to_owned(), balls, Vec::new()).unwrap()
    }

    /// Balls in a row merge into one rod, balls along an L into one rod for each side.
    #[test]
    fn shapes_in_a_row_share_a_capsule() {
        let row = |x: f64, y: f64| {
            (0..8).map(move |k| ball("arm", [x * f64::from(k), y * f64::from(k), 0.0], 0.05))
        };
        let rod = merged(row(0.05, 0.0).collect(), 3);
        assert_eq!(rod.len(), 1);
        assert!((rod[0].enclosure.radius_m - 0.05).abs() < 1e-3, "{:?}", rod[0].enclosure);
        let angle = merged(row(0.05, 0.0).chain(row(0.0, 0.05)).collect(), 3);
        assert_eq!(angle.len(), 2);
        assert!(angle.iter().all(|side| side.enclosure.radius_m < 0.08));
        assert_eq!(merged(row(0.05, 0.0).chain(row(0.0, 0.05)).collect(), 1).len(), 1);
        assert!(merged(Vec::new(), 3).is_empty());
    }

    /// Distant shapes share a capsule only if their number must be reduced.
    #[test]
    fn no_more_capsules_than_are_wanted() {
        let far = || (0..5).map(|k| ball("arm", [f64::from(k * k), 0.0, 0.0], 0.1));
        assert_eq!(merged(far().collect(), 5).len(), 5);
        let few = merged(far().collect(), 3);
        assert_eq!(few.len(), 3);
        let dots = (0..150).map(|k| {
            let (link, y) = if k < 70 { ("left", 0.0) } else { ("right", 50.0) };
            ball(link, [f64::from(k), y, f64::from(k % 2)], 0.1)
        });
        let of_links = merged(dots.collect(), 5);
        let links: Vec<&str> = of_links.iter().map(|group| group.link.as_str()).collect();
        assert_eq!(links, ["left", "right"]);
    }
}
