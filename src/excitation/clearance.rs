//! How far the arm is from itself and from the floor: capsules on the links.

use nalgebra::{Matrix3, Rotation3, Vector3};
use rapier3d::math::{Pose, Vector as ParryVector};
use rapier3d::parry::query::ClosestPoints;
use rapier3d::parry::query::details::closest_points_segment_segment;
use rapier3d::parry::shape::Segment;

use super::limits::LimitKind;
use crate::robot::Arm;

/// Signed distances between the capsules of an arm, and of its moving capsules from the floor.
///
/// Two capsules with segments S₁, S₂ and radii r₁, r₂ are d = dist(S₁, S₂) − r₁ − r₂ apart; d < 0 is
/// the depth by which they overlap (as long as the segments do not cross, where d = −r₁ − r₂). The
/// distance of a capsule from the floor at z_f is min(z of its ends) − r − z_f; the base and the
/// first body are left out, since they do not approach the floor whatever the arm does.
///
/// Immutable; what changes is in [`ClearanceWorkspace`].
#[derive(Debug, Clone)]
pub struct ClearanceModel {
    placements: Vec<(Matrix3<f64>, Vector3<f64>)>,
    capsules: Vec<Shape>,
    pairs: Vec<[usize; 2]>,
    floor: Vec<usize>,
    floor_z_m: f64,
}

#[derive(Debug, Clone)]
struct Shape {
    name: String,
    body: usize,
    ends_m: [Vector3<f64>; 2],
    radius_m: f64,
}

/// Scratch of one evaluation: frames and capsule ends in the base frame.
#[derive(Debug, Clone)]
pub struct ClearanceWorkspace {
    rotations: Vec<Matrix3<f64>>,
    origins_m: Vec<Vector3<f64>>,
    ends_m: Vec<[Vector3<f64>; 2]>,
}

impl ClearanceModel {
    /// The clearance model of `arm`.
    pub fn new(arm: &Arm) -> Self {
        let capsules = arm
            .clearance
            .capsules
            .iter()
            .map(|c| Shape {
                name: c.name.clone(),
                body: c.body,
                ends_m: [c.from_m, c.to_m],
                radius_m: c.radius_m,
            })
            .collect::<Vec<_>>();
        let floor = match arm.clearance.floor_z_m {
            Some(_) => (0..capsules.len()).filter(|&c| capsules[c].body >= 2).collect(),
            None => Vec::new(),
        };
        Self {
            placements: arm
                .joints
                .iter()
                .map(|j| (j.placement.rotation, j.placement.translation_m))
                .collect(),
            capsules,
            pairs: arm.clearance.pairs.clone(),
            floor,
            floor_z_m: arm.clearance.floor_z_m.unwrap_or_default(),
        }
    }

    /// Scratch for this model.
    pub fn workspace(&self) -> ClearanceWorkspace {
        ClearanceWorkspace {
            rotations: vec![Matrix3::identity(); self.placements.len() + 1],
            origins_m: vec![Vector3::zeros(); self.placements.len() + 1],
            ends_m: vec![[Vector3::zeros(); 2]; self.capsules.len()],
        }
    }

    /// Number of distances: the watched pairs, then the capsules above the floor.
    pub fn len(&self) -> usize {
        self.pairs.len() + self.floor.len()
    }

    /// Whether nothing is watched.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// What distance `index` is between.
    pub fn limit(&self, index: usize) -> LimitKind {
        match self.pairs.get(index) {
            Some(&[a, b]) => LimitKind::Clearance {
                one: self.capsules[a].name.clone(),
                other: self.capsules[b].name.clone(),
            },
            None => LimitKind::Floor {
                capsule: self.capsules[self.floor[index - self.pairs.len()]].name.clone(),
            },
        }
    }

    /// Ends (m, base frame) and radius (m) of every capsule at `q_rad`, for drawing.
    pub fn capsules_at(&self, q_rad: &[f64]) -> Vec<([Vector3<f64>; 2], f64)> {
        let mut ws = self.workspace();
        self.place(&mut ws, q_rad);
        ws.ends_m.iter().zip(&self.capsules).map(|(&ends, c)| (ends, c.radius_m)).collect()
    }

    /// All distances (m) at `q_rad` into `distances_m` of length [`len`](Self::len).
    pub fn distances(&self, ws: &mut ClearanceWorkspace, q_rad: &[f64], distances_m: &mut [f64]) {
        self.place(ws, q_rad);
        for (index, d) in distances_m.iter_mut().enumerate() {
            let (p1, p2, radii_m) = self.nearest(ws, index);
            *d = self.signed(index, &(p1 - p2), radii_m);
        }
    }

