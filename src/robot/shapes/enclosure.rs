//! Smallest capsule around a set of balls.

use std::f64::consts::PI;

use nalgebra::{Matrix3, Vector2, Vector3};

/// A ball to be enclosed; a point is a ball of radius 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Ball {
    pub centre_m: Vector3<f64>,
    pub radius_m: f64,
}

impl Ball {
    pub(super) fn point(at_m: Vector3<f64>) -> Self {
        Self { centre_m: at_m, radius_m: 0.0 }
    }
}

/// A capsule that encloses something.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Enclosure {
    pub ends_m: [Vector3<f64>; 2],
    pub radius_m: f64,
}

/// Largest number of balls among which the axis is sought. Of more balls only those that are outermost in one of as
/// many directions are used.
const FEW: usize = 300;
/// Number of steps towards the farthest ball in the search for the line that is nearest to all.
const STEPS: usize = 60;
/// Radii that are tried, as multiples of the smallest possible one: with a larger radius the hemispheres at the ends
/// cover more, so that the segment is shorter.
const GROWTHS: [f64; 10] = [1.0, 1.02, 1.05, 1.1, 1.15, 1.2, 1.25, 1.3, 1.36, 1.42];

impl Enclosure {
    /// The capsule around all balls, as by [`Self::by`]; `None` without any ball.
    pub(super) fn of(balls: &[Ball], axes: &[Vector3<f64>]) -> Option<Self> {
        Self::by(&outermost(balls), balls, axes)
    }

    /// The capsule of the smallest volume along one of the principal axes of the centres, the axes of the frame, or the
    /// given `axes`. The axis is chosen for `few` of the `balls`, the [`outermost`] ones, and the capsule then encloses
    /// all of them; `None` without any ball.
    pub(super) fn by(few: &[Ball], balls: &[Ball], axes: &[Vector3<f64>]) -> Option<Self> {
        let own = principal_axes(few)?;
        let frame = [Vector3::x(), Vector3::y(), Vector3::z()];
        let axes = own.iter().chain(&frame).chain(axes);
        let tried = axes.flat_map(|axis| {
            let line_m = middle(few, axis);
            let along = |growth: f64| Self::about(few, axis, &line_m, growth).volume_m3();
            GROWTHS.map(|growth| (along(growth), axis, line_m, growth))
        });
        let (_, axis, line_m, growth) = tried.min_by(|a, b| a.0.total_cmp(&b.0))?;
        Some(Self::about(balls, axis, &line_m, growth))
    }

    /// The shortest capsule along a line whose radius is `growth` times the smallest possible one.
    fn about(balls: &[Ball], axis: &Vector3<f64>, line_m: &Vector3<f64>, growth: f64) -> Self {
        let place = |ball: &Ball| {
            let from = ball.centre_m - line_m;
            let along = from.dot(axis);
            (along, (from - axis * along).norm())
        };
        let reach = balls.iter().map(|ball| place(ball).1 + ball.radius_m).fold(0.0, f64::max);
        let radius_m = reach * growth;
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for ball in balls {
            let (along, aside) = place(ball);
            let spare = radius_m - ball.radius_m;
            // An end of the segment may be this far from the ball along the axis and still cover it.
            let covered = (spare * spare - aside * aside).max(0.0).sqrt();
            low = low.min(along + covered);
            high = high.max(along - covered);
        }
        if low > high {
            // A sphere covers all balls, with its centre anywhere between the two values.
            let centre = 0.5 * (low + high);
            (low, high) = (centre, centre);
        }
        Self { ends_m: [low, high].map(|along| line_m + axis * along), radius_m }
    }

    pub(super) fn volume_m3(&self) -> f64 {
        let [from, to] = self.ends_m;
        let r = self.radius_m;
        PI * r * r * ((to - from).norm() + 4.0 / 3.0 * r)
    }

    /// The balls at its ends: a convex set that contains both contains the capsule.
    pub(super) fn balls(&self) -> [Ball; 2] {
        self.ends_m.map(|centre_m| Ball { centre_m, radius_m: self.radius_m })
    }
}

