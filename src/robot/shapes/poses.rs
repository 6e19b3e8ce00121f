//! Detection of capsules that are near to each other wherever the arm is.

use std::f64::consts::TAU;

use nalgebra::Vector3;
use rand::rngs::ChaCha8Rng;
use rand::{RngExt, SeedableRng};

use crate::robot::arm::{Arm, Capsule, CellBox, Placement};
use crate::robot::nearest::{nearest_points, nearest_to_box};

/// Number of poses that are looked at.
const POSES: usize = 300;
/// Capsules that are near in this share of the poses are so because they are larger than their links, so that no room
/// is left between them.
const NEARLY_ALL: f64 = 0.95;
/// Distance that counts as near, m: the clearance that `armid excite` keeps by default.
const NEAR_M: f64 = 0.02;

/// Random poses over the whole range of the joints: for each the frames of the base and the bodies.
pub(super) struct Poses(Vec<Vec<Placement>>);

impl Poses {
    pub(super) fn of(arm: &Arm) -> Self {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let mut poses = Vec::with_capacity(POSES);
        for _ in 0..POSES {
            let mut q_rad = Vec::with_capacity(arm.dof());
            for joint in &arm.joints {
                let [low, high] = joint.limits.position_rad;
                q_rad.push(low + rng.random::<f64>() * (high - low).min(TAU));
            }
            let mut frames = vec![Placement::identity()];
            frames.extend(arm.frames(&q_rad));
            poses.push(frames);
        }
        Self(poses)
    }

    /// Whether no motion could keep two capsules apart.
    pub(super) fn are_never_apart(&self, one: &Capsule, other: &Capsule) -> bool {
        self.nearly_always(|frames| {
            let (p, q) = nearest_points(&ends(frames, one), &ends(frames, other));
            (p - q).norm() - one.radius_m - other.radius_m
        })
    }

    /// Whether no motion could keep a capsule out of a box.
    pub(super) fn is_always_in(&self, capsule: &Capsule, cell_box: &CellBox) -> bool {
        self.nearly_always(|frames| {
            let (p, q) = nearest_to_box(&ends(frames, capsule), cell_box);
            (p - q).norm() - capsule.radius_m
        })
    }

    /// Whether a distance, m, is less than [`NEAR_M`] in [`NEARLY_ALL`] of the poses.
    fn nearly_always(&self, distance_m: impl Fn(&[Placement]) -> f64) -> bool {
        let near = self.0.iter().filter(|frames| distance_m(frames) < NEAR_M).count();
        near as f64 >= NEARLY_ALL * self.0.len() as f64
    }
}

/// Ends of a capsule in the base frame.
fn ends(frames: &[Placement], capsule: &Capsule) -> [Vector3<f64>; 2] {
    let Placement { rotation, translation_m } = &frames[capsule.body];
    [capsule.from_m, capsule.to_m].map(|end| rotation * end + translation_m)
}