    /// All distances (m), and their derivatives by the joint angles (m/rad) into `gradients`,
    /// `gradients[index · N + j]`.
    ///
    /// With the nearest points p₁, p₂ and n = (p₁ − p₂)/|p₁ − p₂|: ∂d/∂q_j = n·(ẑ_j × (p₁ − o_j)) for a joint
    /// below p₁ only, minus the same of p₂ (their own motion along the segments is tangential and
    /// drops out). Where segments cross there is no direction and the derivative is given as 0.
    pub fn distances_and_gradients(
        &self,
        ws: &mut ClearanceWorkspace,
        q_rad: &[f64],
        distances_m: &mut [f64],
        gradients: &mut [f64],
    ) {
        self.place(ws, q_rad);
        let dof = self.placements.len();
        for (index, d) in distances_m.iter_mut().enumerate() {
            let (p1, p2, radii_m) = self.nearest(ws, index);
            let apart = p1 - p2;
            *d = self.signed(index, &apart, radii_m);
            let (n, body1, body2) = match self.pairs.get(index) {
                Some(&[a, b]) => {
                    let n = apart.try_normalize(1e-12).unwrap_or_default();
                    (n, self.capsules[a].body, self.capsules[b].body)
                }
                None => {
                    let body = self.capsules[self.floor[index - self.pairs.len()]].body;
                    (Vector3::z(), body, 0)
                }
            };
            for j in 0..dof {
                let (axis, origin) = (ws.rotations[j + 1].column(2), ws.origins_m[j + 1]);
                let mut slope = 0.0;
                if j < body1 {
                    slope += n.dot(&axis.cross(&(p1 - origin)));
                }
                if j < body2 {
                    slope -= n.dot(&axis.cross(&(p2 - origin)));
                }
                gradients[index * dof + j] = slope;
            }
        }
    }

    /// Forward kinematics of the frames and capsule ends. Index 0 is the base.
    fn place(&self, ws: &mut ClearanceWorkspace, q_rad: &[f64]) {
        for (i, ((rotation, translation_m), &q)) in self.placements.iter().zip(q_rad).enumerate() {
            let turn = Rotation3::from_axis_angle(&Vector3::z_axis(), q).into_inner();
            ws.origins_m[i + 1] = ws.origins_m[i] + ws.rotations[i] * translation_m;
            ws.rotations[i + 1] = ws.rotations[i] * rotation * turn;
        }
        for (ends, capsule) in ws.ends_m.iter_mut().zip(&self.capsules) {
            let (r, o) = (&ws.rotations[capsule.body], &ws.origins_m[capsule.body]);
            *ends = [o + r * capsule.ends_m[0], o + r * capsule.ends_m[1]];
        }
    }

    /// Nearest points of distance `index` and what is taken off for the radii. For the floor the
    /// second point is straight below the first.
    fn nearest(&self, ws: &ClearanceWorkspace, index: usize) -> (Vector3<f64>, Vector3<f64>, f64) {
        if let Some(&[a, b]) = self.pairs.get(index) {
            let (p1, p2) = nearest_points(&ws.ends_m[a], &ws.ends_m[b]);
            return (p1, p2, self.capsules[a].radius_m + self.capsules[b].radius_m);
        }
        let c = self.floor[index - self.pairs.len()];
        let [from, to] = ws.ends_m[c];
        let low = if from.z < to.z { from } else { to };
        (low, Vector3::new(low.x, low.y, self.floor_z_m), self.capsules[c].radius_m)
    }

    /// Distance with its sign: below the floor the difference of heights is negative.
    fn signed(&self, index: usize, apart: &Vector3<f64>, radii_m: f64) -> f64 {
        if index < self.pairs.len() { apart.norm() - radii_m } else { apart.z - radii_m }
    }
}