/// The balls that are outermost in one of [`FEW`] directions, which lie on a spiral around the sphere; up to [`FEW`]
/// balls are all kept.
pub(super) fn outermost(balls: &[Ball]) -> Vec<Ball> {
    if balls.len() <= FEW {
        return balls.to_vec();
    }
    let turn = PI * (3.0 - 5.0_f64.sqrt());
    let directions = (0..FEW).map(|k| {
        let z = 1.0 - (2 * k + 1) as f64 / FEW as f64;
        let (sin, cos) = (turn * k as f64).sin_cos();
        let aside = (1.0 - z * z).sqrt();
        Vector3::new(aside * cos, aside * sin, z)
    });
    let farthest = directions.filter_map(|direction| {
        let height = |ball: &Ball| ball.centre_m.dot(&direction) + ball.radius_m;
        let heights = balls.iter().map(|ball| (height(ball), ball));
        heights.max_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, ball)| *ball)
    });
    farthest.collect()
}

/// Principal axes of the centres; `None` without any ball.
fn principal_axes(balls: &[Ball]) -> Option<[Vector3<f64>; 3]> {
    if balls.is_empty() {
        return None;
    }
    let sum = balls.iter().fold(Vector3::zeros(), |sum, ball| sum + ball.centre_m);
    let mean_m = sum / balls.len() as f64;
    let scatter = balls.iter().fold(Matrix3::zeros(), |scatter, ball| {
        let from = ball.centre_m - mean_m;
        scatter + from * from.transpose()
    });
    let vectors = scatter.symmetric_eigen().eigenvectors;
    Some([0, 1, 2].map(|k| vectors.column(k).into_owned()))
}

/// A point on the line along `axis` whose distance from the farthest ball is almost the smallest possible.
///
/// The search starts at the centre of the bounding rectangle across the axis and takes shorter and shorter steps
/// towards the ball that is then farthest.
fn middle(balls: &[Ball], axis: &Vector3<f64>) -> Vector3<f64> {
    let helper = if axis.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
    let u = axis.cross(&helper).normalize();
    let v = axis.cross(&u);
    let flat: Vec<(Vector2<f64>, f64)> = balls
        .iter()
        .map(|ball| (Vector2::new(ball.centre_m.dot(&u), ball.centre_m.dot(&v)), ball.radius_m))
        .collect();
    let (mut low, mut high) = (Vector2::repeat(f64::INFINITY), Vector2::repeat(f64::NEG_INFINITY));
    for (centre, radius) in &flat {
        low = low.inf(&centre.add_scalar(-radius));
        high = high.sup(&centre.add_scalar(*radius));
    }
    let mut at = (low + high) * 0.5;
    let (mut best, mut least) = (at, f64::INFINITY);
    for step in 0..STEPS {
        let reach = |(centre, radius): &(Vector2<f64>, f64)| (centre - at).norm() + radius;
        let Some(farthest) = flat.iter().max_by(|a, b| reach(a).total_cmp(&reach(b))) else {
            break;
        };
        let farthest_reach = reach(farthest);
        if farthest_reach < least {
            (best, least) = (at, farthest_reach);
        }
        at += (farthest.0 - at) / (step + 4) as f64;
    }
    u * best.x + v * best.y
}

#[cfg(test)]
mod tests {
    use nalgebra::Rotation3;
    use proptest::prelude::*;

    use super::*;

    /// Distance by which a ball sticks out of the capsule, m.
    fn beyond_m(capsule: &Enclosure, ball: &Ball) -> f64 {
        let [from, to] = capsule.ends_m;
        let along = to - from;
        let length_squared = along.norm_squared();
        let s = if length_squared > 0.0 {
            ((ball.centre_m - from).dot(&along) / length_squared).clamp(0.0, 1.0)
        } else {
            0.0
        };
        (ball.centre_m - from - along * s).norm() + ball.radius_m - capsule.radius_m
    }

    fn points(corners: &[[f64; 3]]) -> Vec<Ball> {
        corners.iter().map(|corner| Ball::point(Vector3::from(*corner))).collect()
    }

    /// All corners of a box with these half lengths, turned.
    fn corners(half_m: [f64; 3], turn: &Rotation3<f64>) -> Vec<Ball> {
        let signs = (0..8).map(|k| [0, 1, 2].map(|i| if k >> i & 1 == 0 { -1.0 } else { 1.0 }));
        let corner = |sign: [f64; 3]| Vector3::from_fn(|i, _| sign[i] * half_m[i]);
        signs.map(|sign| Ball::point(turn * corner(sign))).collect()
    }

