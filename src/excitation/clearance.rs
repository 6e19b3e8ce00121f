//! Distances of the arm from itself, from the floor and from the boxes of its cell, computed from capsules on the
//! links.

use std::f64::consts::TAU;

use nalgebra::Vector3;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};

use super::limits::LimitKind;
use crate::robot::nearest::{nearest_points, nearest_to_box};
use crate::robot::{Arm, CellBox, ON_AXIS, Placement};

/// Signed distances between the capsules of an arm, and of its moving capsules from the floor and from boxes.
///
/// Two capsules with segments S₁, S₂ and radii r₁, r₂ have the distance d = dist(S₁, S₂) − r₁ − r₂; d < 0 is the depth
/// by which they overlap (unless the segments cross, where d = −r₁ − r₂). The distance of a capsule from the floor at
/// z_f is min(z of its ends) − r − z_f. A capsule whose segment enters a box has the distance −r from it. Distances
/// that no motion can reduce are left out: those of the base and of a capsule of the first body along its axis from
/// floor and boxes, and, if the first body turns about the vertical, those of this body from the floor and from what
/// lies under it.
///
/// Immutable; all mutable data are in [`ClearanceWorkspace`].
#[derive(Debug, Clone)]
pub struct ClearanceModel {
    placements: Vec<Placement>,
    capsules: Vec<Shape>,
    pairs: Vec<[usize; 2]>,
    floor: Vec<usize>,
    floor_z_m: f64,
    boxes: Vec<CellBox>,
    /// Indices of capsule and box.
    box_pairs: Vec<[usize; 2]>,
}

#[derive(Debug, Clone)]
struct Shape {
    name: String,
    body: usize,
    ends_m: [Vector3<f64>; 2],
    radius_m: f64,
}

/// Number of poses that are tried before a distance is reported as never kept.
pub const POSES_TRIED: usize = 5000;

impl Shape {
    /// Whether the arm can move this capsule.
    fn moves(&self) -> bool {
        let is_off_axis = |end: &Vector3<f64>| end.x.hypot(end.y) > ON_AXIS;
        self.body >= 2 || self.body == 1 && self.ends_m.iter().any(is_off_axis)
    }
}

/// The two objects of a watched distance, as indices into the model's lists.
enum Between {
    Capsules { one: usize, other: usize },
    Floor { capsule: usize },
    Box { capsule: usize, which: usize },
}