/// Nearest points of two segments given by their ends.
fn nearest_points(
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

#[cfg(test)]
mod tests {
    use super::*;
    use rand::rngs::ChaCha8Rng;
    use rand::{RngExt, SeedableRng};

    fn poses(count: usize) -> Vec<[f64; 6]> {
        let mut rng = ChaCha8Rng::seed_from_u64(11);
        (0..count).map(|_| std::array::from_fn(|_| rng.random_range(-3.1..3.1))).collect()
    }

    /// Distance between two segments by brute force: 61 × 61 points, refined about the best by
    /// twelve halvings of the window.
    fn brute_force(one: &[Vector3<f64>; 2], other: &[Vector3<f64>; 2]) -> f64 {
        let at = |e: &[Vector3<f64>; 2], s: f64| e[0] + (e[1] - e[0]) * s;
        let (mut centre, mut width, mut best) = ([0.5, 0.5], 1.0, f64::INFINITY);
        for _ in 0..12 {
            let around = centre;
            for i in 0..=60 {
                for k in 0..=60 {
                    let s = (around[0] + width * (i as f64 / 60.0 - 0.5)).clamp(0.0, 1.0);
                    let t = (around[1] + width * (k as f64 / 60.0 - 0.5)).clamp(0.0, 1.0);
                    let d = (at(one, s) - at(other, t)).norm();
                    if d < best {
                        (best, centre) = (d, [s, t]);
                    }
                }
            }
            width *= 0.5;
        }
        best
    }

    #[test]
    fn distances_are_those_of_a_brute_force_search() {
        let arm = Arm::built_in("ur5").unwrap();
        let model = ClearanceModel::new(&arm);
        let mut ws = model.workspace();
        let mut distances = vec![0.0; model.len()];
        for q in poses(15) {
            model.distances(&mut ws, &q, &mut distances);
            let capsules = model.capsules_at(&q);
            for (k, [a, b]) in arm.clearance.pairs.iter().enumerate() {
                let searched =
                    brute_force(&capsules[*a].0, &capsules[*b].0) - capsules[*a].1 - capsules[*b].1;
                assert!((distances[k] - searched).abs() < 1e-5, "{}", model.limit(k));
            }
        }
    }

    #[test]
    fn frames_are_those_of_the_arm() {
        let arm = Arm::built_in("ur5").unwrap();
        let model = ClearanceModel::new(&arm);
        for q in poses(5) {
            let frames = arm.frames(&q);
            for (c, (ends, _)) in arm.clearance.capsules.iter().zip(model.capsules_at(&q)) {
                if c.body > 0 {
                    let f = &frames[c.body - 1];
                    let expected = f.rotation * c.from_m + f.translation_m;
                    assert!((expected - ends[0]).norm() < 1e-12);
                }
            }
        }
    }

    /// Central differences, h = 1e-6: round-off 1e-10. The distance has kinks where the nearest
    /// point jumps between ends; a pose within 1e-6 rad of one has probability below 1e-4.
    #[test]
    fn gradients_are_finite_differences() {
        let arm = Arm::built_in("ur5").unwrap();
        let model = ClearanceModel::new(&arm);
        let mut ws = model.workspace();
        let n = model.len();
        let (mut d, mut up, mut down) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        let mut gradients = vec![0.0; n * 6];
        let h = 1e-6;
        for q in poses(30) {
            model.distances_and_gradients(&mut ws, &q, &mut d, &mut gradients);
            for j in 0..6 {
                let (mut above, mut below) = (q, q);
                above[j] += h;
                below[j] -= h;
                model.distances(&mut ws, &above, &mut up);
                model.distances(&mut ws, &below, &mut down);
                for k in 0..n {
                    let slope = (up[k] - down[k]) / (2.0 * h);
                    let error = (slope - gradients[k * 6 + j]).abs();
                    assert!(error < 1e-6, "{} joint {}: {error:e}", model.limit(k), j + 1);
                }
            }
        }
    }

    /// Poses whose answer is known without computing: upright is free, an arm folded onto itself
    /// and an arm reaching below the floor are not.
    #[test]
    fn known_poses_of_the_ur5() {
        let arm = Arm::built_in("ur5").unwrap();
        let model = ClearanceModel::new(&arm);
        let mut ws = model.workspace();
        let mut d = vec![0.0; model.len()];
        let mut least = |q: [f64; 6]| {
            model.distances(&mut ws, &q, &mut d);
            d.iter().copied().fold(f64::INFINITY, f64::min)
        };
        assert!(least([0.0, -1.57, 0.0, -1.57, 0.0, 0.0]) > 0.02);
        assert!(least([0.0, -1.57, 3.1, 0.0, 0.0, 0.0]) < 0.0);
        assert!(least([0.0, 0.8, 0.0, 0.0, 0.0, 0.0]) < 0.0);
    }
}
