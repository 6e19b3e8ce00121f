//! Where a joint rests between its moves.

use super::scene::Scene;
use crate::identify::pauses;

/// One at the samples of each pause of joint `j`, zero elsewhere. Empty for a single run, whose velocities are not freed
/// of noise.
pub fn rests(scene: &Scene, j: usize) -> Vec<Vec<f64>> {
    if !scene.periodic {
        return Vec::new();
    }
    let samples = scene.motion.samples();
    let epsilon_rad_s = scene.arm.friction_epsilon_rad_s;
    let pauses = match scene.held_at_rest(j) {
        Some(held) => held.pauses.clone(),
        None => pauses(&scene.motion.qd_rad_s, j, scene.rate_hz, epsilon_rad_s),
    };
    let of_pause = |pause: Vec<usize>| {
        let mut rest = vec![0.0; samples];
        pause.into_iter().for_each(|k| rest[k] = 1.0);
        rest
    };
    pauses.into_iter().map(of_pause).collect()
}