    proptest! {
        #[test]
        fn all_of_it_is_inside(
            centres in prop::collection::vec(prop::array::uniform3(-1.0..1.0f64), 1..60),
            radius_m in 0.0..0.3f64,
            stretch in prop::array::uniform3(0.01..1.0f64),
        ) {
            let ball = |centre: &[f64; 3]| Ball {
                centre_m: Vector3::from(*centre).component_mul(&Vector3::from(stretch)),
                radius_m,
            };
            let balls: Vec<Ball> = centres.iter().map(ball).collect();
            let capsule = Enclosure::of(&balls, &[]).unwrap();
            for ball in &balls {
                prop_assert!(beyond_m(&capsule, ball) < 1e-12, "{capsule:?} {ball:?}");
            }
        }
    }

    /// More points than the search looks at, on an ellipsoid, where nearly every point is outermost in its own
    /// direction.
    #[test]
    fn all_of_many_points_is_inside() {
        let point = |k: i32| {
            let (a, b) = (f64::from(k) * 2.4, f64::from(k % 997) * 0.0063);
            Vector3::new(0.1 * a.cos() * b.sin(), 0.2 * a.sin() * b.sin(), 0.4 * b.cos())
        };
        let balls: Vec<Ball> = (0..20_000).map(|k| Ball::point(point(k))).collect();
        let capsule = Enclosure::of(&balls, &[]).unwrap();
        assert!(balls.iter().all(|ball| beyond_m(&capsule, ball) < 1e-12), "{capsule:?}");
        // Along the longest axis, a capsule of radius 0.2 m encloses it: π 0.2² · 0.4 + 4/3 π 0.2³ = 0.084 m³.
        assert!(capsule.volume_m3() < 0.09, "{capsule:?}");
        assert!(Enclosure::of(&[], &[]).is_none());
    }

    #[test]
    fn known_solids_have_the_capsule_that_one_expects() {
        let ball = Ball { centre_m: Vector3::new(0.1, 0.2, 0.3), radius_m: 0.05 };
        let sphere = Enclosure::of(&[ball], &[]).unwrap();
        assert!((sphere.radius_m - 0.05).abs() < 1e-12, "{sphere:?}");
        assert!(sphere.ends_m.iter().all(|end| (end - ball.centre_m).norm() < 1e-12));
        // The capsule around a capsule is the capsule itself.
        let axis = Vector3::new(0.6, 0.0, 0.8);
        let own = Enclosure { ends_m: [Vector3::zeros(), axis * 0.5], radius_m: 0.07 };
        let found = Enclosure::of(&own.balls(), &[]).unwrap();
        assert!((found.radius_m - 0.07).abs() < 1e-9, "{found:?}");
        assert!((found.volume_m3() / own.volume_m3() - 1.0).abs() < 1e-6, "{found:?}");
        // A long box lies in a capsule along it that is little wider than the diagonal of its cross-section.
        let turn = Rotation3::from_euler_angles(0.3, -0.8, 1.1);
        let beam = Enclosure::of(&corners([0.03, 0.04, 0.5], &turn), &[]).unwrap();
        let [from, to] = beam.ends_m;
        let along = (turn.inverse() * (to - from)).normalize();
        assert!(along.z.abs() > 1.0 - 1e-9, "{beam:?}");
        assert!((0.04999..0.056).contains(&beam.radius_m), "{beam:?}");
        assert!(((to - from).norm() - 1.0).abs() < 0.03, "{beam:?}");
        // A cube lies in the sphere through its corners.
        let cube = Enclosure::of(&corners([0.1; 3], &Rotation3::identity()), &[]).unwrap();
        assert!(cube.volume_m3() < 1.02 * 4.0 / 3.0 * PI * (0.03_f64).powf(1.5), "{cube:?}");
    }

    /// The corners of an equilateral triangle: the line must pass through the centre of the circumscribed circle, not
    /// through the middle of the triangle's height.
    #[test]
    fn the_line_is_in_the_middle() {
        let height = 3.0_f64.sqrt() / 2.0;
        let prism = points(&[
            [0.0, 0.0, -2.0],
            [1.0, 0.0, -2.0],
            [0.5, height, -2.0],
            [0.0, 0.0, 2.0],
            [1.0, 0.0, 2.0],
            [0.5, height, 2.0],
        ]);
        let line_m = middle(&prism, &Vector3::z());
        let reach = prism.iter().map(|ball| (ball.centre_m - line_m).xy().norm());
        let farthest = reach.fold(0.0, f64::max);
        assert!(farthest < 1.02 / 3.0_f64.sqrt(), "{farthest}");
    }
}
