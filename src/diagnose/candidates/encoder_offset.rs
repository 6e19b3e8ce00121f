//! A joint angle with a constant error δ: the torques are those of q − δ.

use super::elasticity::{Lag, give_way};
use super::*;

/// See the module.
pub struct EncoderOffset;

/// Offset at which the torque change is evaluated, rad: small enough for it to be linear.
const SMALL_RAD: f64 = 1e-5;

/// Torque per angle, for an angle of joint `j` that is too large by `offset_rad`.
fn turned(scene: &Scene, j: usize, offset_rad: f64) -> Column {
    let turned = Lag::slow(scene, vec![offset_rad; scene.samples()]).of(scene, j);
    give_way(scene, &turned, offset_rad)
}

impl Candidate for EncoderOffset {
    fn kind(&self) -> Kind {
        Kind::EncoderOffset
    }

    fn columns(&self, scene: &Scene, site: Option<usize>, _: Shape) -> Vec<Column> {
        vec![turned(scene, joint(site), SMALL_RAD)]
    }

    fn secants(&self, scene: &Scene, site: Option<usize>, b: &[f64]) -> Option<Vec<Column>> {
        Some(vec![turned(scene, joint(site), large(b[0], SMALL_RAD))])
    }

    fn quantities(&self, _: &Scene, _: Option<usize>, _: Shape, b: &[f64]) -> Vec<Quantity> {
        vec![quantity("offset_rad", b[0], "rad")]
    }

    fn separating_experiment(&self) -> &'static str {
        "the flange against a level or a laser tracker"
    }

    fn in_words(&self) -> &'static str {
        "an angle with a constant error"
    }
}