/// Scratch of one evaluation: frames and capsule ends in the base frame.
#[derive(Debug, Clone)]
pub struct ClearanceWorkspace {
    /// Frame of the base, then of the joints.
    frames: Vec<Placement>,
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
        let moving: Vec<usize> = (0..capsules.len()).filter(|&c| capsules[c].moves()).collect();
        let boxes = arm.clearance.boxes.clone();
        let rises = |c: &usize| capsules[*c].body >= 2 || !arm.is_upright();
        let nears = |c: usize, b: &CellBox| !arm.turns_over(&arm.clearance.capsules[c], b);
        let pairs = |(number, b): (usize, &CellBox)| {
            let near = moving.iter().copied().filter(|c| nears(*c, b));
            near.map(|c| [c, number]).collect::<Vec<_>>()
        };
        let box_pairs = boxes.iter().enumerate().flat_map(pairs).collect();
        let floor = match arm.clearance.floor_z_m {
            Some(_) => moving.iter().copied().filter(rises).collect(),
            None => Vec::new(),
        };
        Self {
            placements: arm.joints.iter().map(|j| j.placement).collect(),
            capsules,
            pairs: arm.clearance.pairs.clone(),
            floor,
            floor_z_m: arm.clearance.floor_z_m.unwrap_or_default(),
            boxes,
            box_pairs,
        }
    }

    /// Creates the scratch for this model.
    pub fn workspace(&self) -> ClearanceWorkspace {
        ClearanceWorkspace {
            frames: vec![Placement::identity(); self.placements.len() + 1],
            ends_m: vec![[Vector3::zeros(); 2]; self.capsules.len()],
        }
    }

    /// Number of distances: watched pairs, moving capsules and the floor, moving capsules and boxes.
    pub fn len(&self) -> usize {
        self.pairs.len() + self.floor.len() + self.box_pairs.len()
    }

    /// The two objects of distance `index`, as indices into the model's lists.
    fn between(&self, index: usize) -> Between {
        let above_floor = index.wrapping_sub(self.pairs.len());
        if index < self.pairs.len() {
            let [one, other] = self.pairs[index];
            Between::Capsules { one, other }
        } else if above_floor < self.floor.len() {
            Between::Floor { capsule: self.floor[above_floor] }
        } else {
            let [capsule, which] = self.box_pairs[above_floor - self.floor.len()];
            Between::Box { capsule, which }
        }
    }

    /// Whether nothing is watched.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The limit that distance `index` belongs to, with names for messages.
    pub fn limit(&self, index: usize) -> LimitKind {
        let name = |capsule: usize| self.capsules[capsule].name.clone();
        match self.between(index) {
            Between::Capsules { one, other } => {
                LimitKind::Clearance { one: name(one), other: name(other) }
            }
            Between::Floor { capsule } => LimitKind::Floor { capsule: name(capsule) },
            Between::Box { capsule, which } => LimitKind::Box { capsule: name(capsule), which },
        }
    }

    /// Finds a distance that is below `clearance_m` in every one of [`POSES_TRIED`] poses over the whole range of the
    /// joints; returns it with its largest value there, m.
    pub fn never_kept(&self, arm: &Arm, clearance_m: f64) -> Option<(LimitKind, f64)> {
        let mut ws = self.workspace();
        let mut distances_m = vec![0.0; self.len()];
        let mut most_m = vec![f64::NEG_INFINITY; self.len()];
        let mut q_rad = vec![0.0; arm.dof()];
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for _ in 0..POSES_TRIED {
            for (q, joint) in q_rad.iter_mut().zip(&arm.joints) {
                let [low, high] = joint.limits.position_rad;
                *q = low + rng.random::<f64>() * (high - low).min(TAU);
            }
            self.distances(&mut ws, &q_rad, &mut distances_m);
            most_m.iter_mut().zip(&distances_m).for_each(|(most, d)| *most = most.max(*d));
        }
        let index = most_m.iter().position(|most| *most < clearance_m)?;
        Some((self.limit(index), most_m[index]))
    }

    /// Ends (m, base frame) and radius (m) of every capsule at `q_rad`, for drawing.
    pub fn capsules_at(&self, q_rad: &[f64]) -> Vec<([Vector3<f64>; 2], f64)> {
        let mut ws = self.workspace();
        self.place(&mut ws, q_rad);
        ws.ends_m.iter().zip(&self.capsules).map(|(&ends, c)| (ends, c.radius_m)).collect()
    }

    /// Writes all distances (m) at `q_rad` into `distances_m` of length [`len`](Self::len).
    pub fn distances(&self, ws: &mut ClearanceWorkspace, q_rad: &[f64], distances_m: &mut [f64]) {
        self.place(ws, q_rad);
        for (index, d) in distances_m.iter_mut().enumerate() {
            let (p1, p2, radii_m) = self.nearest(ws, index);
            *d = self.signed(index, &(p1 - p2), radii_m);
        }
    }

    /// Computes all distances (m), and their derivatives by the joint angles (m/rad) into `gradients`, as
    /// `gradients[index · N + j]`.
    ///
    /// With the nearest points p₁, p₂ and n = (p₁ − p₂)/|p₁ − p₂|: ∂d/∂q_j = n·(ẑ_j × (p₁ − o_j)) if joint j moves p₁,
    /// minus the same term for p₂. The motion of the nearest points along the segments is tangential and drops out.
    /// Where segments cross there is no direction, and the derivative is set to 0.
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
            let away = || apart.try_normalize(1e-12).unwrap_or_default();
            let body = |capsule: usize| self.capsules[capsule].body;
            let (n, body1, body2) = match self.between(index) {
                Between::Capsules { one, other } => (away(), body(one), body(other)),
                Between::Floor { capsule } => (Vector3::z(), body(capsule), 0),
                Between::Box { capsule, .. } => (away(), body(capsule), 0),
            };
            for j in 0..dof {
                let (axis, origin) =
                    (ws.frames[j + 1].rotation.column(2), ws.frames[j + 1].translation_m);
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
        for (i, (placement, &q)) in self.placements.iter().zip(q_rad).enumerate() {
            ws.frames[i + 1] = ws.frames[i].compose(placement).turned(q);
        }
        for (ends, capsule) in ws.ends_m.iter_mut().zip(&self.capsules) {
            let Placement { rotation, translation_m } = &ws.frames[capsule.body];
            *ends = capsule.ends_m.map(|end| translation_m + rotation * end);
        }
    }

    /// Nearest points of distance `index`, and the sum of radii to subtract. For the floor the second point is straight
    /// below the first.
    fn nearest(&self, ws: &ClearanceWorkspace, index: usize) -> (Vector3<f64>, Vector3<f64>, f64) {
        match self.between(index) {
            Between::Capsules { one, other } => {
                let (p1, p2) = nearest_points(&ws.ends_m[one], &ws.ends_m[other]);
                (p1, p2, self.capsules[one].radius_m + self.capsules[other].radius_m)
            }
            Between::Floor { capsule } => {
                let [from, to] = ws.ends_m[capsule];
                let low = if from.z < to.z { from } else { to };
                let below = Vector3::new(low.x, low.y, self.floor_z_m);
                (low, below, self.capsules[capsule].radius_m)
            }
            Between::Box { capsule, which } => {
                let (p1, p2) = nearest_to_box(&ws.ends_m[capsule], &self.boxes[which]);
                (p1, p2, self.capsules[capsule].radius_m)
            }
        }
    }

    /// Signed distance; below the floor the difference in height is negative.
    fn signed(&self, index: usize, apart: &Vector3<f64>, radii_m: f64) -> f64 {
        match self.between(index) {
            Between::Floor { .. } => apart.z - radii_m,
            Between::Capsules { .. } | Between::Box { .. } => apart.norm() - radii_m,
        }
    }
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use nalgebra::Rotation3;

    use super::*;

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

    /// The shoulder of a UR5 turns about the vertical: it may hit a box, but the floor only if the arm is mounted
    /// otherwise.
    #[test]
    fn a_first_body_that_turns_is_watched() {
        let watched = |arm: &Arm| {
            let model = ClearanceModel::new(arm);
            let limits: Vec<String> =
                (0..model.len()).map(|k| model.limit(k).to_string()).collect();
            ["clearance of shoulder and box 1", "clearance of shoulder and floor"]
                .map(|limit| limits.iter().any(|l| l == limit))
        };
        let mut arm = Arm::built_in("ur5").unwrap();
        arm.clearance.floor_z_m = Some(0.0);
        arm.clearance.boxes.push(CellBox {
            low_m: Vector3::new(0.3, -1.0, 0.0),
            high_m: Vector3::new(0.5, 1.0, 1.0),
        });
        assert_eq!(watched(&arm), [true, false]);
        // Turning does not bring it closer to a table.
        let table =
            CellBox { low_m: Vector3::new(-1.0, -1.0, -0.5), high_m: Vector3::new(1.0, 1.0, 0.0) };
        let aside = std::mem::replace(&mut arm.clearance.boxes[0], table);
        assert_eq!(watched(&arm), [false, false]);
        arm.clearance.boxes[0] = aside;
        let tilt = Rotation3::from_axis_angle(&Vector3::x_axis(), 0.5);
        arm.joints[0].placement.rotation = tilt.matrix() * arm.joints[0].placement.rotation;
        assert_eq!(watched(&arm), [true, true]);
    }

    /// If a box surrounds the shoulder, the upper arm always reaches into it; joint 1 can turn it away from a box
    /// beside it.
    #[test]
    fn what_no_motion_keeps_clear_of_is_told() {
        let within = |range_rad: [f64; 2], low_m: [f64; 3], high_m: [f64; 3]| {
            let mut arm = Arm::built_in("ur5").unwrap();
            arm.joints[0].limits.position_rad = range_rad;
            let (low_m, high_m) = (low_m.into(), high_m.into());
            arm.clearance.boxes.push(CellBox { low_m, high_m });
            ClearanceModel::new(&arm).never_kept(&arm, 0.02).map(|(limit, _)| limit.to_string())
        };
        let never_kept = |low_m, high_m| within([-TAU, TAU], low_m, high_m);
        let around = never_kept([-0.3, -0.3, 0.0], [0.3, 0.3, 0.3]);
        assert_eq!(around.as_deref(), Some("clearance of upper arm and box 1"));
        assert_eq!(never_kept([0.12, -1.0, 0.0], [0.5, 1.0, 1.0]), None);
        assert_eq!(never_kept([2.0, -1.0, 0.0], [2.5, 1.0, 1.0]), None);
        // Only the range of joint 1 decides whether it can turn away.
        let beside = ([0.12, -1.0, 0.0], [0.5, 1.0, 1.0]);
        let halves = [[0.0, PI], [PI, TAU]].map(|range| within(range, beside.0, beside.1));
        assert!(halves.iter().any(Option::is_none), "{halves:?}");
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

    /// A box in the cell: distances against a brute-force search along the segment (2001 points: off by
    /// at most half a step of 0.2 mm, and quadratically less near the minimum), gradients against
    /// differences as above.
    #[test]
    fn distances_from_a_box_are_those_of_a_search() {
        let mut arm = Arm::built_in("ur5").unwrap();
        let cell_box =
            CellBox { low_m: Vector3::new(0.3, -0.2, 0.1), high_m: Vector3::new(0.6, 0.4, 0.5) };
        arm.clearance.boxes.push(cell_box);
        let model = ClearanceModel::new(&arm);
        let mut ws = model.workspace();
        let n = model.len();
        let (mut d, mut up, mut down) = (vec![0.0; n], vec![0.0; n], vec![0.0; n]);
        let mut gradients = vec![0.0; n * 6];
        let approaching: Vec<usize> = (0..arm.clearance.capsules.len())
            .filter(|&c| arm.clearance.capsules[c].body >= 2)
            .collect();
        let first = n - approaching.len();
        for q in poses(20) {
            model.distances_and_gradients(&mut ws, &q, &mut d, &mut gradients);
            let capsules = model.capsules_at(&q);
            for (k, &c) in approaching.iter().enumerate() {
                let (ends, radius) = capsules[c];
                let searched = (0..=2000)
                    .map(|i| {
                        let p = ends[0] + (ends[1] - ends[0]) * (i as f64 / 2000.0);
                        (p - p.sup(&cell_box.low_m).inf(&cell_box.high_m)).norm()
                    })
                    .fold(f64::INFINITY, f64::min);
                assert!(
                    (d[first + k] - (searched - radius)).abs() < 2e-4,
                    "{}",
                    model.limit(first + k)
                );
                if searched < 1e-3 {
                    continue;
                }
                for j in 0..6 {
                    let (mut above, mut below) = (q, q);
                    above[j] += 1e-6;
                    below[j] -= 1e-6;
                    model.distances(&mut ws, &above, &mut up);
                    model.distances(&mut ws, &below, &mut down);
                    let slope = (up[first + k] - down[first + k]) / 2e-6;
                    assert!((slope - gradients[(first + k) * 6 + j]).abs() < 1e-5);
                }
            }
        }
    }

    /// Poses whose clearance is known without computing: upright is free, an arm folded onto itself and an arm reaching
    /// below the floor are not.
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
