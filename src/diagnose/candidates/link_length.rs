//! A link that is longer by e than drawn: the vector from the previous joint's frame to that of the joint at the site
//! grows in its own direction.
//!
//! The torque changes by e times its derivative with respect to the length. Most of that looks like other masses and
//! inertias, which the null model absorbs; the rest depends on them only as far as the log determines them.

use super::*;

/// See the module.
pub struct LinkLength;

/// Step of the numerical derivative, m: small compared with links, large compared with rounding.
const STEP_M: f64 = 1e-4;

/// Torque per length, for a link before joint `j` that is longer by `error_m`.
fn lengthened(scene: &Scene, j: usize, error_m: f64) -> Column {
    let length_m = scene.arm.joints[j].placement.translation_m.norm();
    if length_m == 0.0 {
        return Column::default();
    }
    of_changed_arm(scene, error_m, |arm| {
        arm.joints[j].placement.translation_m *= 1.0 + error_m / length_m;
    })
}

impl Candidate for LinkLength {
    fn kind(&self) -> Kind {
        Kind::LinkLength
    }

    /// The link before the first joint is the height of the arm on its base, on which no torque depends.
    fn sites(&self, joints: usize) -> Vec<Option<usize>> {
        (1..joints).map(Some).collect()
    }

    fn columns(&self, scene: &Scene, site: Option<usize>, _: Shape) -> Vec<Column> {
        vec![lengthened(scene, joint(site), STEP_M)]
    }

    fn secants(&self, scene: &Scene, site: Option<usize>, b: &[f64]) -> Option<Vec<Column>> {
        Some(vec![lengthened(scene, joint(site), large(b[0], STEP_M))])
    }

    fn quantities(&self, _: &Scene, _: Option<usize>, _: Shape, b: &[f64]) -> Vec<Quantity> {
        vec![quantity("error_m", b[0], "m")]
    }

    fn separating_experiment(&self) -> &'static str {
        "a measurement of the kinematics"
    }

    fn in_words(&self) -> &'static str {
        "a link that is longer or shorter than drawn"
    }
}
